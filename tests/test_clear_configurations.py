"""Random configurations: clear, within limits, and the same for the same seed."""

import numpy as np
import pytest

from densarm.clear_configurations import clear_configurations
from densarm.clearance import Clearance
from densarm.errors import DensarmError
from densarm.scenario import load_scenario
from densarm.scene import Scene, Sphere


@pytest.fixture(scope="module", params=["swing_up", "panda_table"])
def clearance(request):
    scenario = load_scenario(request.param)
    return Clearance(scenario.arm, scenario.scene)


@pytest.mark.parametrize("room", [0.0, 0.02])
def test_clear_and_within_limits(clearance, room):
    limits = clearance.arm.limits
    for q in clear_configurations(clearance, 5, 0, room):
        angles = clearance.arm.angles(q)
        assert clearance.distances(q).min() > room
        assert ((angles >= limits.lower) & (angles <= limits.upper)).all()


def test_more_of_them_begin_with_the_same(clearance):
    few, many, others = (
        np.array(clear_configurations(clearance, count, seed))
        for count, seed in ((2, 1), (4, 1), (2, 2))
    )
    np.testing.assert_array_equal(few, many[:2])
    assert (few != others).any()


def test_none_asked_for(clearance):
    assert clear_configurations(clearance, 0, 0) == []


def test_nowhere_to_be(clearance, monkeypatch):
    monkeypatch.setattr("densarm.clear_configurations._DRAWS", 20)
    everywhere = Clearance(
        clearance.arm, Scene([Sphere(name="all", radius=5.0, position=[0, 0, 0])])
    )
    with pytest.raises(DensarmError, match="none of 20 random configurations keeps 5 mm"):
        clear_configurations(everywhere, 2, 0, 0.005)
