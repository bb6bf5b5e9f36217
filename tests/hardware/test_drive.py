import os
import signal
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest

from densarm.certificates.task import ROBOT, Input, SimulationParameters
from densarm.control.position_tracking import PositionTracking
from densarm.control.status import Fault
from densarm.control.supervisor import Supervisor
from densarm.control.tracking import DensityTracking
from densarm.errors import InvalidValueError, RobotError
from densarm.hardware.drive import DriveInterrupted, drive
from densarm.hardware.robot import Reading
from densarm.planning.motion import Motion
from densarm.planning.plan import plan_motion
from densarm.simulation.plants import PinocchioPlant
from densarm.simulation.run import Run
from densarm.values.arrays import Array
from densarm.values.outcome import Outcome
from densarm.world.world import World

HOME = [0.6, 0.3, 0.3, -1.8, -0.2, 2.0, 0.8]
ACROSS = [-0.6, 0.3, -0.3, -1.8, 0.2, 2.0, 0.4]


@dataclass
class FakeRobot:
    """A robot in this process, whose clock goes on by a period for each state that is read."""

    world: World
    input: Input = Input.TORQUE
    period: float = 1e-3
    lost: frozenset[int] = frozenset()  # states that never arrive
    stops_at: float = np.inf  # [s]
    lies_from: float = np.inf  # [s], from when its positions are off
    lies_by: float = 0.3  # [rad]
    stands_from: float = np.inf  # [s], from when its joints stand, whatever is told
    ctrl_c_at: float = np.inf  # [s]
    lag: float = 0.03  # [s] of positions that are told
    sent: list[Array] = field(default_factory=list)
    stops: int = 0

    def __post_init__(self) -> None:
        arm = self.world.arm
        self.plant = PinocchioPlant(arm, self.period)
        self.q, self.v, self.steps = arm.configuration(HOME), np.zeros(arm.nv), 0

    def read(self) -> Reading:
        if self.sent:
            self.advance()
            while self.steps in self.lost:
                self.advance()
        now = self.steps * self.period
        if now > self.stops_at:
            raise RobotError("the robot at fake stopped: cartesian_reflex")
        if now > self.ctrl_c_at:
            self.ctrl_c_at = np.inf
            os.kill(os.getpid(), signal.SIGINT)
        off = self.lies_by if now > self.lies_from else 0.0
        return Reading(7.0 + now, self.world.arm.angles(self.q) + off, self.v)

    def advance(self) -> None:
        arm, now, u = self.world.arm, self.steps * self.period, self.sent[-1]
        self.steps += 1
        if self.input == Input.TORQUE:
            self.q, self.v = self.plant.step(self.q, self.v, u)
            return
        stands = now >= self.stands_from
        self.v = 0.0 * u if stands else arm.difference(self.q, arm.configuration(u)) / self.lag
        self.q = arm.integrate(self.q, self.period * self.v)

    def command(self, u: Array) -> None:
        self.sent.append(u.copy())

    def stop(self) -> None:
        self.stops += 1


@pytest.fixture(scope="session")
def motion(posts: World) -> Motion:
    arm = posts.arm
    return plan_motion(posts, arm.configuration(HOME), arm.configuration(ACROSS), period=1e-3)


@pytest.fixture(scope="session")
def driven(posts: World, motion: Motion) -> tuple[FakeRobot, Run]:
    robot = FakeRobot(posts)
    return robot, drive(robot, posts, DensityTracking(posts, motion), title="across")


def test_a_robot_is_driven_to_its_goal_and_certified(driven: tuple[FakeRobot, Run]) -> None:
    robot, run = driven
    assert run.outcome == Outcome.REACHED
    assert run.task.plant == ROBOT
    assert run.certified, str(run.certificate)
    assert run.goal_error < 1e-3
    assert robot.stops == 1
    assert len(run.time) == len(robot.sent)
    np.testing.assert_array_equal(run.tau, np.array(robot.sent))


def test_the_first_command_holds_and_none_changes_faster_than_the_robot_bears(
    driven: tuple[FakeRobot, Run], posts: World
) -> None:
    robot, run = driven
    gravity = [posts.arm.nonlinear_effects(q, np.zeros(7)) for q in run.q]
    free = np.array(robot.sent) - gravity
    assert np.abs(free[0]).max() < 1.0
    rate = posts.arm.limits.torque_rate * robot.period
    assert (np.abs(np.diff(free, axis=0)) <= 1.01 * rate).all()


def test_a_record_is_saved_and_loaded_with_its_certificate(
    driven: tuple[FakeRobot, Run], tmp_path: Any
) -> None:
    driven[1].save(tmp_path / "run.npz")
    loaded = Run.load(tmp_path / "run.npz")
    assert loaded.certified
    assert loaded.task.plant == ROBOT


def test_a_lost_state_is_interpolated_and_many_are_a_fault(posts: World, motion: Motion) -> None:
    robot = FakeRobot(posts, lost=frozenset({300, 301}))
    run = drive(robot, posts, DensityTracking(posts, motion))
    assert run.outcome == Outcome.REACHED
    assert f"2 of {len(run.time)} states were lost" in run.remark
    np.testing.assert_allclose(np.diff(run.time), robot.period)
    supervisor = Supervisor(posts.arm, DensityTracking(posts, motion))
    late = FakeRobot(posts, lost=frozenset(range(300, 320)))
    run = drive(late, posts, supervisor)
    assert supervisor.status.fault == Fault.LATE
    assert run.outcome == Outcome.STUCK
    assert "came 0.021 s after the last one" in run.detail
    assert np.abs(run.v[-1]).max() < 0.02


def test_a_reflex_ends_the_run_in_the_robots_words(posts: World, motion: Motion) -> None:
    robot, supervisor = (
        FakeRobot(posts, stops_at=0.2),
        Supervisor(posts.arm, DensityTracking(posts, motion)),
    )
    run = drive(robot, posts, supervisor)
    assert (run.outcome, run.detail) == (
        Outcome.STUCK,
        "the robot at fake stopped: cartesian_reflex",
    )
    assert supervisor.status.fault == Fault.ROBOT
    assert robot.stops == 1


def test_states_that_cannot_be_believed_leave_the_stop_to_the_robot(
    posts: World, motion: Motion
) -> None:
    robot = FakeRobot(posts, lies_from=0.2)
    run = drive(robot, posts, DensityTracking(posts, motion))
    assert run.outcome == Outcome.STUCK
    assert "the state is off by" in run.detail
    assert robot.stops == 1
    assert run.time[-1] < 0.23


def test_a_supervisor_that_trusts_lets_a_controller_act_and_fail(
    posts: World, motion: Motion
) -> None:
    robot = FakeRobot(posts)
    trusting = Supervisor(posts.arm, DensityTracking(posts, motion), tolerances=None)
    assert drive(robot, posts, trusting).outcome == Outcome.REACHED


def test_what_is_no_number_is_no_state(posts: World, motion: Motion) -> None:
    robot = FakeRobot(posts, lies_from=0.1, lies_by=np.nan)
    run = drive(robot, posts, DensityTracking(posts, motion))
    assert run.outcome == Outcome.STUCK
    assert run.detail.startswith("the robot sent what is no state: ")
    assert robot.stops == 1


def test_ctrl_c_brings_the_arm_to_rest_and_then_raises_with_the_run(
    posts: World, motion: Motion
) -> None:
    robot, before = FakeRobot(posts, ctrl_c_at=0.3), signal.getsignal(signal.SIGINT)
    with pytest.raises(DriveInterrupted) as caught:
        drive(robot, posts, DensityTracking(posts, motion))
    run = caught.value.run
    assert run.outcome == Outcome.STUCK
    assert run.detail == "Ctrl-C at t = 0.301 s"
    assert np.abs(run.v[-1]).max() <= 0.02
    assert robot.stops == 1
    assert signal.getsignal(signal.SIGINT) is before


def test_a_failing_controller_of_positions_leaves_the_robot_stopped(posts: World) -> None:
    class Failing:
        def position(self, t: float, q: Array, _: Array) -> Array:
            if t > 0.1:
                raise ZeroDivisionError
            return posts.arm.angles(q)

    robot = FakeRobot(posts, Input.POSITION)
    with pytest.raises(ZeroDivisionError):
        drive(robot, posts, Failing())
    assert robot.stops == 1


def test_positions_are_streamed_to_the_goal(posts: World, motion: Motion) -> None:
    robot = FakeRobot(posts, Input.POSITION)
    run = drive(robot, posts, PositionTracking(posts.arm, motion))
    assert run.outcome == Outcome.REACHED
    assert run.certified, str(run.certificate)
    assert not run.tau.any()
    assert (run.tracking_error or 1.0) < 5e-3  # where 60 mrad are the way of the lag


def test_a_robot_that_stands_pauses_the_positions(posts: World, motion: Motion) -> None:
    robot = FakeRobot(posts, Input.POSITION, stands_from=0.4)
    run = drive(robot, posts, PositionTracking(posts.arm, motion))
    assert run.outcome == Outcome.STUCK
    assert "paused at t = 0." in run.detail
    told = np.array(robot.sent)
    assert np.abs(told[-1] - told[-200]).max() < 1e-3
    a = np.diff(told, 2, axis=0) / robot.period**2
    assert (np.abs(a) <= 1.05 * posts.arm.limits.acceleration).all()


def test_what_cannot_be_driven_is_refused_before_a_command(posts: World, motion: Motion) -> None:
    away, moves, other = FakeRobot(posts), FakeRobot(posts), FakeRobot(posts)
    away.q = posts.arm.configuration(ACROSS)
    moves.v = np.full(7, 0.1)
    other.input = "force"  # type: ignore[assignment]
    for robot, words in (
        (away, "where the motion begins: plan from where the robot is"),
        (moves, "velocity of the robot"),
        (other, "input of the robot = 'force'"),
    ):
        with pytest.raises(InvalidValueError, match=words):
            drive(robot, posts, DensityTracking(posts, motion))
        assert not robot.sent
    quick, other = PositionTracking(posts.arm, motion, 0.002), FakeRobot(posts, Input.POSITION)
    with pytest.raises(InvalidValueError, match=r"period of the controller = 0.002: must be the"):
        drive(other, posts, quick)
    with pytest.raises(InvalidValueError, match="one with a method position"):
        drive(FakeRobot(posts, Input.POSITION), posts, DensityTracking(posts, motion))


def test_a_robot_that_touches_something_is_not_moved(posts: World) -> None:
    robot = FakeRobot(posts)
    robot.q = posts.arm.configuration([0.0, 1.2, 0.0, -0.8, 0.0, 2.0, 0.8])
    run = drive(robot, posts, Resting(), parameters=SimulationParameters(time_limit=0.1))
    assert run.outcome == Outcome.INFEASIBLE
    assert not robot.sent


class Resting:
    def torque(self, *_: Any) -> Array:
        return np.zeros(7)
