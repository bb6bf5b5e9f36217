"""VelocityController: commanded velocity from time and state."""

from typing import Protocol

from numpy.typing import ArrayLike

from densarm.arrays import Array


class VelocityController(Protocol):
    """A feedback law for a system that moves with the velocity it is told."""

    def velocity(self, t: float, q: ArrayLike, v: ArrayLike) -> Array:
        """Return the velocity to command.

        Args:
            t: time since the motion began [s].
            q: configuration (nq,).
            v: velocity (nv,) [rad/s or m/s].

        Returns:
            u (nv,) [rad/s or m/s].

        Raises:
            InvalidValueError: a state of the wrong length, or one that is not finite.
        """
        ...
