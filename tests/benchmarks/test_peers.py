"""The peers measure what densarm measures, and the comparison runs and is kept."""

import json
import runpy
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
STATE = 700


@pytest.fixture(autouse=True)
def _scripts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(BENCHMARKS))


def needs(package: str) -> None:
    if find_spec(package) is None:
        pytest.skip(f"{package} is not installed: pip install '.[peers]'")


def agrees(step: Any, task: Any, pairs: int) -> None:
    found, exact = step.distances(STATE), task.world.distances(task.q[STATE])
    computed = np.isfinite(found)
    assert computed.sum() == pairs
    np.testing.assert_allclose(found[computed], exact[computed], atol=1e-6)
    assert np.isfinite(step.command(STATE)).all()


@pytest.fixture
def task() -> Any:
    from control_steps.task import panda_task

    return panda_task("capsule", 2, "close")


def test_pink_measures_the_same(task: Any) -> None:
    needs("pink")
    from control_steps.pink_step import PinkStep

    agrees(PinkStep(task, task.world.n_pairs), task, task.world.n_pairs)


def test_mink_measures_the_same_where_it_looks(task: Any) -> None:
    needs("mink")
    from control_steps.mink_step import MinkStep

    near = int((task.world.distances(task.q[STATE]) < 0.1).sum())
    assert 0 < near < task.world.n_pairs
    agrees(MinkStep(task, 0.1), task, near)
    agrees(MinkStep(task, 10.0), task, task.world.n_pairs)


@pytest.mark.slow
def test_the_arm_in_jax_is_the_same(task: Any) -> None:
    """Of cbfpy's step alone, which takes JAX some ten seconds to compile."""
    needs("jax")
    from control_steps.jax_arm import JaxArm

    arm, q, v, model = JaxArm(task.arm), task.q[STATE], 2.0 * task.v[STATE], task.arm.model
    centers = np.array([sphere.position for sphere in task.spheres])
    radii = np.array([sphere.radius for sphere in task.spheres])
    exact = task.world.distances(q)
    np.testing.assert_allclose(arm.sphere_distances(q, centers, radii), exact, atol=1e-5)
    bias = pin.nonLinearEffects(model, model.createData(), q, v)
    np.testing.assert_allclose(arm.bias(q, v), bias, atol=1e-4)
    np.testing.assert_allclose(arm.mass_matrix(q), task.arm.mass_matrix(q), atol=1e-5)


@pytest.mark.slow
def test_the_comparison_is_printed_kept_and_drawn(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    file, picture = tmp_path / "peers.json", tmp_path / "peers.png"
    small = ["--spheres", "1", "--blocks", "2", "2", "--rounds", "1", "--peers", "absent"]
    tasks = ["--tasks", "capsule-scattered", "--json", str(file), "--figure", str(picture)]
    monkeypatch.setattr(sys, "argv", ["peers.py", *small, *tasks])
    script = runpy.run_path(str(BENCHMARKS / "peers.py"))
    script["main"]()
    assert "absent is not installed" in capsys.readouterr().out
    (comparison,) = json.loads(file.read_text())["comparisons"]
    (step,) = comparison["steps"]
    assert comparison["pairs"] == step["pairs_measured"] == 16
    assert step["command_ratio"]["median"] == 1.0
    assert picture.stat().st_size > 0
