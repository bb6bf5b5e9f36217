"""A way to make a certified run fail, and what all ways share."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from densarm import Run

ROWS = ("time", "q", "v", "tau", "clearance")
_MOVING = 0.05  # [rad/s], slowest motion that a left-out sample shows in


class NotPossibleError(Exception):
    """This run cannot be made to fail in this way."""


@dataclass(frozen=True)
class Kind:
    """A way to tamper with a run."""

    part: str
    """The part of the certificate that must fail, or not be claimed (tube); "file" where the file
    must be refused."""
    tamper: Callable[[Run, np.random.Generator], Run]


def exponent(rng: np.random.Generator, low: float, high: float) -> float:
    """Return a number between 10^low and 10^high, even in its logarithm, of either sign."""
    return float(10.0 ** rng.uniform(low, high) * rng.choice([-1.0, 1.0]))


def moving_sample(run: Run, rng: np.random.Generator) -> int:
    moving = np.flatnonzero(np.abs(run.v).max(axis=1) > _MOVING)
    return int(rng.choice(moving[(moving > 1) & (moving < len(run.q) - 3)]))


def regridded(run: Run, rows: NDArray[np.int64]) -> Run:
    """Return the run of some of its samples as if no other had been."""
    named = ROWS[1:] if run.reference is None else (*ROWS[1:], "reference")
    arrays = {name: getattr(run, name)[rows] for name in named}
    return replace(
        run, time=run.task.simulation.dt * np.arange(len(rows), dtype=np.float64), **arrays
    )


def with_task(run: Run, **changes: Any) -> Run:
    return replace(run, task=replace(run.task, **changes))
