"""Colours and opacities of what is drawn, alike on the page and in pictures."""

from dataclasses import dataclass

import numpy as np

from densarm.values.arrays import Array

Color = tuple[float, ...]
"""Red, green and blue, 0 to 1."""

BOARD: Color = (0.85, 0.81, 0.78)
OBSTACLE: Color = (0.83, 0.47, 0.30)
CARRIED: Color = (0.36, 0.42, 0.58)
EDGE: Color = (0.45, 0.22, 0.12)
SENSING: Color = (0.93, 0.69, 0.13)
GOAL: Color = (0.16, 0.62, 0.43)
CLOSEST: Color = (0.85, 0.05, 0.45)
FLOOR: Color = (0.78, 0.81, 0.85)
TEXT: Color = (0.11, 0.15, 0.20)
GOOD: Color = (0.12, 0.48, 0.30)
BAD: Color = (0.70, 0.15, 0.12)
QUIET: Color = (0.89, 0.91, 0.93)

OBSTACLE_OPACITY = 0.45
SENSING_OPACITY = 0.18
GOAL_OPACITY = 0.45

_STOPS = np.array(  # close, in between, far; told apart by colour-blind readers
    [[0.80, 0.10, 0.11], [0.96, 0.62, 0.10], [0.35, 0.70, 0.90], [0.00, 0.35, 0.70]]
)
_TOPS = np.outer(10.0 ** np.arange(-3, 1), [1.0, 2.0, 5.0]).ravel()  # [m]
_LARGEST_TOP = 0.1  # [m]


def css(color: Color) -> str:
    """Return a colour as style sheets write it."""
    return "#" + "".join(f"{round(255 * part):02x}" for part in color)


def hexadecimal(color: Color) -> int:
    """Return a colour as three.js has it."""
    return int(css(color)[1:], 16)


@dataclass(frozen=True)
class ClearanceScale:
    """The colours that stand for clearances, from contact to `top` [m] and above."""

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

    def steps(self, count: int) -> list[Color]:
        """Return colours at equal steps of the clearance, from contact to `top`."""
        return [tuple(color) for color in self.colors(np.linspace(0.0, self.top, count)).tolist()]
