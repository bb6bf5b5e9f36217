"""Runs as files: exact round trip, whole or not at all, and nothing else taken for one."""

import io
import json
import pickle
import stat
import zipfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from densarm.certificates.task import Input, SimulationParameters, Task
from densarm.errors import FileContentError, InvalidValueError
from densarm.scenarios.run import run
from densarm.scenarios.scenario import Scenario, load_scenario
from densarm.simulation.plants import SingleIntegrator
from densarm.simulation.run import Run
from densarm.simulation.simulate import simulate
from densarm.values.arrays import Array
from densarm.values.outcome import Outcome

Content = dict[str, Any]

ARRAYS = ("time", "q", "v", "tau", "clearance")


@pytest.fixture(scope="module")
def short(swing_up_run: Run) -> Run:
    """The first samples of a run, for files that are quick to write."""
    cut: Any = {name: getattr(swing_up_run, name)[:20] for name in (*ARRAYS, "reference")}
    return replace(swing_up_run, **cut)


@pytest.fixture
def content(short: Run, tmp_path: Path) -> Content:
    """What a file of a run holds."""
    short.save(tmp_path / "original.npz")
    with np.load(tmp_path / "original.npz") as data:
        return dict(data)


def written(path: Path, content: Content) -> Path:
    np.savez(path, **content)
    return path


def error_of(path: Path) -> str:
    with pytest.raises(FileContentError) as caught:
        Run.load(path)
    message = str(caught.value)
    assert message.startswith(str(path))
    assert "\n" not in message
    return message


def test_round_trip_is_exact(swing_up_run: Run, tmp_path: Path) -> None:
    swing_up_run.save(tmp_path / "run.npz")
    loaded = Run.load(tmp_path / "run.npz")
    for name in (*ARRAYS, "reference", "tube"):
        np.testing.assert_array_equal(getattr(loaded, name), getattr(swing_up_run, name))
    for name in ("outcome", "detail", "plan_time", "preparation_time", "tracking_error"):
        assert getattr(loaded, name) == getattr(swing_up_run, name)
    assert loaded.task.to_json() == swing_up_run.task.to_json()
    assert loaded.summary() == swing_up_run.summary()
    assert loaded.certified


def test_loads_without_pickle_and_holds_a_json_task(content: Content) -> None:
    assert set(content) == {*ARRAYS, "reference", "tube", "scenario", "result"}
    scenario = json.loads(str(content["scenario"]))
    simulation = scenario["simulation"]
    assert {"dt", "integrator", "control_divisor"} <= set(simulation)
    assert scenario["seed"] == 0
    assert "<robot" in scenario["robot"]["urdf"]


def test_a_name_without_suffix_is_kept(short: Run, tmp_path: Path) -> None:
    short.save(tmp_path / "run")
    assert [path.name for path in tmp_path.iterdir()] == ["run"]


def test_others_may_read_the_file(short: Run, tmp_path: Path) -> None:
    short.save(tmp_path / "run.npz")
    assert stat.S_IMODE((tmp_path / "run.npz").stat().st_mode) & 0o444 == 0o444


@pytest.mark.parametrize(
    ("interruption", "error"),
    [(KeyboardInterrupt(), KeyboardInterrupt), (OSError("disk full"), FileContentError)],
)
def test_interrupted_save_leaves_the_old_file(
    short: Run,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    interruption: BaseException,
    error: type[BaseException],
) -> None:
    path = tmp_path / "run.npz"
    path.write_bytes(b"old")

    def interrupted(file: Any, **_: Any) -> None:
        file.write(b"half")
        raise interruption

    monkeypatch.setattr(np, "savez_compressed", interrupted)
    with pytest.raises(error):
        short.save(path)
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


def test_save_into_a_folder_that_is_not_there(short: Run, tmp_path: Path) -> None:
    with pytest.raises(FileContentError, match="cannot be written: No such file"):
        short.save(tmp_path / "nowhere" / "run.npz")


def test_no_such_file(tmp_path: Path) -> None:
    assert "No such file" in error_of(tmp_path / "missing.npz")


def test_a_folder(tmp_path: Path) -> None:
    error_of(tmp_path)


@pytest.mark.parametrize(
    "data",
    [b"", b"hello", pickle.dumps({"q": 1}), b"PK\x03\x04 not a zip", b"\x93NUMPY\x01\x00"],
    ids=["empty", "text", "pickle", "zip-magic", "npy-magic"],
)
def test_not_an_archive(tmp_path: Path, data: bytes) -> None:
    path = tmp_path / "run.npz"
    path.write_bytes(data)
    assert "not a run" in error_of(path)


def test_a_single_array(tmp_path: Path) -> None:
    path = tmp_path / "run.npy"
    np.save(path, np.zeros(3))
    assert "not a run" in error_of(path)


def test_an_archive_of_objects(tmp_path: Path, content: Content) -> None:
    content["q"] = np.array([{}, None], dtype=object)
    assert "not a run" in error_of(written(tmp_path / "run.npz", content))


@pytest.mark.parametrize("share", [0.1, 0.5, 0.9, 0.999])
def test_truncated(tmp_path: Path, short: Run, share: float) -> None:
    path = tmp_path / "run.npz"
    short.save(path)
    path.write_bytes(path.read_bytes()[: int(share * path.stat().st_size)])
    error_of(path)


def test_damaged_anywhere(tmp_path: Path, short: Run) -> None:
    """A changed byte is refused with one line, or was in what nothing reads."""
    path = tmp_path / "run.npz"
    short.save(path)
    whole, refused = path.read_bytes(), 0
    for at in np.linspace(0, len(whole) - 1, 40).astype(int):
        path.write_bytes(whole[:at] + bytes([whole[at] ^ 0xFF]) + whole[at + 1 :])
        try:
            loaded = Run.load(path)
        except FileContentError as error:
            refused += 1
            assert "\n" not in str(error)  # noqa: PT017
        else:
            for name in ARRAYS:
                np.testing.assert_array_equal(getattr(loaded, name), getattr(short, name))
            assert loaded.task.to_json() == short.task.to_json()
    assert refused > 30


@pytest.mark.parametrize("name", [*ARRAYS, "scenario", "result"])
def test_missing_entry(tmp_path: Path, content: Content, name: str) -> None:
    del content[name]
    assert name in error_of(written(tmp_path / "run.npz", content))


@pytest.mark.parametrize("name", ARRAYS)
def test_wrong_shapes_and_values(tmp_path: Path, content: Content, name: str) -> None:
    path = tmp_path / "run.npz"
    right = content[name]
    for wrong in (right[:-1], right[..., np.newaxis], np.zeros(0), np.full_like(right, np.nan)):
        message = error_of(written(path, {**content, name: wrong}))
        assert name in message or name == "time"  # whose length the others are compared with
    error_of(written(path, {**content, name: np.array("text")}))
    assert "complex128" in error_of(written(path, {**content, name: right.astype(complex)}))


def test_a_number_beyond_all_floats(tmp_path: Path, content: Content) -> None:
    result = json.loads(str(content["result"])) | {"plan_time_s": 10**400}
    error_of(written(tmp_path / "run.npz", {**content, "result": np.array(json.dumps(result))}))


def test_an_array_that_claims_to_be_larger_than_memory(tmp_path: Path, content: Content) -> None:
    path = written(tmp_path / "other.npz", content)
    with zipfile.ZipFile(path) as old:
        entries = {info.filename: old.read(info) for info in old.infolist()}
    claim = b"(20, 400000000000000), }"
    entries["q.npy"] = entries["q.npy"].replace(b"(20, 4), }".ljust(len(claim)), claim)
    with zipfile.ZipFile(path, "w") as new:
        for name, data in entries.items():
            new.writestr(name, data)
    assert "too large" in error_of(path)


def test_a_small_file_of_a_huge_run(
    tmp_path: Path, short: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("densarm.simulation.run._MAX_BYTES", 1000)
    short.save(tmp_path / "run.npz")
    assert "larger than" in error_of(tmp_path / "run.npz")


def test_task_nested_too_deeply(tmp_path: Path, content: Content) -> None:
    content["scenario"] = np.array("[" * 100_000 + "]" * 100_000)
    assert "nested too deeply" in error_of(written(tmp_path / "other.npz", content))


def test_no_sample(tmp_path: Path, content: Content) -> None:
    error_of(written(tmp_path / "run.npz", {**content, **{n: content[n][:0] for n in ARRAYS}}))


def test_a_pair_off_the_circle(tmp_path: Path, content: Content) -> None:
    assert "cos, sin" in error_of(
        written(tmp_path / "run.npz", {**content, "q": 2.0 * content["q"]})
    )


def test_task_that_is_not_one(tmp_path: Path, content: Content) -> None:
    whole = json.loads(str(content["scenario"]))
    settings = {"seed", "planning", "timing", "speed", "gains", "actuation"}
    own = set(whole) - {"name", "title", *settings}
    values: list[Any] = [None, 17.5, "x", [[]], {"x": 1}]
    broken = ["not JSON", "[]", "1", json.dumps({}), json.dumps({**whole, "format": 999})]
    broken += [
        json.dumps({k: v for k, v in whole.items() if k != key})
        # Without them the arm is its model and told torques, as in older files.
        for key in own - {"input", "plant", "disturbances"}
    ]
    broken += [
        json.dumps({**whole, key: value})
        for key in own
        for value in values
        if (key, value) != ("goal", None)
    ]
    for text in broken:
        error_of(written(tmp_path / "run.npz", {**content, "scenario": np.array(text)}))


def test_result_that_is_not_one(tmp_path: Path, content: Content) -> None:
    whole = json.loads(str(content["result"]))
    for key in ("outcome", "plan_time_s", "preparation_time_s", "tracking_error_rad"):
        text = json.dumps({**whole, key: "x"})
        error_of(written(tmp_path / "run.npz", {**content, "result": np.array(text)}))
    error_of(written(tmp_path / "run.npz", {**content, "result": np.array("[]")}))


def test_a_mesh_that_has_changed_is_refused(tmp_path: Path) -> None:
    folder = tmp_path / "robot"
    folder.mkdir()
    mesh = folder / "wedge.obj"
    mesh.write_text(
        "v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nv 0 0 0.1\nf 1 2 3\nf 1 2 4\nf 1 3 4\nf 2 3 4\n"
    )
    inertia = (
        '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
        "</inertial>"
    )
    (folder / "robot.urdf").write_text(
        f'<robot name="r"><link name="a">{inertia}</link><link name="b">{inertia}<collision>'
        '<geometry><mesh filename="wedge.obj"/></geometry></collision></link>'
        '<joint name="j" type="revolute"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/>'
        '<limit lower="-1" upper="1" effort="10" velocity="1"/></joint></robot>'
    )
    (folder / "task.toml").write_text(
        '[robot]\nurdf = "robot.urdf"\n[task]\nstart = [0.0]\ngoal = [0.5]\n'
    )
    done = run(load_scenario(folder / "task.toml"))
    assert done.certified
    done.save(tmp_path / "run.npz")
    assert Run.load(tmp_path / "run.npz").certified
    mesh.write_text(mesh.read_text().replace("0.1 0 0", "0.11 0 0"))
    assert "mesh files have changed" in error_of(tmp_path / "run.npz")


def test_summary(swing_up_run: Run) -> None:
    summary = swing_up_run.summary()
    assert list(summary) == [
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
    assert json.loads(json.dumps(summary)) == summary
    assert summary["outcome"] == "reached"
    assert summary["certified"] is True
    assert 0.0 < summary["min_clearance_m"] == swing_up_run.clearance.min()
    assert summary["goal_error_rad"] <= 0.01
    assert 0.0 < summary["plan_time_s"] < summary["preparation_time_s"]
    assert 0.0 < summary["peak_torque_ratio"] <= 1.0


def test_summary_without_pairs_or_torque_limits(short: Run) -> None:
    alone = replace(short, clearance=np.full(20, np.inf))
    assert alone.summary()["min_clearance_m"] is None
    assert "Infinity" not in json.dumps(alone.summary())


def test_archive_is_a_plain_zip(short: Run, tmp_path: Path) -> None:
    short.save(tmp_path / "run.npz")
    with zipfile.ZipFile(io.BytesIO((tmp_path / "run.npz").read_bytes())) as archive:
        assert archive.testzip() is None


# What a record may be of.


@pytest.mark.parametrize("has_goal", [True, False])
@pytest.mark.parametrize("by_velocity", [True, False])
def test_round_trip_with_and_without_a_goal_by_torque_and_by_velocity(
    swing_up: Scenario, tmp_path: Path, has_goal: bool, by_velocity: bool
) -> None:
    class Falling:
        """Lets go, or turns on at one velocity."""

        def torque(self, *_: Any) -> Array:
            return np.zeros(2)

        def velocity(self, *_: Any) -> Array:
            return np.array([0.1, -0.2])

    p = SimulationParameters(dt=0.01, time_limit=0.2)
    plant = SingleIntegrator(swing_up.arm, p.dt) if by_velocity else None
    goal = swing_up.goal if has_goal else None
    done = simulate(
        swing_up.world, Falling(), swing_up.start, goal, plant=plant, parameters=p, title="A fall"
    )
    done.save(tmp_path / "run.npz")
    loaded = Run.load(tmp_path / "run.npz")
    for name in ARRAYS:
        np.testing.assert_array_equal(getattr(loaded, name), getattr(done, name))
    task, again = done.task, loaded.task
    assert again.to_json() == task.to_json() == Task.from_json(as_json(task)).to_json()
    assert (again.title, again.simulation) == ("A fall", p)
    assert again.input == (Input.VELOCITY if by_velocity else Input.TORQUE)
    assert (again.goal is None) == (not has_goal)
    assert (loaded.summary()["goal_error_rad"] is None) == (not has_goal)
    assert loaded.certificate == done.certificate
    assert [check.name for check in loaded.certificate.checks if not check.holds] == (
        ["goal", "limits"] if by_velocity else ["goal"]
    )


def as_json(task: Task) -> Any:
    return json.loads(json.dumps(task.to_json()))


def test_a_task_keeps_what_else_a_scenario_says(swing_up: Scenario) -> None:
    data = as_json(swing_up.task) | {"gains": {"position": 9.0}, "seed": 3, "note": ["mine"]}
    again = Task.from_json(data)
    assert again.settings["gains"] == {"position": 9.0}
    assert (again.settings["seed"], again.settings["note"]) == (3, ["mine"])
    assert as_json(again) == data


def test_a_file_of_the_first_format_is_read(swing_up_run: Run, tmp_path: Path) -> None:
    swing_up_run.save(tmp_path / "run.npz")
    with np.load(tmp_path / "run.npz") as data:
        content = dict(data)
    first = as_json(swing_up_run.task) | {"format": 1}
    del first["input"]
    content["scenario"] = np.array(json.dumps(first))
    loaded = Run.load(written(tmp_path / "first.npz", content))
    assert loaded.certified
    assert loaded.task.to_json() == swing_up_run.task.to_json()


def test_a_run_that_never_moved_is_a_run_too(swing_up: Scenario, tmp_path: Path) -> None:
    task = swing_up.task
    Run.at_rest(task, swing_up.world, Outcome.NO_PATH, "no way").save(tmp_path / "run.npz")
    loaded = Run.load(tmp_path / "run.npz")
    assert (loaded.outcome, loaded.detail, len(loaded.q)) == (Outcome.NO_PATH, "no way", 1)
    assert not loaded.certified
    summary = loaded.summary()
    assert (summary["outcome"], summary["duration_s"]) == ("no_path", 0.0)
    assert summary["goal_error_rad"] == pytest.approx(np.pi)


@pytest.mark.parametrize("key", ["start", "goal"])
def test_ends_of_a_task_are_checked(swing_up: Scenario, key: str) -> None:
    ends: Any = {key: np.zeros(2)}
    with pytest.raises(InvalidValueError, match=rf"^{key} configuration = .*\(4,\), got \(2,\)"):
        replace(swing_up.task, **ends)
