"""The tree is the block diagram: data flows down the list of layers, imports point up it."""

import ast
import subprocess
import sys
from collections.abc import Iterator
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

import densarm

PACKAGE = Path(densarm.__file__).parent

# A module or folder imports from its own line and from those above it, never in a circle.
LAYERS = (
    (
        "arrays",
        "atomic_file",
        "captured_stderr",
        "compiled",
        "configuration_space",
        "errors",
        "outcome",
        "tables",
        "validation",
    ),
    ("fitted_capsule",),
    ("shapes", "mesh_file"),
    ("obstacles", "mesh", "obstacle_table"),
    ("attachment", "scene"),
    ("robot", "catalogue"),
    ("scene_files",),
    ("arm",),
    ("holding_torque", "joint_torques", "rigid_body"),
    ("distance_view", "pair_gradients", "changing_obstacles", "clearance"),
    ("proof", "clear_configurations"),
    ("density",),
    ("guides",),
    ("fields",),
    ("reference",),
    ("control",),
    ("simulation",),
    ("scenario",),
    ("motion_plan", "feasibility"),
    ("certificates",),
    ("trajectory",),
    ("closed_loop",),
    ("bench",),
    ("study",),
    ("visualization",),
    ("__init__",),
    ("cli",),
    ("__main__",),
)
RANK = {name: rank for rank, layer in enumerate(LAYERS) for name in layer}

HEAVY = {"matplotlib", "meshcat", "mujoco", "numba", "ompl", "scipy", "toppra"}
VAGUE = {"core", "helper", "helpers", "manager", "util", "utils"}
MAX_LINES = 299


def module_name(package: Path, file: Path) -> str:
    """Dotted name inside the package; a folder's __init__ goes by the folder's name."""
    parts = file.relative_to(package).with_suffix("").parts
    return ".".join(parts[:-1] if len(parts) > 1 and parts[-1] == "__init__" else parts)


def imported_modules(package: Path, file: Path, modules: set[str]) -> set[str]:
    """Modules of the package that a file imports, wherever in the file it does."""
    dotted = {
        name
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8")))
        for name in imported_names(package, file, node)
    }
    inside = {name for name in dotted if name.split(".")[0] == package.name}
    return {nearest_module(name.split(".")[1:], modules) for name in inside}


def imported_names(package: Path, file: Path, node: ast.AST) -> Iterator[str]:
    if isinstance(node, ast.Import):
        yield from (alias.name for alias in node.names)
    elif isinstance(node, ast.ImportFrom):
        folder = [package.name, *file.relative_to(package).parent.parts]
        start = folder[: len(folder) + 1 - node.level] if node.level else []
        origin = ".".join([*start, *([node.module] if node.module else [])])
        yield from (f"{origin}.{alias.name}" for alias in node.names)


def nearest_module(parts: list[str], modules: set[str]) -> str:
    """The module that `a.b.name` comes from: itself, or the nearest parent that is one."""
    while parts and ".".join(parts) not in modules:
        parts = parts[:-1]
    return ".".join(parts) or "__init__"


def violations(package: Path) -> list[str]:
    files = {module_name(package, file): file for file in sorted(package.rglob("*.py"))}
    graph = {name: imported_modules(package, file, set(files)) for name, file in files.items()}
    return [*misplaced(graph), *circular(graph), *oversized(files), *vaguely_named(files)]


def misplaced(graph: dict[str, set[str]]) -> Iterator[str]:
    for unit in sorted({name.split(".")[0] for name in graph} - set(RANK)):
        yield f"{unit} has no layer: give it one in LAYERS"
    for name, imports in graph.items():
        for other in sorted(imports):
            rank, other_rank = (RANK.get(n.split(".")[0]) for n in (name, other))
            if None not in (rank, other_rank) and other_rank > rank:
                yield f"{name} imports {other}, which is below it"


def circular(graph: dict[str, set[str]]) -> Iterator[str]:
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        yield "circular: " + " -> ".join(error.args[1])


def oversized(files: dict[str, Path]) -> Iterator[str]:
    for name, file in files.items():
        lines = len(file.read_text(encoding="utf-8").splitlines())
        if lines > MAX_LINES:
            yield f"{name} has {lines} lines, of at most {MAX_LINES}"


def vaguely_named(files: dict[str, Path]) -> Iterator[str]:
    for name in files:
        if VAGUE & set(name.replace(".", "_").split("_")):
            yield f"{name} does not say what it holds"


def heavy_modules_after(statement: str) -> set[str]:
    script = f"{statement}\nimport sys\nprint(*sys.modules)"
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    return HEAVY & set(done.stdout.split())


def test_package_keeps_its_architecture():
    assert violations(PACKAGE) == []


def test_import_densarm_is_light():
    assert heavy_modules_after("import densarm") == set()


def test_heavy_import_is_seen():
    assert heavy_modules_after("import scipy") == {"scipy"}


def write_tree(package: Path, files: dict[str, str]) -> Path:
    for name, text in {"__init__.py": "", **files}.items():
        path = package / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    return package


def test_orderly_tree_passes(tmp_path):
    tree = write_tree(
        tmp_path / "densarm",
        {
            "__init__.py": "from densarm.arm import Arm\n",
            "errors.py": "import sys\n",
            "arm.py": "from densarm.errors import DensarmError\nimport densarm.validation\n",
            "validation.py": "from densarm import errors\n",
            "density/__init__.py": "from densarm.density.smooth_step import smooth_step\n",
            "density/smooth_step.py": "from ..arm import Arm\n",
            "cli.py": "from densarm import Arm\nfrom densarm.density import smooth_step\n",
        },
    )
    assert violations(tree) == []


@pytest.mark.parametrize(
    ("files", "expected"),
    [
        (
            {"errors.py": "from densarm.arm import Arm\n", "arm.py": ""},
            "errors imports arm, which is below it",
        ),
        (
            {"arm.py": "def load():\n    import densarm.cli as cli\n", "cli.py": ""},
            "arm imports cli, which is below it",
        ),
        (
            {"arm.py": "from . import clearance\n", "clearance.py": ""},
            "arm imports clearance, which is below it",
        ),
        (
            {"density/field.py": "from ..control.law import Law\n", "control/law.py": ""},
            "density.field imports control.law, which is below it",
        ),
        ({"arm.py": "from densarm import Scene\n"}, "arm imports __init__, which is below it"),
        (
            {
                "density/__init__.py": "from .bump import bump\n",
                "density/bump.py": "from densarm.density import x",
            },
            "circular: density -> density.bump -> density",
        ),
        ({"novelty.py": ""}, "novelty has no layer: give it one in LAYERS"),
        ({"arm.py": "\n" * 300}, "arm has 300 lines, of at most 299"),
        ({"density/bump_utils.py": ""}, "density.bump_utils does not say what it holds"),
    ],
)
def test_offending_tree_is_caught(tmp_path, files, expected):
    assert violations(write_tree(tmp_path / "densarm", files)) == [expected]
