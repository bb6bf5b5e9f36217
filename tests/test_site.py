"""The pages that docs/pages/ makes have every public name and every key of a scenario."""

import json
import sys
import tomllib
from collections.abc import Iterator
from dataclasses import fields
from pathlib import Path
from types import ModuleType

import pytest

import densarm
from densarm.scenarios import scenario, steps
from densarm.scene.motion import MOTION_TYPES
from densarm.scene.scene import OBSTACLE_TYPES

DOCS = Path(__file__).parents[1] / "docs"
NOTEBOOKS = sorted((DOCS / "tutorials").glob("*.ipynb"))


@pytest.fixture(scope="module", autouse=True)
def pages() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(DOCS / "pages"))
        yield


def made_by(name: str) -> ModuleType:
    __import__(name)
    return sys.modules[name]


def test_every_public_name_has_its_place() -> None:
    reference = made_by("reference")
    named = [path for paths in reference.public_names().values() for path in paths]
    assert {path.rpartition(".")[2] for path in named} == set(densarm.__all__)
    text = "\n".join(reference.pages().values())
    for path in named:
        assert f"\n::: densarm.{path}\n" in text


def test_every_key_is_told() -> None:
    tables = made_by("scenario_keys").scenario_tables()
    for title, keys in tables.items():
        for key in keys:
            assert key.text, (title, key.name)
            assert key.kind, (title, key.name)

    def names(title: str) -> set[str]:
        return {key.name for key in tables[title]}

    assert names("The file") | set(scenario.TABLES) == scenario._KEYS
    parsed = {**scenario.TABLES, "robot": scenario._RobotTable, "task": scenario._TaskTable}
    for table, kind in parsed.items():
        assert names(f"[{table}]") == {field.name for field in fields(kind)}
    moves = {field.name for field in fields(steps._MoveTable)}
    assert names("[[steps]]") == set(steps._KEYS) | moves
    assert names("line, of [[steps]]") == {field.name for field in fields(steps._LineTable)}
    for word, kind in OBSTACLE_TYPES.items():
        own = names(f'type = "{word}"') | names("[[obstacles]]") - {"type"}
        assert own == {field.name for field in fields(kind)}
    for word, motion in MOTION_TYPES.items():
        assert names(f'motion = {{ type = "{word}" }}') == {x.name for x in fields(motion)}


def test_keys_of_a_known_scenario_are_told_as_they_are() -> None:
    page = made_by("scenario_keys").page()
    assert "| `margin` | number | 0 | Safety margin m:" in page
    assert '| `form` | text | "tracking" |' in page
    assert "1400 in tracking" in page


def test_there_are_tutorials() -> None:
    assert len(NOTEBOOKS) >= 8


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_tutorials_are_kept_without_what_they_show(path: Path) -> None:
    notebook = json.loads(path.read_text(encoding="utf-8"))
    code = [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]
    assert code
    assert all(cell["outputs"] == [] and cell["execution_count"] is None for cell in code)
    assert path.stat().st_size < 10_000


def test_version_is_told_in_one_way() -> None:
    project = tomllib.loads((DOCS.parent / "pyproject.toml").read_text(encoding="utf-8"))
    version = project["project"]["version"]
    assert f"\nversion: {version}\n" in (DOCS.parent / "CITATION.cff").read_text(encoding="utf-8")
    assert f"\n## [{version}]" in (DOCS.parent / "CHANGELOG.md").read_text(encoding="utf-8")
