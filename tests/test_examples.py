import json
import re
import runpy
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import densarm
from densarm.simulation.run import Run

EXAMPLES = Path(__file__).parents[1] / "examples"


def run_example(monkeypatch: pytest.MonkeyPatch, name: str, *arguments: str) -> None:
    monkeypatch.setattr("sys.argv", [name, *arguments])
    runpy.run_path(str(EXAMPLES / name), run_name="__main__")


def test_every_example_is_tested_short_and_listed() -> None:
    course = (EXAMPLES / "README.md").read_text(encoding="utf-8")
    for path in EXAMPLES.glob("*.py"):
        assert f"test_{path.stem}" in globals()
        assert len(path.read_text(encoding="utf-8").splitlines()) < 60
        assert f"]({path.name})" in course
    for link in re.findall(r"\]\((.+?)\)", course):
        assert (EXAMPLES / link).is_file()


@pytest.mark.slow
def test_swing_up(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run_example(monkeypatch, "swing_up.py", "--out", str(tmp_path))
    out = capsys.readouterr().out
    assert "reached the goal" in out
    assert "not proved" not in out
    assert "left a critical point of the density" in out
    written = {f"swing_up.{ending}" for ending in ("npz", "html", "png")}
    assert {path.name for path in tmp_path.iterdir()} == written


@pytest.mark.slow
def test_three_link_swing_up(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    run_example(monkeypatch, "three_link_swing_up.py")
    equal, inertia, certified = capsys.readouterr().out.splitlines()
    assert equal.startswith("weights None: stuck, maximum of the density")
    assert inertia.startswith("weights inertia: reached, left a critical point of the density")
    assert certified == "certified: True"


@pytest.mark.slow
def test_panda_table(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run_example(monkeypatch, "panda_table.py", "--out", str(tmp_path))
    out = capsys.readouterr().out
    assert "reached the goal" in out
    assert "certified: True" in out
    assert {path.name for path in tmp_path.iterdir()} == {"panda_table.html", "panda_table.png"}


def test_own_control_loop(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    run_example(monkeypatch, "own_control_loop.py")
    status, result = capsys.readouterr().out.splitlines()
    words = result.split()
    assert status == "The controller acts."
    assert float(words[0]) < 0.01  # [rad] from the goal
    assert float(words[-2]) > 0.0  # [mm] of clearance
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_point_cloud(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    run_example(monkeypatch, "point_cloud.py")
    points, result = capsys.readouterr().out.splitlines()
    assert int(points.split()[0]) > 10_000
    assert result.startswith("reached, certified: True, smallest distance ")


@pytest.mark.slow
def test_plan_beside(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    run_example(monkeypatch, "plan_beside.py")
    planned, result = capsys.readouterr().out.splitlines()
    assert planned.startswith("planned again at t = ")
    assert float(planned.split()[-2]) > 0.0  # [mm] of clearance
    assert float(result.split()[0]) < 0.01  # [rad] from the goal


@pytest.mark.slow
def test_free_body(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run_example(monkeypatch, "free_body.py", "--out", str(tmp_path))
    out = capsys.readouterr().out
    assert "by velocity: reached" in out
    assert "proved clear" in out
    assert "certified: True" in out
    assert {path.name for path in tmp_path.iterdir()} == {"free_body.html"}


@pytest.mark.slow
def test_own_urdf(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run_example(monkeypatch, "own_urdf.py", "--out", str(tmp_path))
    out = capsys.readouterr().out
    assert "slide from -0.2 to 0.1\n" in out
    assert "reached" in out
    assert "certified: True" in out
    assert float(out.split()[-2]) > -190.0  # [mm], where start and goal have the quill
    assert {path.name for path in tmp_path.iterdir()} == {"own_urdf.png"}


@pytest.mark.slow
def test_own_scene(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run_example(monkeypatch, "own_scene.py", "--out", str(tmp_path))
    out = capsys.readouterr().out
    assert "reached" in out
    assert "certified: True" in out
    assert float(out.split()[-2]) > 0.0  # [mm] of clearance
    assert {path.name for path in tmp_path.iterdir()} == {"own_scene.png"}


@pytest.mark.slow
def test_reading_a_run(
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    swing_up_run: Run,
) -> None:
    swing_up_run.save(tmp_path / "run.npz")
    run_example(monkeypatch, "reading_a_run.py", str(tmp_path / "run.npz"), "--out", str(tmp_path))
    out = capsys.readouterr().out
    assert "reached" in out
    assert out.count(" proved: ") == 7
    assert "not proved" not in out
    assert f"{swing_up_run.clearance[0] * 1e3:.1f} mm" in out
    pictures = {"reading_a_run.png", "reading_a_run_plot.png"}
    assert {path.name for path in tmp_path.iterdir()} == {"run.npz", *pictures}


OWN_PARTS = ["own_controller", "own_guide", "own_goal_distance", "own_unsafe_set", "own_plant"]
OWN_PARTS += ["own_mujoco_model", "unknown_payload"]
SWING_UPS = ["swing_up", "three_link_swing_up"]


@pytest.mark.parametrize("name", [*OWN_PARTS, *SWING_UPS])
def test_own_parts_are_short(name: str) -> None:
    assert len((EXAMPLES / f"{name}.py").read_text(encoding="utf-8").splitlines()) < 40


def test_own_controller(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    run_example(monkeypatch, "own_controller.py")
    out = capsys.readouterr().out
    assert out.startswith("collided: panda_link")
    assert "certified: False" in out


@pytest.mark.slow
def test_own_guide(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    run_example(monkeypatch, "own_guide.py")
    out = capsys.readouterr().out
    assert out.startswith("reached")
    assert "certified: True" in out


@pytest.mark.slow
def test_own_goal_distance(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    run_example(monkeypatch, "own_goal_distance.py")
    together, shoulder_first = (
        [float(part.split()[-2]) for part in line.split(",")]
        for line in capsys.readouterr().out.splitlines()
    )
    assert together[0] == pytest.approx(together[1], abs=0.05)  # [s]
    assert shoulder_first[0] < shoulder_first[1] - 0.1


@pytest.mark.slow
def test_own_unsafe_set(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    run_example(monkeypatch, "own_unsafe_set.py")
    without, with_set = (float(line.split()[1]) for line in capsys.readouterr().out.splitlines())
    assert without < 0.2 < with_set  # [rad], the radius of the disc


def test_own_plant(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    run_example(monkeypatch, "own_plant.py")
    first, last = capsys.readouterr().out.splitlines()
    assert first.startswith("reached")
    assert float(first.split()[1]) < 0.001  # [rad], since friction is found and cancelled
    assert last == "certified: False"


@pytest.mark.slow
def test_own_mujoco_model(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    run_example(monkeypatch, "own_mujoco_model.py")
    out = capsys.readouterr().out
    assert out.startswith("reached")
    assert float(out.split()[1]) < 0.002  # [rad], since what differs is found and cancelled
    assert "swept     True" in out
    assert "replay    None: does not apply" in out


@pytest.mark.slow
def test_unknown_payload(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    run_example(monkeypatch, "unknown_payload.py")
    plain, density, found = capsys.readouterr().out.splitlines()
    assert plain.startswith("computed torque: collided")
    assert density.startswith("density: reached")
    scenario = densarm.load_scenario("panda_shelf")
    arm, frame = scenario.arm, pin.LOCAL_WORLD_ALIGNED
    jacobian = pin.computeFrameJacobian(
        arm.model, arm.data, scenario.goal, arm.end_effector_frame, frame
    )
    weight = -9.81 * jacobian[2]  # of a kilogram, as torques [N·m]
    told = found.split(": ")[1].removesuffix(" N·m").split(", ")
    np.testing.assert_allclose([float(torque) for torque in told], weight, atol=0.1)


@pytest.mark.slow
def test_moving_goal(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    run_example(monkeypatch, "moving_goal.py")
    clearance, lags = (
        [float(word) for word in re.findall(r"[0-9.]+", line)]
        for line in capsys.readouterr().out.splitlines()
    )
    assert 0.0 < clearance[0] < 60.0
    assert 10.0 < lags[0] < 100.0
    assert lags[1] < 0.1


@pytest.mark.slow
def test_pose_servo(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    run_example(monkeypatch, "pose_servo.py")
    clearance, off = (
        [float(word) for word in re.findall(r"[0-9.]+", line)]
        for line in capsys.readouterr().out.splitlines()
    )
    assert 0.0 < clearance[0] < 60.0
    assert off[1] < 1.0


@pytest.mark.slow
def test_pose_goal(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    run_example(monkeypatch, "pose_goal.py")
    ways, run, certified, error = capsys.readouterr().out.splitlines()
    assert ways.startswith("8 ways to the cup")
    assert run.startswith("reached")
    assert certified == "certified: True"
    assert error.startswith("infeasible: goal: pose of 'panda_hand_tcp' at (1.4, 0, 0.3) m")
    assert "out of reach: the nearest found is" in error


@pytest.mark.slow
def test_plan_only(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run_example(monkeypatch, "plan_only.py", "--out", str(tmp_path))
    points, tube = capsys.readouterr().out.splitlines()
    assert points.endswith(" points of 6 joints")
    assert tube.startswith("proved clear within 0.0")
    rows = np.loadtxt(tmp_path / "plan_only.csv", delimiter=",", skiprows=1)
    data = json.loads((tmp_path / "plan_only.json").read_text(encoding="utf-8"))
    np.testing.assert_allclose(
        rows[:, 1:7], [point["positions"] for point in data["points"]], atol=1e-8
    )
    goal = densarm.load_scenario("ur5_bin").goal
    np.testing.assert_allclose(rows[-1, 1:7], goal, atol=0.01)


@pytest.mark.slow
def test_pick_and_place(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    run_example(monkeypatch, "pick_and_place.py")
    *phases, run, remark = capsys.readouterr().out.splitlines()
    assert len(phases) == 8
    assert run.startswith("reached after ")
    assert run.endswith("certified: True")
    assert "passed over ways to goal 1: the line of 'panda_hand_tcp' along" in remark


@pytest.mark.slow
def test_own_robot(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    run_example(monkeypatch, "own_robot.py")
    out = capsys.readouterr().out
    assert out.startswith("reached in")
    assert "not proved" not in out


@pytest.mark.slow
def test_way_points(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    run_example(monkeypatch, "way_points.py")
    reached, passes, proved = capsys.readouterr().out.splitlines()
    assert reached.startswith("reached after 1.")
    assert reached.endswith("certified: True")
    assert float(passes.split()[-2]) > 0.5
    assert proved.startswith("2 passed in their order, each joint within 0.0")


@pytest.mark.slow
def test_seen_things(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run_example(monkeypatch, "seen_things.py", "--out", str(tmp_path))
    out = capsys.readouterr().out
    assert re.match(r"reached, certified: True, clearance [5-9] mm\n$", out)
    assert (tmp_path / "seen_things.png").stat().st_size > 10_000
