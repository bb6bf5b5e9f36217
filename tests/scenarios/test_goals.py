"""Goals of scenario files: configurations, postures, poses, and lists of them."""

import json
from pathlib import Path

import numpy as np
import pytest

from densarm.arms.pose import Pose
from densarm.certificates.task import Task
from densarm.errors import FileContentError
from densarm.planning.motion import PlanningError
from densarm.scenarios.run import run
from densarm.scenarios.scenario import Scenario, load_scenario
from densarm.simulation.run import Run

PANDA = """
[robot]
name = "panda"
frames.probe = {{ frame = "panda_hand", position = [0.0, 0.0, 0.2] }}
[task]
start = "ready"
goal = {goal}
[control]
form = "{form}"
[[obstacles]]
type = "box"
name = "table"
size = [0.8, 1.4, 0.04]
position = [0.6, 0.0, 0.1]
"""
DOWN = "orientation_rpy_deg = [180, 0, 0]"
HAND = f'{{ frame = "panda_hand_tcp", position = [0.5, -0.3, 0.3], {DOWN}, free = "z" }}'
PROBE = '{ frame = "probe", position = [0.5, -0.3, 0.3] }'
TURNED = "[0.9, -0.6, 0.0, -2.2, 0.0, 1.6, 0.8]"


def loaded(folder: Path, goal: str, form: str = "tracking") -> Scenario:
    path = folder / "task.toml"
    path.write_text(PANDA.format(goal=goal, form=form), encoding="utf-8")
    return load_scenario(path)


def test_a_pose_stands_for_the_nearest_configuration(tmp_path: Path) -> None:
    scenario = loaded(tmp_path, HAND)
    pose = Pose("panda_hand_tcp", [0.5, -0.3, 0.3], [1.0, 0.0, 0.0, 0.0], "z")
    (goal,) = scenario.goals
    assert isinstance(goal, Pose)
    assert goal.placement.isApprox(pose.placement, 1e-12)
    np.testing.assert_allclose(scenario.arm.pose(scenario.goal).position, pose.position, atol=1e-6)


def test_frames_of_a_file_can_be_led(tmp_path: Path) -> None:
    scenario = loaded(tmp_path, PROBE)
    at = scenario.arm.pose(scenario.goal, "probe").position
    np.testing.assert_allclose(at, [0.5, -0.3, 0.3], atol=1e-6)


def test_of_a_list_any_will_do(tmp_path: Path) -> None:
    scenario = loaded(tmp_path, f'[{HAND}, "stretched", {TURNED}]')
    assert [type(goal) for goal in scenario.goals] == [Pose, np.ndarray, np.ndarray]
    again = Scenario.of_task(Task.from_json(json.loads(json.dumps(scenario.task.to_json()))))
    assert again.goals[0] == scenario.goals[0]
    np.testing.assert_array_equal(again.goals[1], scenario.goals[1])
    np.testing.assert_array_equal(again.goal, scenario.goal)


def test_one_configuration_is_recorded_as_it_was(tmp_path: Path) -> None:
    scenario = loaded(tmp_path, TURNED)
    assert scenario.goals == ()
    assert "goals" not in scenario.task.to_json()


@pytest.mark.slow
@pytest.mark.parametrize("form", ["tracking", "regulation", "velocity"])
def test_every_form_reaches_a_pose_and_records_it(tmp_path: Path, form: str) -> None:
    scenario = loaded(tmp_path, HAND, form)
    done = run(scenario)
    assert done.outcome == "reached"
    done.save(tmp_path / "run.npz")
    kept = Run.load(tmp_path / "run.npz")
    assert kept.certified or form == "velocity"
    assert kept.task.settings["goals"][0]["frame"] == "panda_hand_tcp"
    at = kept.task.arm.pose(kept.q[-1]).placement
    assert np.linalg.norm(at.translation - [0.5, -0.3, 0.3]) < 1e-2
    assert at.rotation[2, 2] < -0.999


@pytest.mark.parametrize(
    ("goal", "expected"),
    [
        (HAND.replace("tcp", "tip"), ["unknown frame 'panda_hand_tip'", "'panda_hand_tcp'?"]),
        (HAND.replace("0.3]", "3.0]"), ["infeasible", "out of reach: the nearest found is", " m"]),
        (HAND.replace("0.3]", "0.1]"), ["infeasible", "in collision", "table overlap by"]),
        (HAND.replace("[180, 0, 0]", "[3.1416, 0, 0]"), ["are these radians?"]),
        (HAND.replace(DOWN, "orientation_xyzw = [1, 1, 0, 0]"), ["a unit quaternion x y z w"]),
        (HAND.replace(f"{DOWN}, ", ""), ["task.goal.free = 'z'"]),
        (f'[{HAND}, "redy"]', ["task.goal[1] 'redy'", "'ready'"]),
        (f"[{HAND}, [45, 0, 0, -90, 0, 90, 45]]", ["task.goal[1]", "are these degrees?"]),
    ],
)
def test_bad_goals_are_one_line(tmp_path: Path, goal: str, expected: list[str]) -> None:
    with pytest.raises((FileContentError, PlanningError)) as caught:
        loaded(tmp_path, goal)
    assert all(part in str(caught.value) for part in expected), str(caught.value)
    assert "\n" not in str(caught.value)
