import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageSequence

from densarm.arms.arm import Arm
from densarm.errors import FileContentError, InvalidValueError
from densarm.scene.scene import Scene
from densarm.simulation.run import Run
from densarm.values.arrays import Array
from densarm.visualization import palette
from densarm.visualization import picture as module
from densarm.visualization.picture import Caption, Picture, save_animation, save_picture
from densarm.visualization.render_scene import RenderScene

SIZE = (320, 180)


def differing(first: Image.Image | Array, second: Image.Image | Array) -> int:
    """Pixels below the caption that differ."""
    apart = np.abs(np.asarray(first, dtype=int) - np.asarray(second, dtype=int)).max(axis=2)
    return int((apart[40:-40] > 8).sum())


def test_frames_show_the_motion_and_the_obstacles(
    swing: Run, record: Callable[..., Run], two_link: Arm
) -> None:
    scene = RenderScene(swing)
    picture = Picture(scene, *SIZE)
    first, last = picture.frame(0), picture.frame(len(scene.time) - 1)
    assert first.size == SIZE
    assert differing(first, last) > 200
    assert differing(picture.frame(0), first) == 0
    alone = RenderScene(record(two_link, two_link.angles(swing.q), 4.0, Scene()))
    alone.camera, alone.floor = scene.camera, scene.floor
    assert differing(Picture(alone, *SIZE).frame(0), first) > 500


def test_a_picture_too_small_for_its_words_is_made(swing: Run) -> None:
    assert Picture(RenderScene(swing), 16, 12).frame(0).size == (16, 12)


def test_arm_covers_its_goal_at_the_end(swing: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = RenderScene(swing)
    last = len(scene.time) - 1
    with_goal = [Picture(scene, *SIZE).frame(k) for k in (0, last)]
    monkeypatch.setattr(palette, "GOAL_OPACITY", 0.0)
    without = [Picture(scene, *SIZE).frame(k) for k in (0, last)]
    assert differing(with_goal[0], without[0]) > 100
    assert differing(with_goal[1], without[1]) < 10


def test_without_a_goal_there_is_no_ghost(swing: Run, aimless: Run) -> None:
    scene = RenderScene(aimless)
    last = len(scene.time) - 1
    with_goal, without = RenderScene(swing), [Picture(scene, *SIZE).frame(k) for k in (0, last)]
    with_goal.camera, with_goal.floor = scene.camera, scene.floor
    assert differing(Picture(with_goal, *SIZE).frame(0), without[0]) > 100
    assert differing(Picture(with_goal, *SIZE).frame(last), without[1]) < 10


@pytest.mark.parametrize("x", [600, 1270])
def test_clearance_is_told_beside_the_contact_and_inside_the_picture(swing: Run, x: int) -> None:
    size, end = (1280, 720), (x, 300)
    image = Image.new("RGB", size, "black")
    Caption(RenderScene(swing), *size).write(image, 0, end)
    white = (np.asarray(image)[200:400] == 255).all(axis=2)
    rows, columns = np.nonzero(white)
    assert len(rows) > 200
    assert np.hypot(rows + 200 - end[1], columns - x).min() > 30  # [pixels]
    assert columns.min() > 0
    assert columns.max() < size[0] - 1


def test_still_is_a_png_of_full_size(swing: Run, tmp_path: Path) -> None:
    save_picture(swing, tmp_path / "run.png")
    with Image.open(tmp_path / "run.png") as image:
        assert image.format == "PNG"
        assert image.size == (1280, 720)
    assert [path.name for path in tmp_path.iterdir()] == ["run.png"]


def test_animation_moves_in_real_time_again_and_again(
    resting: Run,
    record: Callable[..., Run],
    two_link: Arm,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(module, "_ANIMATION_SIZE", SIZE)
    angles = np.linspace([0.0, 0.0], [1.0, 0.5], 21)
    save_animation(record(two_link, angles, 0.2, Scene()), tmp_path / "run.gif")
    with Image.open(tmp_path / "run.gif") as image:
        assert image.info["loop"] == 0
        frames, durations = [], []
        for shown in ImageSequence.Iterator(image):
            durations.append(shown.info["duration"])
            frames.append(np.asarray(shown.convert("RGB")))
    assert sum(durations[:-1]) == pytest.approx(200, abs=40)
    assert differing(frames[0], frames[-1]) > 200
    assert (frames[0][SIZE[1] // 2, -5:] == 255).all()
    save_animation(resting, tmp_path / "rest.gif")
    assert (tmp_path / "rest.gif").read_bytes().startswith(b"GIF")


@pytest.mark.parametrize(("save", "name"), [(save_picture, "a.gif"), (save_animation, "a.png")])
def test_other_endings_and_missing_folders_are_refused(
    resting: Run, tmp_path: Path, save: Callable[[Run, Path], None], name: str
) -> None:
    with pytest.raises(InvalidValueError, match=r"a file ending in \."):
        save(resting, tmp_path / name)
    right = {"a.gif": "a.png", "a.png": "a.gif"}[name]
    with pytest.raises(FileContentError, match=right):
        save(resting, tmp_path / "missing" / right)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_pictures_take_fonts_from_matplotlib_without_importing_it() -> None:
    folder = module._font_folder()
    assert (folder / "DejaVuSans.ttf").is_file()
    code = "import sys, densarm.visualization.picture; sys.exit('matplotlib' in sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True)
