"""ExitStatus: what the process tells its caller."""

from enum import IntEnum


class ExitStatus(IntEnum):
    """Exit status of every command."""

    SUCCESS = 0
    """Reached and free of collision; for `verify`, certified."""
    FAILURE = 1
    """It ran, and did not."""
    WRONG_INPUT = 2
    """One line on stderr says what is wrong with the input."""
    INTERRUPTED = 130
    """Ctrl-C."""
