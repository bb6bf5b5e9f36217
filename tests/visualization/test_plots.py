import dataclasses
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from densarm.arms.arm import Arm
from densarm.arms.description import RobotDescription
from densarm.certificates.task import Task
from densarm.errors import FileContentError, InvalidValueError
from densarm.scenarios.scenario import load_scenario
from densarm.scene.scene import Scene
from densarm.simulation.run import Run
from densarm.values.arrays import Array
from densarm.values.outcome import Outcome
from densarm.visualization.plots import run_figure, save_plot

LIFT = """<robot name="lift">
  <link name="base"><collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision></link>
  <link name="cabin"><inertial><mass value="1"/>
    <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision></link>
  <joint name="lift" type="prismatic"><parent link="base"/><child link="cabin"/>
    <axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="10" velocity="1"/></joint>
</robot>"""


@pytest.fixture(scope="module")
def task() -> Task:
    return load_scenario("swing_up").task


def swinging(task: Task, clearance: float) -> Run:
    """A record of both joints swinging to and fro, one of them close to its velocity limit."""
    time = np.linspace(0.0, 1.0, 101)
    angles = np.column_stack([2.0 * np.sin(3.0 * time), 0.1 * time])
    v = np.column_stack([6.0 * np.cos(3.0 * time), np.full(101, 0.1)])
    return Run(
        task=task,
        time=time,
        q=task.arm.configurations(angles),
        v=v,
        tau=2.0 * v,
        clearance=clearance + 0.2 * time,
        outcome=Outcome.TIMED_OUT,
    )


@pytest.fixture(scope="module")
def run(task: Task) -> Run:
    return swinging(task, clearance=0.012)


@pytest.fixture(scope="module")
def figure(run: Run) -> Figure:
    return run_figure(run)


def axes_of(figure: Figure, ylabel: str) -> list[Axes]:
    return [axes for axes in figure.axes if axes.get_ylabel() == ylabel]


def y_of(line: Line2D) -> Array:
    return np.asarray(line.get_ydata())


def test_panels_show_the_record(run: Run, figure: Figure) -> None:
    velocities, torques = axes_of(figure, "[rad/s]"), axes_of(figure, "[N·m]")
    for panels, values in ((velocities, run.v), (torques, run.tau)):
        assert len(panels) == 2
        for axes, column in zip(panels, values.T, strict=True):
            assert (y_of(axes.get_lines()[0]) == column).all()
    (position,) = axes_of(figure, "shoulder\n[rad], no limit")
    assert y_of(position.get_lines()[0])[50] == pytest.approx(2.0 * np.sin(1.5))
    (clearance,) = axes_of(figure, "clearance [mm]")
    assert y_of(clearance.get_lines()[0]) == pytest.approx(1e3 * run.clearance)
    assert "smallest 12 mm at 0.00 s" in clearance.get_title(loc="left")


def test_limits_are_in_sight_whatever_the_values_are(run: Run, figure: Figure) -> None:
    limits = run.task.arm.limits
    for ylabel, bounds in (("[rad/s]", limits.velocity), ("[N·m]", limits.effort)):
        for axes, bound in zip(axes_of(figure, ylabel), bounds, strict=True):
            drawn = {y_of(line)[0] for line in axes.get_lines()[1:]}
            assert drawn == {-bound, bound}
            low, high = axes.get_ylim()
            assert low < -bound < bound < high
    assert axes_of(figure, "elbow\n[rad], no limit")


@pytest.mark.slow
def test_values_beyond_a_limit_are_in_sight(task: Task) -> None:
    beyond = swinging(task, clearance=0.1)
    beyond = dataclasses.replace(beyond, v=2.0 * beyond.v)
    shoulder, _ = axes_of(run_figure(beyond), "[rad/s]")
    assert shoulder.get_ylim()[1] > 12.0


@pytest.mark.slow
def test_angles_are_drawn_without_jumps_at_half_a_turn(run: Run) -> None:
    angles = np.column_stack([np.linspace(0.0, 9.0, 101), np.zeros(101)])
    turning = dataclasses.replace(run, q=run.task.arm.configurations(angles))
    (position,) = axes_of(run_figure(turning), "shoulder\n[rad], no limit")
    assert y_of(position.get_lines()[0]) == pytest.approx(angles[:, 0])


def test_density_is_that_to_the_goal(run: Run, figure: Figure, task: Task) -> None:
    (line,) = (line for axes in axes_of(figure, "ln ρ") for line in axes.get_lines())
    density = y_of(line)
    assert len(density) == len(run.time)
    # Far from the obstacles nothing but the goal acts: V is a weighted sum of 1 - cos.
    assert task.goal is not None
    error = task.arm.difference(task.goal, run.q[50])
    v = (1.0 - np.cos(error)) @ [1.0, 0.125]
    assert density[50] == pytest.approx(-np.log(v))


def test_joint_space_has_the_motion_between_start_and_goal(figure: Figure) -> None:
    (axes,) = (axes for axes in figure.axes if axes.get_title().startswith("joint space"))
    motion, start, goal = (np.asarray(line.get_xydata()) for line in axes.get_lines())
    assert motion[50, 0] == pytest.approx(2.0 * np.sin(1.5))
    assert start[0].tolist() == [0.0, 0.0]
    assert goal[0, 0] == pytest.approx(np.pi)
    low, high = axes.get_xlim()
    assert high - low == pytest.approx(2.0 * np.pi)
    assert axes.get_xlabel() == "shoulder [rad]"


@pytest.mark.slow
def test_run_without_pairs(task: Task) -> None:
    alone = dataclasses.replace(task, scene=Scene())
    figure = run_figure(swinging(alone, clearance=np.inf))
    (clearance,) = axes_of(figure, "clearance [mm]")
    assert [text.get_text() for text in clearance.texts] == ["no pairs"]


def test_run_without_a_goal_has_no_density(run: Run) -> None:
    figure = run_figure(dataclasses.replace(run, task=dataclasses.replace(run.task, goal=None)))
    assert axes_of(figure, "ln ρ") == []
    (clearance,) = axes_of(figure, "clearance [mm]")
    assert clearance.get_xlabel() == "time [s]"
    (space,) = (axes for axes in figure.axes if axes.get_title().startswith("joint space"))
    legend = space.get_legend()
    assert legend is not None
    assert [text.get_text() for text in legend.get_texts()] == ["motion", "start"]
    assert len(space.collections) > 0


def test_arm_of_other_joints_has_no_joint_space(record: Callable[..., Run]) -> None:
    arm = Arm(RobotDescription(name="lift", urdf=LIFT))
    figure = run_figure(record(arm, np.array([[0.0], [0.3]]), 1.0, Scene()))
    assert axes_of(figure, "lift\n[m]")
    assert axes_of(figure, "[m/s]")
    assert axes_of(figure, "[N]")
    assert not any(axes.get_title().startswith("joint space") for axes in figure.axes)


@pytest.mark.slow
def test_other_endings_are_refused(task: Task, tmp_path: Path) -> None:
    with pytest.raises(InvalidValueError, match=r"\.png"):
        save_plot(swinging(task, clearance=0.1), tmp_path / "run.gif")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_missing_folder(task: Task, tmp_path: Path) -> None:
    with pytest.raises(FileContentError, match=r"run\.png"):
        save_plot(swinging(task, clearance=0.1), tmp_path / "missing" / "run.png")
