"""Bodies: an arm and its scene as arrays, placed by compiled code.

A pose is a row of twelve numbers: the rotation matrix, row by row, then the translation [m].
"""

import math
from typing import NamedTuple
from weakref import WeakKeyDictionary

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from densarm.arms.arm import Arm
from densarm.arms.joint_space import compose, joint_rows, place_joints, pose_row
from densarm.scene.point_cloud import PointCloud
from densarm.scene.point_tree import PointTree
from densarm.scene.shapes import box_hull, convex_hull, extreme_points
from densarm.values.arrays import Array
from densarm.values.kernels import compiled_lean_part
from densarm.world.hulls import Neighbours, cover, edge_table, neighbours
from densarm.world.simplex import Integers
from densarm.world.world import World

_WIDEST = 1e3  # [m], of the cube that stands for a half-space


class Clouds(NamedTuple):
    """Trees of points, one tree after the other, each as `PointTree` has it."""

    points: Array
    """Points (N, 3) [m]."""
    boxes: Array
    """Boxes of nodes (M, 6) [m]."""
    first: Integers
    """First point and first node of each tree, and those after the last (C + 1, 2)."""


class Bodies(NamedTuple):
    """Sphere-swept hulls, convex hulls enlarged by a radius each, and the joints that move them."""

    parent: Integers
    """Joint that each joint moves with (njoints,)."""
    joints: Array
    """`joint_rows` of the arm's model (njoints, 16)."""
    joint: Integers
    """Joint that moves each body (S,)."""
    shapes: Array
    """One row for each body (S, 17 + nv): the pose of its frame in that of its joint, half the
    sides of a box around it, along the axes of its frame and about its origin [m], the radius of a
    ball about that origin [m], by which its hull is enlarged [m], and `World.shape_lipschitz`."""
    points: Array
    """Corners of all hulls, each in its body's frame, one hull after the other (P, 3) [m]."""
    edges: Integers
    """Where the neighbours of each corner begin and end in this array (P + 1,), then the corners
    that share an edge with a corner, one corner after the other."""
    pairs: Integers
    """Both bodies of each pair, and the last joint that moves both (K, 3).

    If one of them is fixed to that joint, as it is in a chain, it is the second.
    """
    clouds: Clouds
    """The point clouds, each in the frame of its bodies."""
    cloud: Integers
    """Index of the cloud that a body stands for, -1 if it is a hull (S,)."""
    covers: Array
    """Balls that cover each link's hull, where there are clouds: middle in its body's frame, and
    radius, without that by which the hull is enlarged (B, 4) [m]."""
    first_cover: Integers
    """First ball of each body, and that after the last (S + 1,)."""


BOX, BALL, RADIUS, LIPSCHITZ = 12, 15, 16, 17
"""First columns of `Bodies.shapes` behind the pose."""


def bodies_of(world: World) -> tuple[Bodies, Integers]:
    """Return the bodies of a world, and for each pair some corner of both hulls (K, 2).

    They are of the obstacles as they are now, kept until one changes, and not to be written to.
    """
    version, made = _MADE.get(world, (0, None))
    if made is None or version != world.version:
        made = _bodies(world)
        _MADE[world] = (world.version, made)
    return made


# A plan proves under several margins, each time with the same bodies.
_MADE: WeakKeyDictionary[World, tuple[int, tuple[Bodies, Integers]]] = WeakKeyDictionary()


def _bodies(world: World) -> tuple[Bodies, Integers]:
    shapes, model = list(world.geometry_model.geometryObjects), world.arm.model
    hulls = [_hull(item.geometry) for item in shapes]
    corners, radii = zip(*map(extreme_points, hulls), strict=True)
    own = _NEIGHBOURS.setdefault(world.arm, {})
    near = [
        own.get(item.name) or neighbours(hull, each, radius)
        for item, hull, each, radius in zip(shapes, hulls, corners, radii, strict=True)
    ]
    own |= {
        item.name: each for item, each in zip(shapes, near, strict=True) if item.parentJoint > 0
    }
    first, radius = np.cumsum([0, *map(len, corners)]), np.array(radii)
    low, high = (np.array([end(each, axis=0) for each in corners]) for end in (np.min, np.max))
    cloud, trees = _cloud_trees(world)
    for c, tree in enumerate(trees):
        low[cloud == c], high[cloud == c] = tree.boxes[0, :3], tree.boxes[0, 3:]
    middles = 0.5 * (low + high)
    centred = [each - middle for each, middle in zip(corners, middles, strict=True)]
    frames = [
        pose_row(_pose(item) * pin.SE3(np.eye(3), middle))
        for item, middle in zip(shapes, middles, strict=True)
    ]
    reach = np.array([np.linalg.norm(each, axis=1).max() for each in centred]) + radius
    for c, tree in enumerate(trees):
        reach[cloud == c] += 0.5 * np.linalg.norm(np.ptp(tree.boxes[0].reshape(2, 3), axis=0))
    box = 0.5 * (high - low) + radius[:, np.newaxis]
    joint = np.array([item.parentJoint for item in shapes], dtype=np.int64)
    supports = [set(above) for above in model.supports]
    shared = np.array([[max(a & b) for b in supports] for a in supports], dtype=np.int64)
    last = shared[joint[world.pair_shapes[:, 0]], joint[world.pair_shapes[:, 1]]]
    is_first = joint[world.pair_shapes[:, :1]] == last[:, np.newaxis]
    pairs = np.where(is_first, world.pair_shapes[:, ::-1], world.pair_shapes)
    covers = [
        cover(points, edges) if trees and item.parentJoint > 0 else np.zeros((0, 4))
        for points, edges, item in zip(centred, near, shapes, strict=True)
    ]
    bodies = Bodies(
        parent=np.array(list(model.parents), dtype=np.int64),
        joints=joint_rows(model),
        joint=joint,
        shapes=np.column_stack([np.array(frames), box, reach, radius, world.shape_lipschitz]),
        points=np.vstack(centred),
        edges=edge_table(near, first),
        pairs=np.column_stack([pairs, last]),
        clouds=_joined(trees),
        cloud=cloud,
        covers=np.vstack([np.zeros((0, 4)), *covers]),
        first_cover=np.cumsum([0, *map(len, covers)]),
    )
    return bodies, first[pairs]


def _cloud_trees(world: World) -> tuple[Integers, list[PointTree]]:
    """Return which cloud each body stands for, else -1 (S,), and the trees of the clouds."""
    cloud, trees = np.full(world.geometry_model.ngeoms, -1), list[PointTree]()
    for slot in world.clouds:
        if isinstance(slot.obstacle, PointCloud):
            cloud[world.pair_shapes[slot.pairs, 1]] = len(trees)
            trees.append(slot.obstacle.tree)
    return cloud, trees


def _joined(trees: list[PointTree]) -> Clouds:
    points, boxes = [np.zeros((0, 3))], [np.zeros((0, 6))]
    for tree in trees:
        middle = 0.5 * (tree.boxes[0, :3] + tree.boxes[0, 3:])
        points.append(tree.points - middle)
        boxes.append(tree.boxes - np.tile(middle, 2))
    first = np.cumsum([[len(a), len(b)] for a, b in zip(points, boxes, strict=True)], axis=0)
    return Clouds(np.vstack(points), np.vstack(boxes), first)


def _hull(shape: coal.CollisionGeometry) -> coal.CollisionGeometry:
    """Return a shape, or of a half-space a cube below the plane z = 0, wider than all reaches."""
    if not isinstance(shape, coal.Halfspace):
        return shape
    return convex_hull(np.array(box_hull([_WIDEST] * 3).points()) - [0.0, 0.0, 0.5 * _WIDEST])


def _pose(item: pin.GeometryObject) -> pin.SE3:
    """Return where a hull is: of a half-space with a face on its surface, below the origin."""
    shape, pose = item.geometry, item.placement
    if not isinstance(shape, coal.Halfspace):
        return pose
    normal = pose.rotation @ shape.n
    turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), normal).toRotationMatrix()
    return pin.SE3(turn, (shape.d + normal @ pose.translation) * normal)


# coal tells them corner by corner, and an arm among obstacles that move is made anew each time.
_NEIGHBOURS: WeakKeyDictionary[Arm, dict[str, Neighbours]] = WeakKeyDictionary()


@compiled_lean_part
def place(
    bodies: Bodies,
    angles: Array,
    step: Array,
    share: float,
    is_asked: NDArray[np.bool_],
    joint_pose: Array,
    pose: Array,
) -> None:
    """Write where joints and bodies are after a share of a motion.

    Args:
        bodies: the bodies.
        angles: joint positions (nv,) [rad or m].
        step: motion of the joints (nv,) [rad or m].
        share: of the motion that was made.
        is_asked: which bodies are to be placed (S,).
        joint_pose: poses of the joints in the world (njoints, 12), overwritten.
        pose: poses of the bodies (S, 12), overwritten.
    """
    place_joints(bodies.parent, bodies.joints, angles, step, share, joint_pose)
    for body in range(bodies.joint.size):
        if is_asked[body]:
            compose(joint_pose[bodies.joint[body]], bodies.shapes[body], pose[body])


@compiled_lean_part
def write_motion_bounds(
    bodies: Bodies,
    step: Array,
    share: float,
    is_asked: NDArray[np.bool_],
    joint_pose: Array,
    pose: Array,
    bounds: Array,
) -> None:
    r"""Write, for bodies seen from each joint that moves them, bounds on their motion.

    Let joint positions move at constant rates u_j over a unit of time, and let the point p of a
    body be seen from the frame of a joint c. Over the joints j between c and the body,

    .. math:: |p'| \le \mu_c = \sum_j r_j |u_j|, \qquad
        |p''| \le \beta_c = \sum_j \omega_j (r_j |u_j| + 2 \mu_j),

    ω_j = |u_j| for joints that turn and 0 for those that slide, r_j a bound on the distance of the
    body from the axis of joint j (1 if it slides). Between the middle of the motion and either
    end that distance changes by no more than half of μ_j.

    Arguments as for `place`, with the poses in the middle of the motion; μ_c and β_c are written
    to `bounds` (2, S, njoints) [m] where c moves the body or is 0.
    """
    joints, shapes = bodies.joints, bodies.shapes
    for body in range(bodies.joint.size):
        if not is_asked[body]:
            continue
        moved = bent = 0.0
        j = bodies.joint[body]
        while j > 0:
            bounds[0, body, j], bounds[1, body, j] = moved, bent
            slides, rate = joints[j, 15], share * abs(step[j - 1])
            along = square = 0.0
            for i in range(3):
                axis = 0.0
                for k in range(3):
                    axis += joint_pose[j, 3 * i + k] * joints[j, 12 + k]
                offset = pose[body, 9 + i] - joint_pose[j, 9 + i]
                along += axis * offset
                square += offset * offset
            across = math.sqrt(max(0.0, square - along * along))
            reach = slides + (1.0 - slides) * (across + 0.5 * moved + shapes[body, BALL])
            travel = rate * min(shapes[body, LIPSCHITZ + j - 1], reach)
            bent += (1.0 - slides) * rate * (travel + 2.0 * moved)
            moved += travel
            j = bodies.parent[j]
        bounds[0, body, 0], bounds[1, body, 0] = moved, bent
