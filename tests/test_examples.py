import runpy
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).parents[1] / "examples"


def run_example(monkeypatch: pytest.MonkeyPatch, name: str, *arguments: str) -> None:
    monkeypatch.setattr("sys.argv", [name, *arguments])
    runpy.run_path(str(EXAMPLES / name), run_name="__main__")


def test_every_example_is_tested():
    names = {path.name for path in EXAMPLES.glob("*.py")}
    assert names == {"swing_up.py", "panda_table.py", "own_control_loop.py", "free_body.py"}


def test_swing_up(monkeypatch, tmp_path, capsys):
    run_example(monkeypatch, "swing_up.py", "--out", str(tmp_path))
    out = capsys.readouterr().out
    assert "reached the goal" in out
    assert "not proved" not in out
    assert {path.name for path in tmp_path.iterdir()} == {"swing_up.npz", "swing_up.html"}
    assert len((EXAMPLES / "swing_up.py").read_text(encoding="utf-8").splitlines()) < 40


def test_panda_table(monkeypatch, tmp_path, capsys):
    run_example(monkeypatch, "panda_table.py", "--out", str(tmp_path))
    out = capsys.readouterr().out
    assert "reached the goal" in out
    assert "certified: True" in out
    assert {path.name for path in tmp_path.iterdir()} == {"panda_table.html", "panda_table.png"}


def test_own_control_loop(monkeypatch, tmp_path, capsys):
    monkeypatch.chdir(tmp_path)
    run_example(monkeypatch, "own_control_loop.py")
    status, result = capsys.readouterr().out.splitlines()
    words = result.split()
    assert status == "The controller acts."
    assert float(words[0]) < 0.01  # [rad] from the goal
    assert float(words[-2]) > 0.0  # [mm] of clearance
    assert list(tmp_path.iterdir()) == []


def test_free_body(monkeypatch, tmp_path, capsys):
    run_example(monkeypatch, "free_body.py", "--out", str(tmp_path))
    out = capsys.readouterr().out
    assert "by velocity: reached" in out
    assert "clear\n" in out
    assert "certified: True" in out
    assert {path.name for path in tmp_path.iterdir()} == {"free_body.html"}
    assert len((EXAMPLES / "free_body.py").read_text(encoding="utf-8").splitlines()) < 60
