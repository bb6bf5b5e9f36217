"""Self-collision pairs: every two links that move against each other, less what is excluded."""

from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum
from itertools import combinations

import numpy as np
import pinocchio as pin

from densarm.arms.description import parse_robot_xml
from densarm.errors import RobotDescriptionError, UnknownNameError
from densarm.values.arrays import Array

_SAMPLES = 1000
"""Random configurations by which a pair that always collides is recognised."""

_FARTHEST = 100.0  # [rad or m], of joint positions drawn from wider limits


class Exclusion(StrEnum):
    """Why two shapes that move against each other are not checked for contact."""

    NEIGHBOURS = "neighbours"
    """One joint alone lies between them, around which links touch by design."""
    SRDF = "srdf"
    """The SRDF disables the pair of their links."""
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

    Left out are pairs of neighbours, and of links that the SRDF, if there is one, disables.
    """
    disabled = _disabled_links(model, srdf) if srdf is not None else set()
    items = list(geometry.geometryObjects)
    links = [model.frames[item.parentFrame].name for item in items]
    excluded: dict[tuple[int, int], Exclusion] = {}
    for i, j in combinations(range(geometry.ngeoms), 2):
        a, b = items[i].parentJoint, items[j].parentJoint
        if a == b:
            continue
        if model.parents[a] == b or model.parents[b] == a:
            excluded[i, j] = Exclusion.NEIGHBOURS
        elif frozenset((links[i], links[j])) in disabled:
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

    States of one name in several groups make one posture.
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
