"""What feedback along a motion senses: nothing on it, and what is near where the arm is off it."""

from typing import NamedTuple

import numpy as np

from densarm.arms.dynamics import Kinematics
from densarm.density.navigation_density import DensityParameters, Gauge
from densarm.density.unsafe_sets import ClearanceSet, JointLimitSet, SensingParameters
from densarm.errors import InvalidValueError
from densarm.planning.motion import Motion
from densarm.values.arrays import Array
from densarm.world.active_pairs import ActivePairs
from densarm.world.near_pairs import least_distances
from densarm.world.world import DISTANCE_TOLERANCE, World

_INTERVAL = 0.02  # [s] of the motion between computed distances
# Sensing distances below which the feedback of a small error would shake the arm.
_LEAST_DISTANCE, _LEAST_JOINT_DISTANCE = 1e-3, 5e-3  # [m], [rad or m]


class SensingDistances(NamedTuple):
    """Sensing distances σ that fit a motion; -inf for what is not sensed."""

    pairs: Array
    """Of the pairs of a world (K,) [m]."""
    joints: Array
    """Of the limits of each joint (nv,) [rad or m]."""


def require_smooth_goal(
    density: DensityParameters, *, may_blend: bool, form: str = "tracking"
) -> None:
    """Refuse a density whose gradient is singular or flat at the goal, or a blend not to be read.

    The form of control is for the error.

    Raises:
        InvalidValueError: such a density.
    """
    is_smooth = density.gauge == Gauge.RECIPROCAL and density.alpha == 1.0
    reason = (
        f"in gauge {str(density.gauge)!r} with alpha = {density.alpha:g}, whose gradient is "
        "singular or flat at the goal (or use gauge 'reciprocal', alpha = 1)"
    )
    if not may_blend and density.blend_radius > 0.0:
        allowed = "0 in tracking, which lives at e = 0, where a blend leaves nothing of obstacles"
        raise InvalidValueError("density.blend_radius", density.blend_radius, allowed)
    if not is_smooth and not may_blend:
        raise InvalidValueError("control.form", form, f"'regulation' or 'plain' {reason}")
    if not is_smooth and density.blend_radius == 0.0:
        raise InvalidValueError("density.blend_radius", 0.0, f"above 0 {reason}")


def sensing_distances(world: World, motion: Motion, sensing: SensingParameters) -> SensingDistances:
    """Return how far off a motion pairs and joint limits are sensed: nothing on it.

    Those that the motion comes nearer than it is tracked are not sensed.
    """
    arm = world.arm
    every = max(1, round(_INTERVAL / motion.period))
    angles = np.vstack([motion.position[::every], motion.position[-1:]])
    configurations = arm.configurations(angles)
    held = motion.margin + DISTANCE_TOLERANCE
    limit = held + sensing.distance / sensing.path_share  # beyond which all are sensed alike
    least = least_distances(world, configurations, limit) - held
    angles = arm.angles(configurations)
    inside = np.minimum(angles - arm.limits.lower, arm.limits.upper - angles).min(axis=0)
    share = sensing.path_share * np.minimum(least, limit), sensing.path_share * inside
    return SensingDistances(
        _worth_sensing(share[0], _LEAST_DISTANCE, sensing.distance),
        _worth_sensing(share[1], _LEAST_JOINT_DISTANCE, sensing.joint),
    )


def sets_off(
    world: World, margin: float, sensing: SensingParameters, kinematics: Kinematics
) -> tuple[ClearanceSet, JointLimitSet]:
    """Return pairs and joint limits, to be given the `SensingDistances` of a motion.

    Pairs whose obstacle moves are sensed from the largest distance on all the same.
    """
    near = ActivePairs(world, kinematics)
    pairs = ClearanceSet(world, margin, sensing.distance, near, sensing.distance)
    return pairs, JointLimitSet(world.arm, sensing.joint)


def _worth_sensing(wanted: Array, least: float, most: float) -> Array:
    return np.where(wanted < least, -np.inf, np.minimum(wanted, most))
