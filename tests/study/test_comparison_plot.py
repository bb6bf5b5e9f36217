"""The figure of a comparison: its panels, units and formats."""

from pathlib import Path

import numpy as np
import pytest
from matplotlib.patches import Rectangle

from densarm.errors import InvalidValueError
from densarm.study.comparison import (
    BaselineResult,
    BaselineRun,
    Comparison,
    comparison_figure,
)
from densarm.visualization.figure_style import save_figure


def run(outcome: str, time: float) -> BaselineRun:
    return BaselineRun((0.0, 0.0), outcome, "", time, 2.0 * time, 0.01 * time, 50.0, 0.1, 0.3, 20.0)


@pytest.fixture(scope="module")
def comparison() -> Comparison:
    density = BaselineResult("density", (run("reached", 1.0), run("reached", 3.0)))
    other = BaselineResult("cbf_qp", (run("stuck", 2.0), BaselineRun((0.0, 0.0), "failed", "why")))
    return Comparison("swing_up", 0, (density, other), 0)


def test_panels_show_counts_and_the_runs_that_reached(comparison: Comparison) -> None:
    figure = comparison_figure(comparison)
    outcomes, time, *_, step = figure.axes
    assert [text.get_text() for text in outcomes.get_yticklabels()] == ["density", "cbf_qp"]
    bars = [bar.get_width() for bar in outcomes.patches if isinstance(bar, Rectangle)]
    assert bars == [2, 0, 0, 1, 0, 1]
    dots, median, none = (np.asarray(line.get_xdata()).tolist() for line in time.get_lines())
    assert dots == [1.0, 3.0]
    assert median == [2.0, 2.0]
    assert none == []
    assert len(np.asarray(step.get_lines()[2].get_xdata())) == 1
    assert [text.get_text() for text in figure.legends[0].get_texts()] == [
        "reached",
        "stuck",
        "failed",
    ]


def test_axes_have_units(comparison: Comparison) -> None:
    labels = [axes.get_xlabel() for axes in comparison_figure(comparison).axes]
    assert all("[" in label for label in labels[1:])


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["png", "pdf", "svg"])
def test_formats(comparison: Comparison, tmp_path: Path, kind: str) -> None:
    path = tmp_path / f"figure.{kind}"
    save_figure(comparison_figure(comparison), path)
    assert path.stat().st_size > 1000


def test_other_formats_are_refused(comparison: Comparison, tmp_path: Path) -> None:
    with pytest.raises(InvalidValueError, match=r"\.png"):
        save_figure(comparison_figure(comparison), tmp_path / "figure.gif")
    assert list(tmp_path.iterdir()) == []
