"""A recorded run as one HTML page: a file that plays from disk, or served by this machine."""

import base64
import gzip
import html
import json
import webbrowser
from collections.abc import Callable
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib.resources import files
from pathlib import Path
from string import Template
from typing import Any

import meshcat
import umsgpack

from densarm.simulation.run import Run
from densarm.values.files import atomic_file
from densarm.values.progress import is_in_notebook
from densarm.visualization import palette
from densarm.visualization.bodies import spoken_names
from densarm.visualization.meshcat_drawing import draw
from densarm.visualization.notebook import show_page
from densarm.visualization.palette import css
from densarm.visualization.render_scene import RenderScene, SummaryLine

_DECIMALS = 6  # of lengths in metres
_STOPS = 9  # of the colour scale
_CHIPS = {True: "good", False: "bad", None: ""}  # classes of the page's style sheet


def view(run: Run, on_url: Callable[[str], object] = print, *, open_browser: bool = True) -> None:
    """Show a run in the browser, with play, pause and a time line, until Ctrl-C.

    In a notebook it is shown below the cell, which is done at once.

    Args:
        run: what to show.
        on_url: told the page's address.
        open_browser: open the page where there is a browser; otherwise the user does.

    Raises:
        KeyboardInterrupt: on Ctrl-C.
    """
    page = html_page(run)
    if is_in_notebook():
        show_page(page)
        return
    with PageServer(page) as server:
        on_url(server.url)
        if open_browser:
            webbrowser.open(server.url)
        server.serve_forever()


def save_html(run: Run, path: str | Path) -> None:
    """Write one HTML file that plays a run from disk, without a network.

    Args:
        run: what to show.
        path: the file; its folder must exist.

    Raises:
        FileContentError: the file cannot be written.
    """
    page = html_page(run)
    with atomic_file(Path(path)) as file:
        file.write(page.encode())


def html_page(run: Run) -> str:
    """Return a page that plays a run in any browser: it asks for nothing beyond itself."""
    scene = RenderScene(run)
    summary, recorder = SummaryLine.of(run), DrawingRecorder()
    draw(scene, meshcat.Visualizer(window=recorder))
    viewer = files("meshcat") / "viewer" / "dist" / "main.min.js"
    page = Template((files("densarm.visualization") / "page.html").read_text(encoding="utf-8"))
    return page.substitute(
        title=html.escape(summary.title),
        chips="".join(
            f'<span class="{_CHIPS[is_good]}">{html.escape(text)}</span>'
            for text, is_good in summary.words
        ),
        detail=html.escape(summary.detail),
        colors=", ".join(map(css, scene.scale.steps(_STOPS))),
        scale_top=f"{scene.scale.top * 1e3:g}",
        obstacle_color=css(palette.OBSTACLE),
        goal_color=css(palette.GOAL),
        goal_hidden="hidden" if run.task.goal is None else "",
        sensing_color=css(palette.SENSING),
        sensing_distance=f"{scene.sensing_distance * 1e3:g}",
        closest_color=css(palette.CLOSEST),
        good_color=css(palette.GOOD),
        bad_color=css(palette.BAD),
        viewer=viewer.read_text(encoding="utf-8"),
        drawing=recorder.packed(),
        closest=json.dumps(_closest(scene)).replace("<", "\\u003c"),
    )


def _closest(scene: RenderScene) -> dict[str, Any]:
    found = {name for pair in scene.closest for name in pair.names}
    spoken = spoken_names(scene.run.task.arm, found)
    return {
        "time": scene.time.round(_DECIMALS).tolist(),
        "distance": scene.clearance.round(_DECIMALS).tolist(),
        "names": [[spoken[name] for name in pair.names] for pair in scene.closest],
        "matrices": {  # column by column, as three.js has them
            name: transforms.transpose(0, 2, 1).reshape(-1, 16).round(_DECIMALS).tolist()
            for name, (_, transforms) in scene.closest_line.items()
        },
    }


class DrawingRecorder:
    """Stands in for meshcat's window: it keeps the drawing commands."""

    def __init__(self) -> None:
        self._commands: list[dict[str, Any]] = []
        self._seen: set[str] = set()

    def send(self, command: Any) -> None:
        """Keep a drawing command; a mesh that an earlier one carries is kept by its uuid alone."""
        data = command.lower()
        if data["type"] == "set_object":
            meshes = data["object"].get("geometries", [])
            data["object"]["geometries"] = [
                {"uuid": mesh["uuid"]} if mesh["uuid"] in self._seen else mesh for mesh in meshes
            ]
            self._seen.update(mesh["uuid"] for mesh in meshes)
        self._commands.append(data)

    def packed(self) -> str:
        """Return the commands as base64 of gzip of one MessagePack list."""
        packed: bytes = umsgpack.packb(self._commands)
        return base64.b64encode(gzip.compress(packed, mtime=0)).decode("ascii")


class PageServer(ThreadingHTTPServer):
    """Serve a page of HTML at http://127.0.0.1, on a port that is free, by `serve_forever`."""

    daemon_threads = True

    def __init__(self, page: str) -> None:
        self.page = page.encode()
        super().__init__(("127.0.0.1", 0), _PageRequest)

    @property
    def url(self) -> str:
        """Address of the page."""
        return f"http://127.0.0.1:{self.server_port}/"


class _PageRequest(BaseHTTPRequestHandler):
    server: PageServer

    def do_GET(self) -> None:
        """Answer with the page, whatever is asked for."""
        self.send_response(200)
        self.send_header("Content-Type", "text/html; charset=utf-8")
        self.send_header("Content-Length", str(len(self.server.page)))
        self.end_headers()
        self.wfile.write(self.server.page)

    def log_message(self, format: str, *args: object) -> None:  # noqa: A002
        """Say nothing."""
