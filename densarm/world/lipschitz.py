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
    return np.array([_of_shape(model, item) for item in shapes]).reshape(-1, model.nv)


def _of_shape(model: pin.Model, shape: pin.GeometryObject) -> Array:
    constants = np.zeros(model.nv)
    if shape.parentJoint == 0:  # fixed, and perhaps without end
        return constants
    points, reach = extreme_points(shape.geometry)
    points = points @ shape.placement.rotation.T + shape.placement.translation
    joint = shape.parentJoint
    while joint > 0:
        # In all configurations the shape is within `reach` of the hull of `points`, which are
        # fixed in the frame of `joint`.
        axis, slides = joint_axis(model, joint)
        across = points - np.outer(points @ axis, axis)
        farthest = reach + float(np.linalg.norm(across, axis=1).max())
        constants[model.joints[joint].idx_v] = 1.0 if slides else farthest
        reach += float(np.linalg.norm(points, axis=1).max())
        if slides:
            index = model.joints[joint].idx_q
            reach += max(abs(model.lowerPositionLimit[index]), abs(model.upperPositionLimit[index]))
        points = model.jointPlacements[joint].translation[np.newaxis]
        joint = model.parents[joint]
    return constants
