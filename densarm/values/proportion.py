"""Proportion: a share of runs, and what is known of the true one."""

import math
from dataclasses import dataclass

from densarm.errors import InvalidValueError


@dataclass(frozen=True)
class Proportion:
    """A count out of a total: a share of runs, with the interval that its sample size allows."""

    count: int
    """Runs that count."""
    total: int
    """All runs, at least one."""

    def __post_init__(self) -> None:
        if not 0 <= self.count <= self.total or self.total < 1:
            allowed = f"from 0 to the total ({self.total}), which is at least 1"
            raise InvalidValueError("count", self.count, allowed)

    @property
    def rate(self) -> float:
        """Count / total."""
        return self.count / self.total

    @property
    def interval(self) -> tuple[float, float]:
        r"""Wilson's interval at 95 %.

        .. math:: \frac{\hat p + z^2/2n \pm z \sqrt{\hat p (1 - \hat p)/n + z^2/4n^2}}{1 + z^2/n}

        Source: E. B. Wilson, JASA 22, 1927.
        """
        n, p, square = self.total, self.rate, _QUANTILE**2
        centre = p + square / (2.0 * n)
        reach = _QUANTILE * math.sqrt(p * (1.0 - p) / n + square / (4.0 * n * n))
        lower, upper = ((centre + sign * reach) / (1.0 + square / n) for sign in (-1.0, 1.0))
        return (lower if self.count else 0.0), (upper if self.count < n else 1.0)

    def __str__(self) -> str:
        """Return the percentage with its interval."""
        lower, upper = self.interval
        return f"{100 * self.rate:.1f} % [{100 * lower:.1f}, {100 * upper:.1f}]"


_QUANTILE = 1.959963984540054  # of the normal distribution, 97.5 %
