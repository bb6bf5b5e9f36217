"""JointLimits: what the joints of an arm may do."""

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from densarm.arrays import Array
from densarm.validation import finite_vector, positive

DEFAULT_ACCELERATION = 10.0
"""Acceleration limit where nothing is known [rad/s² or m/s²]; a URDF carries none."""

_UNLIMITED = 1e12  # URDFs write huge numbers where a joint has no limit


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
    """Torque or force limit [N·m or N]; infinite as the velocity limit."""


def joint_limits(model: pin.Model, acceleration: tuple[float, ...] | None) -> JointLimits:
    """Return the limits of an arm's joints, and defaults where a URDF has none.

    Acceleration is 10 rad/s² or m/s², since a URDF cannot say. Velocity and effort are infinite
    where the URDF has no limit, zero, or 1e12 and more: then the others bound the motion. A
    continuous joint has no position limits, whatever the URDF writes.

    Args:
        model: the arm, of joints with one degree of freedom each.
        acceleration: limits (nv,) [rad/s² or m/s²]; None for the default on every joint.

    Raises:
        InvalidValueError: an acceleration limit that is not positive, or a wrong length.
    """
    if acceleration is None:
        acceleration = (DEFAULT_ACCELERATION,) * model.nv
    given = finite_vector("acceleration", acceleration, model.nv)
    positive("acceleration", given.min())
    joints = list(model.joints)[1:]
    index = [joint.idx_q for joint in joints]
    lower, upper = model.lowerPositionLimit[index], model.upperPositionLimit[index]
    is_circle = np.array([joint.nq == 2 for joint in joints])
    return JointLimits(
        lower=np.where(is_circle | (lower <= -_UNLIMITED), -np.inf, lower),
        upper=np.where(is_circle | (upper >= _UNLIMITED), np.inf, upper),
        velocity=_limit_or_infinity(model.upperVelocityLimit),
        acceleration=given,
        effort=_limit_or_infinity(model.upperEffortLimit),
    )


def _limit_or_infinity(limit: Array) -> Array:
    return np.where((limit <= 0.0) | (limit >= _UNLIMITED), np.inf, limit)
