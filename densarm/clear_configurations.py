"""Random configurations of an arm that touch nothing."""

import numpy as np

from densarm.arrays import Array
from densarm.clearance import Clearance
from densarm.errors import DensarmError

_DRAWS = 10_000


def clear_configurations(
    clearance: Clearance, count: int, seed: int, room: float = 0.0
) -> list[Array]:
    """Draw configurations evenly within the position limits, and keep those that are clear.

    Joints without limits are drawn from a whole turn. The first ones stay the same when more are
    drawn.

    Args:
        clearance: of the arm and its scene.
        count: number of configurations.
        seed: whole number >= 0.
        room: distance that every pair must exceed [m].

    Returns:
        Configurations (nq,).

    Raises:
        DensarmError: almost no configuration is clear.
    """
    random, arm = np.random.default_rng(seed), clearance.arm
    lower = np.where(np.isfinite(arm.limits.lower), arm.limits.lower, -np.pi)
    upper = np.where(np.isfinite(arm.limits.upper), arm.limits.upper, np.pi)

    def draw() -> Array:
        for _ in range(_DRAWS):
            q = arm.configurations(random.uniform(lower, upper))
            if clearance.distances(q).min(initial=np.inf) > room:
                return q
        raise DensarmError(
            f"robot {arm.name!r}: none of {_DRAWS} random configurations keeps "
            f"{1e3 * room:g} mm from contact"
        )

    return [draw() for _ in range(count)]
