"""Measures of a run: the time that it takes, and the least that its way takes."""

from dataclasses import replace

import numpy as np
import pytest

from densarm.simulation.run import Run
from densarm.study.measures import motion_time, shortest_time


def test_time_of_a_motion_is_when_the_goal_is_held(swing_up_run: Run) -> None:
    time = motion_time(swing_up_run)
    hold = swing_up_run.task.simulation.hold_time
    assert time == pytest.approx(swing_up_run.time[-1] - hold, abs=0.5 * hold)
    cut = replace(swing_up_run, time=swing_up_run.time[:50], q=swing_up_run.q[:50])
    assert motion_time(replace(cut, v=swing_up_run.v[:50])) == np.inf
    without_goal = replace(swing_up_run, task=replace(swing_up_run.task, goal=None))
    assert motion_time(without_goal) == np.inf


def test_no_motion_is_faster_than_the_time_optimal_one(swing_up_run: Run) -> None:
    optimal = shortest_time(swing_up_run)
    assert optimal is not None
    assert 0.8 * motion_time(swing_up_run) < optimal < motion_time(swing_up_run)


def test_time_optimal_motion_of_one_joint_is_that_of_its_limits(swing_up_run: Run) -> None:
    """The elbow hanging: half of the turn faster and faster, half slower and slower."""
    arm = swing_up_run.task.arm
    angles = np.column_stack([np.zeros(200), np.linspace(0.0, 0.3, 200)])
    turn = replace(swing_up_run, q=arm.configurations(angles))
    bang_bang = 2.0 * np.sqrt(0.3 / arm.limits.acceleration[1])
    assert shortest_time(turn) == pytest.approx(bang_bang, rel=0.06)
    assert shortest_time(replace(turn, q=turn.q[:1])) is None
