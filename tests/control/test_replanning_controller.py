"""Plans that lose the arm: by a push, or by standing still; the new one begins at rest."""

import numpy as np
import pytest

from densarm.arm import load_arm
from densarm.control.gains import Gains
from densarm.control.replanning_controller import FollowedPlan, ReplanningController
from densarm.control.stoppable_controller import StoppableController
from densarm.reference.reference import Reference

PERIOD = 0.01


class Recorder:
    """Keeps the times that it is called at, and has the tracking error that it is given."""

    def __init__(self, arm):
        self.arm, self.times, self.tracking_error = arm, [], 0.0

    def torque(self, t, *_):
        self.times.append(t)
        return np.zeros(self.arm.nv)


@pytest.fixture(scope="module")
def arm():
    return load_arm("three_link")


def a_plan(arm, reference=None):
    recorder = Recorder(arm)
    controller = StoppableController(arm, recorder, Gains(), PERIOD)
    return FollowedPlan(controller, reference, lambda _: "in the way: a wall"), recorder


def watched(arm, first, answers):
    asked = []

    def plan_again(q):
        asked.append(q)
        return next(answers)

    goal = arm.configuration([1.0, 0.0, 0.0])
    return ReplanningController(arm, goal, first, plan_again, 0.5, 0.01), asked


def reference(arm, seconds=1.0):
    count = round(seconds / PERIOD) + 1
    return Reference(PERIOD, np.zeros((count, arm.nv)), np.zeros((count, arm.nv)))


def test_pushed_arm_is_stopped_first_and_has_a_new_plan_from_where_it_rests(arm):
    first, followed = a_plan(arm, reference(arm))
    second, taken = a_plan(arm, reference(arm))
    controller, asked = watched(arm, first, iter([second]))
    on, off = arm.configuration([0.1, 0.0, 0.0]), arm.configuration([0.4, 0.0, 0.0])
    rest, moving = np.zeros(arm.nv), np.full(arm.nv, 0.5)
    controller.torque(0.0, on, moving)
    followed.tracking_error = 0.4
    controller.torque(0.1, off, moving)
    assert first.controller.is_stopping
    controller.torque(0.2, off, moving)
    assert (asked, controller.replanned_at) == ([], ())
    controller.torque(0.3, off, rest)
    np.testing.assert_array_equal(asked, [off])
    controller.torque(0.35, on, rest)
    assert controller.replanned_at == (0.3,)
    assert followed.times == [0.0]
    assert taken.times == pytest.approx([0.0, 0.05])


def test_arm_that_stands_away_from_the_goal_is_given_a_few_plans(arm):
    plans = [a_plan(arm)[0] for _ in range(5)]
    controller, asked = watched(arm, plans[0], iter(plans[1:]))
    q, rest = arm.configuration([0.5, 0.0, 0.0]), np.zeros(arm.nv)
    for k in range(400):
        controller.torque(k * PERIOD, q, rest)
    assert len(controller.replanned_at) == len(asked) == 3
    assert np.diff([0.0, *controller.replanned_at]) == pytest.approx(0.5, abs=2.5 * PERIOD)
    assert controller.describe_stall(q) == "in the way: a wall"


def test_arm_that_stands_at_the_goal_is_left_there(arm):
    controller, asked = watched(arm, a_plan(arm)[0], iter([]))
    for k in range(200):
        controller.torque(k * PERIOD, arm.configuration([1.005, 0.0, 0.0]), np.zeros(arm.nv))
    assert asked == []


def test_without_a_new_plan_the_arm_is_held_and_the_verdict_says_so(arm):
    first, followed = a_plan(arm)
    controller, asked = watched(arm, first, iter([None]))
    q, rest = arm.configuration([0.5, 0.0, 0.0]), np.zeros(arm.nv)
    for k in range(200):
        tau = controller.torque(k * PERIOD, q, rest)
    assert len(asked) == 1
    assert max(followed.times) < 0.6
    np.testing.assert_allclose(tau, arm.nonlinear_effects(q, rest))
    assert controller.describe_stall(q).startswith("no path from where the arm was stopped; in")
