"""InfeasibleTimingError: a path that the limits do not allow to travel."""

from densarm.errors import DensarmError


class InfeasibleTimingError(DensarmError):
    """The limits leave no way to travel a path, e.g. torque too small to hold the arm."""
