import pytest

from densarm.errors import InvalidValueError
from densarm.study.comparison import Comparison, MethodResult, MethodRun
from densarm.visualization.comparison_plot import comparison_figure, save_comparison_plot


def run(outcome, time):
    return MethodRun((0.0, 0.0), outcome, "", time, 2.0 * time, 0.01 * time, 50.0, 0.1, 0.3, 20.0)


@pytest.fixture(scope="module")
def comparison():
    density = MethodResult("density", (run("reached", 1.0), run("reached", 3.0)))
    rival = MethodResult("cbf_qp", (run("stuck", 2.0), MethodRun((0.0, 0.0), "failed", "why")))
    return Comparison("swing_up", 0, (density, rival), 0)


def test_panels_show_counts_and_the_runs_that_reached(comparison):
    figure = comparison_figure(comparison)
    outcomes, time, *_, step = figure.axes
    assert [text.get_text() for text in outcomes.get_yticklabels()] == ["density", "cbf_qp"]
    assert [bar.get_width() for bar in outcomes.patches] == [2, 0, 0, 1, 0, 1]
    dots, median, none = time.get_lines()
    assert list(dots.get_xdata()) == [1.0, 3.0]
    assert list(median.get_xdata()) == [2.0, 2.0]
    assert len(none.get_xdata()) == 0
    assert len(step.get_lines()[2].get_xdata()) == 1
    assert [text.get_text() for text in figure.legends[0].get_texts()] == [
        "reached",
        "stuck",
        "failed",
    ]


def test_axes_have_units(comparison):
    labels = [axes.get_xlabel() for axes in comparison_figure(comparison).axes]
    assert all("[" in label for label in labels[1:])


@pytest.mark.parametrize("kind", ["png", "pdf", "svg"])
def test_formats(comparison, tmp_path, kind):
    path = tmp_path / f"figure.{kind}"
    save_comparison_plot(comparison, path)
    assert path.stat().st_size > 1000


def test_other_formats_are_refused(comparison, tmp_path):
    with pytest.raises(InvalidValueError, match=r"\.png"):
        save_comparison_plot(comparison, tmp_path / "figure.gif")
    assert list(tmp_path.iterdir()) == []
