"""``densarm run``: what it prints and writes, how it ends, and that it compiles once."""

import json
import os
import pty
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from densarm.arms.catalogue import scenario_paths
from densarm.simulation.run import Run

Command = Callable[..., Any]
KEYS = [
    "outcome",
    "duration_s",
    "min_clearance_m",
    "goal_error_rad",
    "peak_torque_ratio",
    "led_by",
    "plan_time_s",
    "preparation_time_s",
    "certified",
    "tube_rad",
    "plant",
    "disturbances",
]
BALL = """
[[obstacles]]
type = "sphere"
name = "ball"
radius = 0.2
position = [{x}, 0.0, -1.9]
"""


@pytest.mark.slow
def test_swing_up_is_reached_and_says_so(recorded: Any) -> None:
    assert recorded.done.status == 0
    assert recorded.done.err == ""
    assert "reached: The arm reached the goal" in recorded.done.out
    assert "compiled" not in recorded.done.out
    for label in ("duration", "min clearance", "goal error", "peak torque", "planning", "tracking"):
        assert label in recorded.done.out
    for check in ("certified", "swept", "start", "goal", "limits", "replay"):
        assert f"{check} " in recorded.done.out


@pytest.mark.slow
def test_off_a_terminal_there_is_no_progress(recorded: Any) -> None:
    assert "\x1b" not in recorded.done.out
    assert "planning\n" not in recorded.done.out


@pytest.mark.slow
def test_json_has_the_keys_of_the_summary(recorded: Any) -> None:
    data = json.loads(recorded.json.read_text(encoding="utf-8"))
    assert list(data) == KEYS
    assert data["outcome"] == "reached"
    assert data["certified"] is True
    assert data["min_clearance_m"] > 0.0
    assert data["goal_error_rad"] <= 0.01


@pytest.mark.slow
def test_saved_run_is_the_one_summarised(recorded: Any) -> None:
    run = Run.load(recorded.npz)
    data = json.loads(recorded.json.read_text(encoding="utf-8"))
    assert run.summary() == data
    with np.load(recorded.npz, allow_pickle=False) as arrays:
        assert {"time", "q", "v", "tau", "clearance", "scenario"} <= set(arrays)


@pytest.mark.slow
def test_pages_are_what_their_names_say(recorded: Any) -> None:
    page = recorded.html.read_text(encoding="utf-8")
    assert page.lstrip().lower().startswith("<!doctype html>")
    assert "Swing a two-link arm" in page
    assert recorded.png.read_bytes().startswith(b"\x89PNG")


@pytest.mark.slow
def test_nothing_else_is_left_in_the_folder(recorded: Any) -> None:
    written = {recorded.npz, recorded.html, recorded.png, recorded.json}
    assert set(recorded.npz.parent.iterdir()) == written


def test_swing_up_tells_that_the_density_left_a_critical_point(
    command: Command, tmp_path: Path
) -> None:
    done = command("run", "swing_up", "--json", tmp_path / "run.json")
    assert done.status == 0
    assert done.err == ""
    assert "left a critical point of the density at joint positions (0, 0)" in done.out
    data = json.loads((tmp_path / "run.json").read_text(encoding="utf-8"))
    assert data["outcome"] == "reached"
    assert data["certified"] is True
    assert data["plan_time_s"] == 0.0


def test_swing_up_with_equal_weights_is_stuck(command: Command, tmp_path: Path) -> None:
    """V presses the arm against a ball."""
    text = scenario_paths()["swing_up"].read_text(encoding="utf-8")
    path = tmp_path / "equal.toml"
    path.write_text(text.replace('weights = "inertia"', "weights = [1, 1]"), encoding="utf-8")
    done = command("run", path)
    assert done.status == 1
    assert done.err == ""
    assert "stuck: " in done.out
    assert "maximum of the density" in done.out


def test_clearance_without_pairs_is_null(
    command: Command, scenario_file: Callable[..., Path], tmp_path: Path
) -> None:
    done = command("run", scenario_file(), "--json", tmp_path / "run.json")
    assert done.status == 0
    assert "no pairs" in done.out
    assert json.loads((tmp_path / "run.json").read_text())["min_clearance_m"] is None


def test_start_in_contact_is_infeasible_and_names_the_pair(
    command: Command, scenario_file: Callable[..., Path], tmp_path: Path
) -> None:
    path = scenario_file(rest=BALL.format(x=0.0))
    done = command("run", path, "--json", tmp_path / "run.json", "--save", tmp_path / "run.npz")
    assert done.status == 1
    assert done.err == ""
    assert "infeasible: " in done.out
    assert "start: " in done.out
    assert "ball" in done.out
    assert "mm" in done.out
    assert json.loads((tmp_path / "run.json").read_text())["outcome"] == "infeasible"
    assert len(Run.load(tmp_path / "run.npz").time) == 1


WEDGE = """
[[obstacles]]
type = "mesh"
name = "wedge"
path = "{path}"
scale = [{scale}, {scale}, {scale}]
position = [{x}, -0.05, -1.0]
"""


def test_a_mesh_in_centimetres_is_hit_where_it_is_in_metres(
    command: Command, scenario_file: Callable[..., Path]
) -> None:
    """In metres without its unit its hull begins at the same corner and is 100 times as large."""
    path = Path(__file__).parents[1] / "data" / "meshes" / "wedge_cm.dae"
    hit = command("run", scenario_file(rest=WEDGE.format(path=path, scale=1.0, x=-0.05)))
    assert (hit.status, "infeasible: " in hit.out, "wedge" in hit.out) == (1, True, True)
    assert "large meshes" not in hit.out
    past = command("run", scenario_file(rest=WEDGE.format(path=path, scale=1.0, x=0.5)))
    assert past.status == 0
    far = command("run", scenario_file(rest=WEDGE.format(path=path, scale=100.0, x=0.5)))
    assert "large meshes      wedge 30 m: is their unit right?\n" in far.out


def test_goal_outside_the_limits_is_infeasible_and_names_the_joint(
    command: Command, scenario_file: Callable[..., Path]
) -> None:
    ready = "[0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785]"
    beyond = "[0.0, -0.785, 0.0, 1.0, 0.0, 1.571, 0.785]"
    done = command("run", scenario_file('name = "panda"', f"start = {ready}\ngoal = {beyond}"))
    assert done.status == 1
    assert "goal: joint 'panda_joint4'" in done.out


@pytest.mark.parametrize("kind", ["pdf", "svg"])
@pytest.mark.slow
def test_plots_in_other_formats(
    command: Command, scenario_file: Callable[..., Path], tmp_path: Path, kind: str
) -> None:
    assert command("run", scenario_file(), "--plot", tmp_path / f"run.{kind}").status == 0
    assert (tmp_path / f"run.{kind}").stat().st_size > 1000


COMPILES_ANEW = """
import sys
import numba
from densarm.cli import main, first_run
from densarm.simulation import simulate
first_run._is_compiled = lambda: True

def compiling(*ends):
    for _ in range(10):  # one takes no longer than a terminal from one drawing to the next
        numba.njit(lambda x: x + 1)(1)
    return infeasibility(*ends)

infeasibility, simulate.infeasibility = simulate.infeasibility, compiling
sys.exit(main())
"""


@pytest.mark.slow
def test_kernels_that_are_compiled_are_told_of(scenario_file: Callable[..., Path]) -> None:
    """Off a terminal in the summary, on one while it is done too."""
    command = [sys.executable, "-c", COMPILES_ANEW, "run", str(scenario_file())]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    (line,) = (line for line in done.stdout.splitlines() if line.startswith("compiled"))
    assert float(line.split()[1]) > 0.0
    assert line.endswith(" s, once on this machine")
    assert done.stderr == ""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="reads a pseudo-terminal as Linux has them")
def test_compiling_is_shown_on_a_terminal(scenario_file: Callable[..., Path]) -> None:
    ours, theirs = pty.openpty()
    command = [sys.executable, "-c", COMPILES_ANEW, "run", str(scenario_file())]
    env = {**os.environ, "TERM": "xterm"}
    process = subprocess.Popen(command, stdin=theirs, stdout=theirs, env=env)
    shown = b""
    while b"compiling, once on this machine" not in shown:
        shown += os.read(ours, 4096)
    process.communicate(timeout=60)
    os.close(theirs)
    os.close(ours)
    assert process.returncode == 0


def test_what_was_read_otherwise_and_what_is_not_checked_is_told(
    command: Command, scenario_file: Callable[..., Path], tmp_path: Path
) -> None:
    """A link without size, and a table through the base, in one line each."""
    urdf = (Path(__file__).parents[1] / "data" / "branching.urdf").read_text(encoding="utf-8")
    urdf = re.sub(r'<mesh filename="[^"]*"[^>]*/>', '<box size="0.2 0.2 0.2"/>', urdf)
    urdf = urdf.replace('<sphere radius="0.07"/>', '<sphere radius="0"/>')
    (tmp_path / "robot.urdf").write_text(urdf, encoding="utf-8")
    table = 'type = "box"\nname = "table"\nsize = [2.0, 2.0, 0.1]\nposition = [0.0, 0.0, -0.04]'
    far = "start = [9.0, 0.0, 0.0, 0.0, 0.0]\ngoal = [0.0, 0.0, 0.0, 0.0, 0.0]"
    path = scenario_file('urdf = "robot.urdf"', far, f"[[obstacles]]\n{table}")
    done = command("run", path, "--save", tmp_path / "run.npz")
    assert "collision sphere of link 'right_arm' has no size: left out\n" in done.out
    assert re.search(r"not checked +'base_0' is in 'table' by \d+ mm: neither moves\n", done.out)
    (overlap,) = Run.load(tmp_path / "run.npz").base_overlaps
    assert overlap.startswith("'base_0' is in 'table' by ")


def test_a_disturbed_arm_in_mujoco(
    command: Command, scenario_file: Callable[..., Path], tmp_path: Path
) -> None:
    told = ["--disturb", "coulomb=0.01", "--disturb", "mass_scale=[1.0, 1.02]"]
    path = tmp_path / "run.json"
    done = command("run", scenario_file(), "--plant", "mujoco", *told, "--json", path)
    assert (done.status, done.err) == (0, "")
    assert "mujoco, mass_scale [1.0, 1.02], coulomb 0.01" in done.out
    assert (
        "does not apply: the record says that the plant is mujoco, disturbed by coulomb" in done.out
    )
    data = json.loads(path.read_text(encoding="utf-8"))
    assert data["plant"] == "mujoco"
    assert data["disturbances"] == {"mass_scale": [1.0, 1.02], "coulomb": 0.01}


def test_a_goal_may_be_given_in_place_of_the_scenarios(
    command: Command, scenario_file: Callable[..., Path]
) -> None:
    path = scenario_file()
    assert "reached" in command("run", path, "--goal", "[0.1, 0.0]").out
    assert "reached" in command("run", path, "--goal", "hanging").out
    for goal, expected in (
        ("hung", "unknown posture for --goal 'hung'"),
        ("[0.1, 0.0", "'--goal': '[0.1, 0.0': not as in TOML"),
        ('{frame = "hand", position = [0, 0, 1]}', "unknown frame 'hand'"),
    ):
        done = command("run", path, "--goal", goal)
        assert done.status == 2
        assert expected in done.err
        assert done.err.count("\n") == 1
