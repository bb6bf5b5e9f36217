"""What makes a scenario infeasible: limits, weight or contact at its start or goal."""

from collections.abc import Iterator

import numpy as np

from densarm.arm import Arm
from densarm.arrays import Array
from densarm.clearance import Clearance
from densarm.holding_torque import holding_ratios, holding_torque
from densarm.scenario import Scenario


def infeasibility(scenario: Scenario, clearance: Clearance) -> str:
    """Return what makes start or goal infeasible, as a phrase; empty if nothing does.

    Args:
        scenario: start, goal and margin.
        clearance: of its arm and scene.
    """
    ends = {"start": scenario.start, "goal": scenario.goal}
    return "; ".join(
        f"{name}: {fault}"
        for name, q in ends.items()
        for fault in [
            *_limit_faults(scenario, q),
            *_holding_faults(scenario.arm, q),
            *_contact_faults(scenario, clearance, q),
        ]
    )


def _limit_faults(scenario: Scenario, q: Array) -> Iterator[str]:
    limits, names = scenario.arm.limits, scenario.arm.joint_names
    angles = scenario.arm.angles(q)
    for j in np.flatnonzero((angles < limits.lower) | (angles > limits.upper)):
        allowed = f"[{limits.lower[j]:.4g}, {limits.upper[j]:.4g}]"
        yield f"joint {names[j]!r} at {angles[j]:.4g} is outside {allowed}"


def _holding_faults(arm: Arm, q: Array) -> Iterator[str]:
    if holding_ratios(arm, q).max() > 1.0:
        yield holding_torque(arm, q)


def _contact_faults(scenario: Scenario, clearance: Clearance, q: Array) -> Iterator[str]:
    distance = clearance.distances(q)
    for k in np.argsort(distance)[: int((distance <= scenario.control.margin).sum())]:
        pair, gap = " and ".join(clearance.pairs[k]), distance[k] * 1e3
        yield f"{pair} overlap by {-gap:.3g} mm" if gap <= 0.0 else f"{pair} are {gap:.3g} mm apart"
