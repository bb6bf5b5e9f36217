"""MovingHulls: the bodies of an arm and its scene as rounded hulls, placed by compiled code."""

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from densarm.arrays import Array
from densarm.clearance import Clearance
from densarm.compiled import compiled
from densarm.proof.link_placements import JointChain, joint_chain, write_placements
from densarm.proof.separation import RoundedHulls, rounded_hulls


class MovingHulls(NamedTuple):
    """Every pair of rounded hulls, and the joints that move them."""

    chain: JointChain
    hulls: RoundedHulls
    """The shapes, each in a frame at the middle of its box."""
    joint: NDArray[np.int64]
    """Joint that moves each shape (S,)."""
    rotation: Array
    """Of each shape's frame in that of its joint (S, 3, 3)."""
    translation: Array
    """Of each shape's frame in that of its joint (S, 3) [m]."""
    half_side: Array
    """Half the sides of a box around each shape, along the axes of its frame (S, 3) [m]."""
    ball: Array
    """Radius of a ball around each shape (S,) [m]."""
    pairs: NDArray[np.int64]
    """Shapes of each pair (K, 2)."""


class Placements(NamedTuple):
    """Where frames are at one configuration."""

    joint_rotation: Array
    """Of the joints' frames in the world (njoints, 3, 3)."""
    joint_translation: Array
    """Of the joints' frames in the world (njoints, 3) [m]."""
    rotation: Array
    """Of the shapes' frames in the world (S, 3, 3)."""
    translation: Array
    """Of the shapes' frames in the world (S, 3) [m]."""


def moving_hulls(clearance: Clearance) -> MovingHulls:
    """Return the pairs of a clearance and what moves them as arrays."""
    shapes = list(clearance.geometry_model.geometryObjects)
    hulls = rounded_hulls([item.geometry for item in shapes])
    corners = [hulls.points[a:b] for a, b in pairwise(hulls.first)]
    low, high = (np.array([end(points, axis=0) for points in corners]) for end in (np.min, np.max))
    middles = 0.5 * (low + high)
    hulls.points[:] -= np.repeat(middles, np.diff(hulls.first), axis=0)
    placements = [
        item.placement * pin.SE3(np.eye(3), middle)
        for item, middle in zip(shapes, middles, strict=True)
    ]
    reach = np.array([np.linalg.norm(points, axis=1).max() for points in corners])
    return MovingHulls(
        chain=joint_chain(clearance.arm.model),
        hulls=hulls,
        joint=np.array([item.parentJoint for item in shapes], dtype=np.int64),
        rotation=np.array([placement.rotation for placement in placements]),
        translation=np.array([placement.translation for placement in placements]),
        half_side=0.5 * (high - low) + hulls.radius[:, np.newaxis],
        ball=reach + hulls.radius,
        pairs=clearance.pair_shapes,
    )


def placements(bodies: MovingHulls) -> Placements:
    """Return placements that are right for what no joint moves."""
    joints = bodies.chain.parent.size
    return Placements(
        joint_rotation=np.zeros((joints, 3, 3)),
        joint_translation=np.zeros((joints, 3)),
        rotation=bodies.rotation.copy(),
        translation=bodies.translation.copy(),
    )


@compiled
def near_pairs(
    bodies: MovingHulls, at_a: Placements, at_b: Placements, motion: Array, kept: Array
) -> NDArray[np.int64]:
    """Return the pairs that enclosing balls and boxes do not prove apart.

    Args:
        bodies: the pairs.
        at_a: placements at one end of a motion.
        at_b: placements at the other end.
        motion: bounds on how far bodies move against each other in between (K,) [m].
        kept: distances to be kept (K,) [m].
    """
    near, count = np.empty(motion.size, np.int64), 0
    pairs, ball, half_side = bodies.pairs, bodies.ball, bodies.half_side
    for pair in range(motion.size):
        i, j = pairs[pair, 0], pairs[pair, 1]
        apart_a = _apart(at_a.rotation, at_a.translation, half_side, ball, i, j)
        apart_b = _apart(at_b.rotation, at_b.translation, half_side, ball, i, j)
        apart = apart_a + apart_b - 2.0 * kept[pair]
        if not apart > motion[pair]:
            near[count] = pair
            count += 1
    return near[:count]


@compiled
def _apart(
    rotation: Array, translation: Array, half_side: Array, ball: Array, i: int, j: int
) -> float:
    """Return by how much the ball around one shape is outside the box around the other [m]."""
    one = _outside_box(rotation, translation, half_side, i, j) - ball[i]
    other = _outside_box(rotation, translation, half_side, j, i) - ball[j]
    return float(max(one, other))


@compiled
def _outside_box(
    rotation: Array, translation: Array, half_side: Array, shape: int, box: int
) -> float:
    """Return how far the middle of one shape is outside the box around another [m]."""
    x = translation[shape, 0] - translation[box, 0]
    y = translation[shape, 1] - translation[box, 1]
    z = translation[shape, 2] - translation[box, 2]
    square = 0.0
    for i in range(3):
        at = rotation[box, 0, i] * x + rotation[box, 1, i] * y + rotation[box, 2, i] * z
        beyond = abs(at) - half_side[box, i]
        if beyond > 0.0:
            square += beyond * beyond
    return math.sqrt(square)


@compiled
def place(bodies: MovingHulls, at: Placements, angles: Array, step: Array, share: float) -> None:
    """Write where the shapes that move are.

    Args:
        bodies: the shapes and the joints that move them.
        at: placements to overwrite.
        angles: joint positions (nv,) [rad or m].
        step: motion of the joints (nv,) [rad or m].
        share: of the motion that was made.
    """
    write_placements(bodies.chain, angles, step, share, at.joint_rotation, at.joint_translation)
    for shape in range(bodies.joint.size):
        joint = bodies.joint[shape]
        if joint == 0:
            continue
        for i in range(3):
            a = at.joint_rotation[joint, i, 0]
            b = at.joint_rotation[joint, i, 1]
            c = at.joint_rotation[joint, i, 2]
            inner, offset = bodies.rotation[shape], bodies.translation[shape]
            for k in range(3):
                at.rotation[shape, i, k] = a * inner[0, k] + b * inner[1, k] + c * inner[2, k]
            moved = a * offset[0] + b * offset[1] + c * offset[2]
            at.translation[shape, i] = at.joint_translation[joint, i] + moved


@compiled
def write_relative(
    rotation: Array, translation: Array, one: int, other: int, between: Array, offset: Array
) -> None:
    """Write the pose of one shape's frame in another's.

    Args:
        rotation: of all shapes in the world (S, 3, 3).
        translation: of all shapes in the world (S, 3) [m].
        one: index of the shape that is looked at.
        other: index of the shape that is looked from.
        between: rotation (3, 3), overwritten.
        offset: translation (3,) [m], overwritten.
    """
    x = translation[one, 0] - translation[other, 0]
    y = translation[one, 1] - translation[other, 1]
    z = translation[one, 2] - translation[other, 2]
    for i in range(3):
        a, b, c = rotation[other, 0, i], rotation[other, 1, i], rotation[other, 2, i]
        offset[i] = a * x + b * y + c * z
        for k in range(3):
            between[i, k] = (
                a * rotation[one, 0, k] + b * rotation[one, 1, k] + c * rotation[one, 2, k]
            )
