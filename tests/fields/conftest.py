"""Guided densities on the two-link arm between its two obstacles."""

from dataclasses import replace

import pytest

from densarm.clearance import Clearance
from densarm.density import DensityParameters, TorusDistance
from densarm.fields import GuidedDensity, SensingParameters, SubGoalChain
from densarm.guides import DirectGuide, PathGuide
from densarm.proof.swept_bound import SweptBound
from densarm.scenario import load_scenario


@pytest.fixture(scope="session")
def swing_up():
    return load_scenario("swing_up")


@pytest.fixture(scope="session")
def make_guided(swing_up):
    """Return a maker of guided densities in swing_up: by guide, start, goal and parameters."""

    def make(guide="path", start=None, goal=None, scene=None, margin=0.0, **parameters):
        scenario = replace(
            swing_up,
            start=swing_up.start if start is None else swing_up.arm.configuration(start),
            goal=swing_up.goal if goal is None else swing_up.arm.configuration(goal),
            scene=swing_up.scene if scene is None else scene,
        )
        bound = SweptBound(Clearance(scenario.arm, scenario.scene), margin)
        guide = DirectGuide() if guide == "direct" else PathGuide(scenario.arm, bound)
        path = guide.plan(scenario.start, scenario.goal, 0)
        chain = SubGoalChain(bound, path, SensingParameters())
        density = DensityParameters(**parameters)
        distance = TorusDistance(scenario.arm, scenario.goal)
        return bound, GuidedDensity(bound, chain, density, distance)

    return make
