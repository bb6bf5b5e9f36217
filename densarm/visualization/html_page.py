"""One HTML file that plays a motion from disk, without a network."""

import html
from importlib.resources import files
from pathlib import Path
from string import Template

import meshcat
import numpy as np

from densarm.arm import Arm
from densarm.arrays import Array
from densarm.atomic_file import atomic_file
from densarm.scene import Scene
from densarm.visualization.drawing_recorder import DrawingRecorder
from densarm.visualization.meshcat_player import MeshcatPlayer


def write_html(
    path: str | Path,
    arm: Arm,
    scene: Scene,
    time: Array,
    q: Array,
    goal: Array,
    title: str,
    subtitle: str = "",
) -> None:
    """Write one file that plays a motion with a time line, in any browser and from disk.

    The file holds the viewer, the meshes and the motion. It appears complete or not at all.

    Args:
        path: the file.
        arm: the arm.
        scene: its obstacles.
        time: (N,) increasing [s].
        q: (N, nq) the configuration at each time.
        goal: (nq,) the posture that is drawn translucently.
        title: heading of the page.
        subtitle: a second line below it.

    Raises:
        FileContentError: the file cannot be written; its folder does not exist, for one.
    """
    page = Template((files("densarm.visualization") / "page.html").read_text(encoding="utf-8"))
    viewer = files("meshcat") / "viewer" / "dist" / "main.min.js"
    text = page.substitute(
        title=html.escape(title),
        subtitle=html.escape(subtitle),
        viewer=viewer.read_text(encoding="utf-8"),
        drawing=_drawing(arm, scene, time, q, goal),
    )
    with atomic_file(Path(path)) as file:
        file.write(text.encode())


def _drawing(arm: Arm, scene: Scene, time: Array, q: Array, goal: Array) -> str:
    recorder = DrawingRecorder()
    player = MeshcatPlayer(arm, scene, meshcat.Visualizer(window=recorder))
    player.display(q[0])
    player.draw_goal(goal)
    player.draw_path(q)
    player.place_camera(np.vstack([q, goal]))
    player.viewer.set_animation(player.animation(time, q), play=False)
    return recorder.packed()
