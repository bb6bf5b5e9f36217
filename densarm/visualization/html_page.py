"""One HTML page that plays a run from disk, without a network."""

import html
import json
from importlib.resources import files
from string import Template
from typing import Any

import meshcat
import numpy as np

from densarm.trajectory import Trajectory
from densarm.visualization import palette
from densarm.visualization.clearance_scale import ClearanceScale
from densarm.visualization.drawing_recorder import DrawingRecorder
from densarm.visualization.meshcat_drawing import draw
from densarm.visualization.palette import css
from densarm.visualization.stage import Stage
from densarm.visualization.summary_line import SummaryLine

_DECIMALS = 6  # of lengths in metres
_STOPS = 9  # of the colour scale


def html_page(run: Trajectory) -> str:
    """Return a page that plays a run with a time line, in any browser.

    It holds the viewer, the meshes and the motion, and asks for nothing else.

    Args:
        run: what to show.
    """
    stage, summary = Stage(run), SummaryLine.of(run)
    recorder = DrawingRecorder()
    draw(stage, meshcat.Visualizer(window=recorder))
    viewer = files("meshcat") / "viewer" / "dist" / "main.min.js"
    page = Template((files("densarm.visualization") / "page.html").read_text(encoding="utf-8"))
    return page.substitute(
        title=html.escape(summary.title),
        chips="".join(_chips(summary)),
        detail=html.escape("" if summary.is_reached else summary.detail),
        colors=_gradient(stage.scale),
        scale_top=f"{stage.scale.top * 1e3:g}",
        obstacle_color=css(palette.OBSTACLE),
        goal_color=css(palette.GOAL),
        sensing_color=css(palette.SENSING),
        sensing_distance=f"{stage.sensing_distance * 1e3:g}",
        closest_color=css(palette.CLOSEST),
        good_color=css(palette.GOOD),
        bad_color=css(palette.BAD),
        viewer=viewer.read_text(encoding="utf-8"),
        drawing=recorder.packed(),
        closest=json.dumps(_closest(stage)).replace("<", "\\u003c"),
    )


def _chips(summary: SummaryLine) -> list[str]:
    outcome = "good" if summary.is_reached else "bad"
    certificate = "good" if summary.is_certified else "bad"
    chips = [
        (outcome, summary.outcome),
        *(("", fact) for fact in summary.facts),
        (certificate, summary.certificate),
    ]
    return [f'<span class="{kind}">{html.escape(text)}</span>' for kind, text in chips]


def _closest(stage: Stage) -> dict[str, Any]:
    closest = stage.closest
    return {
        "time": stage.time.round(_DECIMALS).tolist(),
        "distance": closest.distance.round(_DECIMALS).tolist(),
        "names": closest.names,
        "matrices": {  # column by column, as three.js has them
            name: transforms.transpose(0, 2, 1).reshape(-1, 16).round(_DECIMALS).tolist()
            for name, (_, transforms) in stage.closest_line.items()
        },
    }


def _gradient(scale: ClearanceScale) -> str:
    colors = scale.colors(np.linspace(0.0, scale.top, _STOPS))
    return ", ".join(css((float(r), float(g), float(b))) for r, g, b in colors)
