import json

import numpy as np
import pytest

from densarm.trajectory import Trajectory

KEYS = [
    "outcome",
    "duration_s",
    "min_clearance_m",
    "goal_error_rad",
    "peak_torque_ratio",
    "plan_time_s",
    "preparation_time_s",
    "certified",
]
BALL = """
[[obstacles]]
type = "sphere"
name = "ball"
radius = 0.2
position = [{x}, 0.0, -1.9]
"""


def test_swing_up_is_reached_and_says_so(swing_up):
    assert swing_up.done.status == 0
    assert swing_up.done.err == ""
    assert "reached: The arm reached the goal" in swing_up.done.out
    for label in ("duration", "min clearance", "goal error", "peak torque", "planning", "tracking"):
        assert label in swing_up.done.out
    for check in ("certified", "swept", "start", "goal", "limits", "replay"):
        assert f"{check} " in swing_up.done.out


def test_off_a_terminal_there_is_no_progress(swing_up):
    assert "\x1b" not in swing_up.done.out
    assert "planning\n" not in swing_up.done.out


def test_json_has_the_keys_of_the_summary(swing_up):
    data = json.loads(swing_up.json.read_text(encoding="utf-8"))
    assert list(data) == KEYS
    assert data["outcome"] == "reached"
    assert data["certified"] is True
    assert data["min_clearance_m"] > 0.0
    assert data["goal_error_rad"] <= 0.01


def test_saved_run_is_the_one_summarised(swing_up):
    run = Trajectory.load(swing_up.npz)
    data = json.loads(swing_up.json.read_text(encoding="utf-8"))
    assert run.summary() == data
    with np.load(swing_up.npz, allow_pickle=False) as arrays:
        assert {"time", "q", "v", "tau", "clearance", "scenario"} <= set(arrays)


def test_pages_are_what_their_names_say(swing_up):
    page = swing_up.html.read_text(encoding="utf-8")
    assert page.lstrip().lower().startswith("<!doctype html>")
    assert "Swing a two-link arm" in page
    assert swing_up.png.read_bytes().startswith(b"\x89PNG")


def test_nothing_else_is_left_in_the_folder(swing_up):
    written = {swing_up.npz, swing_up.html, swing_up.png, swing_up.json}
    assert set(swing_up.npz.parent.iterdir()) == written


def test_direct_guide_is_stuck_at_the_critical_point(command, tmp_path):
    done = command("run", "swing_up", "--guide", "direct", "--json", tmp_path / "run.json")
    assert done.status == 1
    assert done.err == ""
    assert "stuck: " in done.out
    assert "saddle of the density" in done.out
    data = json.loads((tmp_path / "run.json").read_text(encoding="utf-8"))
    assert data["outcome"] == "stuck"
    assert data["certified"] is False
    assert data["plan_time_s"] == 0.0


def test_clearance_without_pairs_is_null(command, scenario_file, tmp_path):
    done = command("run", scenario_file(), "--json", tmp_path / "run.json")
    assert done.status == 0
    assert "no pairs" in done.out
    assert json.loads((tmp_path / "run.json").read_text())["min_clearance_m"] is None


def test_start_in_contact_is_infeasible_and_names_the_pair(command, scenario_file, tmp_path):
    path = scenario_file(rest=BALL.format(x=0.0))
    done = command("run", path, "--json", tmp_path / "run.json", "--save", tmp_path / "run.npz")
    assert done.status == 1
    assert done.err == ""
    assert "infeasible: " in done.out
    assert "start: " in done.out
    assert "ball" in done.out
    assert "mm" in done.out
    assert json.loads((tmp_path / "run.json").read_text())["outcome"] == "infeasible"
    assert len(Trajectory.load(tmp_path / "run.npz").time) == 1


def test_goal_outside_the_limits_is_infeasible_and_names_the_joint(command, scenario_file):
    ready = "[0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785]"
    beyond = "[0.0, -0.785, 0.0, 1.0, 0.0, 1.571, 0.785]"
    done = command("run", scenario_file('name = "panda"', f"start = {ready}\ngoal = {beyond}"))
    assert done.status == 1
    assert "goal: joint 'panda_joint4'" in done.out


@pytest.mark.parametrize("kind", ["pdf", "svg"])
def test_plots_in_other_formats(command, scenario_file, tmp_path, kind):
    assert command("run", scenario_file(), "--plot", tmp_path / f"run.{kind}").status == 0
    assert (tmp_path / f"run.{kind}").stat().st_size > 1000
