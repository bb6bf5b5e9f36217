"""Plans that lose the arm: by a push, or by standing still; the new one begins at rest."""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

from densarm.arms.arm import Arm, load_arm
from densarm.control.controller import Controller, Gains
from densarm.control.replanning import PlanningInLoop, Replanning
from densarm.control.supervisor import Supervisor
from densarm.errors import InvalidValueError
from densarm.planning.motion import Motion, PlanningError
from densarm.scene.obstacles import Sphere
from densarm.scene.scene import Scene
from densarm.values.arrays import Array
from densarm.values.outcome import Outcome
from densarm.world.world import World

PERIOD = 0.01


class Recorder:
    """Keeps the times that it is called at, and has the tracking error that it is given."""

    def __init__(self, arm: Arm, motion: Motion | None = None) -> None:
        self.arm, self.motion = arm, motion
        self.times, self.tracking_error = list[float](), 0.0
        self.is_evading = False

    def torque(self, t: float, *_: Any) -> Array:
        self.times.append(t)
        return np.zeros(self.arm.nv)

    def describe_stall(self, _: Array) -> str:
        return "in the way: a wall"


@pytest.fixture(scope="module")
def arm() -> Arm:
    return load_arm("three_link")


class Answers:
    """A planner that has its answers; None for that there is no way."""

    def __init__(self, answers: Iterator[Controller | None], late: float = 0.0) -> None:
        self.answers, self.late = answers, late
        self.asked, self.ready_at = list[Array](), 0.0

    def ask(self, t: float, q: Array) -> None:
        self.asked.append(q)
        self.ready_at = t + self.late

    def answer(self, t: float, _: Array) -> Controller | None:
        if t < self.ready_at:
            return None
        if (found := next(self.answers)) is None:
            raise PlanningError(Outcome.NO_PATH, "a wall")
        return found


def watched(
    arm: Arm, first: Controller, answers: Iterator[Controller | None], late: float = 0.0
) -> tuple[Replanning, list[Array]]:
    goal, planner = arm.configuration([1.0, 0.0, 0.0]), Answers(answers, late)
    return Replanning(arm, goal, first, planner, 0.5, Gains(), PERIOD), planner.asked


def standing_motion(arm: Arm, seconds: float = 1.0) -> Motion:
    count = round(seconds / PERIOD) + 1
    return Motion(PERIOD, np.zeros((count, arm.nv)), np.zeros((count, arm.nv)))


def test_pushed_arm_is_stopped_first_and_has_a_new_plan_from_where_it_rests(arm: Arm) -> None:
    first, second = (Recorder(arm, standing_motion(arm)) for _ in range(2))
    controller, asked = watched(arm, first, iter([second]))
    on, off = arm.configuration([0.1, 0.0, 0.0]), arm.configuration([0.4, 0.0, 0.0])
    rest, moving = np.zeros(arm.nv), np.full(arm.nv, 0.5)
    controller.torque(0.0, on, moving)
    first.tracking_error = 0.4
    assert controller.tracking_error == 0.4
    tau = controller.torque(0.1, off, moving)
    assert moving @ (tau - arm.nonlinear_effects(off, moving)) < 0.0  # it brakes
    assert controller.tracking_error == 0.0
    controller.torque(0.2, off, moving)
    assert (asked, controller.replanned_at) == ([], ())
    controller.torque(0.3, off, rest)  # here it is seen to rest
    controller.torque(0.31, off, rest)
    np.testing.assert_array_equal(asked, [off])
    controller.torque(0.35, on, rest)
    assert controller.replanned_at == (0.31,)
    assert first.times == [0.0]
    assert second.times == pytest.approx([0.0, 0.04])


def test_an_arm_that_gives_way_is_not_stopped_and_planned_for_where_it_stands(arm: Arm) -> None:
    first, second = (Recorder(arm, standing_motion(arm, 9.0)) for _ in range(2))
    first.is_evading, first.tracking_error = True, 0.9
    controller, asked = watched(arm, first, iter([None, second]))
    rest, goes = np.zeros(arm.nv), arm.configuration([0.9, 0.0, 0.0])
    for k in range(30):
        controller.torque(k * PERIOD, arm.configuration([0.03 * k, 0.0, 0.0]), rest)
    assert (len(first.times), asked) == (30, [])
    for k in range(30, 200):
        controller.torque(k * PERIOD, goes, rest)
    assert len(asked) == 2  # the first was in vain, and the arm went on
    assert len(first.times) + len(second.times) == 200
    assert controller.replanned_at == pytest.approx((1.3,), abs=3 * PERIOD)


def test_the_loop_goes_on_while_a_plan_is_made_and_one_for_elsewhere_is_not_taken(arm: Arm) -> None:
    first, second = (Recorder(arm, standing_motion(arm, 9.0)) for _ in range(2))
    first.is_evading = True
    controller, asked = watched(arm, first, iter([second, second]), late=0.3)
    rest = np.zeros(arm.nv)
    for k in range(200):
        goes_on = 0.25 if k > 60 else 0.0
        controller.torque(k * PERIOD, arm.configuration([0.4 + goes_on, 0.0, 0.0]), rest)
    assert len(asked) == 2
    assert controller.replanned_at == pytest.approx((0.6 + 0.6 + 0.3,), abs=0.15)
    assert len(first.times) + len(second.times) == 200


def test_planning_in_the_loop_sees_what_moves_where_it_will_be_and_takes_its_time(arm: Arm) -> None:
    ball = Sphere(name="ball", radius=0.1, position=(2.0, 0.0, 0.0))
    world, seen = World(arm, Scene([ball])), list[Scene]()
    world.move_obstacle("ball", [1.5, 0.0, 0.0], velocity=[0.0, 0.0, 1.0])

    def plan(predicted: World, _: Array) -> Callable[[Array], Controller]:
        seen.append(predicted.scene)
        return lambda _: Recorder(arm)

    planner, q = PlanningInLoop(world, plan, 0.2), arm.configuration(np.zeros(arm.nv))
    planner.ask(1.0, q)
    assert planner.answer(1.19, q) is None
    assert isinstance(planner.answer(1.2, q), Recorder)
    assert seen[0].obstacles[0].position == pytest.approx([1.5, 0.0, 0.2])
    assert world.scene.obstacles[0].position == pytest.approx([1.5, 0.0, 0.0])


def test_arm_within_reach_of_its_motion_is_left_alone(arm: Arm) -> None:
    first = Recorder(arm, standing_motion(arm))
    controller, asked = watched(arm, first, iter([]))
    first.tracking_error = 0.19
    for k in range(100):
        controller.torque(k * PERIOD, arm.configuration([0.19, 0.0, 0.0]), np.zeros(arm.nv))
    assert asked == []
    assert len(first.times) == 100


def test_arm_that_stands_away_from_the_goal_is_given_a_few_plans(arm: Arm) -> None:
    plans = [Recorder(arm) for _ in range(5)]
    controller, asked = watched(arm, plans[0], iter(plans[1:]))
    q, rest = arm.configuration([0.5, 0.0, 0.0]), np.zeros(arm.nv)
    for k in range(400):
        controller.torque(k * PERIOD, q, rest)
    assert len(controller.replanned_at) == len(asked) == 3
    assert np.diff([0.0, *controller.replanned_at]) == pytest.approx(0.5, abs=2.5 * PERIOD)
    assert controller.describe_stall(q) == "in the way: a wall"


def test_arm_that_stands_at_the_goal_is_left_there(arm: Arm) -> None:
    controller, asked = watched(arm, Recorder(arm), iter([]))
    for k in range(200):
        controller.torque(k * PERIOD, arm.configuration([1.005, 0.0, 0.0]), np.zeros(arm.nv))
    assert asked == []


def test_without_a_new_plan_the_arm_is_held_and_the_verdict_says_so(arm: Arm) -> None:
    first = Recorder(arm)
    controller, asked = watched(arm, first, iter([None]))
    q, rest = arm.configuration([0.5, 0.0, 0.0]), np.zeros(arm.nv)
    for k in range(200):
        tau = controller.torque(k * PERIOD, q, rest)
    assert len(asked) == 1
    assert max(first.times) < 0.6
    np.testing.assert_allclose(tau, arm.nonlinear_effects(q, rest))
    assert controller.describe_stall(q).startswith("no path from where the arm was stopped; in")


def test_a_controller_that_tells_nothing_is_replaced_as_well(arm: Arm) -> None:
    class Plain:
        def torque(self, *_: Any) -> Array:
            return np.zeros(arm.nv)

    controller, asked = watched(arm, Plain(), iter([Plain()]))
    q, rest = arm.configuration([0.5, 0.0, 0.0]), np.zeros(arm.nv)
    for k in range(80):
        controller.torque(k * PERIOD, q, rest)
    assert len(asked) == 1
    assert controller.tracking_error is None
    assert controller.describe_stall(q) == ""
    assert Supervisor(arm, controller).tracking_error is None


@pytest.mark.parametrize("moves", [True, False])
def test_a_state_that_is_none_is_refused(arm: Arm, moves: bool) -> None:
    first = Recorder(arm, standing_motion(arm) if moves else None)
    controller, _ = watched(arm, first, iter([]))
    for q, v in (([0.0], [0.0]), (np.full(arm.nq, np.nan), np.zeros(arm.nv))):
        with pytest.raises(InvalidValueError, match=r"^configuration = "):
            controller.torque(0.0, q, v)
    assert first.times == []
