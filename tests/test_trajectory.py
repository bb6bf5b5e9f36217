"""Runs as files: exact round trip, whole or not at all, and nothing else taken for one."""

import io
import json
import pickle
import stat
import zipfile
from dataclasses import replace

import numpy as np
import pytest

import densarm.trajectory
from densarm.errors import DensarmError, FileContentError
from densarm.scenario import Scenario
from densarm.trajectory import Trajectory

ARRAYS = ("time", "q", "v", "tau", "clearance")


@pytest.fixture(scope="module")
def short(swing_up_run):
    """The first samples of a run, for files that are quick to write."""
    cut = {name: getattr(swing_up_run, name)[:20] for name in ARRAYS}
    return replace(swing_up_run, **cut)


@pytest.fixture
def content(short, tmp_path):
    """What a file of a run holds."""
    short.save(tmp_path / "original.npz")
    with np.load(tmp_path / "original.npz") as data:
        return dict(data)


def written(path, content):
    np.savez(path, **content)
    return path


def error_of(path):
    with pytest.raises(FileContentError) as caught:
        Trajectory.load(path)
    message = str(caught.value)
    assert message.startswith(str(path))
    assert "\n" not in message
    return message


def test_round_trip_is_exact(swing_up_run, tmp_path):
    swing_up_run.save(tmp_path / "run.npz")
    loaded = Trajectory.load(tmp_path / "run.npz")
    for name in ARRAYS:
        np.testing.assert_array_equal(getattr(loaded, name), getattr(swing_up_run, name))
    for name in ("outcome", "detail", "plan_time", "preparation_time", "tracking_error"):
        assert getattr(loaded, name) == getattr(swing_up_run, name)
    assert loaded.scenario.to_json() == swing_up_run.scenario.to_json()
    assert loaded.summary() == swing_up_run.summary()
    assert loaded.certified


def test_loads_without_pickle_and_holds_a_json_scenario(content):
    assert set(content) == {*ARRAYS, "scenario", "result"}
    scenario = json.loads(str(content["scenario"]))
    simulation = scenario["simulation"]
    assert {"dt", "integrator", "control_divisor"} <= set(simulation)
    assert scenario["seed"] == 0
    assert "<robot" in scenario["robot"]["urdf"]


def test_a_name_without_suffix_is_kept(short, tmp_path):
    short.save(tmp_path / "run")
    assert [path.name for path in tmp_path.iterdir()] == ["run"]


def test_others_may_read_the_file(short, tmp_path):
    short.save(tmp_path / "run.npz")
    assert stat.S_IMODE((tmp_path / "run.npz").stat().st_mode) & 0o444 == 0o444


@pytest.mark.parametrize("interruption", [KeyboardInterrupt, OSError("disk full")])
def test_interrupted_save_leaves_the_old_file(short, tmp_path, monkeypatch, interruption):
    path = tmp_path / "run.npz"
    path.write_bytes(b"old")

    def interrupted(file, **_):
        file.write(b"half")
        raise interruption

    monkeypatch.setattr(densarm.trajectory.np, "savez_compressed", interrupted)
    with pytest.raises((KeyboardInterrupt, FileContentError)):
        short.save(path)
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


def test_save_into_a_folder_that_is_not_there(short, tmp_path):
    with pytest.raises(FileContentError, match="cannot be written: No such file"):
        short.save(tmp_path / "nowhere" / "run.npz")


def test_no_such_file(tmp_path):
    assert "No such file" in error_of(tmp_path / "missing.npz")


def test_a_folder(tmp_path):
    error_of(tmp_path)


@pytest.mark.parametrize(
    "content",
    [b"", b"hello", pickle.dumps({"q": 1}), b"PK\x03\x04 not a zip", b"\x93NUMPY\x01\x00"],
    ids=["empty", "text", "pickle", "zip-magic", "npy-magic"],
)
def test_not_an_archive(tmp_path, content):
    path = tmp_path / "run.npz"
    path.write_bytes(content)
    assert "not a run" in error_of(path)


def test_a_single_array(tmp_path):
    path = tmp_path / "run.npy"
    np.save(path, np.zeros(3))
    assert "not a run" in error_of(path)


def test_an_archive_of_objects(tmp_path, content):
    content["q"] = np.array([{}, None], dtype=object)
    assert "not a run" in error_of(written(tmp_path / "run.npz", content))


@pytest.mark.parametrize("share", [0.1, 0.5, 0.9, 0.999])
def test_truncated(tmp_path, short, share):
    path = tmp_path / "run.npz"
    short.save(path)
    path.write_bytes(path.read_bytes()[: int(share * path.stat().st_size)])
    error_of(path)


def test_damaged_anywhere(tmp_path, short):
    """A changed byte is refused with one line, or was in what nothing reads."""
    path = tmp_path / "run.npz"
    short.save(path)
    whole = path.read_bytes()
    for at in np.linspace(0, len(whole) - 1, 40).astype(int):
        path.write_bytes(whole[:at] + bytes([whole[at] ^ 0xFF]) + whole[at + 1 :])
        try:
            Trajectory.load(path)
        except FileContentError as error:
            assert "\n" not in str(error)  # noqa: PT017


@pytest.mark.parametrize("name", [*ARRAYS, "scenario", "result"])
def test_missing_entry(tmp_path, content, name):
    del content[name]
    assert name in error_of(written(tmp_path / "run.npz", content))


@pytest.mark.parametrize("name", ARRAYS)
def test_wrong_shapes_and_values(tmp_path, content, name):
    path = tmp_path / "run.npz"
    right = content[name]
    for wrong in (right[:-1], right[..., np.newaxis], np.zeros(0), np.full_like(right, np.nan)):
        message = error_of(written(path, {**content, name: wrong}))
        assert name in message or name == "time"  # whose length the others are compared with
    error_of(written(path, {**content, name: np.array("text")}))
    assert "complex128" in error_of(written(path, {**content, name: right.astype(complex)}))


def test_a_number_beyond_all_floats(tmp_path, content):
    result = json.loads(str(content["result"])) | {"plan_time_s": 10**400}
    error_of(written(tmp_path / "run.npz", {**content, "result": np.array(json.dumps(result))}))


def test_an_array_that_claims_to_be_larger_than_memory(tmp_path, content):
    path = written(tmp_path / "other.npz", content)
    with zipfile.ZipFile(path) as old:
        entries = {info.filename: old.read(info) for info in old.infolist()}
    claim = b"(20, 400000000000000), }"
    entries["q.npy"] = entries["q.npy"].replace(b"(20, 4), }".ljust(len(claim)), claim)
    with zipfile.ZipFile(path, "w") as new:
        for name, data in entries.items():
            new.writestr(name, data)
    assert "too large" in error_of(path)


def test_a_small_file_of_a_huge_run(tmp_path, short, monkeypatch):
    monkeypatch.setattr("densarm.trajectory._MAX_BYTES", 1000)
    short.save(tmp_path / "run.npz")
    assert "larger than" in error_of(tmp_path / "run.npz")


def test_scenario_nested_too_deeply(tmp_path, content):
    content["scenario"] = np.array("[" * 100_000 + "]" * 100_000)
    assert "nested too deeply" in error_of(written(tmp_path / "other.npz", content))


def test_no_sample(tmp_path, content):
    error_of(written(tmp_path / "run.npz", {**content, **{n: content[n][:0] for n in ARRAYS}}))


def test_a_pair_off_the_circle(tmp_path, content):
    assert "cos, sin" in error_of(
        written(tmp_path / "run.npz", {**content, "q": 2.0 * content["q"]})
    )


def test_scenario_that_is_not_one(tmp_path, content):
    whole = json.loads(str(content["scenario"]))
    broken = ["not JSON", "[]", "1", json.dumps({}), json.dumps({**whole, "format": 999})]
    broken += [json.dumps({k: v for k, v in whole.items() if k != key}) for key in whole]
    for key in whole:
        for value in (None, 17.5, "x", [[]], {"x": 1}):
            if key not in ("name", "title"):
                broken.append(json.dumps({**whole, key: value}))
    for text in broken:
        error_of(written(tmp_path / "run.npz", {**content, "scenario": np.array(text)}))


def test_result_that_is_not_one(tmp_path, content):
    whole = json.loads(str(content["result"]))
    for key in ("outcome", "plan_time_s", "preparation_time_s", "tracking_error_rad"):
        text = json.dumps({**whole, key: "x"})
        error_of(written(tmp_path / "run.npz", {**content, "result": np.array(text)}))
    error_of(written(tmp_path / "run.npz", {**content, "result": np.array("[]")}))


def test_a_mesh_that_has_changed_is_refused(tmp_path):
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
    run = densarm.simulate(densarm.load_scenario(folder / "task.toml"))
    assert run.certified
    run.save(tmp_path / "run.npz")
    assert Trajectory.load(tmp_path / "run.npz").certified
    mesh.write_text(mesh.read_text().replace("0.1 0 0", "0.11 0 0"))
    assert "mesh files have changed" in error_of(tmp_path / "run.npz")


def test_summary(swing_up_run):
    summary = swing_up_run.summary()
    assert list(summary) == [
        "outcome",
        "duration_s",
        "min_clearance_m",
        "goal_error_rad",
        "peak_torque_ratio",
        "plan_time_s",
        "preparation_time_s",
        "certified",
    ]
    assert json.loads(json.dumps(summary)) == summary
    assert summary["outcome"] == "reached"
    assert summary["certified"] is True
    assert 0.0 < summary["min_clearance_m"] == swing_up_run.clearance.min()
    assert summary["goal_error_rad"] <= 0.01
    assert 0.0 < summary["plan_time_s"] < summary["preparation_time_s"]
    assert 0.0 < summary["peak_torque_ratio"] <= 1.0


def test_summary_without_pairs_or_torque_limits(short):
    run = replace(short, clearance=np.full(20, np.inf))
    assert run.summary()["min_clearance_m"] is None
    assert "Infinity" not in json.dumps(run.summary())


def test_archive_is_a_plain_zip(short, tmp_path):
    short.save(tmp_path / "run.npz")
    with zipfile.ZipFile(io.BytesIO((tmp_path / "run.npz").read_bytes())) as archive:
        assert archive.testzip() is None


def test_scenario_of_a_file_is_a_scenario(content):
    assert isinstance(Scenario.from_json(json.loads(str(content["scenario"]))), Scenario)
    with pytest.raises(DensarmError):
        Scenario.from_json({})
