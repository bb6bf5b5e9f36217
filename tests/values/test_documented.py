from dataclasses import dataclass, field

import numpy as np
import pytest

from densarm.values.arrays import Array
from densarm.values.documented import documented, field_docs


@documented
@dataclass(frozen=True)
class Thing:
    """A thing."""

    name: str
    """Its name."""
    size: Array
    """Its size [m]."""
    weight: float = 1.0
    """Its weight [kg]."""
    parts: tuple[str, ...] = field(default_factory=tuple)
    """What it is made of."""


@pytest.mark.parametrize(
    ("thing", "text"),
    [
        (Thing("a", np.zeros(2)), "Thing(name='a', size=[0, 0])"),
        (Thing("a", np.zeros(99)), "Thing(name='a', size=array of 99)"),
        (Thing("a", np.zeros((2, 2))), "Thing(name='a', size=array of 2×2)"),
        (Thing("a", np.ones(1), 2.0), "Thing(name='a', size=[1], weight=2.0)"),
        (Thing("a", np.ones(1), True), "Thing(name='a', size=[1], weight=True)"),
        (Thing("a", np.ones(1), 1.0, ("b",)), "Thing(name='a', size=[1], parts=('b',))"),
    ],
)
def test_repr_tells_what_is_not_by_default(thing: Thing, text: str) -> None:
    assert repr(thing) == text


def test_repr_is_cut() -> None:
    assert len(repr(Thing("a" * 500, np.zeros(2)))) < 100


def test_own_repr_stays() -> None:
    @documented
    @dataclass
    class Other:
        def __repr__(self) -> str:
            return "mine"

    assert repr(Other()) == "mine"


def test_field_docs() -> None:
    assert dict(field_docs(Thing))["size"] == "Its size [m]."
