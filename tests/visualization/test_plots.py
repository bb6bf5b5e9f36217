import dataclasses

import numpy as np
import pytest

from densarm.errors import FileContentError, InvalidValueError
from densarm.outcome import Outcome
from densarm.scenario import Scenario, load_scenario
from densarm.scene import Scene
from densarm.trajectory import Trajectory
from densarm.visualization.plots import run_figure, save_plot


@pytest.fixture(scope="module")
def scenario() -> Scenario:
    return load_scenario("swing_up")


def swinging(scenario: Scenario, clearance: float) -> Trajectory:
    """A record of both joints swinging to and fro, one of them close to its velocity limit."""
    time = np.linspace(0.0, 1.0, 101)
    angles = np.column_stack([2.0 * np.sin(3.0 * time), 0.1 * time])
    v = np.column_stack([6.0 * np.cos(3.0 * time), np.full(101, 0.1)])
    return Trajectory(
        scenario=scenario,
        time=time,
        q=scenario.arm.configurations(angles),
        v=v,
        tau=2.0 * v,
        clearance=clearance + 0.2 * time,
        outcome=Outcome.TIMED_OUT,
    )


def test_panels_show_the_record(scenario):
    run = swinging(scenario, clearance=0.012)
    position, velocity, torque, clearance = run_figure(run).axes
    for axes, values in ((velocity, run.v), (torque, run.tau)):
        for line, column in zip(axes.get_lines(), values.T, strict=False):
            assert (line.get_ydata() == column).all()
    assert position.get_lines()[0].get_ydata()[50] == pytest.approx(2.0 * np.sin(1.5))
    assert (clearance.get_lines()[0].get_ydata() == run.clearance).all()
    assert "smallest 12 mm at 0.00 s" in clearance.get_title(loc="right")


def test_angles_are_drawn_without_jumps_at_half_a_turn(scenario):
    run = swinging(scenario, clearance=0.1)
    angles = np.column_stack([np.linspace(0.0, 9.0, 101), np.zeros(101)])
    run = dataclasses.replace(run, q=scenario.arm.configurations(angles))
    drawn = run_figure(run).axes[0].get_lines()[0].get_ydata()
    assert drawn == pytest.approx(angles[:, 0])


def test_only_limits_that_come_near_are_drawn(scenario):
    figure = run_figure(swinging(scenario, clearance=0.1))
    limits = {line.get_ydata()[0] for line in figure.axes[1].get_lines()[2:]}
    assert limits == {-6.0, 6.0}
    assert len(figure.axes[0].get_lines()) == 2  # continuous joints have no position limits
    assert len(figure.axes[2].get_lines()) == 2  # torque stays far from its limits


def test_run_without_pairs(scenario):
    alone = dataclasses.replace(scenario, scene=Scene())
    clearance = run_figure(swinging(alone, clearance=np.inf)).axes[3]
    assert [text.get_text() for text in clearance.texts] == ["no pairs"]


def test_other_endings_are_refused(scenario, tmp_path):
    with pytest.raises(InvalidValueError, match=r"\.png"):
        save_plot(swinging(scenario, clearance=0.1), tmp_path / "run.gif")
    assert list(tmp_path.iterdir()) == []


def test_missing_folder(scenario, tmp_path):
    with pytest.raises(FileContentError, match=r"run\.png"):
        save_plot(swinging(scenario, clearance=0.1), tmp_path / "missing" / "run.png")
