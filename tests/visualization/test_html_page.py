import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any
from urllib.request import urlopen

import numpy as np
import pytest

from densarm.arms.arm import load_arm
from densarm.errors import DensarmError
from densarm.scene.scene import Scene
from densarm.simulation.run import Run
from densarm.visualization import html_page as module
from densarm.visualization.html_page import PageServer, html_page, save_html

pytestmark = pytest.mark.slow  # pages in Chromium

OBSTACLES = ("ball", "box", "capsule", "cylinder")
DURATION = 4.0  # [s]


@pytest.fixture(scope="module")
def page(
    open_page: Callable[[str], Any], swing: Run, tmp_path_factory: pytest.TempPathFactory
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


def test_time_line_moves_the_arm_and_the_closest_pair(page: Any, swing: Run) -> None:
    page.evaluate("seek(0)")
    scrub = f"slider.value = {DURATION / 2}; slider.dispatchEvent(new Event('input'))"
    assert changed(page, scrub) > 100
    assert page.evaluate("clock.textContent") == "2.000 / 4.000 s"
    millimetres = f"{1e3 * np.interp(2.0, swing.time, swing.clearance):.1f} mm"
    assert page.evaluate("label.textContent") == millimetres
    words = page.evaluate("document.getElementById('closest').textContent")
    assert words.startswith("closest: lower link and ")
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
    open_page: Callable[[str], Any], resting: Run, tmp_path: Path
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


def test_without_a_goal_the_legend_has_none(
    open_page: Callable[[str], Any], aimless: Run, tmp_path: Path
) -> None:
    save_html(aimless, tmp_path / "a.html")
    page = open_page((tmp_path / "a.html").as_uri())
    page.wait_until("playing && time > 0")
    shown = "[...document.querySelectorAll('#legend label')].filter(row => row.offsetParent)"
    words = page.evaluate(f"{shown}.map(row => row.textContent.trim().split(' ')[0])")
    assert words == ["obstacles", "sensed"]
    assert page.complaints() == []


def test_missing_folder(resting: Run, tmp_path: Path) -> None:
    with pytest.raises(DensarmError, match="No such file or directory"):
        save_html(resting, tmp_path / "missing" / "run.html")


def test_failure_leaves_the_old_file(
    resting: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
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


def test_panda_fits_into_five_megabytes(record: Callable[..., Run], tmp_path: Path) -> None:
    arm = load_arm("panda")
    ready = arm.angles(arm.postures["ready"])
    save_html(record(arm, np.array([ready, ready + 0.1]), 1.0, Scene()), tmp_path / "a.html")
    assert (tmp_path / "a.html").stat().st_size < 5e6


def test_served_page_plays(open_page: Callable[[str], Any], swing: Run) -> None:
    with PageServer(html_page(swing)) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        try:
            page = open_page(server.url)
            page.wait_until("playing && time > 0")
            before = page.picture()
            page.wait_until("time > 0.3")
            moved = np.abs(page.picture() - before).max(axis=2) > 8
            assert (
                moved[: page.evaluate("document.querySelector('#timeline').offsetTop")].sum() > 100
            )
            assert page.complaints() == []
            assert {url for url in page.requests() if "http" in url} == {server.url}
        finally:
            server.shutdown()
            thread.join()


def test_page_is_for_this_machine_alone_and_ends_with_ctrl_c(
    resting: Run, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    urls: list[str] = []
    monkeypatch.setattr("webbrowser.open", urls.append)

    def serve(server: PageServer) -> None:
        thread = threading.Thread(target=server.handle_request)
        thread.start()
        with urlopen(server.url, timeout=30) as answer:
            assert answer.read().decode() == server.page.decode()
        thread.join()
        raise KeyboardInterrupt

    monkeypatch.setattr(PageServer, "serve_forever", serve)
    with pytest.raises(KeyboardInterrupt):
        module.view(resting, on_url=urls.append)
    assert urls[0] == urls[1]
    assert urls[0].startswith("http://127.0.0.1:")
    with pytest.raises(OSError, match="refused"):
        urlopen(urls[0], timeout=30)
    assert capfd.readouterr() == ("", "")
