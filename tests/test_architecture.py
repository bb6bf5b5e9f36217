"""The tree's own rules, beside those about imports that `lint-imports` checks."""

import subprocess
import sys
from pathlib import Path

import densarm

PACKAGE = Path(densarm.__file__).parent
HEAVY = {"matplotlib", "meshcat", "mujoco", "numba", "ompl", "scipy", "toppra"}
VAGUE = {"core", "helper", "helpers", "manager", "util", "utils"}


def modules_after(statement: str) -> set[str]:
    script = f"{statement}\nimport sys\nprint(*sys.modules)"
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    return set(done.stdout.split())


def test_nothing_is_loose_at_the_root() -> None:
    assert {path.name for path in PACKAGE.glob("*.py")} == {
        "__init__.py",
        "__main__.py",
        "errors.py",
    }


def test_files_are_as_long_as_a_concept() -> None:
    lengths = {
        path: len(path.read_text(encoding="utf-8").splitlines())
        for path in PACKAGE.rglob("*.py")
        if path.parent != PACKAGE and path.name != "__init__.py"
    }
    assert {path: length for path, length in lengths.items() if length > 410} == {}
    assert sum(length < 40 for length in lengths.values()) <= 10


def test_names_say_what_is_in_a_file() -> None:
    for path in PACKAGE.rglob("*.py"):
        assert not VAGUE & set(path.stem.split("_")), path


def test_import_loads_nothing_else_of_densarm_and_nothing_heavy() -> None:
    after = modules_after("import densarm")
    assert {name for name in after if name.startswith("densarm")} == {"densarm"}
    assert after & (HEAVY | {"numpy", "pinocchio", "coal"}) == set()


def test_heavy_import_is_seen() -> None:
    assert "scipy" in modules_after("import scipy") & HEAVY
