"""Certificate of a run of several phases: each by itself, and how one goes on from another."""

from collections.abc import Collection, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any, NamedTuple

import coal
import numpy as np
import pinocchio as pin

from densarm.arms.arm import Arm
from densarm.arms.description import PER_JOINT, RobotDescription
from densarm.arms.line import Segment
from densarm.arms.models import frame_index
from densarm.arms.self_collision import Exclusion
from densarm.arms.upright import Upright
from densarm.certificates.certificate import Certificate, Check, departure, swept_result
from densarm.certificates.task import Task
from densarm.scene.obstacles import Obstacle, obstacle_pose
from densarm.values.arrays import Array
from densarm.world.lipschitz import shape_lipschitz
from densarm.world.swept_check import SweptVerdict
from densarm.world.world import World

LINE_TOLERANCE = (1e-3, 0.01)
"""Largest distance and turn of a frame from the line that a phase leads it along [m, rad]."""

CONTACT_DEPTH = 5e-4
"""How far a held body may enter, by numbers, what it is lifted from or put on [m]."""

REST_VELOCITY = 1e-3
"""Largest velocity of a joint where other joints move next, or what is held changes [rad/s]."""

LINE = "line"
"""Key of a task's settings: the segment that a phase says it leads a frame along."""

WAY_POINTS = "way_points"
"""Key of a task's settings: positions that a phase says it passes, and how far off at most."""

UPRIGHT = "upright"
"""Key of a task's settings: the frame that a phase says it keeps upright, and within what angle."""

_SAME = 1e-9  # [rad, m], room for rounding
_FAR = 1e3  # [m] that pairs which are not asked for keep beyond all distances


class Claims(NamedTuple):
    """What a task says of its motion beside start and goal; None of what it does not say."""

    line: Segment | None
    """The line that it leads a frame along."""
    positions: Array
    """The joint positions that it passes (M, nv) [rad or m]."""
    blend: float
    """How far off each joint may be there [rad or m]."""
    upright: Upright | None
    """What it keeps upright."""


def claims_of(task: Task) -> Claims:
    """Return what the settings of a task claim.

    Raises:
        KeyError, TypeError, ValueError: other data than it would have been written.
    """
    said, nv = task.settings, task.arm.nv
    passed = said.get(WAY_POINTS, {"positions": [], "blend": 0.0})
    positions = np.array(passed["positions"], np.float64).reshape(-1, nv)
    return Claims(
        Segment.from_json(said[LINE]) if LINE in said else None,
        positions,
        float(passed["blend"]),
        Upright.from_json(said[UPRIGHT]) if UPRIGHT in said else None,
    )


class Phase(NamedTuple):
    """A part of a run, in a world of its own."""

    task: Task
    """What it is about."""
    certificate: Certificate
    """What is proved of it alone."""
    q: Array
    """Its configurations (N, nq)."""
    v: Array
    """Its velocities (N, nv) [rad/s or m/s]."""

    @property
    def duration(self) -> float:
        """How long it takes [s]."""
        return (len(self.q) - 1) * self.task.simulation.dt


def certify_phases(phases: Sequence[Phase]) -> Certificate:
    """Return what is proved about a run of phases.

    Each part of their own certificates holds where it does in all of them. Beside these: each phase
    begins where the last ended, the first at rest, of the same robot, as fast as that, or at rest
    where what is held or moves changes (joined); bodies are held, or put down, where they were
    (held); frames are led along lines (line); way points are passed one after another (way
    points); frames tilt no farther than they may, between samples too (upright); and what a held
    body may touch it enters by no more than `CONTACT_DEPTH`, on such a line alone (support).
    """
    names = dict.fromkeys(check.name for phase in phases for check in phase.certificate.checks)
    merged = (_merged(name, phases) for name in names)
    own = (part(phases) for part in (_joined, _held, _line, _way_points, _upright, _support))
    return Certificate((*merged, *own))


def positions_of(arm: Arm, q: Array, names: Sequence[str]) -> Array:
    """Return positions [rad or m] of joints (N, len(names)), moving or locked, at q (N, nq)."""
    angles, locked = arm.angles(q), arm.description.locked_joints
    still = np.ones(len(q))
    columns = [
        angles[:, arm.joint_names.index(name)] if name in arm.joint_names else still * locked[name]
        for name in names
    ]
    return np.column_stack(columns)


def values_of(arm: Arm, values: Array, names: Sequence[str]) -> Array:
    """Return what there is of each moving joint (N, nv) of joints (N, len(names)), else zero."""
    found, own = np.zeros((len(values), len(names))), set(arm.joint_names)
    for column, name in enumerate(names):
        if name in own:
            found[:, column] = values[:, arm.joint_names.index(name)]
    return found


def body_poses(task: Task, q: Array) -> dict[str, tuple[Obstacle, pin.SE3]]:
    """Return the bodies of a scene and those held at q (nq,): each by its name, and where it is."""
    found = {item.name: (item, obstacle_pose(item)) for item in task.scene}
    for each in task.arm.description.attachments:
        link = task.arm.pose(q, each.link).placement
        found[each.body.name] = each.body, link * obstacle_pose(each.body)
    return found


def _merged(name: str, phases: Sequence[Phase]) -> Check:
    """Return one check for all phases: what fails, else does not apply, else is narrowest."""
    found, before = list[Check](), 0.0
    for k, phase in enumerate(phases):
        for check in phase.certificate.checks:
            if check.name == name:
                detail = f"phase {k + 1} ({phase.task.title}), t from its start: {check.detail}"
                found.append(replace(check, detail=detail, time=before + check.time))
        before += phase.duration
    rank = {False: 0, None: 1, True: 2}
    worst = min(found, key=lambda c: (rank[c.holds], np.inf if c.margin is None else c.margin))
    if not worst.holds:
        return worst
    return replace(worst, detail=f"in all {len(found)} phases; least in {worst.detail}")


def _joined(phases: Sequence[Phase]) -> Check:
    if phases[0].task.begins_in_motion:
        return Check("joined", False, "the first phase begins in motion", None, 0.0)
    fastest, at, before = 0.0, 0.0, 0.0
    for k, (last, after) in enumerate(pairwise(phases), start=2):
        before += last.duration
        fault, speed = _joint_fault(last, after), float(np.abs(last.v[-1]).max())
        if not fault and last.task.arm.joint_names == after.task.arm.joint_names:
            jump = float(np.abs(after.v[0] - last.v[-1]).max())
            fault = "" if jump <= _SAME else f"{jump:.2g} rad/s faster or slower than before"
        if not fault and not speed <= REST_VELOCITY and _changes(last, after):
            fault = f"at {speed:.2g} rad/s, at rest for what changes"
        if fault:
            return Check("joined", False, f"phase {k} ({after.task.title}): {fault}", None, before)
        if speed >= fastest and _changes(last, after):
            fastest, at = speed, before
    detail = f"each of {len(phases)} phases begins where the last ended, and changes arm or hold"
    return Check("joined", True, f"{detail} at {fastest:.2g} rad/s", REST_VELOCITY - fastest, at)


def _changes(last: Phase, after: Phase) -> bool:
    """Return whether other joints move, or other bodies are held, from one phase to the next."""
    arms = last.task.arm, after.task.arm
    names = [(arm.joint_names, [x.body.name for x in arm.description.attachments]) for arm in arms]
    return names[0] != names[1]


def _joint_fault(last: Phase, after: Phase) -> str:
    """Return what differs of joints and robot from one phase to the next; empty for nothing."""
    a, b = last.task.arm, after.task.arm
    if _bare(a.description) != _bare(b.description):
        return "another robot than before"
    if last.task.simulation.dt != after.task.simulation.dt:
        return "another time step than before"
    names = {*a.joint_names, *a.description.locked_joints}
    if names != {*b.joint_names, *b.description.locked_joints}:
        return "other joints than before"
    listed = sorted(names)
    ends = positions_of(a, last.q[-1:], listed), positions_of(b, after.q[:1], listed)
    away = np.abs(np.arctan2(np.sin(ends[1] - ends[0]), np.cos(ends[1] - ends[0])))
    if not away.max() <= _SAME:
        return f"joint {listed[int(away.argmax())]!r} is {away.max():.2g} away from where it was"
    always = {frozenset(x.shapes) for x in b.excluded_pairs if x.reason == Exclusion.ALWAYS}
    if lost := always & {frozenset(pair) for pair in World(a, last.task.scene).pairs}:
        return f"{' and '.join(sorted(*lost))} are not checked any more"
    return ""


def _bare(description: RobotDescription) -> RobotDescription:
    """Return what stays of a robot from phase to phase."""
    per_joint: dict[str, Any] = dict.fromkeys(PER_JOINT)
    return replace(description, locked_joints={}, attachments=(), postures={}, **per_joint)


def _held(phases: Sequence[Phase]) -> Check:
    changes, before = 0, 0.0
    for k, (last, after) in enumerate(pairwise(phases), start=2):
        before += last.duration
        was, now = body_poses(last.task, last.q[-1]), body_poses(after.task, after.q[0])
        held = [{x.body.name for x in p.task.arm.description.attachments} for p in (last, after)]
        fault = "" if was.keys() == now.keys() else "a body came or went"
        for name in was.keys() & now.keys():
            (body, pose), (same, place) = was[name], now[name]
            if _shape(body) != _shape(same) or body.motion is not None:
                fault = f"{name} is another body, or moves"
            if not np.abs(pose.homogeneous - place.homogeneous).max() <= _SAME:
                off = float(np.linalg.norm(pose.translation - place.translation))
                fault = f"{name} is {1e3 * off:.3g} mm from where it was, or turned"
        if fault:
            return Check("held", False, f"phase {k} ({after.task.title}): {fault}", None, before)
        changes += len(held[0] ^ held[1])
    detail = f"bodies taken or put down {changes} times, at rest and where they were"
    return Check("held", True, detail, None, before)


def _shape(body: Obstacle) -> Obstacle:
    return replace(body, position=(0.0, 0.0, 0.0), orientation_xyzw=(0.0, 0.0, 0.0, 1.0))


def _line(phases: Sequence[Phase]) -> Check:
    worst, at, count, before = 0.0, 0.0, 0, 0.0
    for k, phase in enumerate(phases, start=1):
        if (segment := claims_of(phase.task).line) is not None:
            arm = phase.task.arm
            far, turned = segment.off(arm, phase.q)
            far, count = far + _between(arm, segment.frame, phase), count + 1
            share = np.maximum(far / LINE_TOLERANCE[0], turned / LINE_TOLERANCE[1])
            row = int(share.argmax())
            time = before + row * phase.task.simulation.dt
            if not share[row] <= 1.0:
                off = f"{1e3 * far[row]:.3g} mm and {turned[row]:.2g} rad off at t = {time:.3f} s"
                return Check("line", False, f"phase {k} ({phase.task.title}): {off}", None, time)
            if share[row] >= worst:
                worst, at = float(share[row]), time
        before += phase.duration
    if not count:
        return Check("line", None, "does not apply: no phase leads along a line", None, 0.0)
    within = f"within {1e3 * LINE_TOLERANCE[0]:g} mm and {LINE_TOLERANCE[1]:g} rad"
    detail = f"{count} lines kept to {within}, of which {worst:.0%} used at t = {at:.3f} s"
    return Check("line", True, detail, 1.0 - worst, at)


def _between(arm: Arm, frame: str, phase: Phase) -> float:
    r"""Return how far a frame may leave the chords between samples [m].

    Its acceleration is at most Σ r_j |q̈_j| + 2 Σ |q̇_j| Σ r_j |q̇_j|; distances from a line are
    convex along chords.
    """
    index = frame_index(arm.model, frame)
    carried, point = arm.model.frames[index], coal.Sphere(_SAME)
    item = pin.GeometryObject("frame", carried.parentJoint, index, carried.placement, point)
    reach, dt = shape_lipschitz(arm.model, [item])[0], phase.task.simulation.dt
    speed = np.abs(phase.v)
    bend = np.abs(np.diff(phase.v, axis=0, append=phase.v[-1:])) / dt @ reach
    bend += 2.0 * speed.sum(axis=1) * (speed @ reach)
    return float(bend.max()) * dt**2 / 8.0


def _way_points(phases: Sequence[Phase]) -> Check:
    """Prove that way points are passed in their order: by samples, each after the last one's."""
    name, worst, at, count, widest, before = "way points", 0.0, 0.0, 0, 0.0, 0.0
    for k, phase in enumerate(phases, start=1):
        said, arm, row = claims_of(phase.task), phase.task.arm, 0
        blend = said.blend
        for n, angles in enumerate(said.positions, start=1):
            off = np.abs(arm.difference(arm.configuration(angles), phase.q[row:])).max(axis=1)
            nearest = int(off.argmin())
            time = before + (row + nearest) * phase.task.simulation.dt
            if not off[nearest] <= blend:
                far = f"way point {n} is {off[nearest]:.2g} away, and may be {blend:g}"
                return Check(name, False, f"phase {k} ({phase.task.title}): {far}", None, time)
            if (share := float(off[nearest] / blend)) >= worst:
                worst, at = share, time
            row, count = row + int((off <= blend).argmax()), count + 1
            widest = max(widest, blend)
        before += phase.duration
    if not count:
        return Check(name, None, "does not apply: no phase passes any", None, 0.0)
    within = f"each joint within {widest:.3g}"
    detail = f"{count} passed in their order, {within}, of which {worst:.0%} used"
    return Check(name, True, f"{detail} at t = {at:.3f} s", 1.0 - worst, at)


def _upright(phases: Sequence[Phase]) -> Check:
    worst, at, count, widest, before = 0.0, 0.0, 0, 0.0, 0.0
    for k, phase in enumerate(phases, start=1):
        if (upright := claims_of(phase.task).upright) is not None:
            dt = phase.task.simulation.dt
            arm, q, off = phase.task.arm, phase.q, departure(phase.v, dt)
            bounds = np.append(upright.tilts(arm, q[:1]), upright.largest_tilts(arm, q, off))
            row, count = max(int(bounds.argmax()) - 1, 0), count + 1
            time, most = before + row * dt, float(bounds.max())
            if not most <= upright.within:
                far = f"{upright.frame!r} may tilt by {most:.3g} rad, not {upright.within:.3g}"
                return Check("upright", False, f"phase {k} ({phase.task.title}): {far}", None, time)
            widest = max(widest, upright.within)
            if most / upright.within >= worst:
                worst, at = most / upright.within, time
        before += phase.duration
    if not count:
        return Check("upright", None, "does not apply: nothing is kept upright", None, 0.0)
    detail = f"{count} phases keep a frame within {widest:.3g} rad, of which {worst:.0%} used"
    return Check("upright", True, f"{detail} at t = {at:.3f} s", 1.0 - worst, at)


def _support(phases: Sequence[Phase]) -> Check:
    """Prove that held bodies enter what they may touch by no more than next to nothing."""
    said, before = list[str](), 0.0
    for k, phase in enumerate(phases, start=1):
        arm, dt = phase.task.arm, phase.task.simulation.dt
        held = arm.description.attachments
        touching = {(x.body.name, name) for x in held for name in x.touch_obstacles}
        if touching:
            listed = ", ".join(" and ".join(pair) for pair in sorted(touching))
            alone = tuple(replace(each, touch_obstacles=()) for each in held)
            world = World(Arm(replace(arm.description, attachments=alone)), phase.task.scene)
            named = {name for pair in touching for name in pair}
            owners = [tuple(_owner(shape, named) for shape in pair) for pair in world.pairs]
            kept = np.where([pair in touching for pair in owners], -CONTACT_DEPTH, -_FAR)
            result = swept_result(world, phase.q, phase.v, dt, kept)
            if result.verdict != SweptVerdict.CLEAR or LINE not in phase.task.settings:
                why = "entered" if LINE in phase.task.settings else "left out off a line"
                detail = f"phase {k} ({phase.task.title}): {listed} {why}"
                return Check("support", False, detail, None, before + result.index * dt)
            said.append(f"{listed} (phase {k})")
        before += phase.duration
    if not said:
        return Check("support", None, "does not apply: every pair counts", None, 0.0)
    detail = f"may touch, by less than {1e3 * CONTACT_DEPTH:g} mm: {'; '.join(said)}"
    return Check("support", True, detail, None, 0.0)


def _owner(shape: str, bodies: Collection[str]) -> str:
    """Return the body that a shape is, or is a part of."""
    return shape if shape in bodies else shape.rpartition(".")[0]
