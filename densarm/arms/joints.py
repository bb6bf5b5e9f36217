"""Joints of an arm: their limits, which of a URDF's move, where the others stand."""

import xml.etree.ElementTree as ElementTree
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pinocchio as pin

from densarm.arms.description import PER_JOINT, RobotDescription, parse_robot_xml
from densarm.arms.self_collision import PAIR_ENTRIES
from densarm.arms.urdf import Urdf, end_link
from densarm.errors import InvalidValueError, RobotDescriptionError, UnknownNameError
from densarm.values.arrays import Array
from densarm.values.checks import finite_tuple, finite_vector, non_negative, positive
from densarm.values.documented import documented

DEFAULT_ACCELERATION = 10.0
"""Acceleration limit where nothing is known [rad/s² or m/s²]; a URDF carries none."""

POSITION_TOLERANCE = 1e-9
"""By which a position, computed or rounded to digits, may exceed its limits [rad or m]."""

_SLOWEST = 1e-9  # [rad/s or m/s], of a limit that falls to zero, so that all can be divided by it
_UNLIMITED = 1e12  # URDFs write huge numbers where a joint has no limit
_LINK_MARK = " (link)"


@documented
@dataclass(frozen=True)
class JointLimits:
    """Limits of the joints, each of shape (nv,); infinite where a joint has none."""

    lower: Array
    """Lower position limit [rad or m]; minus infinity on continuous joints and beyond 1e12."""
    upper: Array
    """Upper position limit [rad or m]; infinity on continuous joints and beyond 1e12."""
    velocity: Array
    """Velocity limit [rad/s or m/s]; infinite where the URDF writes zero, or 1e12 or more."""
    acceleration: Array
    """Acceleration limit [rad/s² or m/s²]."""
    effort: Array
    """Torque or force limit [N·m or N]; infinite as the velocity limit, and without masses."""
    torque_rate: Array
    """Limit of the change of torque, but for gravity's [N·m/s or N/s]; infinite where none is
    declared, and without masses."""
    emergency_torque_rate: Array
    """The same in emergencies: infinite but for arms that stop by themselves beyond the other."""
    jerk: Array
    """Jerk limit [rad/s³ or m/s³]; infinite where none is declared."""

    deceleration: Array
    """a of `fastest` [rad/s² or m/s²]; infinite where velocity limits do not fall."""
    velocity_offset: Array
    """o there [rad/s or m/s]."""

    def fastest(self, angles: Array, towards: Array) -> Array:
        r"""Return the velocity limits (..., nv) [rad/s or m/s], as they fall to position limits.

        .. math:: \min\big( v^{max}, \sqrt{o^2 + 2 a d} - o \big)

        Args:
            angles: joint positions (..., nv).
            towards: velocity or direction (..., nv), whose sign tells which limit is at d ahead.

        Source: libfranka, `computeUpperLimitsJointVelocity`.
        """
        if np.isinf(self.deceleration).all():
            return self.velocity
        ahead = np.where(towards > 0.0, self.upper - angles, angles - self.lower)
        offset, ahead = self.velocity_offset, np.maximum(ahead, 0.0)
        falling = np.sqrt(offset**2 + 2.0 * self.deceleration * ahead) - offset
        return np.minimum(self.velocity, np.maximum(falling, _SLOWEST))

    def excess(self, angles: Array) -> Array:
        """Return how far joint positions (..., nv) are outside their limits [rad or m], or < 0."""
        return np.maximum(self.lower - angles, angles - self.upper)


def joint_limits(
    model: pin.Model, description: RobotDescription, *, has_masses: bool = True
) -> JointLimits:
    """Return the limits of an arm's joints, of its model and its description.

    Without masses nothing tells what torque a motion takes, so that no torque is limited.
    """
    limits = ("acceleration", "torque_rate", "jerk", "deceleration")
    acceleration, torque_rate, jerk, deceleration = (
        _given_limit(model, description, key) for key in limits
    )
    joints = list(model.joints)[1:]
    index = [joint.idx_q for joint in joints]
    lower, upper = model.lowerPositionLimit[index], model.upperPositionLimit[index]
    if not has_masses:
        torque_rate = np.full(model.nv, np.inf)
    continuous = np.array([joint.nq == 2 for joint in joints])
    return JointLimits(
        lower=np.where(continuous | (lower <= -_UNLIMITED), -np.inf, lower),
        upper=np.where(continuous | (upper >= _UNLIMITED), np.inf, upper),
        velocity=_limit_or_infinity(model.upperVelocityLimit),
        acceleration=np.where(np.isinf(acceleration), DEFAULT_ACCELERATION, acceleration),
        effort=_limit_or_infinity(has_masses * model.upperEffortLimit),
        torque_rate=torque_rate,
        emergency_torque_rate=torque_rate
        if description.torque_rate_is_hard
        else np.full(model.nv, np.inf),
        jerk=jerk,
        deceleration=deceleration,
        velocity_offset=_given_or_zero(model, description, "velocity_offset"),
    )


def rotor_inertia(model: pin.Model, description: RobotDescription) -> Array:
    """Return the inertia of the joints' rotors (nv,) [kg·m² or kg]."""
    return _given_or_zero(model, description, "armature")


def _given_or_zero(model: pin.Model, description: RobotDescription, key: str) -> Array:
    """Return what a description has per joint (nv,), zero where it has none."""
    if getattr(description, key) is None:
        return np.zeros(model.nv)
    given = _per_joint(model, description, key)
    non_negative(key, given.min())
    return given


def _given_limit(model: pin.Model, description: RobotDescription, key: str) -> Array:
    """Return a limit per joint (nv,), infinite where the description has none."""
    if getattr(description, key) is None:
        return np.full(model.nv, np.inf)
    given = _per_joint(model, description, key)
    positive(key, given.min())
    return given


def _per_joint(model: pin.Model, description: RobotDescription, key: str) -> Array:
    value = getattr(description, key)
    return finite_vector(key, value if isinstance(value, tuple) else [value] * model.nv, model.nv)


def without_joints(description: RobotDescription, locked: Mapping[str, float]) -> RobotDescription:
    """Return the description with joints locked [rad or m], also in what it gives per joint."""
    if not locked:
        return description
    positions = {j: finite_tuple(f"locked_joints.{j}", [x], 1)[0] for j, x in locked.items()}
    changed = replace(description, locked_joints={**description.locked_joints, **positions})
    return _of_joints(changed, _joint_names(description), _joint_names(changed))


def only_joints(
    description: RobotDescription, joints: Iterable[str], locked: Mapping[str, float]
) -> RobotDescription:
    """Return the description with all joints locked but those named.

    They stand at the positions given [rad or m], the others at zero or the limit next to it.
    """
    urdf = Urdf(description)
    names = [name for name in list(urdf.model.names)[1:] if name not in description.locked_joints]
    mimics, every = _mimics(urdf), _names(urdf.root, "joint")
    for name in joints:
        if name not in names:
            raise UnknownNameError("joint", name, names)
        if name in locked:
            raise InvalidValueError(f"locked_joints.{name}", locked[name], "of no joint in joints")
    led = {name for name, (leader, _, _) in mimics.items() if leader in every}
    standing = set(names) - set(joints) - led
    others = {name: _neutral(urdf, name) for name in names if name in standing}
    return without_joints(description, {**others, **locked})


def with_moving(
    description: RobotDescription, joints: Collection[str], standing: Mapping[str, float]
) -> RobotDescription:
    """Return the description with locked joints that move, and others that stand instead.

    What it gives per joint is left out. Joints that mimic others do not.

    Args:
        description: the arm.
        joints: locked joints that move.
        standing: positions of joints that stand [rad or m].
    """
    locked = {j: x for j, x in description.locked_joints.items() if j not in joints}
    none: dict[str, Any] = dict.fromkeys(PER_JOINT)
    return replace(description, locked_joints={**locked, **standing}, postures={}, **none)


def without_mimics(description: RobotDescription) -> RobotDescription:
    """Return the description with every locked joint told by itself, also those that mimic."""
    urdf = Urdf(description)
    root = parse_robot_xml(description.urdf, "URDF")
    for joint in root.iter("joint"):
        for mimic in joint.findall("mimic"):
            joint.remove(mimic)
    return replace(
        description,
        urdf=ElementTree.tostring(root, encoding="unicode"),
        locked_joints=_locked_positions(urdf, description.locked_joints),
    )


def followed(description: RobotDescription, positions: Mapping[str, float]) -> dict[str, float]:
    """Return positions of joints [rad or m] with those of the joints that mimic them."""
    found, followers = dict(positions), _mimics(Urdf(description))
    while ready := [j for j, mimic in followers.items() if j not in found and mimic[0] in found]:
        for name in ready:
            leader, multiplier, offset = followers[name]
            found[name] = multiplier * found[leader] + offset
    return found


def without_subtrees(description: RobotDescription, joints: Iterable[str]) -> RobotDescription:
    """Return a robot without joints of any type, and without all that they carry, a gripper say.

    What the description says of the links and joints that go, goes too; an end effector among them
    becomes the last link.
    """
    root = parse_robot_xml(description.urdf, "URDF")
    whole, before = _names(root, "link"), _joint_names(description)
    _cut(root, joints)
    kept_links, kept_joints = _names(root, "link"), _names(root, "joint")
    srdf, end = description.srdf, description.end_effector
    return _of_joints(
        description,
        before,
        kept_joints,
        urdf=ElementTree.tostring(root, encoding="unicode"),
        srdf=None if srdf is None else _without_pairs(srdf, whole - kept_links),
        locked_joints={j: x for j, x in description.locked_joints.items() if j in kept_joints},
        end_effector=end if end in kept_links | kept_joints else None,
        frames={k: x for k, x in description.frames.items() if x.frame in kept_links | kept_joints},
    )


def lock_joints(
    urdf: Urdf, geometry: pin.GeometryModel, given: Mapping[str, float]
) -> tuple[pin.Model, pin.GeometryModel]:
    """Return a URDF's models without joints locked at positions [rad or m], and their followers."""
    positions = _locked_positions(urdf, given)
    free = {name: mimic[0] for name, mimic in _mimics(urdf).items() if name not in positions}
    if free:
        name, leader = next(iter(free.items()))
        lost = {j for j, head in free.items() if not urdf.model.existJointName(head)}
        heads = sorted(set(free.values()) - free.keys() - {free[j] for j in lost} | lost)
        listed = ", ".join(f"{head!r}: position" for head in heads or [name])
        raise RobotDescriptionError(
            f"joint {name!r} mimics {leader!r}, which "
            f"{'is no joint' if name in lost else 'moves'}: lock by locked_joints={{{listed}}}, or "
            "name the joints that move as joints=[...]"
        )
    if not positions:
        return urdf.model, geometry
    q = pin.neutral(urdf.model)
    for name, position in positions.items():
        joint = _joint(urdf, name)
        if joint.nv == 1:
            single = [np.cos(position), np.sin(position)] if joint.nq == 2 else [position]
            q[joint.idx_q : joint.idx_q + joint.nq] = single
        elif position != 0.0:
            raise RobotDescriptionError(
                f"joint {name!r} has {joint.nv} degrees of freedom, so it can be locked at 0 "
                "alone, its neutral pose"
            )
    return _reduced(urdf.model, geometry, [_joint(urdf, name).id for name in positions], q)


def _mimics(urdf: Urdf) -> dict[str, tuple[str, float, float]]:
    """Return the joints that follow others: name to leader, multiplier and offset."""
    mimics = {}
    for joint in urdf.root.iter("joint"):
        element, name = joint.find("mimic"), joint.get("name", "")
        if element is not None and urdf.model.existJointName(name):
            multiplier, offset = element.get("multiplier", "1"), element.get("offset", "0")
            mimics[name] = (element.get("joint", ""), float(multiplier), float(offset))
    return mimics


def _joint_names(description: RobotDescription) -> list[str]:
    """Return the names of the joints that the arm keeps, in Pinocchio's order."""
    urdf = Urdf(description)
    locked = _locked_positions(urdf, description.locked_joints)
    return [name for name in list(urdf.model.names)[1:] if name not in locked]


def _locked_positions(urdf: Urdf, given: Mapping[str, float]) -> dict[str, float]:
    """Return the positions of all locked joints: those given, and those that mimic them."""
    names = list(urdf.model.names)[1:]
    for name in given:
        if name not in names:
            raise UnknownNameError("joint to lock", name, names)
    all_joints = {joint.get("name", "") for joint in urdf.root.iter("joint")}
    standing = {**dict.fromkeys(all_joints - set(names), 0.0), **given}
    followers = {name: mimic for name, mimic in _mimics(urdf).items() if name not in given}
    while ready := [name for name, mimic in followers.items() if mimic[0] in standing]:
        for name in ready:
            leader, multiplier, offset = followers.pop(name)
            standing[name] = multiplier * standing[leader] + offset
    locked = {name: standing[name] for name in names if name in standing}
    for name, position in locked.items():
        finite_vector(f"locked_joints.{name}", [position], 1)
    return locked


def _reduced(
    model: pin.Model, geometry: pin.GeometryModel, ids: list[int], q: Array
) -> tuple[pin.Model, pin.GeometryModel]:
    """Lock joints at q; Pinocchio does not tell a joint to lock from a link of the same name."""
    for frame in model.frames:
        if frame.type == pin.FrameType.BODY:
            frame.name += _LINK_MARK
    model, (geometry,) = pin.buildReducedModel(model, [geometry], ids, q)
    for frame in model.frames:
        frame.name = frame.name.removesuffix(_LINK_MARK)
    return model, geometry


def _joint(urdf: Urdf, name: str) -> pin.JointModel:
    return urdf.model.joints[urdf.model.getJointId(name)]


def _neutral(urdf: Urdf, name: str) -> float:
    joint = _joint(urdf, name)
    if joint.nq > 1:
        return 0.0
    limits = urdf.model.lowerPositionLimit[joint.idx_q], urdf.model.upperPositionLimit[joint.idx_q]
    return float(np.clip(0.0, *limits))


def _of_joints(
    description: RobotDescription, before: list[str], kept: Collection[str], **changes: Any
) -> RobotDescription:
    """Return a description with changes, and what it gives per joint for the joints kept alone."""
    index = [i for i, name in enumerate(before) if name in kept]
    postures = description.postures.items()
    limits = {key: getattr(description, key) for key in PER_JOINT}
    for key, limit in limits.items():
        if isinstance(limit, tuple):
            changes[key] = [limit[i] for i in index]
    return replace(
        description,
        postures={name: [angles[i] for i in index] for name, angles in postures},
        **changes,
    )


def _cut(root: ElementTree.Element, joints: Iterable[str]) -> None:
    """Take joints and what they carry out of a URDF."""
    known = {joint.get("name", ""): joint for joint in root.findall("joint")}
    links = {link.get("name", ""): link for link in root.findall("link")}
    waiting = list(joints)
    while waiting:
        name = waiting.pop()
        if name not in known:
            raise UnknownNameError("joint to cut at", name, known)
        child = end_link(known[name], "child")
        waiting += [j for j, joint in known.items() if end_link(joint, "parent") == child]
        for element in (known[name], links.get(child)):
            if element is not None and element in root:
                root.remove(element)


def _names(root: ElementTree.Element, kind: str) -> set[str]:
    return {element.get("name", "") for element in root.findall(kind)}


def _without_pairs(srdf: str, links: set[str]) -> str:
    root = parse_robot_xml(srdf, "SRDF")
    for pair in [entry for tag in PAIR_ENTRIES for entry in root.findall(tag)]:
        if {pair.get(key) for key in ("link", "link1", "link2")} & links:
            root.remove(pair)
    return ElementTree.tostring(root, encoding="unicode")


def _limit_or_infinity(limit: Array) -> Array:
    return np.where((limit <= 0.0) | (limit >= _UNLIMITED), np.inf, limit)
