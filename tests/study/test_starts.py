"""Random starts: clear, within limits, and the same for the same seed."""

import numpy as np
import pytest

from densarm.clearance import Clearance
from densarm.errors import DensarmError
from densarm.scenario import load_scenario
from densarm.scene import Scene, Sphere
from densarm.study.starts import random_starts


@pytest.fixture(scope="module", params=["swing_up", "panda_table"])
def setting(request):
    scenario = load_scenario(request.param)
    return scenario, Clearance(scenario.arm, scenario.scene)


def test_clear_and_within_limits(setting):
    scenario, clearance = setting
    limits = scenario.arm.limits
    for q in random_starts(scenario, clearance, 5, 0):
        angles = scenario.arm.angles(q)
        assert clearance.distances(q).min() > scenario.control.path_margin
        assert ((angles >= limits.lower) & (angles <= limits.upper)).all()


def test_more_of_them_begin_with_the_same(setting):
    few, many, others = (
        np.array(random_starts(*setting, count, seed)) for count, seed in ((2, 1), (4, 1), (2, 2))
    )
    np.testing.assert_array_equal(few, many[:2])
    assert (few != others).any()


def test_none_asked_for(setting):
    assert random_starts(*setting, 0, 0) == []


def test_nowhere_to_start(setting, monkeypatch):
    monkeypatch.setattr("densarm.study.starts._DRAWS", 20)
    scenario, _ = setting
    everywhere = Clearance(
        scenario.arm, Scene([Sphere(name="all", radius=5.0, position=[0, 0, 0])])
    )
    with pytest.raises(DensarmError, match="none of 20 random configurations keeps 5 mm"):
        random_starts(scenario, everywhere, 2, 0)
