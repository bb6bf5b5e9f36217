import os
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import settings

import densarm

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
def swing_up_run() -> "densarm.Trajectory":
    """A certified run of swing_up."""
    return densarm.simulate(densarm.load_scenario("swing_up"))


@pytest.fixture(scope="session")
def fenced_in() -> "densarm.Scenario":
    """A swing-up inside a ring of balls, to a goal that a short search finds no path to."""
    swing_up = densarm.load_scenario("swing_up")
    ring = [
        densarm.Sphere(
            name=f"ball{k}", radius=0.2, position=[2.1 * np.sin(a), 0.0, -2.1 * np.cos(a)]
        )
        for k, a in enumerate(np.linspace(0.3, 2 * np.pi - 0.3, 40))
    ]
    return replace(
        swing_up,
        scene=densarm.Scene(ring),
        goal=swing_up.arm.configuration((1.0, 0.5)),
        planning=replace(swing_up.planning, iterations=50, searches=1),
    )
