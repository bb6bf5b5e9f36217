"""Spread: how a measured quantity is distributed."""

from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import ArrayLike


@dataclass(frozen=True)
class Spread:
    """Median and percentiles of a sample."""

    p5: float
    median: float
    p95: float
    p99: float
    p999: float
    largest: float

    @classmethod
    def of(cls, sample: ArrayLike, scale: float = 1.0) -> "Spread":
        values = np.asarray(sample) * scale
        at = np.percentile(values, [5.0, 50.0, 95.0, 99.0, 99.9, 100.0])
        return cls(*at.tolist())

    def to_json(self) -> dict[str, float]:
        return asdict(self)
