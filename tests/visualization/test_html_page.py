from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from densarm.arm import Arm, load_arm
from densarm.errors import DensarmError
from densarm.scene import Box, Capsule, Cylinder, Scene, Sphere
from densarm.visualization.html_page import write_html

SCENE = Scene(
    [
        Sphere(name="ball", radius=0.3, position=(1.5, 0.0, -0.5)),
        Box(name="box", size=(0.5, 0.5, 0.5), position=(-1.5, 0.0, -0.5)),
        Capsule(name="capsule", radius=0.2, length=0.5, position=(-1.5, 0.0, 1.0)),
        Cylinder(name="cylinder", radius=0.2, length=0.5, position=(1.5, 0.0, 1.0)),
    ]
)
DURATION = 4.0  # [s]


def swing(arm: Arm) -> tuple[np.ndarray, np.ndarray]:
    time = np.linspace(0.0, DURATION, 401)
    turn = 0.8 * np.pi * time / DURATION
    return time, np.array([arm.configuration([angle, -0.5 * angle]) for angle in turn])


def write(path: Path, **changes: Any) -> Path:
    arm = load_arm("two_link")
    time, q = swing(arm)
    given = {"arm": arm, "scene": SCENE, "time": time, "q": q, "goal": q[-1], "title": "Swing"}
    write_html(path, **{**given, **changes})
    return path


@pytest.fixture(scope="module")
def page(open_page: Callable[[str], Any], tmp_path_factory: pytest.TempPathFactory) -> Any:
    """The page of a swing, paused."""
    file = write(tmp_path_factory.mktemp("page") / "swing.html", subtitle="a <b> & c")
    page = open_page(file.as_uri())
    page.wait_until("playing && time > 0")
    page.evaluate("button.click()")
    return page


def changed(page: Any, change: str) -> int:
    """Pixels of the scene that an expression changes."""
    above_timeline = slice(0, page.evaluate("document.querySelector('#timeline').offsetTop"))
    before = page.picture()[above_timeline]
    page.evaluate(change)
    return int((np.abs(page.picture()[above_timeline] - before).max(axis=2) > 8).sum())


def visible(path: list[str], value: bool) -> str:
    command = {"type": "set_property", "path": "/".join(path), "property": "visible"}
    return f"viewer.handle_command({{...{command}, value: {str(value).lower()}}})"


@pytest.mark.parametrize(
    "part", ["robot", "goal", "path", "floor", *(f"obstacles/{item.name}" for item in SCENE)]
)
def test_every_part_is_seen(page: Any, part: str) -> None:
    page.evaluate("seek(1)")
    node = ["meshcat", *part.split("/")]
    assert changed(page, visible(node, value=False)) > 100
    assert changed(page, visible(node, value=True)) > 100


def test_time_line_moves_the_arm(page: Any) -> None:
    page.evaluate("seek(0)")
    scrub = f"slider.value = {DURATION / 2}; slider.dispatchEvent(new Event('input'))"
    assert changed(page, scrub) > 100
    assert page.evaluate("clock.textContent") == "2.00 / 4.00 s"


def test_arm_covers_its_goal_at_the_end(page: Any) -> None:
    page.evaluate(f"seek({DURATION})")
    assert changed(page, visible(["meshcat", "goal"], value=False)) < 100
    page.evaluate(visible(["meshcat", "goal"], value=True))


def test_button_plays_and_pauses(page: Any) -> None:
    page.evaluate("seek(0)")
    page.evaluate("button.click()")
    page.wait_until("time > 0.5")
    page.evaluate("button.click()")
    stopped = page.evaluate("time")
    assert changed(page, "0") == 0
    assert page.evaluate("time") == stopped


def test_heading_is_shown_as_text(page: Any) -> None:
    assert page.evaluate("document.querySelector('h1').textContent") == "Swing"
    assert page.evaluate("document.querySelector('#heading p').textContent") == "a <b> & c"


def test_page_says_nothing_and_asks_nobody(page: Any) -> None:
    assert page.complaints() == []
    assert {url.split(":")[0] for url in page.requests()} <= {"file", "data", "blob"}


CORNERS_IN_PICTURE = """(() => {
    const box = new MeshCat.THREE.Box3();
    for (const part of ["robot", "obstacles"])
        box.expandByObject(viewer.scene_tree.find(["meshcat", part]).object);
    return [box.min, box.max].map(corner => corner.project(viewer.camera).toArray());
})()"""


def test_single_sample_off_centre(open_page: Callable[[str], Any], tmp_path: Path) -> None:
    arm = load_arm("two_link")
    q = arm.configuration([0.3, 0.3])[None]
    scene = Scene([Sphere(name="ball", radius=0.3, position=(1.5, 0.0, 0.5))])
    file = write(tmp_path / "a.html", time=np.zeros(1), q=q, scene=scene, goal=q[0])
    page = open_page(file.as_uri())
    page.wait_until("playing")
    assert changed(page, visible(["meshcat", "robot"], value=False)) > 100
    corners = np.array(page.evaluate(CORNERS_IN_PICTURE))
    assert np.all(np.abs(corners) < 1.0)
    np.testing.assert_allclose(corners[:, :2].sum(axis=0), 0.0, atol=0.3)
    assert page.complaints() == []


def test_missing_folder(tmp_path: Path) -> None:
    with pytest.raises(DensarmError, match="No such file or directory"):
        write(tmp_path / "missing" / "run.html")


def test_failure_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "run.html"
    file.write_text("old")

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.replace", full)
    with pytest.raises(DensarmError, match="No space left"):
        write(file)
    assert [item.name for item in tmp_path.iterdir()] == ["run.html"]
    assert file.read_text() == "old"


def test_panda_fits_into_five_megabytes(tmp_path: Path) -> None:
    arm = load_arm("panda")
    q = np.array([arm.postures["ready"], arm.postures["ready"] + 0.1])
    file = write(tmp_path / "a.html", arm=arm, time=np.array([0.0, 1.0]), q=q, goal=q[1])
    assert file.stat().st_size < 5e6
