"""Inverse kinematics of the named arms and in the scenes that come with densarm, timed."""

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import pinocchio as pin

from densarm.arms.arm import Arm, load_arm
from densarm.arms.catalogue import robot_names, scenario_paths
from densarm.arms.inverse_kinematics import InverseKinematics
from densarm.arms.pose import AXES, Pose
from densarm.errors import DensarmError, UnknownNameError
from densarm.scenarios.scenario import load_scenario
from densarm.values.arrays import Array
from densarm.values.checks import non_negative_integer, positive_integer
from densarm.values.progress import OnProgress
from densarm.world.configurations import clear_configurations

_POSITION, _TURN = 1e-4, 1e-3  # [m] and [rad] that a pose may be off
_WHOLE = 6  # joints from which on an arm is asked for whole poses


@dataclass(frozen=True)
class PoseResults:
    """How many poses of a kind were found, and in what processor time each."""

    where: str
    """The arm, or the scenario whose obstacles were kept clear of."""
    asked: str
    """What of each pose: "pose", "position", or "free about z" with the axis."""
    found: int
    """Poses found: within 0.1 mm and 1 mrad, inside the limits, and in a scenario clear."""
    total: int
    """Poses asked for."""
    median_ms: float
    """Median of the times [ms]."""
    p98_ms: float
    """98 % of the times are below it [ms]."""
    longest_ms: float
    """Longest of the times [ms]."""


def time_poses(
    names: tuple[str, ...] = (),
    poses: int = 200,
    seed: int = 0,
    on_progress: OnProgress = lambda _: None,
) -> list[PoseResults]:
    """Look for poses that configurations evenly within the limits have, and time each search.

    Arms of six joints and more are asked for whole poses, the others for positions and free axes;
    scenarios for what they can do of this, at configurations that are clear, so that each pose can
    be reached.

    Args:
        names: arms and scenarios; all where none are given.
        poses: number of poses of each kind.
        seed: of the draws and searches.
        on_progress: told what is being done.

    Raises:
        UnknownNameError: no such arm or scenario.
        InvalidValueError: a number of poses below one, or a seed that is not a whole number.
    """
    positive_integer("poses", poses)
    non_negative_integer("seed", seed)
    known = [*robot_names(), *scenario_paths()]
    for name in names:
        if name not in known:
            raise UnknownNameError("robot or scenario", name, known)
    results = []
    for name in names or known:
        on_progress(name)
        of = _of_arm if name in robot_names() else _of_scenario
        results += list(of(name, poses, seed))
    return results


def _of_arm(name: str, poses: int, seed: int) -> Iterator[PoseResults]:
    arm = load_arm(name)
    random, limits = np.random.default_rng(seed), arm.limits
    lower, upper = np.clip([limits.lower, limits.upper], -np.pi, np.pi)
    drawn = [arm.configurations(random.uniform(lower, upper)) for _ in range(poses)]
    near = arm.configurations(np.clip(0.0, limits.lower, limits.upper))

    def first(pose: Pose) -> Array:
        for ways in InverseKinematics(arm, pose).solutions(near, seed):
            return ways[0]
        raise DensarmError("none found")

    for asked in ("pose",) if arm.nv >= _WHOLE else ("position", *AXES):
        yield _timed(name, arm, drawn, asked, first)


def _of_scenario(name: str, poses: int, seed: int) -> Iterator[PoseResults]:
    scenario = load_scenario(name)
    arm, world = scenario.arm, scenario.world
    world.set_time(0.0)
    drawn = clear_configurations(world, poses, seed)

    def clear(pose: Pose) -> Array:
        q = np.array(world.inverse_kinematics(pose, 1, seed)[0])
        if not world.distances(q).min(initial=np.inf) > 0.0:
            raise DensarmError("not clear")
        return q

    yield _timed(name, arm, drawn, "pose" if arm.nv >= _WHOLE else "position", clear)


def _timed(
    where: str, arm: Arm, drawn: list[Array], asked: str, find: Callable[[Pose], Array]
) -> PoseResults:
    times, found = [], 0
    wanted = [_part(arm.pose(q), asked) for q in drawn]
    find(wanted[0])  # kernels are loaded
    for pose in wanted:
        began = time.process_time()
        try:
            q = find(pose)
        except DensarmError:
            q = None
        times.append(1e3 * (time.process_time() - began))
        found += q is not None and _is_at(arm, pose, q)
    kind = f"free about {asked}" if asked in AXES else asked
    at = partial(np.percentile, times)
    return PoseResults(
        where, kind, found, len(drawn), float(at(50)), float(at(98)), float(max(times))
    )


def _part(pose: Pose, asked: str) -> Pose:
    if asked == "position":
        return replace(pose, orientation_xyzw=None)
    return replace(pose, free=asked) if asked in AXES else pose


def _is_at(arm: Arm, pose: Pose, q: Array) -> bool:
    """Return whether a configuration (nq,) is inside the limits and near enough to a pose."""
    at, want = arm.pose(q, pose.frame).placement, pose.placement
    turn = 0.0
    if pose.free:
        column = AXES.index(pose.free)
        a, b = at.rotation[:, column], want.rotation[:, column]
        turn = float(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b))
    elif pose.orientation_xyzw is not None:
        turn = float(np.linalg.norm(pin.log3(at.rotation.T @ want.rotation)))
    off = float(np.linalg.norm(at.translation - want.translation))
    inside = bool(arm.limits.excess(arm.angles(q)).max() <= 0.0)
    return inside and off <= _POSITION and turn <= _TURN
