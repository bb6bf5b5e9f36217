import json

import pytest

from densarm.errors import FileContentError
from densarm.visualization import figure_style as style
from densarm.visualization.figure_report import FigureReport, figure_arguments


def test_writes_exactly_the_four_keys(tmp_path, capsys):
    FigureReport("Fig. 0", "It holds.", True, {"starts": 3}).write(tmp_path)
    result = json.loads((tmp_path / "result.json").read_text(encoding="utf-8"))
    assert result == {
        "figure": "Fig. 0",
        "claim": "It holds.",
        "holds": True,
        "numbers": {"starts": 3},
    }
    assert "holds" in capsys.readouterr().out


def test_arguments_make_the_folder(tmp_path):
    options = figure_arguments("shows", 10, ["--out", str(tmp_path / "a" / "b")])
    assert options.out.is_dir()
    assert options.starts == 10


def test_pictures_are_png_and_pdf(tmp_path):
    figure = style.new_figure(3.0, 2.0)
    style.plane_axes(figure.subplots(), (0.0, 1.0, 0.0, 1.0), "empty")
    png, pdf = style.save_figure(figure, tmp_path, "picture")
    assert png.read_bytes().startswith(b"\x89PNG")
    assert pdf.read_bytes().startswith(b"%PDF")
    with pytest.raises(FileContentError):
        style.save_figure(figure, tmp_path / "missing", "picture")
