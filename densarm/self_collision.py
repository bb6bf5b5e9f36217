"""Self-collision pairs: every two links that move against each other, less what is excluded."""

from itertools import combinations

import numpy as np
import pinocchio as pin

from densarm.errors import UnknownNameError
from densarm.robot_description import parse_robot_xml

_SAMPLES = 100
"""Random configurations by which a pair that always collides is recognised."""


def add_self_collision_pairs(
    model: pin.Model, geometry: pin.GeometryModel, srdf: str | None
) -> None:
    """Add the self-collision pairs of an arm to its collision model.

    Left out are two shapes on the same or on neighbouring joints, the pairs that the SRDF
    disables, and the pairs that collide in every one of 100 random configurations.

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
    for pair in _always_colliding(model, geometry):
        geometry.removeCollisionPair(pair)


def srdf_postures(srdf: str | None) -> dict[str, dict[str, float]]:
    """Return the SRDF's ``group_state`` entries: posture name to joint name to position.

    Args:
        srdf: the SRDF's text, or None.
    """
    if srdf is None:
        return {}
    states = parse_robot_xml(srdf, "SRDF").iter("group_state")
    return {
        state.get("name", ""): {
            joint.get("name", ""): float(joint.get("value", "nan").split()[0])
            for joint in state.iter("joint")
        }
        for state in states
    }


def _are_neighbours(model: pin.Model, joints: set[int]) -> bool:
    if len(joints) == 1:
        return True
    a, b = joints
    return model.parents[a] == b or model.parents[b] == a


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


def _always_colliding(model: pin.Model, geometry: pin.GeometryModel) -> list[pin.CollisionPair]:
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
    return [pair for pair, always in zip(pairs, colliding, strict=True) if always]


def _random_configuration(model: pin.Model, random: np.random.Generator) -> np.ndarray:
    # pin.randomConfiguration draws from a global seed and fails on unbounded joints.
    q = pin.neutral(model)
    for joint in list(model.joints)[1:]:
        if joint.nq == 2:
            angle = random.uniform(-np.pi, np.pi)
            q[joint.idx_q : joint.idx_q + 2] = np.cos(angle), np.sin(angle)
        else:
            low, high = (
                limit[joint.idx_q] for limit in (model.lowerPositionLimit, model.upperPositionLimit)
            )
            q[joint.idx_q] = random.uniform(max(low, -10.0), min(high, 10.0))
    return q
