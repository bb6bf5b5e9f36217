import os
import shutil
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import settings

import densarm
from densarm.scenarios.run import run
from densarm.scenarios.scenario import Scenario, load_scenario
from densarm.scene.obstacles import Sphere
from densarm.scene.scene import Scene
from densarm.simulation.run import Run

# A process that a test starts imports the densarm under test, whatever its working directory.
os.environ["PYTHONSAFEPATH"] = "1"
os.environ["PYTHONPATH"] = str(Path(densarm.__file__).parents[1])

# The first call of a compiled function takes seconds, so a deadline would measure the compiler.
settings.register_profile("densarm", deadline=None, derandomize="CI" in os.environ)
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
    """The two-link arm swings up between two balls."""
    return load_scenario("swing_up")


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
