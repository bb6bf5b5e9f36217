"""A scenario's closed loop, from planning to the recorded outcome."""

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from densarm.arrays import Array
from densarm.clearance import Clearance
from densarm.control.controller import Controller
from densarm.control.density_feedback import DensityFeedback
from densarm.control.density_tracking import DensityTracking
from densarm.control.field_regulation import FieldRegulation
from densarm.control.field_velocity import FieldVelocity
from densarm.control.replanning_controller import FollowedPlan, ReplanningController
from densarm.control.stoppable_controller import StoppableController
from densarm.control.velocity_controller import VelocityController
from densarm.feasibility import infeasibility
from densarm.fields.density_field import DensityField
from densarm.fields.speed_law import SpeedLaw
from densarm.guides.guide import Guide, NoPath
from densarm.motion_plan import MotionPlan, plan_motion
from densarm.outcome import Outcome
from densarm.reference.infeasible_timing import InfeasibleTimingError
from densarm.reference.reference import Reference
from densarm.reference.reference_density import reference_density
from densarm.scenario import ControlForm, GuideKind, Scenario
from densarm.simulation.fixed_step_loop import REACHED_POSITION, FixedStepLoop, LoopEnd, Recording
from densarm.simulation.plant import PinocchioPlant
from densarm.trajectory import Trajectory
from densarm.validation import one_of

OnProgress = Callable[[str], None]
"""Told in a phrase what is being done."""


@dataclass(frozen=True)
class Drive:
    """What drives an arm to its goal."""

    controller: Controller
    describe_stall: Callable[[Array], str]
    """From a configuration (nq,) to why the arm rests there, as a phrase."""
    reference: Reference | None = None
    """What the controller tracks, if it does."""
    replanned_at: Callable[[], tuple[float, ...]] = tuple
    """Tells the times at which it planned again [s]."""
    plan_time: float = 0.0
    """Wall-clock time that its guide took [s], if it has one."""


Method = Callable[[Scenario, Clearance], Drive | NoPath]
"""A way to drive an arm: from a scenario, and the clearance of its arm and scene."""


def simulate(
    scenario: Scenario,
    guide: Guide | GuideKind | str | None = None,
    seed: int | None = None,
    on_progress: OnProgress = lambda _: None,
) -> Trajectory:
    """Plan and run a scenario's torque-driven closed loop.

    Args:
        scenario: what to run.
        guide: "path", "direct" or a `Guide`; None for the scenario's own.
        seed: of the guide's random choices; None for the scenario's own.
        on_progress: told what is being done.

    Returns:
        The recorded run with its scenario, guide and seed as they were. Whatever happened is its
        `outcome`, not an exception. The same scenario and seed give the same run, bit for bit.

    Raises:
        InvalidValueError: a guide of an unknown name, or a seed that is not a whole number.
    """
    if isinstance(guide, str):
        guide = GuideKind(one_of("guide", guide, list(GuideKind)))
        scenario = replace(scenario, control=replace(scenario.control, guide=guide))
    if seed is not None:
        scenario = replace(scenario, seed=seed)
    chosen = scenario.control.guide if guide is None else guide

    def by_density(scenario: Scenario, clearance: Clearance) -> Drive | NoPath:
        plan = plan_motion(scenario, clearance, chosen)
        if isinstance(plan, NoPath):
            return plan
        return _drive(scenario, clearance, plan, chosen)

    run = run_closed_loop(scenario, by_density, on_progress)
    return replace(run, plan_time=0.0) if chosen == GuideKind.DIRECT else run


def run_closed_loop(
    scenario: Scenario, method: Method, on_progress: OnProgress = lambda _: None
) -> Trajectory:
    """Run a scenario's torque-driven closed loop by any method.

    Args:
        scenario: what to run.
        method: called once, unless start or goal is infeasible.
        on_progress: told what is being done.

    Returns:
        The recorded run; as its `preparation_time` the time until the method was ready.
    """
    began = time.perf_counter()
    clearance = Clearance(scenario.arm, scenario.scene)
    if fault := infeasibility(scenario, clearance):
        return _at_rest(scenario, clearance, Outcome.INFEASIBLE, fault)
    on_progress("planning")
    try:
        drive = method(scenario, clearance)
    except InfeasibleTimingError as error:
        return _at_rest(scenario, clearance, Outcome.INFEASIBLE, str(error))
    elapsed = time.perf_counter() - began
    if isinstance(drive, NoPath):
        return _at_rest(scenario, clearance, Outcome.NO_PATH, drive.reason, elapsed)
    run = _run(scenario, clearance, drive, on_progress)
    return replace(run, plan_time=drive.plan_time, preparation_time=elapsed)


def _drive(
    scenario: Scenario, clearance: Clearance, plan: MotionPlan, guide: Guide | GuideKind
) -> Drive:
    """Return what drives an arm along a plan, and along others from where it is pushed."""

    def followed(plan: MotionPlan) -> FollowedPlan:
        return FollowedPlan(make_controller(scenario, plan), plan.reference, plan.describe_stall)

    def plan_again(q: Array) -> FollowedPlan | None:
        try:
            again = plan_motion(replace(scenario, start=q), clearance, guide)
        except InfeasibleTimingError:
            return None
        return None if isinstance(again, NoPath) else followed(again)

    if guide == GuideKind.DIRECT:  # which has but one plan
        first = followed(plan)
        return Drive(first.controller, first.describe_stall, plan.reference)
    controller = ReplanningController(
        scenario.arm,
        scenario.goal,
        followed(plan),
        plan_again,
        patience=0.5 * scenario.simulation.stall_time,
        tolerance=REACHED_POSITION,
    )
    return Drive(
        controller,
        controller.describe_stall,
        plan.reference,
        plan_time=plan.guide_time,
        replanned_at=lambda: controller.replanned_at,
    )


def make_controller(scenario: Scenario, plan: MotionPlan) -> StoppableController:
    """Return the controller that a scenario names.

    Args:
        scenario: form, gains and speed law.
        plan: the way that it drives the arm along.
    """
    period = scenario.simulation.control_period
    controller = _controller(scenario, plan, period)
    return StoppableController(scenario.arm, controller, scenario.gains, period)


def _controller(scenario: Scenario, plan: MotionPlan, period: float) -> Controller:
    arm = scenario.arm
    if plan.reference is not None:
        density = reference_density(
            plan.bound, plan.reference, scenario.sensing, scenario.density, scenario.control.kappa
        )
        return DensityTracking(arm, density, plan.reference, scenario.gains)
    field = _field(scenario, plan)
    if scenario.control.form == ControlForm.REGULATION:
        return FieldRegulation(arm, field, scenario.gains, period)
    return DensityFeedback(arm, field, scenario.gains, period)


def make_velocity_controller(scenario: Scenario, plan: MotionPlan) -> VelocityController:
    """Return the planning system of a plan, for a plant that takes velocities.

    Args:
        scenario: speed law, and gains, whose K_p / K_v is the rate λ of `DensityField`. Its form
            should not be "plain", which weighs joints by inertia.
        plan: the way that it drives the arm along.
    """
    return FieldVelocity(scenario.arm, _field(scenario, plan))


def _field(scenario: Scenario, plan: MotionPlan) -> DensityField:
    return DensityField(plan.guided, SpeedLaw(plan.bound, scenario.speed), scenario.gains.rate)


def _run(
    scenario: Scenario,
    clearance: Clearance,
    drive: Drive,
    on_progress: OnProgress,
) -> Trajectory:
    arm, simulation = scenario.arm, scenario.simulation
    plant = PinocchioPlant(arm, simulation.dt, simulation.integrator)
    recording = FixedStepLoop(arm, plant, simulation).run(
        drive.controller,
        scenario.start,
        scenario.goal,
        not_before=0.0 if drive.reference is None else drive.reference.duration,
        on_progress=lambda at: on_progress(f"running, {at:.1f} s simulated"),
    )
    on_progress("computing clearance")
    smallest, pair = _smallest_distances(clearance, recording.q)
    outcome, detail = _outcome(recording, drive)
    last = len(smallest)
    if (smallest <= 0.0).any():
        last = int(np.argmax(smallest <= 0.0)) + 1
        outcome = Outcome.COLLIDED
        touching = " and ".join(clearance.pairs[pair[last - 1]])
        detail = f"{touching} at t = {recording.time[last - 1]:.3f} s"
    return Trajectory(
        scenario=scenario,
        time=recording.time[:last],
        q=recording.q[:last],
        v=recording.v[:last],
        tau=recording.u[np.minimum(np.arange(last), max(last - 2, 0))],
        clearance=smallest[:last],
        outcome=outcome,
        detail=detail,
        tracking_error=_tracking_error(scenario, drive, recording),
        replanned_at=drive.replanned_at(),
    )


def _outcome(recording: Recording, drive: Drive) -> tuple[Outcome, str]:
    if recording.end == LoopEnd.REACHED:
        return Outcome.REACHED, ""
    if recording.end == LoopEnd.TIMED_OUT:
        return Outcome.TIMED_OUT, f"after {recording.time[-1]:.3g} s"
    return Outcome.STUCK, drive.describe_stall(recording.q[-1])


def _smallest_distances(clearance: Clearance, q: Array) -> tuple[Array, NDArray[np.int64]]:
    """Return the smallest distance (N,) and its pair (N,) at every sample (N, nq)."""
    if clearance.n_pairs == 0:
        return np.full(len(q), np.inf), np.zeros(len(q), dtype=np.int64)
    smallest, pair = np.empty(len(q)), np.empty(len(q), dtype=np.int64)
    for k, configuration in enumerate(q):
        distance = clearance.distances(configuration)
        pair[k] = distance.argmin()
        smallest[k] = distance[pair[k]]
    return smallest, pair


def _tracking_error(scenario: Scenario, drive: Drive, recording: Recording) -> float | None:
    reference = drive.reference
    if reference is None or drive.replanned_at():
        return None
    arm = scenario.arm
    wanted = np.array([reference.sample(t).position for t in recording.time])
    return float(np.abs(arm.difference(arm.configurations(wanted), recording.q)).max())


def _at_rest(
    scenario: Scenario, clearance: Clearance, outcome: Outcome, detail: str, plan_time: float = 0.0
) -> Trajectory:
    q, rest = scenario.start, np.zeros((1, scenario.arm.nv))
    return Trajectory(
        scenario=scenario,
        time=np.zeros(1),
        q=q[np.newaxis],
        v=rest,
        tau=rest.copy(),
        clearance=_smallest_distances(clearance, q[np.newaxis])[0],
        outcome=outcome,
        detail=detail,
        plan_time=plan_time,
    )
