"""Paths of the two-link arm between the obstacles of swing_up."""

import numpy as np
import pytest

from densarm.clearance import Clearance
from densarm.proof.swept_bound import SweptBound
from densarm.scenario import load_scenario


@pytest.fixture(scope="session")
def bound():
    scenario = load_scenario("swing_up")
    return SweptBound(Clearance(scenario.arm, scenario.scene))


@pytest.fixture(scope="session")
def curve(bound):
    """A polyline with corners, over the back of a continuous joint."""
    corners = [[2.8, 0.0], [3.4, 0.9], [4.0, 0.6], [3.6, -0.4]]
    return np.stack([bound.arm.configuration(corner) for corner in corners])
