import fcntl
import os
import shutil
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache
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
from densarm.scenarios.steps import Step
from densarm.scene.obstacles import Box, Cylinder, Sphere
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


@pytest.hookimpl(optionalhook=True)  # there may be no xdist
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """Give a file's tests to one worker, so that its arms and runs are made once.

    In the order of their names one worker cuts arms into pieces while another compiles kernels; by
    numbers of tests both would compile the same ones.
    """
    from xdist.scheduler import LoadFileScheduling

    config.option.loadscopereorder = False
    return LoadFileScheduling(config, log) if config.getvalue("dist") == "load" else None


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
def catalogue_run(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Run]:
    """Return what gives the record of a scenario by its name, run by one worker for all."""
    folder = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        folder = folder.parent

    @cache
    def ran(name: str) -> Run:
        path = folder / f"{name}.npz"
        with path.with_suffix(".lock").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            if not path.exists():
                run(load_scenario(name)).save(path)
        return Run.load(path)

    return ran


TCP = "panda_hand_tcp"


@pytest.fixture(scope="session")
def can_on_a_table() -> World:
    """Panda beside a table on which a can stands, its gripper open."""
    table = Box(name="table", size=[0.8, 1.4, 0.04], position=[0.6, 0.0, 0.1])
    can = Cylinder(name="can", radius=0.033, length=0.12, position=[0.5, -0.2, 0.18])
    return World(densarm.load_arm("panda"), Scene([table, can]))


@pytest.fixture(scope="session")
def carrying_steps() -> tuple[Step, ...]:
    """Take the can, lift it, and put it down elsewhere on the table."""
    above = densarm.Pose(TCP, [0.5, -0.2, 0.315], [1.0, 0.0, 0.0, 0.0], "z")
    beyond = densarm.Pose(TCP, [0.5, 0.1, 0.315], [1.0, 0.0, 0.0, 0.0], "z")
    return (
        densarm.MoveTo(above),
        densarm.Line(TCP, along=[0.0, 0.0, 0.1]),
        densarm.Grip({"panda_finger_joint1": 0.0336}),
        densarm.Attach("can", "panda_hand", 0.3, "table"),
        densarm.Line(TCP, by=[0.0, 0.0, 0.1]),
        densarm.MoveTo(beyond, upright=TCP),
        densarm.Line(TCP, by=[0.0, 0.0, -0.1]),
        densarm.Detach("can", "table"),
        densarm.Grip({"panda_finger_joint1": 0.038}),
        densarm.Wait(0.2),
    )


@pytest.fixture(scope="session")
def carried_can(can_on_a_table: World, carrying_steps: tuple[Step, ...]) -> Run:
    """A certified run of several phases."""
    start = can_on_a_table.arm.postures["ready"]
    return densarm.run_steps(can_on_a_table, start, carrying_steps)


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
