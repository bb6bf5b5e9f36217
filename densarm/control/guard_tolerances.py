"""GuardTolerances: what a guarded controller takes for normal."""

from dataclasses import dataclass

from densarm.validation import positive


@dataclass(frozen=True)
class GuardTolerances:
    """How far state and clock may be off before the guard brakes.

    A model whose accelerations are wrong by δa lets the observed velocity lag by δa · `memory`
    and the position by δa · `memory`²: the defaults allow 4 rad/s².

    Raises:
        InvalidValueError: a value that is not positive.
    """

    position: float = 0.0025
    """Largest difference of a joint from where the dynamics put it [rad or m]."""
    velocity: float = 0.1
    """Largest difference of its velocity [rad/s or m/s]."""
    memory: float = 0.025
    """Time in which the observed state forgets such a difference [s]."""
    tracking: float = 0.02
    """Largest distance of a joint from the controller's reference, if it has one [rad or m]."""
    gap: float = 0.005
    """Longest time between two calls [s]; at least one and a half periods."""
    delay: float = 0.05
    """Time for which a state that came unexplained must agree with itself to be believed [s]."""

    def __post_init__(self) -> None:
        for name in ("position", "velocity", "memory", "tracking", "gap", "delay"):
            positive(name, getattr(self, name))
