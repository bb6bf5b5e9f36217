"""Gains of the feedback."""

from dataclasses import dataclass

from densarm.validation import positive


@dataclass(frozen=True)
class Gains:
    """K_p and K_v, the same on every joint; critically damped by default.

    Raises:
        InvalidValueError: a gain that is not positive.
    """

    position: float = 400.0
    """K_p [1/s²], on the density's gradient."""
    velocity: float = 40.0
    """K_v [1/s], on the velocity error."""

    @property
    def rate(self) -> float:
        """λ = K_p / K_v [1/s]: the velocity at which K_p ∇ρ and K_v q̇ balance, per ∇ρ."""
        return self.position / self.velocity

    def __post_init__(self) -> None:
        positive("position", self.position)
        positive("velocity", self.velocity)
