"""The density around a reference: one on the reference, falling where the arm is pushed off it."""

import numpy as np

from densarm.density import (
    DensityParameters,
    JointLimitSet,
    NavigationDensity,
    NearClearanceSet,
    NearPairs,
    TorusDistance,
)
from densarm.fields.sub_goal_chain import SensingParameters
from densarm.proof.swept_bound import SweptBound
from densarm.reference.reference import Reference

_INTERVAL = 0.02  # [s] of the reference between computed distances
_SMALLEST = 1e-6  # [m or rad], sensing distance where the reference leaves no room


def reference_density(
    bound: SweptBound,
    reference: Reference,
    sensing: SensingParameters,
    parameters: DensityParameters,
    kappa: float,
) -> NavigationDensity[TorusDistance]:
    """Return the density that a reference is tracked by.

    Every sensing distance is below what the reference keeps from the unsafe set, so that Ψ = 1 on
    it and obstacles act only on an arm that was pushed off it.

    Args:
        bound: distances and the safety margin.
        reference: q_d(t).
        sensing: largest sensing distances and their share of the room on the way.
        parameters: of the density.
        kappa: of the goal distance.
    """
    arm = bound.arm
    every = max(1, round(_INTERVAL / reference.period))
    angles = np.vstack([reference.position[::every], reference.position[-1:]])
    configurations = arm.configurations(angles)
    slack = np.array([bound.slack(q) for q in configurations]).min(axis=0)
    angles = arm.angles(configurations)
    room = np.minimum(angles - arm.limits.lower, arm.limits.upper - angles).min(axis=0)
    pair_sensing = np.clip(sensing.path_share * slack, _SMALLEST, sensing.distance)
    joint_sensing = np.clip(sensing.path_share * room, _SMALLEST, sensing.joint)
    return NavigationDensity(
        [
            NearClearanceSet(NearPairs(bound), bound.margin, pair_sensing),
            JointLimitSet(arm, joint_sensing),
        ],
        TorusDistance(arm, configurations[0], kappa=kappa),
        parameters,
    )
