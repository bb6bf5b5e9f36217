"""Hulls that overlap where meshes do not are counted, and what pieces make of them."""

import runpy
import sys
from pathlib import Path

import pytest

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"


@pytest.mark.slow
@pytest.mark.parametrize("shapes", ["hull", "pieces"])
def test_pieces_of_a_ur10_are_apart(
    shapes: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["", "ur10", "--shapes", shapes, "--configurations", "50"])
    assert runpy.run_path(str(BENCHMARKS / "hulls_and_meshes.py"))["main"]() == 0
    overlap, apart, still, missed = capsys.readouterr().out.splitlines()[-1].split()[2:]
    assert int(overlap) > int(apart) > 0
    assert int(still) == int(missed) == 0


@pytest.mark.slow
def test_capsules_are_not(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["", "ur10", "--shapes", "capsule", "--configurations", "50"])
    assert runpy.run_path(str(BENCHMARKS / "hulls_and_meshes.py"))["main"]() == 1
    assert int(capsys.readouterr().out.splitlines()[-1].split()[-2]) > 0
