"""Random starts: configurations of an arm that touch nothing."""

import numpy as np

from densarm.arrays import Array
from densarm.clearance import Clearance
from densarm.errors import DensarmError
from densarm.scenario import Scenario

_DRAWS = 10_000


def random_starts(scenario: Scenario, clearance: Clearance, count: int, seed: int) -> list[Array]:
    """Draw configurations evenly within the position limits, and keep those that are clear.

    Every pair keeps the margin and the path margin. Joints without limits are drawn from a whole
    turn. The first starts stay the same when more are drawn.

    Args:
        scenario: its margins.
        clearance: of its arm and scene.
        count: number of starts.
        seed: whole number >= 0.

    Returns:
        Configurations (nq,).

    Raises:
        DensarmError: almost no configuration is clear.
    """
    random, limits = np.random.default_rng(seed), scenario.arm.limits
    lower = np.where(np.isfinite(limits.lower), limits.lower, -np.pi)
    upper = np.where(np.isfinite(limits.upper), limits.upper, np.pi)
    room = scenario.control.margin + scenario.control.path_margin

    def draw() -> Array:
        for _ in range(_DRAWS):
            q = scenario.arm.configurations(random.uniform(lower, upper))
            if clearance.distances(q).min(initial=np.inf) > room:
                return q
        raise DensarmError(
            f"scenario {scenario.name!r}: none of {_DRAWS} random configurations keeps "
            f"{1e3 * room:g} mm from contact"
        )

    return [draw() for _ in range(count)]
