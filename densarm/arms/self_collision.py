"""Self-collision pairs: every two links that move against each other, less what is excluded."""

from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum
from itertools import combinations

import numpy as np
import pinocchio as pin

from densarm.arms.description import parse_robot_xml
from densarm.arms.joint_space import joint_axis
from densarm.errors import RobotDescriptionError
from densarm.values.arrays import Array

_SAMPLES = 1000
"""Random configurations by which a pair that always collides is recognised."""

PAIR_ENTRIES = {
    "disable_collisions": ("link1", "link2"),
    "enable_collisions": ("link1", "link2"),
    "disable_default_collisions": ("link",),
}
"""Tags of an SRDF that say which links are checked, and the attributes that name them."""

_JOINT_SIZE = 0.02  # [m], of links without shapes between the axes of what counts as one joint

_FARTHEST = 100.0  # [rad or m], of joint positions drawn from wider limits


class Exclusion(StrEnum):
    """Why two shapes that move against each other are not checked for contact."""

    NEIGHBOURS = "neighbours"
    """One joint alone lies between them, around which links touch by design.

    It may have several axes: revolute joints between whose links, of at most 20 mm and without
    shapes, lies nothing else.

    Of links that are fixed to each other those alone count that are nearest to the joint: the
    base of a second arm, or a mast beside the first, is no neighbour of what turns on the base.
    """
    SRDF = "srdf"
    """The SRDF disables the pair of their links, or one of them by default."""
    ALWAYS = "always"
    """They collide in every one of 1000 random configurations.

    So either they touch by design, or the convex hulls of their meshes overlap where the meshes do
    not. With 99 % confidence they are apart in less than 0.5 % of the joint space.
    """


@dataclass(frozen=True)
class ExcludedPair:
    """Two shapes that move against each other and that no distance is computed of."""

    shapes: tuple[str, str]
    """Names of the shapes."""
    reason: Exclusion
    """Why they are left out."""


def add_self_collision_pairs(
    model: pin.Model, geometry: pin.GeometryModel, srdf: str | None
) -> tuple[ExcludedPair, ...]:
    """Add the pairs of shapes that move against each other, and return those left out.

    Left out are pairs of neighbours, and of links that the SRDF, if there is one, disables: a pair
    by ``disable_collisions``, or by ``disable_default_collisions`` of one of its links; in the
    latter and in neighbours it may enable pairs.

    Source: MoveIt 2, `collision_detection::AllowedCollisionMatrix(srdf::Model)`.
    """
    entries = _srdf_links(srdf)
    enabled, disabled = entries["enable_collisions"], entries["disable_collisions"]
    alone = frozenset().union(*entries["disable_default_collisions"])
    items = list(geometry.geometryObjects)
    links = [model.frames[item.parentFrame].name for item in items]
    carried = {(a, item.parentFrame) for a, item in _carriers(model, items)}
    excluded: dict[tuple[int, int], Exclusion] = {}
    for i, j in combinations(range(geometry.ngeoms), 2):
        a, b = items[i].parentJoint, items[j].parentJoint
        if a == b:
            continue
        pair = frozenset((links[i], links[j]))
        if pair not in enabled and (
            (a, items[j].parentFrame) in carried or (b, items[i].parentFrame) in carried
        ):
            excluded[i, j] = Exclusion.NEIGHBOURS
        elif pair in disabled or (pair & alone and pair not in enabled):
            excluded[i, j] = Exclusion.SRDF
        else:
            geometry.addCollisionPair(pin.CollisionPair(i, j))
    return tuple(
        ExcludedPair((items[i].name, items[j].name), reason) for (i, j), reason in excluded.items()
    )


def remove_always_colliding_pairs(
    model: pin.Model, geometry: pin.GeometryModel
) -> tuple[ExcludedPair, ...]:
    """Remove and return the pairs that collide in every one of the same random configurations.

    A pair that never collides stays, since no number of samples proves that it cannot.
    """
    pairs = list(geometry.collisionPairs)
    data, geometry_data = model.createData(), geometry.createData()
    colliding = np.ones(len(pairs), dtype=bool)
    for q in random_configurations(model, _SAMPLES):
        if not colliding.any():
            break
        pin.updateGeometryPlacements(model, data, geometry, geometry_data, q)
        for k in np.flatnonzero(colliding):
            colliding[k] = pin.computeCollision(geometry, geometry_data, int(k))
    # Pinocchio's own pairs are references into a vector that shifts when one is removed.
    always = [(pairs[k].first, pairs[k].second) for k in np.flatnonzero(colliding)]
    for i, j in always:
        geometry.removeCollisionPair(pin.CollisionPair(i, j))
    names = [item.name for item in geometry.geometryObjects]
    return tuple(ExcludedPair((names[i], names[j]), Exclusion.ALWAYS) for i, j in always)


def random_configurations(model: pin.Model, count: int) -> Iterator[Array]:
    """Yield random configurations (nq,) within the limits, the same ones at every call."""
    # pin.randomConfiguration draws from a global seed and fails on unbounded joints.
    random = np.random.default_rng(0)
    limits = np.clip([model.lowerPositionLimit, model.upperPositionLimit], -_FARTHEST, _FARTHEST)
    joints = list(model.joints)[1:]
    for _ in range(count):
        q = np.zeros(model.nq)
        for joint in joints:
            if joint.nq == 2:
                angle = random.uniform(-np.pi, np.pi)
                q[joint.idx_q : joint.idx_q + 2] = np.cos(angle), np.sin(angle)
            else:
                q[joint.idx_q] = random.uniform(*limits[:, joint.idx_q])
        yield q


def srdf_postures(srdf: str | None) -> dict[str, dict[str, float]]:
    """Return an SRDF's ``group_state`` entries: posture to joint to position [rad or m].

    States of one name in several groups make one posture. A joint of several axes, which no arm
    has, may have several numbers, of which the first is returned.
    """
    postures: dict[str, dict[str, float]] = {}
    states = [] if srdf is None else parse_robot_xml(srdf, "SRDF").iter("group_state")
    for state in states:
        posture = postures.setdefault(state.get("name", ""), {})
        for joint in state.iter("joint"):
            posture[joint.get("name", "")] = _position(joint.get("value", ""))
    return postures


def _carriers(
    model: pin.Model, items: list[pin.GeometryObject]
) -> Iterator[tuple[int, pin.GeometryObject]]:
    """Yield each joint with the shapes it is fixed to, which by fixed joints are nearest to it."""
    before = _neighbours_before(model, {item.parentJoint for item in items})
    for joint in range(1, model.njoints):
        first = joint
        while model.parents[first] != before[joint]:
            first = int(model.parents[first])
        frame = model.getFrameId(model.names[first], pin.FrameType.JOINT)
        root = _ancestors(model, model.frames[frame].parentFrame)
        fixed = [item for item in items if item.parentJoint == before[joint]]
        away = [len(root ^ _ancestors(model, item.parentFrame)) for item in fixed]
        yield from ((joint, item) for item, n in zip(fixed, away, strict=True) if n == min(away))


def _ancestors(model: pin.Model, frame: int) -> set[int]:
    """Return a frame and those above it up to the base, through every joint."""
    found: set[int] = set()
    while frame not in found:
        found.add(frame)
        frame = model.frames[frame].parentFrame
    return found


def _position(text: str) -> float:
    try:
        positions = [float(part) for part in text.split()]
    except ValueError:
        positions = []
    if not positions or not np.isfinite(positions).all():
        raise RobotDescriptionError(
            f"SRDF: group_state: value {text!r} is not a finite number, of rad or m without a unit"
        )
    return positions[0]


def unknown_links(model: pin.Model, srdf: str | None) -> tuple[str, ...]:
    """Return, a phrase each, which links an SRDF has in its pairs and the arm has not."""
    known = {frame.name for frame in model.frames}
    named = {link for pairs in _srdf_links(srdf).values() for pair in pairs for link in pair}
    return tuple(f"SRDF: no link {link!r}: its pairs are ignored" for link in sorted(named - known))


def _srdf_links(srdf: str | None) -> dict[str, set[frozenset[str]]]:
    """Return the links of each of an SRDF's `PAIR_ENTRIES`, by its tag."""
    root = None if srdf is None else parse_robot_xml(srdf, "SRDF")
    links: dict[str, set[frozenset[str]]] = {tag: set() for tag in PAIR_ENTRIES}
    for tag, keys in PAIR_ENTRIES.items():
        for entry in [] if root is None else root.iter(tag):
            links[tag].add(frozenset(entry.get(key, "") for key in keys))
    return links


def _neighbours_before(model: pin.Model, shaped: set[int]) -> list[int]:
    """Return for each joint the one, nearer to the base, whose links are neighbours of its own.

    Where links without shapes are longer, say an upper arm, the links around them can meet.
    """
    before = [int(parent) for parent in model.parents]
    for joint in range(1, model.njoints):
        child, parent, length = joint, before[joint], 0.0
        while parent > 0 and parent not in shaped:
            slides = joint_axis(model, child)[1] or joint_axis(model, parent)[1]
            length += float(np.linalg.norm(model.jointPlacements[child].translation))
            if slides or length > _JOINT_SIZE:
                break
            child, parent = parent, int(model.parents[parent])
        else:
            before[joint] = parent
    return before
