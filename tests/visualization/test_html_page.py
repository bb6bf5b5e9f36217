from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from densarm.arm import load_arm
from densarm.errors import DensarmError
from densarm.scene import Scene
from densarm.trajectory import Trajectory
from densarm.visualization.view import save_html

OBSTACLES = ("ball", "box", "capsule", "cylinder")
DURATION = 4.0  # [s]


@pytest.fixture(scope="module")
def page(
    open_page: Callable[[str], Any], swing: Trajectory, tmp_path_factory: pytest.TempPathFactory
) -> Any:
    """The page of a swing, opened from disk and paused."""
    file = tmp_path_factory.mktemp("page") / "swing.html"
    save_html(swing, file)
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


@pytest.mark.parametrize(
    "part", ["robot", "goal", "path", "floor", "closest", *(f"obstacles/{o}" for o in OBSTACLES)]
)
def test_every_part_is_seen(page: Any, part: str) -> None:
    page.evaluate("seek(1)")
    assert changed(page, f"show('{part}', false)") > 50
    page.evaluate(f"show('{part}', true)")


@pytest.mark.parametrize("part", ["obstacles", "goal", "sensing"])
def test_legend_shows_and_hides(page: Any, part: str) -> None:
    page.evaluate("seek(1)")
    click = f"document.querySelector('#legend input[value={part}]').click()"
    before = page.picture()
    assert changed(page, click) > 500
    page.evaluate(click)
    assert np.array_equal(page.picture(), before)


def test_time_line_moves_the_arm_and_the_closest_pair(page: Any, swing: Trajectory) -> None:
    page.evaluate("seek(0)")
    scrub = f"slider.value = {DURATION / 2}; slider.dispatchEvent(new Event('input'))"
    assert changed(page, scrub) > 100
    assert page.evaluate("clock.textContent") == "2.000 / 4.000 s"
    millimetres = f"{1e3 * np.interp(2.0, swing.time, swing.clearance):.1f} mm"
    assert page.evaluate("label.textContent") == millimetres
    words = page.evaluate("document.getElementById('closest').textContent")
    assert words.startswith("closest: lower_link_0 and ")
    assert words.endswith(millimetres)


def test_distance_stands_beside_the_line(page: Any) -> None:
    page.evaluate("seek(1)")
    page.picture()
    beside = """(() => {
        const end = viewer.scene_tree.find(["meshcat", "closest", "second"]).object;
        const at = end.getWorldPosition(new MeshCat.THREE.Vector3()).project(viewer.camera);
        const box = label.getBoundingClientRect();
        return [box.left - (at.x + 1) / 2 * innerWidth, (1 - at.y) / 2 * innerHeight - box.bottom];
    })()"""
    right, above = page.evaluate(beside)
    assert 0.0 < right < 30.0
    assert 0.0 < above < 30.0


def test_arm_covers_its_goal_at_the_end(page: Any) -> None:
    page.evaluate(f"seek({DURATION})")
    assert changed(page, "show('goal', false)") < 100
    page.evaluate("show('goal', true)")


def test_button_plays_and_pauses(page: Any) -> None:
    page.evaluate("seek(0)")
    assert changed(page, "button.click()") >= 0
    page.wait_until("time > 0.5")
    assert changed(page, "button.click()") > 0
    stopped = page.evaluate("time")
    assert changed(page, "seek(0)") > 100
    assert changed(page, f"seek({stopped})") > 100
    assert page.evaluate("time") == stopped


def test_heading_says_how_it_ended(page: Any) -> None:
    heading = "document.querySelector('#heading')"
    assert page.evaluate(f"{heading}.querySelector('h1').textContent") == "Swing <b> & co"
    chips = page.evaluate(f"[...{heading}.querySelectorAll('span')].map(chip => chip.textContent)")
    assert chips[0] == "timed out"
    assert chips[1] == "4.000 s"
    assert chips[2].startswith("smallest clearance ")
    assert chips[3] == "not certified"
    assert page.evaluate(f"{heading}.querySelector('p').textContent").endswith("late")


def test_page_says_nothing_and_asks_nobody(page: Any) -> None:
    assert page.complaints() == []
    assert {url.split(":")[0] for url in page.requests()} <= {"file", "data", "blob"}


CORNERS_IN_PICTURE = """(() => {
    const box = new MeshCat.THREE.Box3();
    box.expandByObject(viewer.scene_tree.find(["meshcat", "robot"]).object);
    return [box.min, box.max].map(corner => corner.project(viewer.camera).toArray());
})()"""


def test_single_sample_without_pairs(
    open_page: Callable[[str], Any], resting: Trajectory, tmp_path: Path
) -> None:
    save_html(resting, tmp_path / "a.html")
    page = open_page((tmp_path / "a.html").as_uri())
    page.wait_until("playing")
    assert changed(page, "show('robot', false)") > 100
    corners = np.array(page.evaluate(CORNERS_IN_PICTURE))
    assert np.all(np.abs(corners) < 1.0)
    np.testing.assert_allclose(corners[:, :2].sum(axis=0), 0.0, atol=0.3)
    words = page.evaluate("document.getElementById('closest').textContent")
    assert words == "closest: no pairs"
    assert page.complaints() == []


def test_missing_folder(resting: Trajectory, tmp_path: Path) -> None:
    with pytest.raises(DensarmError, match="No such file or directory"):
        save_html(resting, tmp_path / "missing" / "run.html")


def test_failure_leaves_the_old_file(
    resting: Trajectory, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "run.html"
    file.write_text("old")

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.replace", full)
    with pytest.raises(DensarmError, match="No space left"):
        save_html(resting, file)
    assert [item.name for item in tmp_path.iterdir()] == ["run.html"]
    assert file.read_text() == "old"


def test_panda_fits_into_five_megabytes(record: Callable[..., Trajectory], tmp_path: Path) -> None:
    arm = load_arm("panda")
    ready = arm.angles(arm.postures["ready"])
    save_html(record(arm, np.array([ready, ready + 0.1]), 1.0, Scene()), tmp_path / "a.html")
    assert (tmp_path / "a.html").stat().st_size < 5e6
