"""Rantzer: where along a run the divergence condition of its density holds."""

from dataclasses import dataclass

import numpy as np

from densarm.arrays import Array
from densarm.certificates.plain_density import plain_density
from densarm.density import rantzer_condition
from densarm.scenario import Scenario
from densarm.simulation.fixed_step_loop import REACHED_POSITION

_SAMPLES = 6  # of the run at most that are looked at


@dataclass(frozen=True)
class RantzerRecord:
    """Where Rantzer's condition held; never a pass or fail."""

    gauge: str
    """Of the density; the condition's sign depends on it."""
    samples: int
    """Samples that were looked at."""
    share: float | None
    """Share of them at which the condition holds; None without samples."""
    smallest: float | None
    """Smallest value of the condition [1/rad² or 1/m²], as `RantzerCondition.margin` has it."""
    time: float | None
    """Where that was [s]."""


def record_rantzer(scenario: Scenario, q: Array) -> RantzerRecord:
    r"""Record where along a run the condition :math:`\nabla\cdot(\rho k) \ge 0` holds.

    It is the condition of the plain density, towards the goal and without sub-goals, at 6 samples
    at most, evenly spaced; samples at the goal or in contact, where ρ is infinite or zero, are
    left out.

    Args:
        scenario: arm, scene, goal and the density's parameters.
        q: configurations (N, nq).

    Source: A. Rantzer, Systems & Control Letters 42(3), 2001; [ZNV] appendix.
    """
    arm, gauge = scenario.arm, scenario.density.gauge
    error = np.abs(arm.difference(scenario.goal, q)).max(axis=1)
    away = np.flatnonzero(error > REACHED_POSITION)
    looked_at = away[:: 1 + len(away) // _SAMPLES]
    density, values, times = plain_density(scenario), [], []
    for k in looked_at:
        if np.isfinite(density.evaluate(q[k]).log_value):
            value = float(rantzer_condition(density, q[k], arm.integrate).margin(gauge))
            if np.isfinite(value):
                values.append(value)
                times.append(float(k * scenario.simulation.dt))
    if not values:
        return RantzerRecord(str(gauge), 0, None, None, None)
    least = int(np.argmin(values))
    share = float(np.mean(np.array(values) >= 0.0))
    return RantzerRecord(str(gauge), len(values), share, values[least], times[least])
