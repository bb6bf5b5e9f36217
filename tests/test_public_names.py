import ast
import importlib
import json
import pkgutil
import subprocess
import sys
from pathlib import Path

import pytest

import densarm

HEAVY = {"matplotlib", "meshcat", "numba", "ompl", "scipy"}


def typed_names() -> dict[str, str]:
    """Name to module, as the imports for type checkers have it."""
    tree = ast.parse(Path(densarm.__file__).read_text(encoding="utf-8"))
    block = next(node for node in tree.body if isinstance(node, ast.If))
    imports = [node for node in block.body if isinstance(node, ast.ImportFrom)]
    return {alias.name: node.module or "" for node in imports for alias in node.names}


def modules_after(statement: str) -> set[str]:
    script = f"{statement}\nimport json, sys\nprint(json.dumps(list(sys.modules)))"
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    return set(json.loads(done.stdout))


@pytest.mark.parametrize("name", densarm.__all__)
def test_public_name_can_be_used(name):
    assert getattr(densarm, name) is not None
    assert name in dir(densarm)


def test_type_checkers_see_the_same_names():
    typed = typed_names()
    assert {*typed, "__version__"} == set(densarm.__all__)
    for name, module in typed.items():
        assert getattr(importlib.import_module(module), name) is getattr(densarm, name)


def test_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="no attribute 'load_arms'"):
        densarm.load_arms  # noqa: B018


def test_import_loads_nothing_else_of_densarm_and_nothing_heavy():
    after = modules_after("import densarm")
    assert {name for name in after if name.startswith("densarm")} == {"densarm"}
    assert after & (HEAVY | {"numpy", "pinocchio", "coal"}) == set()


def test_no_module_hides_a_public_name():
    modules = {module.name for module in pkgutil.iter_modules(densarm.__path__)}
    assert modules & set(densarm.__all__) == set()
