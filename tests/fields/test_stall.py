"""Stalls, on a ball that two slides carry in a plane: joint space is the plane itself."""

import numpy as np
import pytest

from densarm.arm import load_arm
from densarm.clearance import Clearance
from densarm.density import (
    DensityParameters,
    JointLimitSet,
    NavigationDensity,
    NearClearanceSet,
    NearPairs,
    TorusDistance,
)
from densarm.fields import GuidedDensity, PlanningSystem, SensingParameters, SubGoalChain
from densarm.fields.critical_point import CriticalKind
from densarm.fields.stall import find_stall
from densarm.guides import DirectGuide
from densarm.proof.swept_bound import SweptBound
from densarm.scene import Box, Scene, Sphere

LINK = """<link name="{name}"><inertial><mass value="1"/>
  <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>{body}</link>"""
JOINT = """<joint name="{name}" type="prismatic"><parent link="{parent}"/><child link="{child}"/>
  <axis xyz="{axis}"/><limit lower="-1" upper="1" effort="50" velocity="1"/></joint>"""
BALL = '<collision><geometry><sphere radius="0.1"/></geometry></collision>'
URDF = "".join(
    [
        '<robot name="slides"><link name="base"/>',
        LINK.format(name="bridge", body=""),
        LINK.format(name="ball", body=BALL),
        JOINT.format(name="along", parent="base", child="bridge", axis="1 0 0"),
        JOINT.format(name="across", parent="bridge", child="ball", axis="0 1 0"),
        "</robot>",
    ]
)
DISC = Sphere(name="disc", radius=0.2)
WALL = Box(name="wall", size=(0.1, 1.0, 0.2))


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    path = tmp_path_factory.mktemp("slides") / "slides.urdf"
    path.write_text(URDF, encoding="utf-8")
    return load_arm(path)


def stall_of(arm, obstacle, goal, q):
    pairs = NearPairs(SweptBound(Clearance(arm, Scene([obstacle]))))
    clearance_set = NearClearanceSet(pairs, 0.0, 0.05)
    sets = [clearance_set, JointLimitSet(arm, 0.1)]
    density = NavigationDensity(sets, TorusDistance(arm, np.array(goal), kappa=np.inf))
    return density, find_stall(density, clearance_set, np.full(2, 0.1), np.array(q))


def around(density, q, radius=2e-3):
    """How ρ at points around q differs from ρ at q, in its logarithm."""
    turns = np.linspace(0.0, 2.0 * np.pi, 361)
    ring = q + radius * np.column_stack([np.cos(turns), np.sin(turns)])
    here = density.evaluate(q).log_value
    return np.array([density.evaluate(point).log_value for point in ring]) - here


def test_behind_a_disc_is_a_saddle(arm):
    # Nearly where the disc holds the ball: beyond it by the sensing distance at most.
    density, stall = stall_of(arm, DISC, (0.6, 0.0), (-0.345, 0.0))
    assert stall.kind is CriticalKind.SADDLE
    assert stall.blocking == ("ball_0 and disc",)
    assert stall.description.startswith("saddle of the density at joint positions (-0.345, 0)")
    rise = around(density, np.array([-0.3432, 0.0]), 0.03)
    assert (rise > 0.0).any()
    assert (rise < 0.0).any()


@pytest.mark.parametrize("across", [0.0, 0.2])
def test_behind_a_wall_is_a_maximum(arm, across):
    goal = (0.6, across)
    bound = SweptBound(Clearance(arm, Scene([WALL])))
    start = np.array([-0.6, -0.1])
    path = DirectGuide().plan(start, np.array(goal), 0)
    chain = SubGoalChain(bound, path, SensingParameters())
    distance = TorusDistance(arm, np.array(goal), kappa=np.inf)
    guided = GuidedDensity(bound, chain, DensityParameters(), distance)
    curve = PlanningSystem(guided, bound).integrate(start)
    assert not curve.reached
    assert curve.detail.startswith("maximum of the density at joint positions (-0.1")
    assert curve.detail.endswith("blocked by ball_0 and wall")
    density, stall = stall_of(arm, WALL, goal, curve.q[-1])
    assert stall.kind is CriticalKind.MAXIMUM
    assert (around(density, curve.q[-1]) < 0.0).all()


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_position_limit_that_blocks_is_named(arm, side):
    # Of a goal nearer to the limit than ρ senses it, the limit keeps off who comes from inside.
    far = Sphere(name="far", radius=0.1, position=(0.0, 0.0, 2.0))
    _, stall = stall_of(arm, far, (0.0, side * 0.995), (0.0, side * 0.95))
    assert stall.blocking == (f"the {'upper' if side > 0 else 'lower'} limit of joint 'across'",)
    assert stall.kind is CriticalKind.MAXIMUM


def test_where_nothing_is_critical_nothing_is_decided(arm):
    _, stall = stall_of(arm, DISC, (0.6, 0.0), (-0.8, 0.5))
    assert stall.kind is None
    assert stall.blocking == ()
    assert "not decided" in stall.description
    assert "nothing sensed there" in stall.description
