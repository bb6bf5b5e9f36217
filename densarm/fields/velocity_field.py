"""VelocityField: what the density and its rivals have in common on an arm."""

from typing import Protocol

from densarm.arrays import Array
from densarm.density.distance_bounds import DistanceBounds
from densarm.fields.speed_law import SpeedLaw


class VelocityField(Protocol):
    """A planning system q̇ = k(q) on the joint space of an arm, within its speed law."""

    @property
    def distances(self) -> DistanceBounds:
        """Distances of all pairs, at the configuration that was updated last."""
        ...

    @property
    def speed_law(self) -> SpeedLaw:
        """How fast the arm may go and still stop in the free space ahead."""
        ...

    def restart(self) -> None:
        """Forget where the arm was."""
        ...

    def update(self, q: Array) -> Array:
        """Return k (nv,) at q (nq,) [rad/s or m/s]; zero where it leads nowhere."""
        ...
