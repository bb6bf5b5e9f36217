"""Disturbed scenarios: from TOML, Python and the command line, to the record."""

from dataclasses import replace
from pathlib import Path

import pytest

from densarm.errors import DensarmError
from densarm.scenarios.control import ControlForm
from densarm.scenarios.run import run
from densarm.scenarios.scenario import Scenario, load_scenario
from densarm.simulation.disturbances import Disturbances, Push
from densarm.simulation.run import Run

TASK = """
plant = "mujoco"

[robot]
name = "two_link"

[task]
start = [0.0, 0.0]
goal = [0.2, 0.1]

[disturbances]
coulomb = [0.01, 0.02]
torque_delay = 0.001
pushes = [{time = 0.1, joint = "elbow", velocity = 0.05}]
"""


@pytest.fixture
def scenario(tmp_path: Path) -> Scenario:
    return loaded(tmp_path, TASK)


def loaded(tmp_path: Path, text: str) -> Scenario:
    path = tmp_path / "task.toml"
    path.write_text(text, encoding="utf-8")
    return load_scenario(path)


def test_a_file_says_plant_and_disturbances(scenario: Scenario) -> None:
    assert scenario.plant == "mujoco"
    assert scenario.disturbances == Disturbances(
        coulomb=(0.01, 0.02), torque_delay=0.001, pushes=(Push(0.1, "elbow", 0.05),)
    )


def test_the_record_keeps_them(scenario: Scenario, tmp_path: Path) -> None:
    done = run(scenario)
    assert done.outcome == "reached"
    done.save(tmp_path / "run.npz")
    task = Run.load(tmp_path / "run.npz").task
    assert task.plant == "mujoco"
    assert task.disturbances == done.task.disturbances == scenario.disturbances.given
    again = Scenario.of_task(task)
    assert (again.plant, again.disturbances) == ("mujoco", scenario.disturbances)
    checks = {check.name: check.holds for check in done.certificate.checks}
    assert checks["swept"] is True
    assert checks["replay"] is None


def test_what_the_caller_says_counts(scenario: Scenario) -> None:
    done = run(scenario, plant="pinocchio", disturbances=Disturbances())
    assert (done.task.plant, done.task.disturbances) == ("pinocchio", {})
    assert done.certified


def test_the_same_seed_gives_the_same_noisy_run(scenario: Scenario) -> None:
    told = Disturbances(encoder_noise=1e-5, velocity_noise=1e-4, seed=7)
    runs = [run(scenario, disturbances=told) for _ in range(2)]
    other = run(scenario, disturbances=replace(told, seed=8))
    assert (runs[0].q == runs[1].q).all()
    assert len(other.q) != len(runs[0].q) or (other.q != runs[0].q).any()


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"mujoco"', '"bullet"', "plant = 'bullet': must be one of mujoco, pinocchio"),
        ("[0.01, 0.02]", "-1", "disturbances.coulomb = -1"),
        ("[0.01, 0.02]", "[1, 2, 3]", "one per joint of 'two_link'"),
        ("coulomb", "friction", "unknown key of .disturbances. 'friction'.*viscous"),
        ('"elbow"', '"hand"', "unknown disturbances.pushes.joint 'hand'"),
        ("velocity = 0.05", "speed = 1", "disturbances.pushes"),
    ],
)
def test_what_a_file_must_not_say(tmp_path: Path, old: str, new: str, message: str) -> None:
    with pytest.raises(DensarmError, match=message):
        loaded(tmp_path, TASK.replace(old, new))


def test_velocities_drive_no_disturbed_body(scenario: Scenario) -> None:
    control = replace(scenario.control, form=ControlForm.VELOCITY)
    with pytest.raises(DensarmError, match=r"^control.form = 'velocity'"):
        replace(scenario, control=control)
