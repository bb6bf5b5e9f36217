import pytest

from densarm.trajectory import Trajectory


def test_view_shows_the_run_and_tells_the_address(command, swing_up, monkeypatch):
    shown = []

    def view(run, on_url):
        shown.append(run)
        on_url("http://127.0.0.1:7000/")

    monkeypatch.setattr("densarm.visualization.view.view", view)
    done = command("view", swing_up.npz)
    assert done.status == 0
    assert "http://127.0.0.1:7000/" in done.out
    run = Trajectory.load(swing_up.npz)
    assert (shown[0].q == run.q).all()


def test_with_options_it_writes_files_and_ends(command, swing_up, tmp_path, monkeypatch):
    monkeypatch.setattr("densarm.visualization.view.view", pytest.fail)
    monkeypatch.setattr("densarm.visualization.picture_file._ANIMATION_SIZE", (96, 54))
    monkeypatch.setattr("densarm.visualization.picture_file._STILL_SIZE", (96, 54))
    options = {"html": b"<!DOCTYPE", "png": b"\x89PNG", "gif": b"GIF"}
    arguments = [word for key in options for word in (f"--{key}", tmp_path / f"run.{key}")]
    done = command("view", swing_up.npz, *arguments)
    assert (done.status, done.out, done.err) == (0, "", "")
    for key, begins in options.items():
        assert (tmp_path / f"run.{key}").read_bytes().startswith(begins)
    assert len(list(tmp_path.iterdir())) == len(options)
