"""Messages are one line: what was wrong, its value, what is allowed."""

import numpy as np
import pytest

from densarm.errors import (
    DensarmError,
    FileContentError,
    InvalidValueError,
    RobotDescriptionError,
    UnknownNameError,
)


def test_every_error_is_a_densarm_error() -> None:
    for kind in (FileContentError, InvalidValueError, RobotDescriptionError, UnknownNameError):
        assert issubclass(kind, DensarmError)
    assert issubclass(DensarmError, ValueError)


def test_unknown_name_lists_the_known_and_the_nearest() -> None:
    error = UnknownNameError("robot", "pnda", {"two_link", "panda"})
    assert str(error) == "unknown robot 'pnda'; did you mean 'panda'? (known: panda, two_link)"
    assert str(UnknownNameError("key", None, [])) == "unknown key 'None' (known: none)"


def test_invalid_value_keeps_its_parts() -> None:
    error = InvalidValueError("radius", -1, "a finite number > 0")
    assert str(error) == "radius = -1: must be a finite number > 0"
    assert str(InvalidValueError("x", np.float64(0), "> 0")) == "x = 0.0: must be > 0"
    assert (error.name, error.value, error.allowed) == ("radius", -1, "a finite number > 0")


@pytest.mark.parametrize("value", [np.zeros((30, 30)), "a\nb", list(range(1000))])
def test_values_are_shown_short_and_on_one_line(value: object) -> None:
    message = str(InvalidValueError("value", value, "smaller"))
    assert "\n" not in message
    assert len(message) < 120


def test_file_content() -> None:
    assert str(FileContentError("run.npz", "not a run")) == "run.npz: not a run"
