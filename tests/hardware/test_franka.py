import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest

from densarm.arms.arm import load_arm
from densarm.errors import DensarmError, InvalidValueError, RobotError
from densarm.hardware.franka import FrankaRobot
from densarm.values.arrays import Array

ARM = load_arm("fr3")
READY = ARM.postures["ready"]
GRAVITY = ARM.nonlinear_effects(READY, np.zeros(7))
REFLEX = 'libfranka: Move command aborted:\nmotion aborted by reflex! ["cartesian_reflex"]'


class Errors(list[str]):
    def __str__(self) -> str:
        return f"[{', '.join(self)}]"


class FrankaError(Exception):
    pass


@dataclass
class Torques:
    tau_J: list[float]  # noqa: N815
    motion_finished: bool = False


@dataclass
class Stand:
    """Stands for pylibfranka and for the robot behind it."""

    mode: str = "Idle"
    errors: list[str] = field(default_factory=list)
    acting: Array = field(default_factory=lambda: np.zeros(7))
    velocity: Array = field(default_factory=lambda: np.zeros(7))
    fails: str = ""
    sent: list[Torques] = field(default_factory=list)
    events: list[str] = field(default_factory=list)

    def module(self) -> Any:
        module: Any = ModuleType("pylibfranka")
        module.FrankaException, module.Torques = FrankaError, Torques
        module.RealtimeConfig = SimpleNamespace(kEnforce=0, kIgnore=1)
        module.RobotMode = SimpleNamespace(Idle=SimpleNamespace(name="Idle"))
        module.Robot = self.connect
        return module

    def connect(self, address: str, _: int) -> "Stand":
        if address == "192.0.2.1":
            raise RuntimeError("libfranka: Connection to FCI refused.\nPlease install FCI")
        return self

    def read_once(self) -> Any:
        idle = SimpleNamespace(name="Idle")
        return SimpleNamespace(
            q=READY.tolist(),
            dq=self.velocity.tolist(),
            tau_J_d=self.acting.tolist(),
            time=SimpleNamespace(to_sec=lambda: 5.0),
            robot_mode=idle if self.mode == "Idle" else SimpleNamespace(name=self.mode),
            current_errors=Errors(self.errors),
            last_motion_errors=Errors(),
        )

    def start_torque_control(self) -> "Stand":
        self.events.append("start")
        return self

    def readOnce(self) -> tuple[Any, int]:  # noqa: N802
        if self.fails:
            raise RuntimeError(self.fails)
        return self.read_once(), 1

    def writeOnce(self, command: Torques) -> None:  # noqa: N802
        self.sent.append(command)
        self.acting = np.array(command.tau_J)

    def stop(self) -> None:
        self.events.append("stop")
        raise RuntimeError("nothing to stop")

    def automatic_error_recovery(self) -> None:
        self.mode, self.errors = "Idle", []


Stands = Callable[..., Stand]


@pytest.fixture
def stands(monkeypatch: pytest.MonkeyPatch) -> Stands:
    def stand(**options: Any) -> Stand:
        made = Stand(**options)
        monkeypatch.setitem(sys.modules, "pylibfranka", made.module())
        return made

    return stand


def test_gravity_is_left_to_the_robot(stands: Stands) -> None:
    stand = stands()
    robot = FrankaRobot("fake", ARM)
    reading = robot.read()
    np.testing.assert_array_equal(reading.position, READY)
    assert reading.time == 5.0
    assert not stand.events
    robot.command(GRAVITY)
    assert stand.events == ["start"]
    np.testing.assert_allclose(stand.sent[0].tau_J, 0.0, atol=1e-12)


def test_torque_changes_from_what_the_robot_acts_by_as_fast_as_it_bears(stands: Stands) -> None:
    stand = stands()
    robot = FrankaRobot("fake", ARM)
    wanted = np.array([4.0, -2.0, 1.0, 0.5, 0.0, -0.1, 0.2])
    for k in range(1, 5):
        robot.command(GRAVITY + wanted)
        robot.read()
        np.testing.assert_allclose(stand.sent[-1].tau_J, wanted * min(1.0, k * 0.999 / 4.0))
    stand.acting = -wanted  # the robot took another one since
    robot.read()
    robot.command(GRAVITY + wanted)
    np.testing.assert_allclose(stand.sent[-1].tau_J, -wanted + wanted * 0.999 / 4.0)


def test_torque_changes_no_faster_from_what_was_sent_last_where_the_state_is_older(
    stands: Stands,
) -> None:
    stand = stands()
    robot = FrankaRobot("fake", ARM)
    wanted = np.array([4.0, -2.0, 1.0, 0.5, 0.0, -0.1, 0.2])
    robot.command(GRAVITY + wanted)
    before = np.zeros(7)
    for _ in range(3):  # each state was sent before the last command arrived
        stand.acting, last = before, np.array(stand.sent[-1].tau_J)
        robot.read()
        robot.command(GRAVITY - wanted)
        now = np.array(stand.sent[-1].tau_J)
        assert np.abs(now - last).max() <= 1.0
        assert np.abs(now - before).max() <= 1.0
        before = last
    assert now[0] < -0.5


def test_what_is_sent_keeps_the_torque_limits_without_gravity_too(stands: Stands) -> None:
    limit = ARM.limits.effort
    stand = stands(acting=limit - 0.1)
    FrankaRobot("fake", ARM).command(limit + np.abs(GRAVITY))
    np.testing.assert_allclose(stand.sent[0].tau_J, limit, atol=0.1)
    assert (np.array(stand.sent[0].tau_J) <= limit).all()


def test_a_reflex_is_told_in_the_robots_words_in_one_line(stands: Stands) -> None:
    stand = stands()
    robot = FrankaRobot("fake", ARM)
    robot.command(GRAVITY)
    stand.fails = REFLEX
    with pytest.raises(RobotError, match=r'^the robot at fake stopped: .*\["cartesian_reflex"\]$'):
        robot.read()
    robot.stop()  # has nothing left to stop
    assert stand.events == ["start"]


@pytest.mark.parametrize(("speed", "is_moving"), [(0.0, False), (0.2, True)])
def test_a_robot_at_rest_ends_its_motion_and_one_that_moves_stops(
    stands: Stands, speed: float, is_moving: bool
) -> None:
    stand = stands(velocity=np.full(7, speed))
    robot = FrankaRobot("fake", ARM)
    robot.command(GRAVITY)
    robot.stop()
    robot.stop()
    assert stand.sent[-1].motion_finished is not is_moving
    assert ("stop" in stand.events) is is_moving


def test_a_robot_in_reflex_is_refused_in_its_words_and_recovers(stands: Stands) -> None:
    stand = stands(mode="Reflex", errors=["joint_velocity_violation"])
    words = r"in mode Reflex, for \[joint_velocity_violation\]: clear its way, then call recover"
    with pytest.raises(RobotError, match=words):
        FrankaRobot("fake", ARM)
    stand.mode, stand.errors = "Idle", []
    robot = FrankaRobot("fake", ARM)
    stand.mode = "Reflex"
    robot.read()
    with pytest.raises(RobotError, match="in mode Reflex"):
        robot.require_ready()
    robot.recover()
    robot.require_ready()


def test_a_robot_that_is_not_there_is_one_line(stands: Stands) -> None:
    stands()
    with pytest.raises(RobotError, match=r"^the robot at 192.0.2.1 cannot be reached: .*FCI$"):
        FrankaRobot("192.0.2.1", ARM)


def test_an_arm_of_other_joints_and_a_missing_package_are_refused(
    stands: Stands, monkeypatch: pytest.MonkeyPatch
) -> None:
    stands()
    with pytest.raises(InvalidValueError, match=r"joints of the arm = 6: must be 7"):
        FrankaRobot("fake", load_arm("ur5"))
    monkeypatch.setitem(sys.modules, "pylibfranka", None)
    with pytest.raises(DensarmError, match=r"pip install 'densarm\[franka\]'"):
        FrankaRobot("fake", ARM)
