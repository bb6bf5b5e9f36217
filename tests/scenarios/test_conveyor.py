"""A goal that keeps to an obstacle that moves, from the file to the record."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from densarm.arms.pose import Pose
from densarm.control.goal_on_obstacle import GoalOnObstacle
from densarm.errors import DensarmError
from densarm.scenarios.control import ControlForm, ControlParameters
from densarm.scenarios.run import run
from densarm.scenarios.scenario import Scenario, load_scenario
from densarm.simulation.run import Run
from densarm.values.outcome import Outcome
from densarm.world.world import World


@pytest.fixture(scope="module")
def conveyor() -> Scenario:
    return load_scenario("ur5_conveyor")


@pytest.fixture(scope="module")
def done(conveyor: Scenario) -> Run:
    return run(conveyor)


@pytest.mark.slow
def test_the_part_is_followed_and_the_run_is_certified(conveyor: Scenario, done: Run) -> None:
    assert (done.outcome, done.certified) == (Outcome.REACHED, True)
    off = []
    for k in range(2500, 4000, 50):  # [ms], while the part moves and the arm has caught up
        x, y, z = conveyor.arm.pose(done.q[k], "tool0").position
        off.append(np.hypot(x - 0.5, y + 0.4 - 0.2 * done.time[k]) + abs(z - 0.23))
    assert max(off) <= 2e-3
    rate = np.abs(np.diff(done.tau[:-1], axis=0)) / 0.001
    assert (rate <= conveyor.arm.limits.torque_rate * (1.0 + 1e-9)).all()
    assert float(done.remark.split(" mm off")[0]) <= 2.0
    assert done.task.goal is not None
    assert conveyor.arm.pose(done.task.goal, "tool0").position[1] == pytest.approx(0.4, abs=1e-3)


@pytest.mark.slow
def test_its_record_knows_what_the_goal_keeps_to(done: Run, tmp_path: Path) -> None:
    done.save(tmp_path / "run.npz")
    again = Run.load(tmp_path / "run.npz")
    assert again.certified
    scenario = Scenario.of_task(again.task)
    assert scenario.goal_follows == "part"
    assert scenario.moving_goal is not None
    assert json.dumps(again.task.to_json()) == json.dumps(done.task.to_json())


def test_the_goal_keeps_to_an_obstacle_that_is_moved_and_turned(conveyor: Scenario) -> None:
    world, pose = World(conveyor.arm, conveyor.scene), conveyor.moving_goal
    assert isinstance(pose, Pose)
    follower, rest = GoalOnObstacle(world, pose, "part"), np.zeros(6)
    half = np.sqrt(0.5)
    turned = [0.0, 0.0, half, half]
    world.move_obstacle("part", [0.4, -0.3, 0.1], turned, velocity=[0.1, 0, 0, 0, 0, 1.0])
    follower.torque(0.0, conveyor.start, rest)
    np.testing.assert_allclose(follower.goal.position, [0.4, -0.3, 0.23], atol=1e-12)
    x_axis = follower.goal.placement.rotation[:, 0]
    np.testing.assert_allclose(np.abs(x_axis), [0.0, 1.0, 0.0], atol=1e-9)
    assert follower.is_moving
    off = np.subtract(conveyor.arm.pose(conveyor.start, "tool0").position, [0.4, -0.3, 0.23])
    assert follower.lag == pytest.approx(np.linalg.norm(off))


def test_what_no_goal_can_keep_to_is_refused_in_one_line(conveyor: Scenario) -> None:
    tracking = ControlParameters(form=ControlForm.TRACKING)
    refused: list[tuple[dict[str, Any], str]] = [
        ({"goal_follows": "prat"}, r"goal_follows.*'prat'.*did you mean 'part'"),
        ({"control": tracking}, r"control.form = 'tracking'.*'regulation' where the goal follows"),
        ({"goal": conveyor.goal, "goals": ()}, r"goal_follows = 'part'.*goal is no pose"),
    ]
    for change, told in refused:
        with pytest.raises(DensarmError, match=told) as raised:
            replace(conveyor, **change)
        assert "\n" not in str(raised.value)
