"""The goal distance of a pose: its gradient wherever the frame is, and where its steps lead."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from densarm.arms.arm import Arm, load_arm
from densarm.arms.description import RobotDescription
from densarm.arms.pose import Pose
from densarm.density.pose_distance import LENGTH, PoseDistance
from densarm.errors import InvalidValueError, UnknownNameError
from densarm.values.arrays import Array

LINK = """<link name="{name}"><inertial><mass value="1"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial><collision><geometry>
<sphere radius="0.01"/></geometry></collision></link>"""
JOINT = """<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{name}_link"/>
<origin xyz="0.1 -0.2 0.3" rpy="0.4 0.5 -0.6"/><axis xyz="{axis}"/>
<limit lower="-3" upper="3" effort="50" velocity="1"/></joint>"""
KINDS = ("continuous", "prismatic", "revolute", "continuous", "prismatic", "revolute", "revolute")
AXES = ("0 0 1", "0 1 0", "1 0 0", "0 1 0", "1 0 0", "0 0 1", "0 1 0")
FREEDOMS = st.sampled_from(["whole", "position", "x", "y", "z"])
ANGLES = arrays(np.float64, len(KINDS), elements=st.floats(-3.0, 3.0))
# Near nothing to turn, where log is θ, and near half a turn, where it does not know which way.
TURNS = st.one_of(
    st.floats(0.0, math.pi),
    st.sampled_from([0.0, 1e-12, 1e-9, 1e-6, 1e-3]),
    st.sampled_from([0.0, 1e-12, 1e-9, 1e-6, 1e-3]).map(lambda near: math.pi - near),
)
DIRECTIONS = arrays(np.float64, 3, elements=st.floats(-1.0, 1.0)).map(
    lambda axis: axis / np.linalg.norm(axis) if np.linalg.norm(axis) > 1e-3 else np.eye(3)[0]
)


@pytest.fixture(scope="module")
def mixed() -> Arm:
    """An arm of slides, bounded and continuous joints whose axes are askew."""
    text, parent = LINK.format(name="base"), "base"
    for k, (kind, axis) in enumerate(zip(KINDS, AXES, strict=True)):
        text += LINK.format(name=f"j{k}_link")
        text += JOINT.format(name=f"j{k}", kind=kind, parent=parent, axis=axis)
        parent = f"j{k}_link"
    return Arm(RobotDescription(name="mixed", urdf=f'<robot name="mixed">{text}</robot>'))


def partial(pose: Pose, freedom: str) -> Pose:
    if freedom == "position":
        return Pose(pose.frame, pose.position)
    free = None if freedom == "whole" else freedom
    return Pose(pose.frame, pose.position, pose.orientation_xyzw, free)


def evaluated(distance: PoseDistance, q: Array) -> tuple[float, Array]:
    gradient = np.full(len(KINDS), np.nan)
    return distance.evaluate(q, q, gradient), gradient


@settings(max_examples=100)
@given(angles=ANGLES, turn=TURNS, axis=DIRECTIONS, shift=DIRECTIONS, freedom=FREEDOMS)
def test_gradient_is_the_derivative_however_far_is_left_to_turn(
    mixed: Arm,
    numerical_gradient: Callable[..., Array],
    angles: Array,
    turn: float,
    axis: Array,
    shift: Array,
    freedom: str,
) -> None:
    q = mixed.configuration(angles)
    goal = mixed.pose(q).moved(np.concatenate([turn * shift, turn * axis]))
    distance = PoseDistance(mixed, partial(goal, freedom))
    value, gradient = evaluated(distance, q)
    numerical = numerical_gradient(
        lambda p: evaluated(distance, p)[0], q, mixed.nv, mixed.integrate
    )
    np.testing.assert_allclose(gradient, numerical, rtol=1e-6, atol=1e-8 * (1.0 + value))


@settings(max_examples=80)
@given(angles=ANGLES, turn=TURNS, axis=DIRECTIONS, shift=DIRECTIONS)
def test_value_is_that_of_the_error_of_position_and_angle(
    mixed: Arm, angles: Array, turn: float, axis: Array, shift: Array
) -> None:
    q = mixed.configuration(angles)
    goal = mixed.pose(q).moved(np.concatenate([0.2 * shift, turn * axis]))
    distance = PoseDistance(mixed, goal)
    expected = 0.5 * (0.2 / LENGTH) ** 2 + 2.0 * math.sin(0.5 * turn) ** 2
    assert evaluated(distance, q)[0] == pytest.approx(expected, rel=1e-9)
    assert distance.off(q) == pytest.approx((0.2, turn), abs=1e-7)


@settings(max_examples=60)
@given(angles=ANGLES, turn=st.floats(-3.0, 3.0), freedom=FREEDOMS)
def test_is_zero_at_the_pose_and_where_what_is_free_is_turned(
    mixed: Arm, angles: Array, turn: float, freedom: str
) -> None:
    q = mixed.configuration(angles)
    here = mixed.pose(q)
    axis = {"position": np.ones(3) / math.sqrt(3.0), "whole": np.zeros(3)}.get(freedom)
    if axis is None:
        axis = here.placement.rotation[:, "xyz".index(freedom)]
    goal = here.moved(np.concatenate([np.zeros(3), turn * axis]))
    value, gradient = evaluated(PoseDistance(mixed, partial(goal, freedom)), q)
    assert value == pytest.approx(0.0, abs=1e-28)
    np.testing.assert_allclose(gradient, np.zeros(mixed.nv), atol=1e-13)


def test_keeps_tiny_errors(mixed: Arm) -> None:
    q = mixed.configuration(np.full(mixed.nv, 0.3))
    goal = mixed.pose(q).moved(np.array([0.0, 0.0, 0.0, 1e-8, 0.0, 0.0]))
    assert evaluated(PoseDistance(mixed, goal), q)[0] == pytest.approx(0.5e-16, rel=1e-6)


@settings(max_examples=60)
@given(angles=ANGLES, turn=TURNS, axis=DIRECTIONS, shift=DIRECTIONS, freedom=FREEDOMS)
def test_the_step_is_the_gradient_in_the_metric_and_leads_down(
    mixed: Arm, angles: Array, turn: float, axis: Array, shift: Array, freedom: str
) -> None:
    q = mixed.configuration(angles)
    goal = mixed.pose(q).moved(np.concatenate([0.1 * shift, turn * axis]))
    distance = PoseDistance(mixed, partial(goal, freedom))
    value, gradient = evaluated(distance, q)
    step = distance.step()
    np.testing.assert_allclose(distance.metric @ step, -gradient, atol=1e-9)
    assert evaluated(distance, mixed.integrate(q, 0.005 * step))[0] <= value + 1e-15


@pytest.mark.parametrize("freedom", ["whole", "position", "z"])
def test_steps_lead_to_the_pose(mixed: Arm, freedom: str) -> None:
    q = mixed.configuration(np.linspace(-0.7, 0.9, mixed.nv))
    goal = mixed.pose(q).moved(np.array([0.1, -0.05, 0.1, 0.5, -0.3, 0.4]))
    distance = PoseDistance(mixed, partial(goal, freedom))
    for _ in range(15):
        evaluated(distance, q)
        q = mixed.integrate(q, distance.step())
    assert evaluated(distance, q)[0] < 1e-20


@settings(max_examples=40)
@given(angles=ANGLES, twist=arrays(np.float64, 6, elements=st.floats(-0.2, 0.2)))
def test_an_arm_that_follows_a_twist_keeps_the_frame_at_the_goal(
    mixed: Arm, angles: Array, twist: Array
) -> None:
    q, dt = mixed.configuration(angles), 1e-4
    pose = mixed.pose(q)
    distance = PoseDistance(mixed, pose)
    evaluated(distance, q)
    weakest = np.linalg.eigvalsh(distance.metric)[1]  # the first is of the joint to spare
    ahead = mixed.integrate(q, dt * distance.following(twist))
    distance.set_pose(pose.moved(dt * twist))
    position, turn = distance.off(ahead)
    lost = 1e-4 / weakest * np.linalg.norm(twist) / LENGTH
    assert max(position / LENGTH, turn) <= dt * (lost + 1e-3 + 1e-2 * np.linalg.norm(twist))


def test_a_far_base_counts() -> None:
    base = pin.SE3(np.eye(3), np.array([1000.0, -2000.0, 5.0]))
    far = load_arm("panda", base_placement=base)
    ready = far.postures["ready"]
    position, turn = PoseDistance(far, far.pose(ready)).off(ready)
    assert max(position, turn) < 1e-7


@pytest.mark.parametrize(
    ("frame", "error"), [("nowhere", UnknownNameError), ("base", InvalidValueError)]
)
def test_a_frame_that_cannot_be_led_is_refused_and_the_old_pose_kept(
    mixed: Arm, frame: str, error: Any
) -> None:
    q = mixed.configuration(np.zeros(mixed.nv))
    distance = PoseDistance(mixed, mixed.pose(q))
    with pytest.raises(error, match="frame"):
        distance.set_pose(Pose(frame, [0, 0, 0]))
    assert evaluated(distance, q)[0] == pytest.approx(0.0, abs=1e-28)
