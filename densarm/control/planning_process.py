"""PlanningProcess: plans again in a process of its own, beside a control loop that goes on."""

import os
import signal
from concurrent.futures import BrokenExecutor, Future, ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context
from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from densarm.arms.arm import Arm
from densarm.control.controller import Controller
from densarm.control.sensing import SensingDistances, sensing_distances
from densarm.control.tracking import DensityTracking
from densarm.density.unsafe_sets import SensingParameters
from densarm.planning.motion import Motion, PlanningError
from densarm.planning.plan import plan_motion
from densarm.scene.scene import Scene
from densarm.values.arrays import Array
from densarm.values.checks import non_negative
from densarm.values.outcome import Outcome
from densarm.world.world import World

_POLITENESS = 5  # by which the loop's process has the first claim to a processor

_Pairs = tuple[tuple[str, str], ...]
_Answer = Future[tuple[Motion, _Pairs, SensingDistances]]
_arm: Arm  # of the process that plans


class PlanningProcess:
    """Plans again in another process, for a `DensityTracking` in a loop: a `Planner`.

    It plans from where the arm stands, around obstacles where they will be, and has the motion's
    sensing distances computed there too, so that neither `ask` nor `answer` keeps a loop at 1 kHz
    waiting. The process is another Python: the script that makes this must be importable, its own
    work behind ``if __name__ == "__main__":``. It ends with `close`, or a ``with`` block.

    Args:
        world: the arm among obstacles, as the loop has it.
        tracking: what is to follow the new motions.
        goal: configuration to reach (nq,).
        ahead: how far ahead obstacles are predicted [s].
        sensing: as of `tracking`.
        options: those of `plan_motion`; margin and period are the motion's.

    Attributes:
        goal: as given; another one holds from the next `ask` on.

    Raises:
        InvalidValueError: a time that is negative, or the goal is not a configuration.
    """

    def __init__(
        self,
        world: World,
        tracking: DensityTracking,
        goal: ArrayLike,
        *,
        ahead: float = 0.3,
        sensing: SensingParameters = SensingParameters(),
        **options: Any,
    ) -> None:
        self._world, self._tracking = world, tracking
        self._ahead = non_negative("ahead", ahead)
        self.goal: Array = world.arm.check_configuration("goal", goal)
        own = {"margin": tracking.motion.margin, "period": tracking.motion.period}
        self._options, self._sensing = {**options, **own}, sensing
        self._pool = ProcessPoolExecutor(1, get_context("spawn"), _begin, (world.arm,))
        self._asked = self._begin_to_plan(world.arm.configurations(tracking.motion.position[0]))
        self._asked.exception()  # waits until the process has loaded all that planning needs

    def ask(self, t: float, q: Array) -> None:
        """Act as `Planner.ask`."""
        self._asked.cancel()
        self._asked = self._begin_to_plan(q)

    def answer(self, t: float, q: Array) -> Controller | None:
        """Act as `Planner.answer`."""
        if not self._asked.done():
            return None
        try:
            motion, pairs, sensed = self._asked.result()
        except BrokenExecutor as error:
            raise PlanningError(Outcome.NO_PATH, "the process that plans has ended") from error
        if pairs != self._world.pairs:  # obstacles came or went, whose pairs are others
            known = dict(zip(pairs, sensed.pairs.tolist(), strict=True))
            most = self._sensing.distance
            wanted = np.array([known.get(pair, most) for pair in self._world.pairs])
            sensed = sensed._replace(pairs=wanted)
        self._tracking.follow(motion, q, sensed)
        return self._tracking

    def _begin_to_plan(self, q: Array) -> _Answer:
        scene = self._world.predicted(self._ahead)
        try:
            return self._pool.submit(_plan, scene, q, self.goal, self._sensing, self._options)
        except BrokenExecutor as error:
            failed = _Answer()
            failed.set_exception(error)
            return failed

    def close(self) -> None:
        """End the process."""
        self._pool.shutdown(cancel_futures=True)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()


def _begin(arm: Arm) -> None:
    global _arm  # noqa: PLW0603  # how an executor's processes keep what is large
    _arm = arm
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the loop's to answer
    os.nice(_POLITENESS)


def _plan(
    scene: Scene, start: Array, goal: Array, sensing: SensingParameters, options: dict[str, Any]
) -> tuple[Motion, _Pairs, SensingDistances]:
    world = World(_arm, scene)
    motion = plan_motion(world, start, goal, **options)
    sensed = sensing_distances(world, motion, sensing)
    return replace(motion, world=None), world.pairs, sensed
