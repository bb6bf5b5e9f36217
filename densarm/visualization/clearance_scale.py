"""ClearanceScale: the colour that stands for a clearance."""

from dataclasses import dataclass

import numpy as np

from densarm.arrays import Array

_STOPS = np.array(  # close, in between, far; told apart by colour-blind readers
    [[0.80, 0.10, 0.11], [0.96, 0.62, 0.10], [0.35, 0.70, 0.90], [0.00, 0.35, 0.70]]
)
_TOPS = np.outer(10.0 ** np.arange(-3, 1), [1.0, 2.0, 5.0]).ravel()  # [m]
_LARGEST_TOP = 0.1  # [m]


@dataclass(frozen=True)
class ClearanceScale:
    """Colours from contact to clearances of `top` [m] and above."""

    top: float

    @classmethod
    def fitting(cls, clearance: Array) -> "ClearanceScale":
        """Return the scale for clearances (N,) [m] that ends at a round number."""
        largest = min(float(np.max(clearance, initial=0.0)), _LARGEST_TOP)
        return cls(float(_TOPS[np.searchsorted(_TOPS, largest - 1e-9)]))

    def colors(self, clearance: Array) -> Array:
        """Return red, green and blue (N, 3), 0 to 1, of clearances (N,) [m]."""
        share = np.clip(clearance / self.top, 0.0, 1.0)
        at = np.linspace(0.0, 1.0, len(_STOPS))
        return np.column_stack([np.interp(share, at, channel) for channel in _STOPS.T])
