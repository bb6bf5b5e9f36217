"""docs/errors.md has a section on every error and every outcome, and a row on every fault."""

import importlib
import pkgutil
import re
from collections.abc import Iterator
from pathlib import Path

import densarm
from densarm.control.status import Fault
from densarm.errors import DensarmError

PAGE = (Path(__file__).parents[1] / "docs" / "errors.md").read_text(encoding="utf-8")
SECTIONS = dict(re.findall(r"^### (\w+)\n(.*?)(?=^##|\Z)", PAGE, flags=re.DOTALL | re.MULTILINE))


def errors(base: type[DensarmError] = DensarmError) -> Iterator[str]:
    yield base.__name__
    for error in base.__subclasses__():
        yield from errors(error)


def test_every_error_and_every_outcome_has_its_section() -> None:
    for module in pkgutil.walk_packages(densarm.__path__, "densarm."):
        if not module.name.endswith("__main__"):
            importlib.import_module(module.name)
    ours = {name for name in errors() if not name.startswith("_")}
    assert set(SECTIONS) == ours | {str(outcome) for outcome in densarm.Outcome}
    assert all("**Do" in section for section in SECTIONS.values())


def test_every_fault_has_its_row() -> None:
    rows = re.findall(r"^\| (`.*?`) \|", PAGE, flags=re.MULTILINE)
    named = {name for row in rows for name in re.findall(r"`(\w+)`", row)}
    assert named == {str(fault) for fault in Fault if fault != Fault.NONE}
