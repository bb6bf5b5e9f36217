"""What the scripts of the paper's figures have in common."""

import json
import runpy
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from PIL import Image

from densarm.arms.joint_space import EuclideanSpace
from densarm.density.navigation_density import DensityParameters, Gauge
from densarm.errors import FileContentError
from densarm.euclidean.density import EuclideanDensity
from densarm.euclidean.runs import run_points
from densarm.simulation.plants import SingleIntegrator
from densarm.visualization.figure_style import new_figure

MODULE = Path(__file__).parents[2] / "examples" / "paper" / "paper_figure.py"


@pytest.fixture(scope="module")
def paper() -> SimpleNamespace:
    return SimpleNamespace(**runpy.run_path(str(MODULE)))


def test_writes_what_it_is(
    paper: SimpleNamespace, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    report = paper.FigureReport("Fig. 0", "It holds.", True, {"starts": 3}, ("α = 0.2.",))
    report.write(tmp_path)
    result = json.loads((tmp_path / "result.json").read_text(encoding="utf-8"))
    assert result == {
        "figure": "Fig. 0",
        "claim": "It holds.",
        "holds": True,
        "numbers": {"starts": 3},
        "departures": ["α = 0.2."],
    }
    printed = capsys.readouterr().out
    assert "holds" in printed
    assert "departs: α = 0.2." in printed


def test_departures_are_at_the_foot_of_the_picture(paper: SimpleNamespace, tmp_path: Path) -> None:
    departure = "a gain of 5, " + "of which the paper says nothing, " * 5
    heights = {}
    for name, departures in (("without", ()), ("with", (departure, "θ = 0"))):
        figure = new_figure(3.0, 2.0)
        figure.subplots()
        report = paper.FigureReport("Fig. 0", "It holds.", True, {}, departures)
        report.write(tmp_path, **{name: figure})
        with Image.open(tmp_path / f"{name}.png") as picture:
            heights[name] = picture.height
        shown = "".join(text.get_text() for text in figure.texts)
        assert all(each in " ".join(shown.split()) for each in departures)
    assert heights["with"] > heights["without"] + 50


def test_arrivals_are_counted_at_both_times(paper: SimpleNamespace) -> None:
    density = EuclideanDensity([], np.zeros(1), DensityParameters(gauge=Gauge.LOG))
    plant = SingleIntegrator(EuclideanSpace(1), 1.0)
    runs = run_points(
        lambda _: density, plant, np.array([[1.0], [20.0], [200.0]]), 0.1, 1200.0, 0.1
    )
    assert paper.arrivals(runs, 0.1) == {
        "starts": 3,
        "collided": 0,
        "reached_within_120_s": 1,
        "reached_within_1200_s": 2,
    }


def test_arguments_make_the_folder(paper: SimpleNamespace, tmp_path: Path) -> None:
    options = paper.figure_arguments("shows", 10, ["--out", str(tmp_path / "a" / "b")])
    assert options.out.is_dir()
    assert options.starts == 10


def test_pictures_are_png_and_pdf(paper: SimpleNamespace, tmp_path: Path) -> None:
    figure = new_figure(3.0, 2.0)
    paper.plane_axes(figure.subplots(), (0.0, 1.0, 0.0, 1.0), "empty")
    png, pdf = paper.save_figure(figure, tmp_path, "picture")
    assert png.read_bytes().startswith(b"\x89PNG")
    assert pdf.read_bytes().startswith(b"%PDF")
    with pytest.raises(FileContentError):
        paper.save_figure(figure, tmp_path / "missing", "picture")
