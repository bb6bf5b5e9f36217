"""Links whose hulls overlap where they do not themselves are checked by their convex pieces."""

import os
from dataclasses import replace
from itertools import product
from pathlib import Path

import coal
import numpy as np
import pinocchio as pin
import pytest

from densarm.arms import catalogue, link_pieces
from densarm.arms.arm import Arm, load_arm
from densarm.arms.catalogue import robot_description
from densarm.arms.convex_pieces import ConvexTree, convex_tree
from densarm.arms.self_collision import Exclusion
from densarm.scene.obstacles import Sphere
from densarm.scene.scene import Attachment, Scene
from densarm.values.arrays import Array
from densarm.world.world import World

INERTIAL = (
    '<inertial><mass value="1"/>'
    '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
)
CORNERS = np.array(list(product((-1.0, 1.0), repeat=3)))
FACES = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]


def fork(folder: Path, lift: str = "-0.6 0.6", slide: str = "-0.6 0.6") -> Path:
    """An arm that lifts and slides a fork, two bars 0.1 m thick, past a tongue 0.2 m wide."""
    bars = [CORNERS * [0.05, 0.1, 0.3] + [x, 0.0, 0.0] for x in (-0.3, 0.3)]
    lines = [f"v {x:g} {y:g} {z:g}" for x, y, z in np.vstack(bars)]
    for first in (1, 9):
        lines += [f"f {first + a} {first + b} {first + c}" for a, b, c, _ in FACES]
        lines += [f"f {first + a} {first + c} {first + d}" for a, _, c, d in FACES]
    (folder / "fork.obj").write_text("\n".join(lines))
    shapes = {
        "tongue": '<box size="0.2 0.2 0.2"/>',
        "stem": "",
        "fork": '<mesh filename="fork.obj"/>',
    }
    text = "".join(
        f'<link name="{name}">{INERTIAL}'
        + (f"<collision><geometry>{shape}</geometry></collision></link>" if shape else "</link>")
        for name, shape in shapes.items()
    )
    joints = [("lift", "tongue", "stem", "0 0 1", lift), ("slide", "stem", "fork", "1 0 0", slide)]
    for name, parent, child, axis, limits in joints:
        low, high = limits.split()
        text += (
            f'<joint name="{name}" type="prismatic"><parent link="{parent}"/>'
            f'<child link="{child}"/><axis xyz="{axis}"/>'
            f'<limit lower="{low}" upper="{high}" effort="9" velocity="1"/></joint>'
        )
    path = folder / "fork.urdf"
    path.write_text(f'<robot name="fork">{text}</robot>')
    return path


@pytest.fixture(autouse=True)
def kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty folder for what is kept."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "kept"))
    return tmp_path / "kept"


def clearance(arm: Arm, *angles: float) -> float:
    return float(World(arm, Scene([])).distances(arm.configuration(angles)).min())


PAIRS = {("fork_0.1", "tongue_0"), ("fork_0.2", "tongue_0")}


def pairs_of(arm: Arm) -> set[tuple[str, ...]]:
    return {tuple(sorted(pair)) for pair in World(arm, Scene([])).pairs}


@pytest.mark.parametrize("shapes", ["hull", "pieces"])
def test_a_tongue_goes_into_a_fork(tmp_path: Path, shapes: str) -> None:
    arm = load_arm(fork(tmp_path), shapes=shapes)
    assert pairs_of(arm) == PAIRS
    assert clearance(arm, 0.0, 0.0) == pytest.approx(0.15, abs=1e-6)
    assert clearance(arm, 0.1, 0.1) == pytest.approx(0.05, abs=1e-6)
    assert clearance(arm, 0.0, 0.2) == pytest.approx(-0.05, abs=1e-6)  # into a bar
    assert clearance(arm, 0.5, 0.3) == pytest.approx(0.1, abs=1e-6)
    assert "neutral" in arm.postures


def test_capsules_stay_one(tmp_path: Path) -> None:
    arm = load_arm(fork(tmp_path), shapes="capsule")
    assert pairs_of(arm) == {("fork_0", "tongue_0")}
    assert "neutral" not in arm.postures


def test_obstacles_and_held_bodies_see_hulls_or_pieces(tmp_path: Path) -> None:
    ball = Sphere(name="ball", radius=0.1, position=(0.0, 0.0, 0.0))
    held = Attachment(Sphere(name="held", radius=0.01, position=(0.0, 0.0, 0.0)), "tongue")
    for shapes, seen in (("hull", {"fork_0"}), ("pieces", {"fork_0.1", "fork_0.2"})):
        arm = load_arm(fork(tmp_path), shapes=shapes)
        assert arm.self_pieces == ({"fork_0.1", "fork_0.2"} if shapes == "hull" else set())
        for world, name in (
            (World(arm, Scene([ball])), "ball"),
            (World(arm.holding(held), Scene([])), "held"),
        ):
            assert {pair[0] for pair in world.pairs if pair[1] == name} == seen


def test_hulls_that_always_overlap_are_checked_by_their_pieces(tmp_path: Path) -> None:
    for shapes in ("hull", "pieces"):
        arm = load_arm(fork(tmp_path, "-0.2 0.2", "-0.1 0.1"), shapes=shapes)
        assert pairs_of(arm) == PAIRS
        assert not [pair for pair in arm.excluded_pairs if pair.reason == Exclusion.ALWAYS]
        # The bars themselves always overlap with the tongue.
        arm = load_arm(fork(tmp_path, "-0.2 0.2", "0.2 0.3"), shapes=shapes)
        assert not pairs_of(arm)
        assert [pair.reason for pair in arm.excluded_pairs][-1] == Exclusion.ALWAYS


def test_hulls_stay_where_pieces_make_no_difference(tmp_path: Path) -> None:
    arm = load_arm(fork(tmp_path, "0.5 0.9"))
    assert pairs_of(arm) == {("fork_0", "tongue_0")}
    assert not arm.self_pieces
    assert not load_arm("panda").self_pieces


def test_pieces_are_made_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kept: Path) -> None:
    path, made = fork(tmp_path), list[int]()

    def counted(triangles: Array) -> ConvexTree:
        made.append(len(triangles))
        return convex_tree(triangles)

    monkeypatch.setattr(link_pieces, "convex_tree", counted)
    first = pairs_of(load_arm(path))
    assert pairs_of(load_arm(path)) == first
    load_arm(path, shapes="pieces")
    assert made == [24]
    for file in kept.iterdir():
        file.write_bytes(file.read_bytes()[:100])
    assert pairs_of(load_arm(path)) == first
    assert made == [24, 24]
    mesh = tmp_path / "fork.obj"
    mesh.write_text(mesh.read_text().replace("0.25", "0.2"))
    os.utime(mesh, (0, 0))  # coal sees changes by whole seconds
    assert clearance(load_arm(path), 0.0, 0.0) == pytest.approx(0.1, abs=1e-6)
    assert made == [24, 24, 24]


def test_pieces_are_known_wherever_the_base_is(tmp_path: Path, kept: Path) -> None:
    path = fork(tmp_path)
    load_arm(path)
    files = set(kept.iterdir())
    for angles in ((0.3, -2.0, 0.7), (0.0, 1.0, 0.0)):
        base = pin.SE3(pin.rpy.rpyToMatrix(*angles), np.array([0.1, -2.0, 7.0]))
        arm = load_arm(path, base_placement=base)
        assert pairs_of(arm) == PAIRS
        assert clearance(arm, 0.1, 0.1) == pytest.approx(0.05, abs=1e-6)
    assert set(kept.iterdir()) == files
    load_arm(fork(tmp_path, "-0.6 0.5"))  # another arm
    assert len(set(kept.iterdir()) - files) == 1


@pytest.mark.parametrize("bound", ["_CUT", "_LOOKED_AT"])
def test_links_that_take_too_long_stay_hulls(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, bound: str
) -> None:
    monkeypatch.setattr(link_pieces, bound, -1)
    arm = load_arm(fork(tmp_path))
    assert pairs_of(arm) == {("fork_0", "tongue_0")}
    assert clearance(arm, 0.0, 0.0) < 0.0


@pytest.mark.parametrize(("size", "x"), [(0.02, 0.3), (0.02, 0.0), (0.02, 0.9), (2.0, 0.0)])
def test_one_body_inside_the_other(tmp_path: Path, size: float, x: float) -> None:
    fork(tmp_path)
    mesh = coal.MeshLoader(coal.BV_OBB).load(str(tmp_path / "fork.obj"), np.ones(3))
    place = pin.SE3(np.eye(3), np.array([x, 0.0, 0.0]))
    items = [
        pin.GeometryObject("fork", 0, pin.SE3.Identity(), mesh),
        pin.GeometryObject("box", 0, place, coal.Box(size, size, size)),
    ]
    for first, second in (items, items[::-1]):
        model = pin.GeometryModel()
        for item in (first, second):
            model.addGeometryObject(item)
        model.addCollisionPair(pin.CollisionPair(0, 1))
        data = model.createData()
        pin.updateGeometryPlacements(pin.Model(), pin.Data(pin.Model()), model, data, np.empty(0))
        # In a bar; between the bars; beyond them; around them, which counts for meshes alone.
        assert link_pieces.one_inside_the_other(model, data, 0, {}) == (x == 0.3)


def test_a_named_arm_may_be_in_pieces(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "own").mkdir()
    entry = f'urdf = "{fork(tmp_path / "own").name}"\nshapes = "pieces"\n'
    (tmp_path / "own" / "arm.toml").write_text(entry)
    monkeypatch.setattr(catalogue, "robots_folder", lambda: tmp_path)
    arm = load_arm("own")
    assert pairs_of(arm) == PAIRS
    assert not arm.self_pieces  # they stand for the fork in all pairs
    assert load_arm("own", shapes="hull").self_pieces


@pytest.mark.slow
def test_a_ur5_without_srdf_can_fold_its_wrist(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("NUMBA_CACHE_DIR")
    arm = Arm(replace(robot_description("ur5"), srdf=None))
    assert ("forearm_link_0", "wrist_2_link_0") not in pairs_of(arm)
    folded = arm.configuration([1.9, -2.2, 1.3, 2.2, -0.6, 0.3])
    assert clearance(arm, *folded) > 0.006
    hulls, wrist = arm.collision_model.copy(), ("forearm_link_0", "wrist_2_link_0")
    hulls.removeAllCollisionPairs()
    hulls.addCollisionPair(pin.CollisionPair(*map(hulls.getGeometryId, wrist)))
    data = hulls.createData()
    pin.computeDistances(arm.model, arm.data, hulls, data, folded)
    assert data.distanceResults[0].min_distance < -0.015
