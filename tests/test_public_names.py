import ast
import importlib
import inspect
import pkgutil
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import pytest

import densarm

CLASSES = [value for name in densarm.__all__ if inspect.isclass(value := getattr(densarm, name))]


def listed_names() -> dict[str, str]:
    """Name to module, as the stub has it."""
    stub = Path(densarm.__file__).with_suffix(".pyi").read_text(encoding="utf-8")
    imports = [node for node in ast.parse(stub).body if isinstance(node, ast.ImportFrom)]
    return {alias.name: f"densarm.{node.module}" for node in imports for alias in node.names}


def test_seventy_three_names_at_most() -> None:
    assert len(densarm.__all__) <= 73


@pytest.mark.parametrize("name", densarm.__all__)
def test_public_name_is_that_of_its_module(name: str) -> None:
    assert getattr(importlib.import_module(listed_names()[name]), name) is getattr(densarm, name)
    assert name in dir(densarm)
    assert getattr(densarm, name).__doc__


@pytest.mark.parametrize("cls", [cls for cls in CLASSES if is_dataclass(cls)])
def test_help_says_what_each_field_is(cls: type[Any]) -> None:
    described = inspect.getdoc(cls) or ""
    for field in fields(cls):
        if field.init:
            assert f"    {field.name}:\n        " in described


@pytest.mark.parametrize(
    ("room", "names"),
    [
        ("density", {"JointSpaceCover", "ProductDistance"}),
        ("euclidean", {"EuclideanDensity", "run_points", "saturate"}),
    ],
)
def test_rooms_list_what_the_paper_has_beside_the_public_names(room: str, names: set[str]) -> None:
    package = importlib.import_module(f"densarm.{room}")
    modules = {module.name for module in pkgutil.iter_modules(package.__path__)}
    assert names <= set(package.__all__)
    assert not modules & set(package.__all__)
    for name in package.__all__:
        assert getattr(package, name).__doc__
    departures = (Path(__file__).parents[1] / "docs" / "departures.md").read_text("utf-8")
    assert all(f"`densarm.{room}.{name}`" in departures for name in names)


def test_unknown_name_is_an_attribute_error() -> None:
    unknown = "load_arms"
    with pytest.raises(AttributeError, match=unknown):
        getattr(densarm, unknown)


def test_no_module_hides_a_public_name() -> None:
    modules = {module.name for module in pkgutil.iter_modules(densarm.__path__)}
    assert modules & set(densarm.__all__) == set()


@pytest.mark.slow
def test_reprs_are_short(swing_up_run: densarm.Run) -> None:
    task, path = swing_up_run.task, densarm.GuidePath(swing_up_run.q[:2], is_clear=True)
    arm, goal = task.arm, swing_up_run.q[-1]
    world = densarm.World(arm, task.scene)
    motion = densarm.Motion(0.1, arm.angles(swing_up_run.q), swing_up_run.v)
    regulation = densarm.DensityRegulation(world, goal)
    pose = densarm.Pose("tip", [0.0, 0.0, 1.0])
    told = {
        "Arm('two_link', 2 joints)": arm,
        "Run('Swing a two-link arm from hanging to upright": swing_up_run,
        "World(Arm('two_link', 2 joints), Scene(": world,
        "Pose(frame='tip', position=(0, 0, 1))": pose,
        "Certificate(proved: swept, start, goal": swing_up_run.certificate,
        "DensityRegulation('two_link' to [": regulation,
        "Supervisor('two_link' to [": densarm.Supervisor(arm, regulation),
        "DensityTracking('two_link' to [": densarm.DensityTracking(world, motion),
        "Motion(": motion,
        "MotionSamples(": motion.samples(0.1),
        "GuidePath(waypoints=array of 2×4, ": path,
        "Scenario('swing_up', ": densarm.load_scenario("swing_up"),
        "NavigationDensity(goal=[": densarm.density_towards(world, goal),
        "TorusDistance(weights=[1, 1], kappa=1)": densarm.TorusDistance(arm),
        "SingleIntegrator(Arm(": densarm.SingleIntegrator(arm),
        "MujocoPlant(World(": densarm.MujocoPlant(world),
        "ClearanceSample(": world.clearance(goal),
        "Task(": task,
    }
    for start, value in told.items():
        assert repr(value).startswith(start)
        assert len(repr(value)) < 200
    title, sentence, figures, proved = str(swing_up_run).splitlines()
    assert (title, sentence) == (task.title, swing_up_run.outcome.description)
    assert "clearance" in figures
    assert proved == repr(swing_up_run.certificate)
