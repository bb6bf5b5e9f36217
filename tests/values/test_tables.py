"""Tables of files become dataclasses, or one error that names the key."""

from dataclasses import dataclass
from datetime import date, time
from enum import StrEnum
from typing import Any

import pytest

from densarm.errors import DensarmError, UnknownNameError
from densarm.values.checks import positive
from densarm.values.tables import parse_table


class Colour(StrEnum):
    RED = "red"
    BLUE = "blue"


@dataclass(frozen=True)
class Paint:
    depth: float
    colour: Colour = Colour.RED
    spots: tuple[float, ...] = ()
    coats: int = 1

    def __post_init__(self) -> None:
        positive("paint.depth", self.depth)


def test_tables() -> None:
    paint = parse_table("paint", Paint, {"depth": 1, "colour": "blue", "spots": [1, 2.5]})
    assert paint == Paint(1.0, Colour.BLUE, (1.0, 2.5))


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ({"depth": 1, "color": "red"}, r"unknown key of \[paint\] 'color'; did you mean 'colour'"),
        ({"depth": -1}, "paint.depth = -1.0: must be a finite number > 0"),
        ({"depth": "deep"}, "paint.depth = 'deep': must be a valid number"),
        ({"depth": float("nan")}, "paint.depth"),
        ({"depth": True}, "paint.depth = True"),
        ({"depth": 1, "colour": "green"}, "paint.colour = 'green': must be 'red' or 'blue'"),
        ({"depth": 1, "spots": [1, "x"]}, "paint.spots = 'x'"),
        ({"depth": 1, "coats": 1.5}, "paint.coats = 1.5"),
        (
            {"colour": date(1979, 5, 27)},
            r"paint.colour = datetime.date\(1979, 5, 27\): must be",
        ),
        ({"spots": [1, time(7)]}, r"paint.spots = .*time\(7, 0\)\]: must be a string, number"),
        ({}, "paint.depth"),
        ("red", r"paint = 'red': must be a table"),
    ],
)
def test_wrong_tables(table: Any, message: str) -> None:
    with pytest.raises(DensarmError, match=message) as raised:
        parse_table("paint", Paint, table)
    assert "\n" not in str(raised.value)
    assert isinstance(raised.value, UnknownNameError) == ("color" in table)
