"""simulate: a scenario's closed loop, from planning to the recorded outcome."""

import time
from collections.abc import Callable

import numpy as np

from densarm.arrays import Array
from densarm.clearance import Clearance
from densarm.control.controller import Controller
from densarm.control.density_feedback import DensityFeedback
from densarm.control.density_regulation import DensityRegulation
from densarm.control.density_tracking import DensityTracking
from densarm.fields.density_field import DensityField
from densarm.fields.speed_law import SpeedLaw
from densarm.guides.guide import Guide, NoPath
from densarm.motion_plan import MotionPlan, plan_motion
from densarm.outcome import Outcome
from densarm.reference.infeasible_timing import InfeasibleTimingError
from densarm.scenario import ControlForm, GuideKind, Scenario
from densarm.simulation.fixed_step_loop import FixedStepLoop, LoopEnd, Recording
from densarm.trajectory import Trajectory
from densarm.validation import one_of

OnProgress = Callable[[str], None]
"""Told in a phrase what is being done."""


def simulate(
    scenario: Scenario,
    guide: Guide | GuideKind | str | None = None,
    seed: int | None = None,
    on_progress: OnProgress = lambda phrase: None,
) -> Trajectory:
    """Plan and run a scenario's torque-driven closed loop.

    Args:
        scenario: what to run.
        guide: "path", "direct" or a `Guide`; None for the scenario's own.
        seed: of the guide's random choices; None for the scenario's own.
        on_progress: told what is being done.

    Returns:
        The recorded run. Whatever happened is its `outcome`, not an exception. The same scenario
        and seed give the same run, bit for bit.

    Raises:
        InvalidValueError: a guide of an unknown name.
    """
    if isinstance(guide, str):
        guide = GuideKind(one_of("guide", guide, list(GuideKind)))
    guide = scenario.control.guide if guide is None else guide
    clearance = Clearance(scenario.arm, scenario.scene)
    if fault := _fault(scenario, clearance):
        return _at_rest(scenario, clearance, Outcome.INFEASIBLE, fault)
    on_progress("planning")
    began = time.perf_counter()
    try:
        plan = plan_motion(scenario, clearance, guide, scenario.seed if seed is None else seed)
    except InfeasibleTimingError as error:
        return _at_rest(scenario, clearance, Outcome.INFEASIBLE, str(error))
    plan_time = 0.0 if guide == GuideKind.DIRECT else time.perf_counter() - began
    if isinstance(plan, NoPath):
        return _at_rest(scenario, clearance, Outcome.NO_PATH, plan.reason, plan_time)
    return _run(scenario, clearance, plan, plan_time, on_progress)


def make_controller(scenario: Scenario, plan: MotionPlan) -> Controller:
    """Return the controller that a scenario names.

    Args:
        scenario: form, gains and speed law.
        plan: the way that it drives the arm along.
    """
    arm, period = scenario.arm, scenario.simulation.control_period
    if scenario.control.form == ControlForm.TRACKING:
        density, distance = plan.guided.density, plan.guided.goal_distance
        return DensityTracking(arm, density, distance, plan.reference, scenario.gains)
    field = DensityField(plan.guided, SpeedLaw(plan.bound, scenario.speed), scenario.gains.rate)
    if scenario.control.form == ControlForm.REGULATION:
        return DensityRegulation(arm, field, scenario.gains, period)
    return DensityFeedback(arm, field, scenario.gains, period)


def _run(
    scenario: Scenario,
    clearance: Clearance,
    plan: MotionPlan,
    plan_time: float,
    on_progress: OnProgress,
) -> Trajectory:
    tracks = scenario.control.form == ControlForm.TRACKING
    recording = FixedStepLoop(scenario.arm, scenario.simulation).run(
        make_controller(scenario, plan),
        scenario.start_configuration,
        scenario.goal_configuration,
        not_before=plan.reference.duration if tracks else 0.0,
        on_progress=lambda at: on_progress(f"running, {at:.1f} s simulated"),
    )
    on_progress("computing clearance")
    smallest, pair = _smallest_distances(clearance, recording.q)
    outcome, detail = _outcome(recording, plan)
    last = len(smallest)
    if (smallest <= 0.0).any():
        last = int(np.argmax(smallest <= 0.0)) + 1
        outcome = Outcome.COLLIDED
        detail = f"{' and '.join(clearance.pairs[pair[last - 1]])} at t = {recording.time[last - 1]:.3f} s"
    return Trajectory(
        scenario=scenario,
        time=recording.time[:last],
        q=recording.q[:last],
        v=recording.v[:last],
        tau=recording.tau[:last],
        clearance=smallest[:last],
        outcome=outcome,
        detail=detail,
        plan_time=plan_time,
        tracking_error=_tracking_error(scenario, plan, recording) if tracks else None,
    )


def _outcome(recording: Recording, plan: MotionPlan) -> tuple[Outcome, str]:
    if recording.end == LoopEnd.REACHED:
        return Outcome.REACHED, ""
    if recording.end == LoopEnd.TIMED_OUT:
        return Outcome.TIMED_OUT, f"after {recording.time[-1]:.3g} s"
    return Outcome.STUCK, plan.curve.detail or "at rest away from the goal"


def _smallest_distances(clearance: Clearance, q: Array) -> tuple[Array, Array]:
    """Return the smallest distance (N,) and its pair (N,) at every sample (N, nq)."""
    if clearance.n_pairs == 0:
        return np.full(len(q), np.inf), np.zeros(len(q), dtype=np.int64)
    smallest, pair = np.empty(len(q)), np.empty(len(q), dtype=np.int64)
    for k, configuration in enumerate(q):
        distance = clearance.distances(configuration)
        pair[k] = distance.argmin()
        smallest[k] = distance[pair[k]]
    return smallest, pair


def _tracking_error(scenario: Scenario, plan: MotionPlan, recording: Recording) -> float:
    arm = scenario.arm
    wanted = np.array([plan.reference.sample(t).position for t in recording.time])
    return float(np.abs(arm.difference(arm.configurations(wanted), recording.q)).max())


def _fault(scenario: Scenario, clearance: Clearance) -> str:
    """Return what makes start or goal infeasible, as a phrase; empty if nothing does."""
    arm, margin = scenario.arm, scenario.control.margin
    faults = []
    for name, angles in (("start", np.array(scenario.start)), ("goal", np.array(scenario.goal))):
        limits = arm.limits
        for j in np.flatnonzero((angles < limits.lower) | (angles > limits.upper)):
            faults.append(
                f"{name}: joint {arm.joint_names[j]!r} = {angles[j]:.4g} is outside "
                f"[{limits.lower[j]:.4g}, {limits.upper[j]:.4g}]"
            )
        distance = clearance.distances(arm.configuration(angles))
        for k in np.argsort(distance)[: int((distance <= margin).sum())]:
            a, b = clearance.pairs[k]
            faults.append(f"{name}: {a} and {b} are {distance[k] * 1e3:.3g} mm apart")
    return "; ".join(faults)


def _at_rest(
    scenario: Scenario, clearance: Clearance, outcome: Outcome, detail: str, plan_time: float = 0.0
) -> Trajectory:
    q, rest = scenario.start_configuration, np.zeros((1, scenario.arm.nv))
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
