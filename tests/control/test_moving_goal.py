"""Goals that are set now and then: told or estimated velocities, and where they end."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from densarm.arms.arm import load_arm
from densarm.arms.pose import Pose
from densarm.control.moving_goal import MovingGoal
from densarm.control.regulation import DensityRegulation
from densarm.scene.scene import Scene
from densarm.simulation.plants import PinocchioPlant
from densarm.values.arrays import Array
from densarm.world.world import World

ARM = load_arm("two_link")
AT = ARM.configuration


@given(
    velocity=st.lists(st.floats(-1.5, 1.5), min_size=2, max_size=2),
    every=st.floats(0.002, 0.1),
    later=st.floats(0.0, 0.099),
)
def test_a_stream_of_goals_is_gone_on_from_at_its_own_velocity(
    velocity: list[float], every: float, later: float
) -> None:
    w, moving = np.array(velocity), MovingGoal(ARM, AT([0.2, -0.1]))
    moving.at(0.0)
    moving.set(ARM.integrate(AT([0.2, -0.1]), every * w), None)
    moving.at(every)
    goal, goes = moving.at(every + later)
    wanted = ARM.integrate(AT([0.2, -0.1]), (every + later) * w)
    np.testing.assert_allclose(ARM.difference(wanted, np.asarray(goal)), 0.0, atol=1e-9)
    np.testing.assert_allclose(goes, w, atol=1e-9)


@pytest.mark.parametrize(
    ("before", "after", "pause"),
    [(AT([0.0, 0.0]), AT([0.5, 0.0]), 0.05), (AT([0.0, 0.0]), AT([0.01, 0.0]), 0.11)],
    ids=["jump", "pause"],
)
def test_what_is_no_stream_counts_as_at_rest(before: Array, after: Array, pause: float) -> None:
    moving = MovingGoal(ARM, before)
    moving.at(1.0)
    moving.set(after, None)
    for t in (1.0 + pause, 1.05 + pause):
        goal, goes = moving.at(t)
        assert goal is after
        assert not goes.any()


def test_a_stream_that_ends_leaves_the_goal_where_it_was_set_last() -> None:
    moving, last = MovingGoal(ARM, AT([0.0, 0.0])), AT([0.01, 0.0])
    moving.at(0.0)
    moving.set(last, None)
    np.testing.assert_array_equal(np.asarray(moving.at(0.03)[0]), last)
    assert moving.at(0.05)[0] is not last
    assert moving.at(0.2)[0] is last


def test_a_stream_of_poses_is_gone_on_from() -> None:
    twist = np.array([0.1, 0.0, -0.2, 0.0, 0.5, 0.1])
    first = Pose("tool", [0.1, 0.2, 0.3], [0.0, 0.0, 0.0, 1.0])
    moving = MovingGoal(ARM, first)
    moving.at(0.0)
    moving.set(first.moved(0.05 * twist), None)
    moving.at(0.05)
    goal, goes = moving.at(0.08)
    assert isinstance(goal, Pose)
    np.testing.assert_allclose(goal.placement, first.moved(0.08 * twist).placement, atol=1e-12)
    np.testing.assert_allclose(goes, twist, atol=1e-12)
    moving.set(AT([0.0, 0.0]), None)  # of another kind
    assert not moving.at(0.1)[1].any()


@pytest.mark.slow
def test_teleoperation_is_followed_within_sixty_milliseconds_and_the_rate_of_torques() -> None:
    """Thirty goals a second, no velocity told, of a hand that swings."""
    arm, dt = load_arm("panda", shapes="capsule"), 0.001
    world, q = World(arm, Scene([])), arm.postures["ready"]
    reach = np.array([0.3, 0.15, 0.2, 0.2, 0.2, 0.2, 0.3])
    controller, plant = DensityRegulation(world, q), PinocchioPlant(arm, dt)
    v, torques, lags, start, sets = np.zeros(arm.nv), [], [], q, 0
    for k in range(4000):
        t = k * dt
        angle, ready = 1.5 * t, min(t, 1.0)
        if t * 30.0 >= sets:
            controller.set_goal(arm.integrate(start, ready * np.sin(angle) * reach))
            sets += 1
        torques.append(controller.torque(t, q, v))
        q, v = plant.step(q, v, torques[-1])
        if t > 1.0:
            off = arm.difference(q, arm.integrate(start, np.sin(1.5 * (t + dt)) * reach))
            lags.append(np.abs(off).max() / (1.5 * reach.max()))
    rate = np.abs(np.diff(torques, axis=0)) / dt
    assert (rate <= arm.limits.torque_rate * (1.0 + 1e-9)).all()
    assert max(lags) <= 0.06  # [s], at the fastest that it goes
