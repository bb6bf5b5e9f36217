"""Navigation densities: unsafe sets, goal distances and the field they make together."""

from densarm.density.divergence import RantzerCondition, rantzer_condition, rantzer_map
from densarm.density.gauge import Gauge
from densarm.density.goal_distance import (
    EuclideanDistance,
    GoalDistance,
    ProductDistance,
    TorusDistance,
)
from densarm.density.inverse_bump import inverse_bump
from densarm.density.joint_error import joint_error
from densarm.density.navigation_density import (
    DensityParameters,
    DensitySample,
    NavigationDensity,
)
from densarm.density.near_clearance_set import NearClearanceSet
from densarm.density.near_pairs import NearPairs
from densarm.density.smooth_step import smooth_step
from densarm.density.unsafe_set import ClearanceSet, ImplicitSet, JointLimitSet, UnsafeSet

__all__ = [
    "ClearanceSet",
    "DensityParameters",
    "DensitySample",
    "EuclideanDistance",
    "Gauge",
    "GoalDistance",
    "ImplicitSet",
    "JointLimitSet",
    "NavigationDensity",
    "NearClearanceSet",
    "NearPairs",
    "ProductDistance",
    "RantzerCondition",
    "TorusDistance",
    "UnsafeSet",
    "inverse_bump",
    "joint_error",
    "rantzer_condition",
    "rantzer_map",
    "smooth_step",
]
