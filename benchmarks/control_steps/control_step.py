"""ControlStep: what is compared."""

from typing import Protocol

from densarm.values.arrays import Array


class ControlStep(Protocol):
    """One library's way to do the task, at states given by their index."""

    name: str
    set_up: str
    """How it was set up, and what differs from the others."""

    def measure(self, k: int) -> object:
        """Compute distances and their gradients, from the configuration alone."""
        ...

    def command(self, k: int) -> Array:
        """Compute the whole command."""
        ...

    def distances(self, k: int) -> Array:
        """Return the distances (K,) [m] in the task's order of pairs; NaN where not computed."""
        ...
