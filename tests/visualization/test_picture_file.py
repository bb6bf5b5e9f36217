import numpy as np
import pytest
from PIL import Image

from densarm.errors import FileContentError, InvalidValueError
from densarm.scene import Scene
from densarm.visualization import palette, picture_file
from densarm.visualization.picture import Picture
from densarm.visualization.picture_file import save_animation, save_picture
from densarm.visualization.stage import Stage

SIZE = (320, 180)


def differing(first, second):
    """Pixels below the caption that differ."""
    apart = np.abs(np.asarray(first, dtype=int) - np.asarray(second, dtype=int)).max(axis=2)
    return int((apart[40:-40] > 8).sum())


def test_frames_show_the_motion_and_the_obstacles(swing, record, two_link):
    stage = Stage(swing)
    picture = Picture(stage, *SIZE)
    first, last = picture.frame(0), picture.frame(len(stage.time) - 1)
    assert first.size == SIZE
    assert differing(first, last) > 200
    assert differing(picture.frame(0), first) == 0
    alone = Stage(record(two_link, two_link.angles(swing.q), 4.0, Scene()))
    alone.camera, alone.floor = stage.camera, stage.floor
    assert differing(Picture(alone, *SIZE).frame(0), first) > 500


def test_arm_covers_its_goal_at_the_end(swing, monkeypatch):
    stage = Stage(swing)
    last = len(stage.time) - 1
    with_goal = [Picture(stage, *SIZE).frame(k) for k in (0, last)]
    monkeypatch.setattr(palette, "GOAL_OPACITY", 0.0)
    without = [Picture(stage, *SIZE).frame(k) for k in (0, last)]
    assert differing(with_goal[0], without[0]) > 100
    assert differing(with_goal[1], without[1]) < 10


def test_still_is_a_png_of_full_size(swing, tmp_path):
    save_picture(swing, tmp_path / "run.png")
    with Image.open(tmp_path / "run.png") as image:
        assert image.format == "PNG"
        assert image.size == (1280, 720)
    assert [path.name for path in tmp_path.iterdir()] == ["run.png"]


def test_animation_moves_in_real_time_again_and_again(
    resting, record, two_link, tmp_path, monkeypatch
):
    monkeypatch.setattr(picture_file, "_ANIMATION_SIZE", SIZE)
    angles = np.linspace([0.0, 0.0], [1.0, 0.5], 21)
    save_animation(record(two_link, angles, 0.2, Scene()), tmp_path / "run.gif")
    with Image.open(tmp_path / "run.gif") as image:
        assert image.info["loop"] == 0
        frames, durations = [], []
        for k in range(image.n_frames):
            image.seek(k)
            durations.append(image.info["duration"])
            frames.append(np.asarray(image.convert("RGB")))
    assert sum(durations[:-1]) == pytest.approx(200, abs=40)
    assert differing(frames[0], frames[-1]) > 200
    assert (frames[0][SIZE[1] // 2, -5:] == 255).all()
    save_animation(resting, tmp_path / "rest.gif")
    assert (tmp_path / "rest.gif").read_bytes().startswith(b"GIF")


@pytest.mark.parametrize(("save", "name"), [(save_picture, "a.gif"), (save_animation, "a.png")])
def test_other_endings_and_missing_folders_are_refused(resting, tmp_path, save, name):
    with pytest.raises(InvalidValueError, match=r"a file ending in \."):
        save(resting, tmp_path / name)
    right = {"a.gif": "a.png", "a.png": "a.gif"}[name]
    with pytest.raises(FileContentError, match=right):
        save(resting, tmp_path / "missing" / right)
    assert list(tmp_path.iterdir()) == []
