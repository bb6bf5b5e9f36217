"""MovingHulls: the bodies of an arm and its scene as rounded hulls, placed by compiled code."""

from functools import lru_cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from densarm.arrays import Array
from densarm.clearance import Clearance
from densarm.compiled import compiled
from densarm.proof.link_placements import (
    joint_table,
    pose_row,
    write_composed,
    write_joint_poses,
)
from densarm.proof.rounded_hulls import rounded_hulls


class MovingHulls(NamedTuple):
    """Every pair of rounded hulls, and the joints that move them, as arrays."""

    parent: NDArray[np.int64]
    """Joint that each joint moves with (njoints,)."""
    joints: Array
    """The table of joints (njoints, 16)."""
    joint: NDArray[np.int64]
    """Joint that moves each shape (S,)."""
    frame: Array
    """Pose of each shape's frame, at the middle of its box, in that of its joint (S, 12)."""
    box: Array
    """Half the sides of a box around each shape, along the axes of its frame (S, 3) [m]."""
    ball: Array
    """Radius of a ball around each shape, about its frame's origin (S,) [m]."""
    points: Array
    """Corners of all hulls, each in its shape's frame (P, 3) [m]."""
    neighbours: NDArray[np.int64]
    """Corners that share an edge with each corner (E,), see `RoundedHulls`."""
    first_neighbour: NDArray[np.int64]
    """Index of each corner's first neighbour (P + 1,), see `RoundedHulls`."""
    radius: Array
    """By which each hull is enlarged (S,) [m]."""
    pairs: NDArray[np.int64]
    """Both shapes of each pair, and the last joint that moves both (K, 3).

    If one of them is fixed to that joint, as it is in a chain, it is the second.
    """


def moving_hulls(clearance: Clearance) -> tuple[MovingHulls, NDArray[np.int64]]:
    """Return the pairs of a clearance, and for each one some corner of both hulls (K, 2).

    What is returned is of the obstacles as they are now, and not to be written to.
    """
    return _moving_hulls(clearance, clearance.version)


# A plan proves under several margins, each time with the same hulls.
@lru_cache(maxsize=1)
def _moving_hulls(clearance: Clearance, _: int) -> tuple[MovingHulls, NDArray[np.int64]]:
    shapes = list(clearance.geometry_model.geometryObjects)
    hulls = rounded_hulls([item.geometry for item in shapes])
    corners = [hulls.points[a:b] for a, b in pairwise(hulls.first)]
    low, high = (np.array([end(points, axis=0) for points in corners]) for end in (np.min, np.max))
    middles = 0.5 * (low + high)
    hulls.points[:] -= np.repeat(middles, np.diff(hulls.first), axis=0)
    frames = [
        pose_row(item.placement * pin.SE3(np.eye(3), middle))
        for item, middle in zip(shapes, middles, strict=True)
    ]
    reach = np.array([np.linalg.norm(points, axis=1).max() for points in corners])
    joint = np.array([item.parentJoint for item in shapes], dtype=np.int64)
    parent, joints = joint_table(clearance.arm.model)
    shared = [_last_shared(parent, *joint[pair]) for pair in clearance.pair_shapes]
    last = np.array(shared, dtype=np.int64)
    is_first = joint[clearance.pair_shapes[:, :1]] == last[:, np.newaxis]
    pairs = np.where(is_first, clearance.pair_shapes[:, ::-1], clearance.pair_shapes)
    bodies = MovingHulls(
        parent=parent,
        joints=joints,
        joint=joint,
        frame=np.array(frames),
        box=0.5 * (high - low) + hulls.radius[:, np.newaxis],
        ball=reach + hulls.radius,
        points=hulls.points,
        neighbours=hulls.neighbours,
        first_neighbour=hulls.first_neighbour,
        radius=hulls.radius,
        pairs=np.column_stack([pairs, last]),
    )
    return bodies, hulls.first[pairs]


def _last_shared(parent: NDArray[np.int64], joint: int, other: int) -> int:
    """Return the last joint that moves with both joints; a joint comes after its parent."""
    while joint != other:
        if joint > other:
            joint = int(parent[joint])
        else:
            other = int(parent[other])
    return joint


@compiled
def place(
    parent: NDArray[np.int64],
    joints: Array,
    joint: NDArray[np.int64],
    frame: Array,
    is_asked: NDArray[np.bool_],
    angles: Array,
    step: Array,
    share: float,
    joint_pose: Array,
    shape_pose: Array,
) -> None:
    """Write where joints and some shapes are after a share of a motion.

    Args:
        parent: see `MovingHulls`, as the next three.
        joints: the table of joints.
        joint: that moves each shape.
        frame: of each shape.
        is_asked: which shapes are to be placed (S,).
        angles: joint positions (nv,) [rad or m].
        step: motion of the joints (nv,) [rad or m].
        share: of the motion that was made.
        joint_pose: poses of the joints in the world (njoints, 12 or more), overwritten.
        shape_pose: poses of the shapes (S, 12), overwritten but for those that no joint moves.
    """
    write_joint_poses(parent, joints, angles, step, share, joint_pose)
    for shape in range(joint.size):
        if is_asked[shape] and joint[shape] > 0:
            write_composed(joint_pose, joint[shape], frame, shape, shape_pose)
