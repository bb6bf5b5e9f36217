import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from densarm.arms.arm import load_arm
from densarm.control.position_tracking import PositionTracking
from densarm.errors import DensarmError, RobotError
from densarm.hardware.drive import drive
from densarm.hardware.universal import UniversalRobot
from densarm.planning.plan import plan_motion
from densarm.scene.scene import Scene
from densarm.values.outcome import Outcome
from densarm.world.world import World

READY = [0.0, -1.5, 1.5, -1.5, -1.5, 0.0]


@dataclass
class Stand:
    """Stands for both interfaces of ur_rtde and for the robot, in time that goes when read."""

    protective: bool = False
    is_silent: bool = False
    takes: bool = True
    time: float = 3.0
    q: list[float] = field(default_factory=lambda: list(READY))
    qd: list[float] = field(default_factory=lambda: [0.0] * 6)
    told: list[list[float]] = field(default_factory=list)
    stops: int = 0

    def connect(self, address: str, frequency: float) -> "Stand":
        if address == "192.0.2.1":
            raise RuntimeError("Error: Could not connect to: 192.0.2.1 at 30004, verify the IP")
        self.period = 1.0 / frequency
        return self

    def getTimestamp(self) -> float:  # noqa: N802
        if not self.is_silent:
            self.time += self.period
            if self.told:  # follows with a lag of 20 ms
                share = self.period / 0.02
                self.qd = [(a - b) / 0.02 for a, b in zip(self.told[-1], self.q, strict=True)]
                self.q = [b + share * (a - b) for a, b in zip(self.told[-1], self.q, strict=True)]
        return self.time

    def getActualQ(self) -> list[float]:  # noqa: N802
        return self.q

    def getActualQd(self) -> list[float]:  # noqa: N802
        return self.qd

    def isConnected(self) -> bool:  # noqa: N802
        return True

    def isEmergencyStopped(self) -> bool:  # noqa: N802
        return False

    def isProtectiveStopped(self) -> bool:  # noqa: N802
        return self.protective

    def servoJ(self, q: list[float], *numbers: float) -> bool:  # noqa: N802
        assert numbers == (0.0, 0.0, self.period, 0.05, 500.0)
        self.told.append(q)
        return self.takes

    def servoStop(self) -> bool:  # noqa: N802
        self.stops += 1
        return True


Stands = Callable[..., Stand]


@pytest.fixture
def stands(monkeypatch: pytest.MonkeyPatch) -> Stands:
    def stand(**options: Any) -> Stand:
        made = Stand(**options)
        receive: Any = ModuleType("rtde_receive")
        control: Any = ModuleType("rtde_control")
        receive.RTDEReceiveInterface = control.RTDEControlInterface = made.connect
        monkeypatch.setitem(sys.modules, "rtde_receive", receive)
        monkeypatch.setitem(sys.modules, "rtde_control", control)
        return made

    return stand


def test_a_motion_is_streamed_to_its_goal(stands: Stands) -> None:
    stand, world = stands(), World(load_arm("ur5"), Scene())
    robot, arm = UniversalRobot("fake"), world.arm
    goal = arm.configuration([1.0, -1.2, 1.2, -1.5, -1.5, 0.5])
    motion = plan_motion(world, arm.configuration(READY), goal, period=robot.period)
    run = drive(robot, world, PositionTracking(arm, motion))
    assert run.outcome == Outcome.REACHED
    assert stand.stops == 1
    assert len(stand.told) == len(run.time)
    np.testing.assert_allclose(stand.told[0], READY, atol=1e-3)


def test_what_stops_the_robot_is_told_in_one_line(stands: Stands) -> None:
    stand = stands()
    robot = UniversalRobot("fake")
    stand.protective = True
    with pytest.raises(RobotError, match="protective stop: clear its way and unlock it"):
        robot.read()
    stand.protective, stand.takes = False, False
    with pytest.raises(RobotError, match="took no position: its script stopped"):
        robot.command(np.array(READY))
    robot.read()
    stand.is_silent = True
    with pytest.raises(RobotError, match="sends no states any more"):
        robot.read()
    robot.stop()
    robot.stop()
    assert stand.stops == 1


def test_a_robot_that_is_not_there_or_stopped_is_refused(
    stands: Stands, monkeypatch: pytest.MonkeyPatch
) -> None:
    stands()
    with pytest.raises(RobotError, match=r"^the robot at 192.0.2.1 cannot be reached: Error"):
        UniversalRobot("192.0.2.1")
    stands(protective=True)
    with pytest.raises(RobotError, match="protective stop"):
        UniversalRobot("fake")
    monkeypatch.setitem(sys.modules, "rtde_receive", None)
    with pytest.raises(DensarmError, match=r"pip install 'densarm\[ur\]'"):
        UniversalRobot("fake")
