"""TimingParameters: how much of the limits a reference may use."""

from dataclasses import dataclass

from densarm.errors import InvalidValueError


@dataclass(frozen=True)
class TimingParameters:
    """Shares of the limits that a reference may use; the rest is left to feedback.

    Raises:
        InvalidValueError: a share outside (0, 1].
    """

    velocity_share: float = 0.95
    """Share of the velocity limits."""
    acceleration_share: float = 0.9
    """Share of the acceleration limits."""
    torque_share: float = 0.9
    """Share of the torque limits."""

    def __post_init__(self) -> None:
        for name in ("velocity_share", "acceleration_share", "torque_share"):
            if not 0.0 < getattr(self, name) <= 1.0:
                raise InvalidValueError(name, getattr(self, name), "above 0 and at most 1")
