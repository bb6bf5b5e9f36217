"""The fixed-step loop: any controller around any plant, judged and recorded."""

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from densarm.arms.pose import Pose
from densarm.certificates.task import PLANTS, Input, SimulationParameters, Task
from densarm.control.controller import Controller, VelocityController
from densarm.errors import InvalidValueError
from densarm.simulation.disturbances import Disturbances, Signals
from densarm.simulation.ending import Ending
from densarm.simulation.plants import PinocchioPlant, Plant, SingleIntegrator
from densarm.simulation.run import Run
from densarm.values.arrays import Array
from densarm.values.checks import finite_vector, one_of
from densarm.values.outcome import Outcome
from densarm.values.progress import OnProgress
from densarm.world.configurations import infeasibility
from densarm.world.near_pairs import NearPairs
from densarm.world.swept_check import SweptCheck
from densarm.world.world import World

_PROGRESS_INTERVAL = 200  # steps


def simulate(
    world: World,
    controller: Controller | VelocityController,
    start: ArrayLike,
    goal: ArrayLike | Pose | None = None,
    *,
    plant: Plant | str | None = None,
    disturbances: Disturbances | None = None,
    parameters: SimulationParameters = SimulationParameters(),
    title: str = "run",
    on_progress: OnProgress = lambda _: None,
) -> Run:
    """Run a controller in a closed loop from rest, until it ends.

    It ends where the arm has held the goal, where it touches something, where it rests away from
    the goal for too long, or when the time is up. Obstacles with a motion move along, from time
    zero on; the world is left as it is in the end. A goal is taken to be the controller's own
    attribute `goal`, which may move if it is a pose; without any the run ends by contact or time. A
    pose counts as held within 0.5 mm and 0.005 rad, and the configuration that holds it is the goal
    of the record then.

    Args:
        world: the arm among obstacles, as they are now, or in motion.
        controller: called at each control period, with the time since the run began. Its
            attributes `goal`, `motion`, `is_moving`, `tracking_error`, `remark`, `describe_stall`
            and `passive_speed`, if any, tell what it wants, how long it moves, why it rests, and
            before what it comes to rest.
        start: configuration (nq,).
        goal: configuration (nq,), or pose; None for the controller's own.
        plant: what is driven; None or "pinocchio" for the arm's model, "mujoco" for the same in
            MuJoCo.
        disturbances: how the plant differs from the arm's model, which no controller is told; None
            for those of a plant of one's own, or none.
        parameters: time step and limits of time.
        title: of the record.
        on_progress: told what is being done.

    Returns:
        The recorded run. Whatever happened is its `outcome`, not an exception.

    Raises:
        UnknownNameError: a pose of an unknown frame.
        InvalidValueError: start or goal is not a configuration, a plant of another time step or an
            unknown input or name, a controller without the method for it, a torque that is not
            one, or disturbances that a plant of one's own does not have.
        DensarmError: MuJoCo is asked for, and not installed.
        RobotDescriptionError: no plant, and an arm with links without a mass.
    """
    if isinstance(plant, str) or plant is None:
        driven = plant_of(world, plant or PLANTS[0], parameters, disturbances or Disturbances())
    else:
        driven = plant
    wanted: Any = getattr(controller, "goal", None) if goal is None else goal
    wanted, pose = (None, wanted) if isinstance(wanted, Pose) else (wanted, None)
    told = getattr(driven, "input", Input.TORQUE)
    task = Task(
        arm=world.arm,
        scene=world.scene,
        start=world.arm.check_configuration("start", start),
        goal=None if wanted is None else world.arm.check_configuration("goal", wanted),
        title=title,
        passive_speed=getattr(controller, "passive_speed", None),
        simulation=parameters,
        input=Input(one_of("input of the plant", told, list(Input))),
    )
    return simulate_task(task, world, controller, driven, disturbances, on_progress, pose)


def plant_of(
    world: World, name: str, parameters: SimulationParameters, disturbances: Disturbances
) -> Plant:
    """Return one of `PLANTS` of a world's arm, told torque, as it is disturbed."""
    if one_of("plant", name, PLANTS) == PinocchioPlant.name:
        return PinocchioPlant(world.arm, parameters.dt, parameters.integrator, disturbances)
    from densarm.simulation.mujoco_plant import MujocoPlant  # which is slow to import

    return MujocoPlant(world, parameters.dt, disturbances)


def simulate_task(
    task: Task,
    world: World,
    controller: Controller | VelocityController,
    plant: Plant | None = None,
    disturbances: Disturbances | None = None,
    on_progress: OnProgress = lambda _: None,
    pose: Pose | None = None,
) -> Run:
    """Run a controller on a task; as `simulate`, which makes the task.

    A task without a goal may have a pose for it.

    None for a plant is the task's, or for a task of velocities the arm that has them.
    """
    parameters, own = task.simulation, getattr(plant, "disturbances", Disturbances())
    told = own if disturbances is None else disturbances
    if plant is None and task.input == Input.VELOCITY:
        if task.plant != PinocchioPlant.name:
            raise InvalidValueError("plant", task.plant, "'pinocchio' where velocities are told")
        driven: Plant = SingleIntegrator(world.arm, parameters.dt)
    else:
        driven = plant or plant_of(world, task.plant, parameters, told)
    told.require_fit(world.arm)
    if told.of_the_body != getattr(driven, "disturbances", Disturbances()).of_the_body:
        allowed = "those of the plant, which is given its own when it is made"
        raise InvalidValueError("disturbances", list(told.of_the_body), allowed)
    name = getattr(driven, "name", PinocchioPlant.name)
    task = replace(task, plant=name, disturbances=told.given)
    if driven.dt != parameters.dt:
        raise InvalidValueError("dt of the plant", driven.dt, f"the loop's, {parameters.dt}")
    if not callable(getattr(controller, task.input, None)):
        allowed = f"one with a method {task.input}(t, q, v), which this plant needs"
        raise InvalidValueError("controller", type(controller).__name__, allowed)
    world.set_time(0.0)
    if fault := infeasibility(SweptCheck(world, task.margin), {"start": task.start}):
        return Run.at_rest(task, world, Outcome.INFEASIBLE, fault)
    signals = Signals(told, world.arm, parameters.dt)
    return _Loop(task, world, controller, driven, signals, pose).run(on_progress)


@dataclass(eq=False)
class _Loop:
    """One run in the making."""

    task: Task
    world: World
    controller: Controller | VelocityController
    plant: Plant
    signals: Signals
    pose: Pose | None
    q: list[Array] = field(default_factory=list)
    v: list[Array] = field(default_factory=list)
    clearance: list[float] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._pairs = NearPairs(self.world)
        self._ending = Ending(self.task, self.world, self.controller, self.pose)

    def run(self, on_progress: OnProgress) -> Run:
        task, p = self.task, self.task.simulation
        q, v, inputs = task.start, np.zeros(task.arm.nv), []
        if task.start_velocity is not None:
            v = task.start_velocity.copy()
        wanted: list[Array | None] = []
        tracking_error: float | None = None
        outcome, detail = Outcome.TIMED_OUT, f"after {p.time_limit:.3g} s"
        self._record(q, v)
        for k in range(round(p.time_limit / p.dt)):
            if k % p.control_divisor == 0:
                u = self._input(k * p.dt, *self.signals.measured(q, v))
                wanted.append(getattr(self.controller, "reference", None))
                error = getattr(self.controller, "tracking_error", None)
                if error is not None:
                    tracking_error = max(float(error), tracking_error or 0.0)
            q, v = self.plant.step(q, self.signals.pushed(k * p.dt, v), self.signals.acting(u))
            self.world.set_time((k + 1) * p.dt)
            inputs.append(u)
            if touching := self._record(q, v):
                outcome, detail = Outcome.COLLIDED, f"{touching} at t = {(k + 1) * p.dt:.3f} s"
                break
            if (ended := self._ending.after(k, q, v)) is not None:
                outcome, is_reached = ended, ended == Outcome.REACHED
                detail = "" if is_reached else self._ending.describe_rest(q)
                if is_reached:
                    task = replace(task, goal=self._ending.goal_reached(q))
                break
            if k % _PROGRESS_INTERVAL == 0:
                on_progress(f"running, {k * p.dt:.1f} s simulated")
        tau = np.array([*inputs, inputs[-1]])
        motion, reference = getattr(self.controller, "motion", None), self._reference(wanted)
        return Run(
            task=task,
            time=p.dt * np.arange(len(self.q), dtype=np.float64),
            q=np.array(self.q),
            v=np.array(self.v),
            tau=tau if task.input == Input.TORQUE else np.zeros_like(tau),
            clearance=np.array(self.clearance),
            outcome=outcome,
            detail=detail,
            tracking_error=tracking_error,
            replanned_at=tuple(getattr(self.controller, "replanned_at", ())),
            remark=str(getattr(self.controller, "remark", "")),
            reference=reference,
            tube=None if reference is None or motion is None else motion.tube,
        )

    def _input(self, t: float, q: Array, v: Array) -> Array:
        u = getattr(self.controller, self.task.input)(t, q, v)
        if not (isinstance(u, np.ndarray) and u.shape == v.shape and np.isfinite(u).all()):
            u = finite_vector(f"{self.task.input} of the controller at t = {t:.3f} s", u, len(v))
        return np.array(u, np.float64)  # a controller may write the next one into the same array

    def _reference(self, wanted: list[Array | None]) -> Array | None:
        """Return the reference (nv,) of each control period at each sample (N, nv)."""
        known = [row for row in wanted if row is not None]
        if len(known) < len(wanted):
            return None
        at, every = np.arange(len(self.q)), self.task.simulation.control_divisor
        columns = [np.interp(at, every * np.arange(len(known)), row) for row in np.transpose(known)]
        return np.transpose(columns)

    def _record(self, q: Array, v: Array) -> str:
        """Keep a state; return what touches there, or in the step before, as a phrase."""
        distance, pair = self._pairs.smallest(q)
        self.q.append(q.copy())  # as may a plant
        self.v.append(v.copy())
        self.clearance.append(distance)
        touching = " and ".join(self.world.pairs[pair]) if distance <= 0.0 else ""
        told = getattr(self.plant, "describe_contact", str)()
        if not told:
            return touching
        return f"{touching or told} ({told}, smallest distance {1e3 * distance:.3g} mm by coal)"
