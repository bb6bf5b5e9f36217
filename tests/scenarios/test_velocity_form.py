"""The velocity form: runs that need no masses, and what a scenario says of an arm without."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import densarm
from densarm.certificates.task import Input, Task
from densarm.cli import main
from densarm.density.navigation_density import DensityParameters, Gauge
from densarm.errors import FileContentError, InvalidValueError
from densarm.planning.motion import TimingParameters
from densarm.scenarios.control import ControlForm
from densarm.scenarios.run import records, run
from densarm.scenarios.scenario import Scenario, load_scenario
from densarm.simulation.run import Run
from densarm.study.comparison import compare
from densarm.values.outcome import Outcome

MASSLESS = Path(__file__).parents[1] / "data" / "massless.urdf"
SCENARIO = """
[robot]
urdf = "{urdf}"
{robot}
[control]
{control}
[task]
start = [-1.0, -1.0]
goal = [1.0, 1.0]
[[obstacles]]
type = "sphere"
name = "ball"
radius = 0.05
position = [0.45, 0.0, 0.4]
"""

Write = Callable[..., Path]


@pytest.fixture
def write(tmp_path: Path) -> Write:
    def written(robot: str = "", control: str = "") -> Path:
        path = tmp_path / "reach.toml"
        path.write_text(SCENARIO.format(urdf=MASSLESS, robot=robot, control=control))
        return path

    return written


@pytest.mark.parametrize("form", ["", 'form = "regulation"', 'form = "plain"'])
def test_torque_is_refused_with_both_ways_out(
    write: Write, form: str, capsys: pytest.CaptureFixture[str]
) -> None:
    path = write(control=form)
    both = r"none of link 'lower': .*inertia = 'from_shapes'.*control.form = 'velocity'"
    with pytest.raises(FileContentError, match=both):
        load_scenario(path)
    assert main(["run", str(path)]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.count("\n") == 1


@pytest.mark.slow
def test_velocities_reach_and_are_certified(
    write: Write, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, file = write(control='form = "velocity"'), tmp_path / "run.npz"
    assert main(["run", str(path), "--save", str(file)]) == 0
    assert "none, velocities are commanded" in capsys.readouterr().out
    assert main(["verify", str(file)]) == 0
    done = Run.load(file)
    assert (done.task.input, done.outcome) == (Input.VELOCITY, Outcome.REACHED)
    assert done.summary()["peak_torque_ratio"] is None
    limits, dt = done.task.arm.limits, done.task.simulation.dt
    shares = TimingParameters()
    peak = np.abs(np.diff(done.v, axis=0)).max(axis=0) / dt / limits.acceleration
    assert 0.5 < peak.max() <= shares.acceleration_share
    assert (np.abs(done.v) <= shares.velocity_share * limits.velocity).all()
    assert run(load_scenario(path)).q.tobytes() == done.q.tobytes()


@pytest.mark.slow
def test_masses_from_shapes_let_torque_drive_it(write: Write) -> None:
    done = run(load_scenario(write('inertia = "from_shapes"\ndensity = 2700.0')))
    assert (done.task.input, done.outcome) == (Input.TORQUE, Outcome.REACHED)
    assert done.certified
    assert done.task.arm.model.inertias[2].mass == pytest.approx(2700.0 * 0.2 * 0.04 * 0.03)


def test_a_scenario_of_velocities_is_rebuilt(write: Write) -> None:
    scenario = load_scenario(write(control='form = "velocity"'))
    again = Scenario.of_task(Task.from_json(json.loads(json.dumps(scenario.task.to_json()))))
    assert again.control.form == ControlForm.VELOCITY
    assert again.task.input == Input.VELOCITY


def test_in_python_without_a_scenario() -> None:
    arm = densarm.load_arm(MASSLESS)
    ball = densarm.Sphere(name="ball", radius=0.05, position=[0.45, 0.0, 0.4])
    world, start = densarm.World(arm, densarm.Scene([ball])), arm.configuration([-1.0, -1.0])
    motion = densarm.plan_motion(world, start, arm.configuration([1.0, 1.0]))
    plant = densarm.SingleIntegrator(arm)
    done = densarm.simulate(world, densarm.DensityTracking(world, motion), start, plant=plant)
    assert done.certified
    energy, _ = records(done)
    assert "velocity" in energy.detail


def test_densities_that_tracking_cannot_read(swing_up: Scenario) -> None:
    control = replace(swing_up.control, form=ControlForm.VELOCITY)
    with pytest.raises(InvalidValueError, match=r"^control.form = 'velocity': must be"):
        replace(swing_up, control=control, density=DensityParameters(gauge=Gauge.LOG))


def test_baselines_are_of_torque(write: Write) -> None:
    with pytest.raises(InvalidValueError, match=r"control.form = 'velocity': must be one of tor"):
        compare(load_scenario(write(control='form = "velocity"')))
