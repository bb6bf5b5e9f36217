"""The loop that drives a robot by a controller, in the robot's time, and records what it did."""

import gc
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from densarm.arms.pose import Pose
from densarm.certificates.task import REACHED_POSITION, ROBOT, Input, SimulationParameters, Task
from densarm.control.status import Fault
from densarm.control.supervisor import Supervisor
from densarm.errors import InvalidValueError, RobotError
from densarm.hardware.robot import Reading, Robot
from densarm.simulation.ending import Ending
from densarm.simulation.run import Run
from densarm.values.arrays import Array
from densarm.values.checks import one_of
from densarm.values.documented import in_short
from densarm.values.outcome import Outcome
from densarm.world.configurations import infeasibility
from densarm.world.near_pairs import NearPairs
from densarm.world.swept_check import SweptCheck
from densarm.world.world import World

_WARM_UPS = 5  # calls before the first command
_AT_REST = 0.02  # [rad/s or m/s] at most, from which a robot is driven
_BLIND = 0.02  # [s] that a supervisor brakes without a state that it believes
_STOPPING_TIME = 3.0  # [s] for coming to rest after Ctrl-C


class DriveInterrupted(KeyboardInterrupt):
    """Ctrl-C while a robot was driven, raised once it is at rest.

    Attributes:
        run: what it did until then.
    """

    def __init__(self, run: Run) -> None:
        super().__init__(run.detail)
        self.run = run


def drive(
    robot: Robot,
    world: World,
    controller: Any,
    goal: ArrayLike | Pose | None = None,
    *,
    parameters: SimulationParameters = SimulationParameters(),
    title: str = "run",
) -> Run:
    """Drive a robot from where it rests, until it holds the goal, rests elsewhere or stops.

    The clock is the robot's: each state that it sends is answered by one command. A torque comes
    through a `Supervisor`, the one given or one of its own, which stops the arm where state, clock
    or controller go wrong; where it does not believe the states for 20 ms, the robot stops itself,
    and what the robot's protocol refuses ends the run. In the end, whatever happens, `Robot.stop`
    is called. Ctrl-C brakes the arm as `Supervisor.stop` does, and raises once it rests; pressed
    again, it stops the robot at once.

    Nothing here is a certified safety function: the robot's own limits, its emergency stop and
    whoever can press it come first.

    Args:
        robot: what is driven.
        world: its arm among obstacles, as they are now, or in motion.
        controller: with the method that the robot's input names, as `simulate` has it; or a
            `Supervisor` of one.
        goal: as `simulate`.
        parameters: limits of time; dt and control_divisor are the robot's.
        title: of the record.

    Returns:
        The run, each period of the robot a sample, those that it lost interpolated. Its first
        sample counts as at rest. A robot that stopped by itself is `stuck`, in its own words.

    Raises:
        RobotError: the robot does not answer before the first command.
        DriveInterrupted: Ctrl-C, at rest again.
        InvalidValueError: the robot has another number of joints, moves, is not where the
            controller's motion begins, or has another period; else as `simulate`.
    """
    arm, first = world.arm, robot.read()
    told = Input(one_of("input of the robot", robot.input, list(Input)))
    law = controller
    if told == Input.TORQUE and not isinstance(controller, Supervisor):
        law = Supervisor(arm, controller, robot.period)
    if not callable(getattr(law, told, None)):
        allowed = f"one with a method {told}(t, q, v), which this robot needs"
        raise InvalidValueError("controller", type(controller).__name__, allowed)
    if (period := getattr(law, "period", robot.period)) != robot.period:
        raise InvalidValueError("period of the controller", period, f"the robot's, {robot.period}")
    start = _start(world, law, first)
    wanted: Any = getattr(law, "goal", None) if goal is None else goal
    wanted, pose = (None, wanted) if isinstance(wanted, Pose) else (wanted, None)
    task = Task(
        arm=arm,
        scene=world.scene,
        start=start,
        goal=None if wanted is None else arm.check_configuration("goal", wanted),
        title=title,
        passive_speed=getattr(controller, "passive_speed", None),
        simulation=replace(parameters, dt=robot.period, control_divisor=1),
        input=told,
        plant=ROBOT,
    )
    world.set_time(0.0)
    if fault := infeasibility(SweptCheck(world, task.margin), {"start": start}):
        return Run.at_rest(task, world, Outcome.INFEASIBLE, fault)
    loop = _Loop(task, world, robot, law, pose)
    with _interrupts() as pressed:
        run = loop.run(start, pressed)
    if pressed:
        raise DriveInterrupted(run)
    return run


def _start(world: World, law: Any, first: Reading) -> Array:
    """Return the configuration (nq,) from which a robot can be driven as it is."""
    arm = world.arm
    if len(first.position) != arm.nv:
        raise InvalidValueError("joints of the robot", len(first.position), f"{arm.nv}, the arm's")
    if np.abs(first.velocity).max() > _AT_REST:
        raise InvalidValueError("velocity of the robot", first.velocity, "zero: it must rest")
    start = arm.configuration(first.position)
    if (motion := getattr(law, "motion", None)) is not None:
        begin = arm.configurations(motion.position[0])
        if np.abs(arm.difference(begin, start)).max() > REACHED_POSITION:
            allowed = (
                f"within {REACHED_POSITION} rad or m of {in_short(motion.position[0])}, where "
            )
            allowed += "the motion begins: plan from where the robot is"
            raise InvalidValueError("position of the robot", first.position, allowed)
    return start


@contextmanager
def _interrupts() -> Iterator[list[int]]:
    """Collect what Ctrl-C would interrupt; in threads other than the main one nothing comes."""
    pressed: list[int] = []
    if threading.current_thread() is not threading.main_thread():
        yield pressed
        return
    before = signal.signal(signal.SIGINT, lambda number, _: pressed.append(number))
    try:
        yield pressed
    finally:
        signal.signal(signal.SIGINT, before)


@dataclass(eq=False)
class _Loop:
    """One run in the making."""

    task: Task
    world: World
    robot: Robot
    law: Any
    pose: Pose | None

    def __post_init__(self) -> None:
        self._pairs = NearPairs(self.world)
        self._ending = Ending(self.task, self.world, self.law, self.pose)
        self._steps: list[int] = [0]
        self._q, self._v = [self.task.start], [np.zeros(self.task.arm.nv)]
        self._u: list[Array] = []
        self._wanted: list[Array | None] = []
        self._clearance = [self._pairs.smallest(self.task.start)[0]]
        self._tracking_error: float | None = None
        self._seen = self._moved = 0.0  # when the state was believed last, or no stop was over

    def run(self, start: Array, pressed: list[int]) -> Run:
        rest = np.zeros(self.task.arm.nv)
        for _ in range(_WARM_UPS):
            u = self._input(0.0, start, rest)
        self._keep(u)
        collects = gc.isenabled()
        gc.collect()
        gc.disable()
        try:
            outcome, detail = self._until_it_ends(u, pressed)
        except RobotError as error:
            outcome, detail = Outcome.STUCK, str(error)
            if isinstance(self.law, Supervisor):
                self.law.stop(detail, fault=Fault.ROBOT)
        finally:
            self.robot.stop()
            if collects:
                gc.enable()
        if outcome == Outcome.STUCK and not detail:
            detail = self._ending.describe_rest(self._q[-1])
        return self._recorded(outcome, detail)

    def _until_it_ends(self, u: Array, pressed: list[int]) -> tuple[Outcome, str]:
        p, began, interrupted = self.task.simulation, None, None
        steps = round(p.time_limit / p.dt)
        self.robot.command(u)
        while self._steps[-1] < steps:
            reading = self.robot.read()
            began = reading.time - p.dt if began is None else began
            t = reading.time - began
            q, v = self._configuration(reading), reading.velocity
            self.world.set_time(t)
            u = self._input(t, q, v)
            self.robot.command(u)
            k = max(round(t / p.dt), self._steps[-1] + 1)
            self._steps.append(k)
            self._q.append(q)
            self._v.append(v)
            self._keep(u)
            distance, pair = self._pairs.smallest(q)
            self._clearance.append(distance)
            if distance <= 0.0:
                touching = " and ".join(self.world.pairs[pair])
                return Outcome.COLLIDED, f"{touching} at t = {t:.3f} s"
            if self._was_stopped(t):
                return Outcome.STUCK, self.law.status.sentence
            if pressed and interrupted is None:
                interrupted = t
                self._brake()
            if interrupted is not None:
                if len(pressed) > 1 or self._rests(v) or t - interrupted > _STOPPING_TIME:
                    return Outcome.STUCK, f"Ctrl-C at t = {interrupted:.3f} s"
            elif ended := self._ending.after(k, q, v):
                return ended, ""
        return Outcome.TIMED_OUT, f"after {p.time_limit:.3g} s"

    def _configuration(self, reading: Reading) -> Array:
        try:
            return self.task.arm.configuration(reading.position)
        except InvalidValueError as error:
            raise RobotError(f"the robot sent what is no state: {error}") from None

    def _was_stopped(self, t: float) -> bool:
        """Return whether a supervisor's stop is over, or the robot's own knows more than it."""
        if not isinstance(self.law, Supervisor):
            return False
        if self.law.trusts_state or self.law.status.fault == Fault.NONE:
            self._seen = t
        self._moved = self._moved if self.law.is_at_rest else t
        return t - self._seen > _BLIND or t - self._moved >= self.task.simulation.stall_time

    def _brake(self) -> None:
        if isinstance(self.law, Supervisor):
            self.law.stop("Ctrl-C was pressed.")
        elif hasattr(self.law, "pause"):
            self.law.pause()

    def _rests(self, v: Array) -> bool:
        stopped = getattr(self.law, "is_at_rest", getattr(self.law, "is_paused", True))
        return bool(stopped) and bool(np.abs(v).max() <= _AT_REST)

    def _input(self, t: float, q: Array, v: Array) -> Array:
        u: Array = getattr(self.law, self.task.input)(t, q, v)
        return u

    def _keep(self, u: Array) -> None:
        self._u.append(np.array(u, np.float64))
        self._wanted.append(getattr(self.law, "reference", None))
        error = getattr(self.law, "tracking_error", None)
        if error is not None:
            self._tracking_error = max(float(error), self._tracking_error or 0.0)

    def _recorded(self, outcome: Outcome, detail: str) -> Run:
        task, arm, dt = self.task, self.task.arm, self.task.simulation.dt
        if outcome == Outcome.REACHED:
            task = replace(task, goal=self._ending.goal_reached(self._q[-1]))
        at = np.array(self._steps)
        steps = np.arange(at[-1] + 1)
        before = np.searchsorted(at, steps, side="right") - 1

        def between(rows: list[Array]) -> Array:
            columns = np.transpose(np.array(rows))
            return np.transpose([np.interp(steps, at, column) for column in columns])

        angles = arm.unwrapped(np.array(self._q))
        missing = len(steps) - len(at)
        remarks = [str(getattr(self.law, "remark", ""))]
        if missing:
            remarks.append(f"{missing} of {len(steps)} states were lost, and are interpolated")
        known = [row for row in self._wanted if row is not None]
        reference = between(known) if len(known) == len(at) else None
        motion = getattr(self.law, "motion", None)
        u = np.array(self._u)[before]
        return Run(
            task=task,
            time=dt * steps.astype(np.float64),
            q=arm.configurations(between(list(angles))),
            v=between(self._v),
            tau=u if task.input == Input.TORQUE else np.zeros_like(u),
            clearance=np.interp(steps, at, self._clearance),
            outcome=outcome,
            detail=detail,
            tracking_error=self._tracking_error,
            replanned_at=tuple(getattr(self.law, "replanned_at", ())),
            remark="; ".join(filter(None, remarks)),
            reference=reference,
            tube=None if reference is None or motion is None else motion.tube,
        )
