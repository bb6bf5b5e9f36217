"""The plain density to a scenario's goal, which plots show a motion in."""

import numpy as np

from densarm.arrays import Array
from densarm.clearance import Clearance
from densarm.density import ClearanceSet, JointLimitSet, NavigationDensity, TorusDistance
from densarm.scenario import Scenario


def goal_density(scenario: Scenario, clearance: Clearance) -> NavigationDensity[TorusDistance]:
    """Return ρ = Π Ψ_k / V^α with the scenario's parameters and its largest sensing distances.

    Args:
        scenario: goal, margin and parameters.
        clearance: of its arm and scene.

    Source: [ZNV] eq. 4.
    """
    arm, sensing, control = scenario.arm, scenario.sensing, scenario.control
    return NavigationDensity(
        [
            ClearanceSet(clearance, control.margin, sensing.distance),
            JointLimitSet(arm, sensing.joint),
        ],
        TorusDistance(arm, scenario.goal, kappa=control.kappa),
        scenario.density,
    )


def log_density(density: NavigationDensity[TorusDistance], q: Array) -> Array:
    """Return ln ρ at configurations (N, nq), NaN where it is infinite."""
    values = np.array([density.evaluate(configuration).log_value for configuration in q])
    return np.where(np.isfinite(values), values, np.nan)
