"""Playback in real time, in a browser that meshcat's server feeds."""

import contextlib
import io
import itertools
import math
import time as wall
from collections.abc import Callable, Iterator

import meshcat
import numpy as np

from densarm.arm import Arm
from densarm.arrays import Array
from densarm.scene import Scene
from densarm.visualization.meshcat_player import MeshcatPlayer

_FRAMES_PER_SECOND = 60.0
_PAUSE = 1.0  # between the end of the motion and its next start [s]


def play(
    arm: Arm,
    scene: Scene,
    time: Array,
    q: Array,
    goal: Array,
    *,
    on_url: Callable[[str], object],
    open_browser: bool = True,
    loops: int | None = None,
) -> None:
    """Play a motion in the browser, in real time, again and again.

    It starts when a browser shows the page. Frames follow the wall clock: a slow machine shows
    fewer of them, not a slower motion.

    Args:
        arm: the arm.
        scene: its obstacles.
        time: (N,) increasing [s].
        q: (N, nq) the configuration at each time.
        goal: (nq,) the posture that is drawn translucently.
        on_url: called once with the page's address.
        open_browser: open the page; otherwise the user does.
        loops: how often to play; None for until Ctrl-C.

    Raises:
        KeyboardInterrupt: on Ctrl-C, after the server has been stopped.
    """
    with _server() as viewer:
        player = MeshcatPlayer(arm, scene, viewer)
        player.display(q[0])
        player.draw_goal(goal)
        player.draw_path(q)
        player.place_camera(np.vstack([q, goal]))
        on_url(viewer.url())
        if open_browser:
            viewer.open()
        _wait_for_browser(viewer)
        for _ in itertools.count() if loops is None else range(loops):
            _play_once(player, time - time[0], q)
            wall.sleep(_PAUSE)


def _play_once(player: MeshcatPlayer, time: Array, q: Array) -> None:
    start = wall.monotonic()
    while (now := wall.monotonic() - start) < time[-1]:
        player.display(q[np.searchsorted(time, now, side="right") - 1])
        late = wall.monotonic() - start
        next_frame = math.ceil(late * _FRAMES_PER_SECOND) / _FRAMES_PER_SECOND
        wall.sleep(next_frame - late)
    player.display(q[-1])


def _wait_for_browser(viewer: meshcat.Visualizer) -> None:
    viewer.wait()
    # The server misses the request that follows its answer, unless it comes by a new connection.
    viewer.window.zmq_socket.close(linger=0)
    viewer.window.connect_zmq()


@contextlib.contextmanager
def _server() -> Iterator[meshcat.Visualizer]:
    with contextlib.redirect_stdout(io.StringIO()):  # meshcat prints the address
        viewer = meshcat.Visualizer()
    window = viewer.window
    try:
        yield viewer
    finally:
        window.zmq_socket.close(linger=0)
        with window.server_proc as process:  # closes its pipes
            process.kill()
