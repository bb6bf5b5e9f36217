import os
import shutil
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import coal
import numpy as np
import pytest
from hypothesis import settings

import densarm
from densarm.density.goal_distance import TorusDistance
from densarm.density.navigation_density import DensityParameters
from densarm.density.sub_goals import GuidedDensity, GuidePath, SubGoals
from densarm.density.unsafe_sets import SensingParameters
from densarm.planning.guide import NoPath
from densarm.planning.path_guide import PathGuide
from densarm.scenarios.control import ControlParameters
from densarm.scenarios.run import run
from densarm.scenarios.scenario import Scenario, load_scenario
from densarm.scene.obstacles import Sphere
from densarm.scene.scene import Scene
from densarm.simulation.run import Run
from densarm.values.arrays import Array
from densarm.world.separating_planes import SeparatingPlanes
from densarm.world.swept_check import SweptCheck
from densarm.world.world import World

# A process that a test starts imports the densarm under test, whatever its working directory.
os.environ["PYTHONSAFEPATH"] = "1"
os.environ["PYTHONPATH"] = str(Path(densarm.__file__).parents[1])

# The first call of a compiled function takes seconds, so a deadline would measure the compiler.
settings.register_profile("densarm", deadline=None, max_examples=50, derandomize="CI" in os.environ)
settings.load_profile("densarm")


@pytest.fixture(scope="session")
def chromium() -> str:
    """Path of a Chromium; without one the test is skipped, or fails where one is required."""
    path = shutil.which("chromium") or shutil.which("chromium-browser")
    if path is None:
        missing = pytest.fail if os.environ.get("DENSARM_REQUIRE_BROWSER") else pytest.skip
        missing("no Chromium: apt-get install chromium")
    return path


@pytest.fixture(scope="session")
def swing_up() -> Scenario:
    """The two-link arm swings up between two balls, along a path, all parameters by default."""
    return replace(
        load_scenario("swing_up"),
        control=ControlParameters(),
        density=DensityParameters(),
        sensing=SensingParameters(),
    )


@pytest.fixture(scope="session")
def swing_up_run(swing_up: Scenario) -> Run:
    """A certified run of swing_up."""
    return run(swing_up)


@pytest.fixture(scope="session")
def fenced_in(swing_up: Scenario) -> Scenario:
    """A swing-up that two balls beside the upper link make impossible, and a short search."""
    beside = [
        Sphere(name=name, radius=0.2, position=(x, 0.0, -0.5))
        for name, x in (("left", -0.5), ("right", 0.5))
    ]
    return replace(
        swing_up,
        scene=Scene(beside),
        planning=replace(swing_up.planning, iterations=50, searches=1),
    )


@pytest.fixture(scope="session")
def make_guided(swing_up: Scenario) -> Callable[..., GuidedDensity]:
    """Return a maker of guided densities in swing_up: by guide, start, goal and parameters."""

    def make(
        guide: str = "path",
        start: Sequence[float] | None = None,
        goal: Sequence[float] | None = None,
        scene: Scene | None = None,
        margin: float = 0.0,
        **parameters: Any,
    ) -> GuidedDensity:
        arm = swing_up.arm
        check = SweptCheck(World(arm, swing_up.scene if scene is None else scene), margin)
        ends = (
            swing_up.start if start is None else arm.configuration(start),
            swing_up.goal if goal is None else arm.configuration(goal),
        )
        path: GuidePath | NoPath = GuidePath(np.stack(ends), is_clear=False)
        if guide != "direct":
            path = PathGuide(arm, SeparatingPlanes(check.world, margin)).plan(*ends, 0)
        assert isinstance(path, GuidePath)
        goals = SubGoals(check, path, SensingParameters())
        return GuidedDensity(check, goals, TorusDistance(arm), DensityParameters(**parameters))

    return make


@pytest.fixture(scope="session")
def excess() -> Callable[[coal.CollisionGeometry, Array], float]:
    """Return what tells how far the farthest of some points (N, 3) is outside a shape [m]."""

    def measure(shape: coal.CollisionGeometry, points: Array) -> float:
        pose, ball = coal.Transform3s(), coal.Sphere(1e-3)
        request = coal.DistanceRequest(True)
        request.gjk_tolerance = request.epa_tolerance = 1e-10
        distances: list[float] = []
        for point in points:
            ball_pose = coal.Transform3s(np.eye(3), point)
            result = coal.DistanceResult()
            distances.append(coal.distance(shape, pose, ball, ball_pose, request, result) + 1e-3)
        return max(distances)

    return measure
