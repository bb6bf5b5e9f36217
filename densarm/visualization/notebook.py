"""Runs in notebooks: a still picture with what is proved, and the page that plays below a cell."""

import base64
import html
import sys
from io import BytesIO
from typing import Any

from densarm.simulation.run import Run
from densarm.visualization.picture import still
from densarm.visualization.render_scene import SummaryLine

_SIZE = (800, 450)  # of the picture [pixels]
_HEIGHT = 480  # of the page [pixels]
_SIGNS = {True: "✓", False: "✗", None: "–"}


def run_in_notebook(run: Run) -> str:
    """Return HTML of a run: picture, outcome, clearance, and each part of the certificate."""
    summary, image = SummaryLine.of(run), BytesIO()
    still(run, *_SIZE).save(image, format="PNG")
    picture = base64.b64encode(image.getvalue()).decode("ascii")
    words = ", ".join(html.escape(text) for text, _ in summary.words)
    rows = "".join(
        f"<tr><td>{_SIGNS[check.holds]}</td><td>{check.name}</td>"
        f'<td style="text-align: left">{html.escape(check.detail)}</td></tr>'
        for check in run.certificate.checks
    )
    return (
        f'<img src="data:image/png;base64,{picture}" alt="{html.escape(summary.title)}" '
        f'style="width: {_SIZE[0]}px; max-width: 100%"><p><b>{words}</b><br>'
        f"{html.escape(summary.detail)}</p><table>{rows}</table>"
    )


def show_page(page: str) -> None:
    """Show a page of HTML below the cell that runs."""
    display: Any = sys.modules["IPython"].display
    frame = f'<iframe srcdoc="{html.escape(page)}" width="100%" height="{_HEIGHT}"'
    display.display(display.HTML(f'<div>{frame} style="border: 0"></iframe></div>'))
