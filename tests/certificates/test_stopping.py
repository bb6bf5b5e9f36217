"""The stopping part refuses runs timed without regard to it, and it alone does."""

from dataclasses import replace

import numpy as np
import pytest

from densarm.certificates.certificate import Check, certify
from densarm.control.tracking import DensityTracking
from densarm.planning.motion import TimingParameters
from densarm.planning.smoothing import smooth_path
from densarm.planning.timing import time_path
from densarm.scenarios.scenario import Scenario
from densarm.scene.obstacles import Sphere
from densarm.scene.scene import Scene
from densarm.simulation.simulate import simulate
from densarm.world.stopping import StoppingCheck, StoppingTrajectory
from densarm.world.world import World

BALL = Sphere(name="ball", radius=0.1, position=(1.487, 0.0, 1.337))


@pytest.fixture(scope="module")
def scenario(swing_up: Scenario) -> Scenario:
    goal = swing_up.arm.configuration((2.4, -2.4))
    return replace(swing_up, scene=Scene([BALL]), goal=goal)


def failing(scenario: Scenario, stopping: StoppingCheck | None) -> dict[str, Check]:
    """Parts that fail for a controller that sees no obstacle, along a path past the ball."""
    arm, empty = scenario.arm, World(scenario.arm, Scene())
    corners = np.stack([scenario.start, arm.configuration((2.4, 0.0)), scenario.goal])
    path = smooth_path(empty, 0.0, corners)
    assert path is not None
    motion = time_path(arm, path, 4.8, 0.001, TimingParameters(), stopping)
    run = simulate(scenario.world, DensityTracking(empty, motion), scenario.start, scenario.goal)
    certificate = certify(scenario.task, run.time, run.q, run.v, run.tau)
    return {check.name: check for check in certificate.checks if not check.holds}


def test_timed_without_stopping_in_mind(scenario: Scenario) -> None:
    refused = failing(scenario, None)
    assert set(refused) == {"stopping"}
    assert "comes too near to a body" in refused["stopping"].detail
    assert refused["stopping"].margin is None
    assert 0.0 < refused["stopping"].time < 2.0


def test_timed_with_stopping_in_mind(scenario: Scenario) -> None:
    stopping = StoppingTrajectory(scenario.arm, 0.9, 0.9)
    assert failing(scenario, StoppingCheck(scenario.world, stopping, 1e-3)) == {}
