"""What every arm of the catalogue keeps to."""

from functools import cache
from itertools import combinations

import numpy as np
import pinocchio as pin
import pytest

from densarm.arms.arm import Arm, load_arm
from densarm.arms.catalogue import (
    robot_description,
    robot_names,
    robots_folder,
    scenario_paths,
)
from densarm.arms.description import parse_robot_xml
from densarm.arms.models import robot_outline
from densarm.arms.self_collision import Exclusion
from densarm.errors import UnknownNameError
from densarm.scene.scene import Scene
from densarm.world.world import World

loaded = cache(load_arm)

# Meshes of many triangles take seconds to load, and the first time to cut into pieces.
LARGE = {"kinova", "so100", "so101", "z1"}
SLOW = [pytest.param(name, marks=pytest.mark.slow) for name in sorted(LARGE)]


@pytest.fixture(params=[*(name for name in robot_names() if name not in LARGE), *SLOW])
def arm(request: pytest.FixtureRequest) -> Arm:
    return loaded(request.param)


def test_arms_that_people_have_are_known() -> None:
    known = {"panda", "ur3", "ur5", "ur10", "xarm7", "z1", "kinova", "so100", "so101"}
    assert known | {"two_link", "three_link"} <= set(robot_names())


@pytest.mark.slow
def test_postures_touch_nothing_and_are_within_limits(arm: Arm) -> None:
    assert "ready" in arm.postures
    clearance = World(arm, Scene([]))
    for name, q in arm.postures.items():
        angles = arm.angles(q)
        assert (clearance.distances(q) > 0.0).all(), name
        assert ((angles >= arm.limits.lower) & (angles <= arm.limits.upper)).all(), name


def test_limits_are_stated_and_carry_the_ready_posture(arm: Arm) -> None:
    limits = arm.limits
    for limit in (limits.velocity, limits.acceleration, limits.effort):
        assert np.isfinite(limit).all()
        assert (limit > 0.0).all()
    assert (limits.lower[~arm.continuous] < limits.upper[~arm.continuous]).all()
    weight = arm.nonlinear_effects(arm.postures["ready"], np.zeros(arm.nv))
    assert (np.abs(weight) < limits.effort).all()


def test_end_effector_moves_with_the_last_joint(arm: Arm) -> None:
    assert arm.model.frames[arm.end_effector_frame].parentJoint == arm.model.njoints - 1


def whole_shapes(arm: Arm) -> list[pin.GeometryObject]:
    return [x for x in arm.collision_model.geometryObjects if x.name not in arm.self_pieces]


def checked_pairs(arm: Arm) -> set[frozenset[str]]:
    """Pairs of whole shapes, a piece counting as what it is of."""
    whole = {name: name.rpartition(".")[0] for name in arm.self_pieces}
    pairs = World(arm, Scene([])).pairs
    return {frozenset(whole.get(name, name) for name in pair) for pair in pairs}


def test_every_two_shapes_that_move_against_each_other_are_checked_or_listed(arm: Arm) -> None:
    moving = {
        frozenset((a.name, b.name))
        for a, b in combinations(whole_shapes(arm), 2)
        if a.parentJoint != b.parentJoint
    }
    checked = checked_pairs(arm)
    left_out = {frozenset(pair.shapes) for pair in arm.excluded_pairs}
    assert checked | left_out == moving
    assert not checked & left_out


def test_outline_without_meshes_is_that_of_the_arm(arm: Arm) -> None:
    moving = [item for item in whole_shapes(arm) if item.parentJoint > 0]
    own, left_out = len(checked_pairs(arm)), len(arm.excluded_pairs)
    assert robot_outline(arm.description) == (arm.nv, len(moving), own, left_out)


def test_every_link_that_is_drawn_can_collide(arm: Arm) -> None:
    if arm.name in {"two_link", "three_link"}:
        assert arm.links_without_collision == ("base",)
        return
    frames = [item.parentFrame for item in arm.collision_model.geometryObjects]
    links = parse_robot_xml(arm.description.urdf, "URDF").findall("link")
    drawn = {link.get("name") for link in links if link.find("visual") is not None}
    assert drawn
    assert drawn <= {arm.model.frames[frame].name for frame in frames}


def test_no_named_arm_needs_a_pair_left_out_since_it_always_collides(arm: Arm) -> None:
    assert Exclusion.ALWAYS not in {pair.reason for pair in arm.excluded_pairs}


@pytest.mark.slow
def test_catalogue() -> None:
    assert {"two_link", "panda"} <= set(robot_names())
    assert {"swing_up", "panda_table", "panda_shelf"} <= set(scenario_paths())
    for name in robot_names():
        assert (robots_folder() / name / "arm.toml").is_file()
        assert loaded(name).name == name
    with pytest.raises(UnknownNameError, match=r"'tow_link'; did you mean 'two_link'"):
        robot_description("tow_link")
