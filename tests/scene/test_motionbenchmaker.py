"""MotionBenchMaker's problems in JSON."""

import json
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from densarm.errors import DensarmError, FileContentError
from densarm.scene.loading import load_problems, load_scene
from densarm.scene.obstacles import Box, Cylinder

POSE: Any = {"position": [1.0, 0.1, 0.5], "orientation_xyzw": [0.0, 0.0, 0.0, 1.0]}
PROBLEM = {
    "scene": "box",
    "index": 2,
    "start": [0, -0.785],
    "goal": [0.1, 0.6],
    "obstacles": [
        {"name": "Can1", "type": "cylinder", "length": 0.14, "radius": 0.03, **POSE},
        {"name": "base", "type": "box", "size": [1.2, 1, 0.04], **POSE},
    ],
}
METADATA = {"robot": "panda", "joints": ["a", "b"], "locked_joints": {"finger": 0.065}}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("scenes")


def saved(
    folder: Path, problems: list[dict[str, Any]], metadata: dict[str, Any] = METADATA
) -> Path:
    path = folder / "problems.json"
    path.write_text(json.dumps({"metadata": metadata, "problems": problems}))
    return path


def test_problems(tmp_path: Path) -> None:
    first, second = load_problems(saved(tmp_path, [PROBLEM, {**PROBLEM, "index": 4}]))
    assert (first.robot, first.scene_name, first.index, second.index) == ("panda", "box", 2, 4)
    assert (first.joints, first.locked_joints) == (("a", "b"), {"finger": 0.065})
    assert (first.start, first.goal) == ((0.0, -0.785), (0.1, 0.6))
    can, base = first.scene
    assert can == Cylinder(name="Can1", length=0.14, radius=0.03, **POSE)
    assert base == Box(name="base", size=(1.2, 1, 0.04), **POSE)


def test_scene_of_a_single_problem(tmp_path: Path) -> None:
    path = saved(tmp_path, [PROBLEM])
    assert load_scene(path) == load_problems(path)[0].scene
    with pytest.raises(FileContentError, match="holds 2 problems, not one"):
        load_scene(saved(tmp_path, [PROBLEM] * 2))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"start": [0]}, r"problems\[1\]: start = \[0\]: must be of shape \(2,\)"),
        ({"goal": [0, None]}, r"problems\[1\]: goal = .*must be 2 numbers"),
        ({"index": "2"}, r"problems\[1\]: index = '2': must be an integer"),
        ({"obstacles": [{"type": "tree"}]}, r"problems\[1\]: unknown type of obstacle"),
        ({"obstacles": 3}, r"problems\[1\]: not of the form"),
    ],
)
def test_wrong_problems(tmp_path: Path, change: dict[str, Any], message: str) -> None:
    with pytest.raises(FileContentError, match=message) as caught:
        load_problems(saved(tmp_path, [PROBLEM, {**PROBLEM, **change}]))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("key", PROBLEM)
def test_missing_keys(tmp_path: Path, key: str) -> None:
    problem = {k: v for k, v in PROBLEM.items() if k != key}
    with pytest.raises(FileContentError, match=rf"problems\[0\]: the key '{key}' is missing"):
        load_problems(saved(tmp_path, [problem]))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{\n]", "line 2: not JSON"),
        ("[]", "not of the form of a list of problems"),
        ("{}", "the key 'metadata' is missing"),
        ("[" * 100_000, "not of the form of a list of problems"),
        ("9" * 5000, "not JSON"),
    ],
)
def test_wrong_files(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "problems.json"
    path.write_text(text)
    with pytest.raises(FileContentError, match=message) as caught:
        load_problems(path)
    assert "\n" not in str(caught.value)


JSON = st.recursive(
    st.one_of(st.none(), st.booleans(), st.integers(), st.floats(), st.text(max_size=3)),
    lambda inner: st.one_of(
        st.lists(inner, max_size=3), st.dictionaries(st.text(max_size=3), inner, max_size=3)
    ),
    max_leaves=5,
)


@settings(max_examples=50)
@given(junk=JSON, key=st.sampled_from([*PROBLEM, *METADATA]))
def test_wrong_values_raise_nothing_else(folder: Path, junk: Any, key: str) -> None:
    problem, metadata = ({**table, key: junk} for table in (PROBLEM, METADATA))
    with suppress(DensarmError):
        load_problems(saved(folder, [problem], metadata))
