"""What every arm of the catalogue keeps to."""

from functools import cache
from itertools import combinations

import numpy as np
import pytest

from densarm.arm import Arm, load_arm
from densarm.bench.problem_results import run_problem
from densarm.bench.random_problems import random_problems
from densarm.catalogue import robot_names
from densarm.clearance import Clearance
from densarm.outcome import Outcome
from densarm.robot.outline import robot_outline
from densarm.robot.robot_description import parse_robot_xml
from densarm.robot.self_collision import Exclusion
from densarm.scene import Scene

loaded = cache(load_arm)


@pytest.fixture(params=robot_names())
def arm(request) -> Arm:
    return loaded(request.param)


def test_arms_that_people_have_are_known():
    known = {"panda", "ur3", "ur5", "ur10", "xarm7", "z1", "kinova", "so100", "so101"}
    assert known | {"two_link", "three_link"} <= set(robot_names())


def test_postures_touch_nothing_and_are_within_limits(arm):
    assert "ready" in arm.postures
    clearance = Clearance(arm, Scene([]))
    for name, q in arm.postures.items():
        angles = arm.angles(q)
        assert (clearance.distances(q) > 0.0).all(), name
        assert ((angles >= arm.limits.lower) & (angles <= arm.limits.upper)).all(), name


def test_limits_are_stated_and_carry_the_ready_posture(arm):
    limits = arm.limits
    for limit in (limits.velocity, limits.acceleration, limits.effort):
        assert np.isfinite(limit).all()
        assert (limit > 0.0).all()
    assert (limits.lower[~arm.is_circle] < limits.upper[~arm.is_circle]).all()
    weight = arm.nonlinear_effects(arm.postures["ready"], np.zeros(arm.nv))
    assert (np.abs(weight) < limits.effort).all()


def test_end_effector_moves_with_the_last_joint(arm):
    assert arm.model.frames[arm.end_effector_frame].parentJoint == arm.model.njoints - 1


def test_every_two_shapes_that_move_against_each_other_are_checked_or_listed(arm):
    items = list(arm.collision_model.geometryObjects)
    moving = {
        frozenset((a.name, b.name))
        for a, b in combinations(items, 2)
        if a.parentJoint != b.parentJoint
    }
    checked = {frozenset(pair) for pair in Clearance(arm, Scene([])).pairs}
    left_out = {frozenset(pair.shapes) for pair in arm.excluded_pairs}
    assert checked | left_out == moving
    assert not checked & left_out


def test_outline_without_meshes_is_that_of_the_arm(arm):
    moving = [item for item in arm.collision_model.geometryObjects if item.parentJoint > 0]
    own, left_out = len(arm.collision_model.collisionPairs), len(arm.excluded_pairs)
    assert robot_outline(arm.description) == (arm.nv, len(moving), own, left_out)


def test_every_link_that_is_drawn_can_collide(arm):
    if arm.name in {"two_link", "three_link"}:
        assert arm.links_without_collision == ("base",)
        return
    frames = [item.parentFrame for item in arm.collision_model.geometryObjects]
    links = parse_robot_xml(arm.description.urdf, "URDF").findall("link")
    drawn = {link.get("name") for link in links if link.find("visual") is not None}
    assert drawn
    assert drawn <= {arm.model.frames[frame].name for frame in frames}


def test_no_named_arm_needs_a_pair_left_out_since_it_always_collides(arm):
    assert Exclusion.ALWAYS not in {pair.reason for pair in arm.excluded_pairs}


@pytest.mark.parametrize(
    ("name", "seed"), [("three_link", 2), ("xarm7", 1), ("z1", 1), ("ur5", 2), ("kinova", 1)]
)
def test_between_random_configurations(name, seed):
    result = run_problem(random_problems(name, 1, seed, "none")[0])
    assert (result.outcome, result.certified) == (Outcome.REACHED, True), result.detail
