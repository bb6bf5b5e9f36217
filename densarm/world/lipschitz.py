"""Lipschitz constants: how far a point of a shape moves at most when a joint moves."""

import numpy as np
import pinocchio as pin

from densarm.arms.joint_space import joint_axis
from densarm.scene.shapes import extreme_points
from densarm.values.arrays import Array


def joint_support(model: pin.Model) -> Array:
    """Return S (njoints, nv): 1 where a velocity index moves a joint's frame, else 0."""
    support = np.zeros((model.njoints, model.nv))
    for joint in range(1, model.njoints):
        support[joint] = support[model.parents[joint]]
        support[joint, model.joints[joint].idx_v] = 1.0
    return support


def shape_lipschitz(model: pin.Model, shapes: pin.StdVec_GeometryObject) -> Array:
    """Return how far a point of each shape moves at most per motion of each joint, r_j (S, nv).

    It is the largest distance from the joint's axis to any point of the shape, over all
    configurations within the position limits [m/rad]: 1 for prismatic joints, 0 for joints that
    do not move the shape.
    """
    axes = [joint_axis(model, joint) for joint in range(1, model.njoints)]
    joints = [(np.zeros(3), False), *axes]
    steps = [
        _extent(pose.translation[np.newaxis], joints[parent][0])
        for pose, parent in zip(model.jointPlacements, model.parents, strict=True)
    ]
    return np.array([_of_shape(model, joints, steps, item) for item in shapes]).reshape(
        -1, model.nv
    )


def _of_shape(
    model: pin.Model,
    joints: list[tuple[Array, bool]],
    steps: list[tuple[float, float]],
    shape: pin.GeometryObject,
) -> Array:
    """Return r_j (nv,) of a shape, given of all joints the `joint_axis`, and `_extent` of the way.

    That is the way from a joint's parent to it, seen from the parent.
    """
    constants = np.zeros(model.nv)
    if shape.parentJoint == 0:  # fixed, and perhaps without end
        return constants
    points, reach = extreme_points(shape.geometry)
    points = points @ shape.placement.rotation.T + shape.placement.translation
    joint = shape.parentJoint
    across, far = _extent(points, joints[joint][0])
    while joint > 0:
        # In all configurations the shape is within `reach` of the hull of points, which are
        # fixed in the frame of `joint`: the shape's own, then the next joint.
        slides = joints[joint][1]
        constants[model.joints[joint].idx_v] = 1.0 if slides else reach + across
        reach += far
        if slides:
            index = model.joints[joint].idx_q
            reach += max(abs(model.lowerPositionLimit[index]), abs(model.upperPositionLimit[index]))
        across, far = steps[joint]
        joint = model.parents[joint]
    return constants


def _extent(points: Array, axis: Array) -> tuple[float, float]:
    """Return how far points (N, 3) are at most from an axis (3,) through zero, and from zero."""
    across = points - np.outer(points @ axis, axis)
    distances = np.linalg.norm([across, points], axis=2).max(axis=1)
    return float(distances[0]), float(distances[1])
