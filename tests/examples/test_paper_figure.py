"""What the scripts of the paper's figures have in common."""

import json
import runpy
from pathlib import Path
from types import SimpleNamespace

import pytest

from densarm.errors import FileContentError
from densarm.visualization.figure_style import new_figure

MODULE = Path(__file__).parents[2] / "examples" / "paper" / "paper_figure.py"


@pytest.fixture(scope="module")
def paper() -> SimpleNamespace:
    return SimpleNamespace(**runpy.run_path(str(MODULE)))


def test_writes_exactly_the_four_keys(
    paper: SimpleNamespace, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    paper.FigureReport("Fig. 0", "It holds.", True, {"starts": 3}).write(tmp_path)
    result = json.loads((tmp_path / "result.json").read_text(encoding="utf-8"))
    assert result == {
        "figure": "Fig. 0",
        "claim": "It holds.",
        "holds": True,
        "numbers": {"starts": 3},
    }
    assert "holds" in capsys.readouterr().out


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
