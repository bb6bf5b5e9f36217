"""The table of foreign URDFs: one line for each, whatever is in the file."""

import runpy
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


def test_every_file_has_a_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    whole = (ROOT / "robots" / "two_link" / "robot.urdf").read_text(encoding="utf-8")
    empty = '<collision><geometry><sphere radius="0"/></geometry></collision></link>'
    (tmp_path / "deeper").mkdir()
    odd = whole.replace("</link>", empty, 1)
    for name, text in (("good", whole), ("deeper/odd", odd), ("none", "<robot/>")):
        (tmp_path / f"{name}.urdf").write_text(text, encoding="utf-8")
    script = runpy.run_path(str(ROOT / "benchmarks" / "foreign_urdfs.py"))
    assert script["main"]([str(tmp_path)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[2].startswith("| deeper/odd.urdf | loads; collision sphere of link ")
    assert lines[3] == "| good.urdf | loads | 2 | 1 |"
    assert lines[4] == "| none.urdf | refused: URDF: it has no <link> |  |  |"
    assert lines[-1] == "Of 3: 2 loads, 1 refused."
