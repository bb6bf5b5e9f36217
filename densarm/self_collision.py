"""Self-collision pairs: every two links that move against each other, less what is excluded."""

from itertools import combinations

import numpy as np
import pinocchio as pin

from densarm.arrays import Array
from densarm.errors import RobotDescriptionError, UnknownNameError
from densarm.robot_description import parse_robot_xml

_SAMPLES = 1000
"""Random configurations by which a pair that always collides is recognised."""

_FARTHEST = 100.0  # [rad or m], of joint positions drawn from wider limits


def add_self_collision_pairs(
    model: pin.Model, geometry: pin.GeometryModel, srdf: str | None
) -> None:
    """Add the self-collision pairs of an arm to its collision model.

    Left out are two shapes on the same or on neighbouring joints, the pairs that the SRDF
    disables, and the pairs that collide in every one of 1000 random configurations.

    Args:
        model: the arm.
        geometry: its differentiable collision shapes; the pairs are added to it.
        srdf: the SRDF's text, or None.

    Raises:
        RobotDescriptionError: the SRDF is not one.
        UnknownNameError: the SRDF disables a link that the URDF does not have.
    """
    disabled = _disabled_links(model, srdf) if srdf is not None else set()
    links = [model.frames[item.parentFrame].name for item in geometry.geometryObjects]
    for i, j in combinations(range(geometry.ngeoms), 2):
        joints = {geometry.geometryObjects[k].parentJoint for k in (i, j)}
        if not _are_neighbours(model, joints) and frozenset((links[i], links[j])) not in disabled:
            geometry.addCollisionPair(pin.CollisionPair(i, j))
    for first, second in _always_colliding(model, geometry):
        geometry.removeCollisionPair(pin.CollisionPair(first, second))


def srdf_postures(srdf: str | None) -> dict[str, dict[str, float]]:
    """Return the SRDF's ``group_state`` entries: posture name to joint name to position.

    States of one name in several groups make one posture.

    Args:
        srdf: the SRDF's text, or None.

    Raises:
        RobotDescriptionError: the SRDF is not one, or a value is not a finite number.
    """
    postures: dict[str, dict[str, float]] = {}
    states = [] if srdf is None else parse_robot_xml(srdf, "SRDF").iter("group_state")
    for state in states:
        posture = postures.setdefault(state.get("name", ""), {})
        for joint in state.iter("joint"):
            posture[joint.get("name", "")] = _position(joint.get("value", ""))
    return postures


def _position(text: str) -> float:
    try:
        position = float(text.split(maxsplit=1)[0])
    except (ValueError, IndexError):
        position = np.nan
    if not np.isfinite(position):
        raise RobotDescriptionError(f"SRDF: group_state: value {text!r} is not a finite number")
    return position


def _are_neighbours(model: pin.Model, joints: set[int]) -> bool:
    if len(joints) == 1:
        return True
    a, b = joints
    return bool(model.parents[a] == b or model.parents[b] == a)


def _disabled_links(model: pin.Model, srdf: str) -> set[frozenset[str]]:
    known = {frame.name for frame in model.frames}
    disabled = set()
    for entry in parse_robot_xml(srdf, "SRDF").iter("disable_collisions"):
        links = [entry.get("link1", ""), entry.get("link2", "")]
        for link in links:
            if link not in known:
                raise UnknownNameError("link in the SRDF", link, known)
        disabled.add(frozenset(links))
    return disabled


def _always_colliding(model: pin.Model, geometry: pin.GeometryModel) -> list[tuple[int, int]]:
    pairs = list(geometry.collisionPairs)
    data, geometry_data = model.createData(), geometry.createData()
    random = np.random.default_rng(0)
    colliding = np.ones(len(pairs), dtype=bool)
    for _ in range(_SAMPLES):
        if not colliding.any():
            break
        q = _random_configuration(model, random)
        pin.updateGeometryPlacements(model, data, geometry, geometry_data, q)
        for k in np.flatnonzero(colliding):
            colliding[k] = pin.computeCollision(geometry, geometry_data, int(k))
    # Pinocchio's own pairs are references into a vector that shifts when one is removed.
    return [
        (pair.first, pair.second) for pair, always in zip(pairs, colliding, strict=True) if always
    ]


def _random_configuration(model: pin.Model, random: np.random.Generator) -> Array:
    # pin.randomConfiguration draws from a global seed and fails on unbounded joints.
    q = np.zeros(model.nq)
    limits = np.clip([model.lowerPositionLimit, model.upperPositionLimit], -_FARTHEST, _FARTHEST)
    for joint in list(model.joints)[1:]:
        if joint.nq == 2:
            angle = random.uniform(-np.pi, np.pi)
            q[joint.idx_q : joint.idx_q + 2] = np.cos(angle), np.sin(angle)
        else:
            q[joint.idx_q] = random.uniform(*limits[:, joint.idx_q])
    return q
