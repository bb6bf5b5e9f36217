"""The parsers, real files to start from, and how their files are mutated."""

import json
import shutil
import tomllib
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from random import Random
from typing import Any

import yaml

import densarm
from densarm import Arm
from densarm.arms.catalogue import robots_folder, scenario_paths
from fuzzing import mutations
from fuzzing.mutations import Draw

DATA = Path(__file__).parents[2] / "tests" / "data"

SCENE = """(noname)
* table top
0.5 0 0.2
0 0 0 1
2
box
1 2 0.1
0 0 0
0 0 0 1
0 0 0 0
mesh
4 2
0 0 0
1 0 0
0 1 0
0 0 1
0 1 2
0 2 3
0 0 1
0 0 0 1
0 0 0 0
1
grip
0 0 0.1
0 0 0 1
* ball
0 0 1
0 0 0 1
1
sphere
0.1
0 0 0
0 0 0 1
1 0 0 1
0
.
"""
PLANNING_SCENE = """
robot_state:
  attached_collision_objects:
    - link_name: hand
      touch_links: [left, right]
      weight: 0.5
      object:
        header: {frame_id: hand}
        id: bar
        primitives: [{type: 1, dimensions: [0.02, 0.5, 0.02]}]
        primitive_poses: [{position: {z: 0.1}, orientation: {x: 0, y: 0, z: 0, w: 0}}]
        operation: 0
world:
  collision_objects:
    - id: table
      pose: {position: {x: 1.0, y: 0, z: 0}, orientation: {x: 0, y: 0, z: 1, w: 0}}
      primitives: [{type: box, dimensions: [1, 1, 0.1]}, {type: cone, dimensions: [1, 0.1]}]
      meshes: [{vertices: [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], triangles: []}]
      planes: [{coef: [0, 0, 2, 1]}]
      operation: 0
  octomap: {header: {frame_id: ''}, octomap: {data: []}}
"""
POSE = {"position": [1.0, 0.1, 0.5], "orientation_xyzw": [0.0, 0.0, 0.0, 1.0]}
CORNERS = [f"vertex {corner}\n" for corner in ("0 0 0", "1 0 0", "0 1 0", "0 0 1")]
LOOPS = ["".join(CORNERS[:k] + CORNERS[k + 1 :]) for k in range(4)]
FACETS = [f"facet normal 0 0 0\nouter loop\n{loop}endloop\nendfacet\n" for loop in LOOPS]
STL = f"solid it\n{''.join(FACETS)}endsolid it\n"
NODES = b"""<node><matrix>0 -1 0 5 1 0 0 0 0 0 2 7 0 0 0 1</matrix>
<node><translate>1 0 0</translate><rotate>0 0 1 90</rotate><scale>2 1 1</scale>
<instance_geometry url="#wedge"/></node>"""
PROBLEMS = {
    "metadata": {"robot": "panda", "joints": ["a", "b"], "locked_joints": {"finger": 0.065}},
    "problems": [
        {
            "scene": "box",
            "index": 2,
            "start": [0, -0.785],
            "goal": [0.1, 0.6],
            "obstacles": [
                {"name": "can", "type": "cylinder", "length": 0.14, "radius": 0.03, **POSE},
                {"name": "base", "type": "box", "size": [1.2, 1, 0.04], **POSE},
            ],
        }
    ],
}


Mutation = Callable[[bytes, Random, Draw], bytes]


@dataclass(frozen=True)
class Target:
    """A parser and the files that it is given."""

    suffix: str
    parse: Callable[[Path], Any]
    seeds: tuple[bytes, ...]
    mutate: Mutation
    """From a seed, a source of random choices and hypothesis' draw to a file."""


def _text(content: bytes, random: Random, _: Draw) -> bytes:
    return mutations.mutated_text(content, random)


def _structured(load: Callable[[str], Any], dump: Callable[[Any], str]) -> Mutation:
    def mutate(content: bytes, random: Random, draw: Draw) -> bytes:
        value = mutations.mutated_value(load(content.decode()), random, draw)
        return dump(value).encode("utf-8", "surrogatepass")

    return mutate


def _toml(value: Any) -> str:
    return mutations.toml(value) if isinstance(value, dict) else mutations.dumped(value)


def _xml(content: bytes, random: Random, _: Draw) -> bytes:
    return mutations.mutated_xml(content, random)


def _yaml(text: str) -> Any:
    return next(iter(yaml.safe_load_all(text)))


def _mesh(path: Path) -> densarm.Mesh:
    return densarm.Mesh(name="it", path=path)


def _with_srdf(path: Path) -> Arm:
    return densarm.load_arm(DATA / "branching.urdf", srdf=path)


def _run_file(folder: Path) -> bytes:
    scenario = densarm.load_scenario("swing_up")
    arm = scenario.arm
    short = replace(scenario, start=arm.configuration((0.02, 0.0)), goal=arm.postures["hanging"])
    path = folder / "seed.npz"
    densarm.run(replace(short, scene=densarm.Scene([]))).save(path)
    content = path.read_bytes()
    path.unlink()
    return content


def targets(folder: Path) -> dict[str, Target]:
    """Return all parsers by name, with what their files refer to in a folder."""
    shutil.copytree(DATA / "meshes", folder / "meshes")
    robot = (robots_folder() / "two_link" / "robot.urdf").read_bytes()
    tree = (DATA / "branching.urdf").read_bytes()
    in_centimetres = tree.replace(b"wedge.stl", b"wedge_cm.dae")
    collada, stl = ((DATA / "meshes" / name).read_bytes() for name in ("wedge_cm.dae", "wedge.stl"))
    scenarios = tuple(path.read_bytes() for path in scenario_paths().values())
    problems = json.dumps(PROBLEMS).encode()
    return {
        "scenario": Target(
            ".toml", densarm.load_scenario, scenarios, _structured(tomllib.loads, _toml)
        ),
        "run": Target(".npz", densarm.Run.load, (_run_file(folder),), mutations.mutated_npz),
        "problems": Target(
            ".json", densarm.load_problems, (problems,), _structured(json.loads, mutations.dumped)
        ),
        "urdf": Target(".urdf", densarm.load_arm, (robot, tree, in_centimetres), _xml),
        "srdf": Target(".srdf", _with_srdf, ((DATA / "branching.srdf").read_bytes(),), _xml),
        "scene": Target(".scene", densarm.load_scene, (SCENE.encode(),), _text),
        "yaml": Target(
            ".yaml",
            densarm.load_scene,
            (PLANNING_SCENE.encode(), f"---{PLANNING_SCENE}---\n".encode()),
            _structured(_yaml, lambda value: f"{mutations.dumped(value)}\n---\n"),
        ),
        "dae": Target(".dae", _mesh, (collada, collada.replace(b"<node>", NODES)), _xml),
        "stl": Target(".stl", _mesh, (STL.encode(), STL.upper().encode(), stl), _text),
    }


NAMES = ("scenario", "run", "problems", "urdf", "srdf", "scene", "yaml", "dae", "stl")
