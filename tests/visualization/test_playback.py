from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from densarm.arm import load_arm
from densarm.scene import Scene, Sphere
from densarm.visualization import playback

ELBOW = "viewer.scene_tree.find(['meshcat', 'robot', 'elbow']).object.position.toArray()"


def test_plays_to_the_end_and_stops(
    open_page: Callable[[str], Any], capfd: pytest.CaptureFixture[str]
) -> None:
    arm = load_arm("two_link")
    time = np.linspace(0.0, 0.5, 501)
    q = np.array([arm.configuration([angle, 0.0]) for angle in np.pi * time])
    scene = Scene([Sphere(name="ball", radius=0.2, position=(1.5, 0.0, -0.5))])
    pages: list[Any] = []
    playback.play(
        arm,
        scene,
        time,
        q,
        q[-1],
        on_url=lambda url: pages.append(open_page(url)),
        open_browser=False,
        loops=1,
    )
    (page,) = pages
    page.wait_until(f"Math.abs({ELBOW}[0] - 1) < 1e-9")
    assert np.unique(page.picture().reshape(-1, 3), axis=0).shape[0] > 100
    assert capfd.readouterr() == ("", "")


def test_interrupt_stops_the_server(monkeypatch: pytest.MonkeyPatch) -> None:
    arm = load_arm("two_link")
    viewers: list[Any] = []
    create = playback.meshcat.Visualizer
    monkeypatch.setattr(
        playback.meshcat, "Visualizer", lambda: viewers.append(create()) or viewers[0]
    )

    def interrupt(url: str) -> None:
        assert url.startswith("http://127.0.0.1:")
        raise KeyboardInterrupt

    q = arm.configuration([0.0, 0.0])[None]
    with pytest.raises(KeyboardInterrupt):
        playback.play(arm, Scene(), np.zeros(1), q, q[0], on_url=interrupt)
    assert viewers[0].window.server_proc.returncode is not None
