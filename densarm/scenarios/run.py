"""A scenario's closed loop, from planning to the recorded outcome."""

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from densarm.certificates.records import (
    EnergyRecord,
    RantzerRecord,
    no_energy,
    record_energy,
    record_rantzer,
)
from densarm.control.controller import Controller
from densarm.control.goal_on_obstacle import GoalOnObstacle
from densarm.control.passive import PassiveTracking
from densarm.control.regulation import DensityRegulation
from densarm.control.replanning import PlanningInLoop, Replanning
from densarm.control.tracking import DensityTracking
from densarm.density.goal_distance import InertiaDistance, TorusDistance
from densarm.density.navigation_density import density_towards
from densarm.errors import InvalidValueError
from densarm.planning.guide import Guide, GuidePath, PlannedPath
from densarm.planning.motion import Motion, PlanningError
from densarm.planning.path_margins import inside_limits
from densarm.planning.plan import GUIDES, plan_motion, plan_path
from densarm.scenarios.control import ControlForm
from densarm.scenarios.perform import perform
from densarm.scenarios.scenario import Scenario, load_scenario
from densarm.simulation.disturbances import Disturbances
from densarm.simulation.plants import Plant
from densarm.simulation.run import Run
from densarm.simulation.simulate import simulate_task
from densarm.values.arrays import Array
from densarm.values.checks import one_of
from densarm.values.outcome import Outcome
from densarm.values.progress import OnProgress, shown_progress
from densarm.world.swept_check import SweptCheck
from densarm.world.world import World


@dataclass(frozen=True, eq=False)
class Drive:
    """What drives an arm to its goal."""

    controller: Controller
    plan_time: float = 0.0
    """Wall-clock time that its guide took [s], if it has one."""
    motion: Motion | None = None
    """What the controller tracks, if it does."""
    path: GuidePath | None = None
    """The sub-goals that a guide found, if it has one."""
    goal: Array | None = None
    """The configuration that it leads to (nq,); None for the scenario's."""


Baseline = Callable[[Scenario], Drive]
"""A way to drive a scenario's arm; it raises `PlanningError` where it has none."""


def run(
    scenario: Scenario | str | Path,
    guide: Guide | str | None = None,
    seed: int | None = None,
    on_progress: OnProgress | None = None,
    *,
    plant: Plant | str | None = None,
    disturbances: Disturbances | None = None,
) -> Run:
    """Plan and run a scenario's closed loop.

    Args:
        scenario: what to run: a `Scenario`, a known name, or the path of a TOML file.
        guide: one of `GUIDES`, or a `Guide`; None for the scenario's own.
        seed: of the guide's random choices; None for the scenario's own.
        on_progress: told what is being done; None for a line below the cell of a notebook.
        plant: "pinocchio", "mujoco", or a plant of one's own; None for the scenario's.
        disturbances: how the plant differs from the arm's model; None for the scenario's own.

    Returns:
        The recorded run, its guide and seed as they were. Whatever happened is its `outcome`, not
        an exception. The same scenario and seed give the same run, bit for bit.

    Raises:
        InvalidValueError: a guide or plant of an unknown name, a seed that is not a whole number,
            or disturbances of another arm.
        DensarmError: a scenario that cannot be loaded, or MuJoCo is not installed.
    """
    chosen = scenario if isinstance(scenario, Scenario) else load_scenario(scenario)
    if isinstance(guide, str):
        control = replace(chosen.control, guide=one_of("guide", guide, GUIDES))
        chosen = replace(chosen, control=control)
    if seed is not None:
        chosen = replace(chosen, seed=seed)
    if isinstance(plant, str):
        chosen = replace(chosen, plant=plant)
    if disturbances is not None:
        chosen = replace(chosen, disturbances=disturbances)
    own = None if guide is None or isinstance(guide, str) else guide
    is_by_name = own is None and (plant is None or isinstance(plant, str))
    if chosen.steps and not is_by_name:
        raise InvalidValueError("guide or plant", own or plant, "one by name, of steps")
    other = None if isinstance(plant, str) else plant
    with shown_progress(on_progress) as tell:
        if chosen.steps:
            return perform(chosen, tell)
        return run_by(chosen, lambda scenario: by_density(scenario, own), tell, other)


def run_by(
    scenario: Scenario,
    baseline: Baseline,
    on_progress: OnProgress = lambda _: None,
    plant: Plant | None = None,
) -> Run:
    """Run a scenario's closed loop by any way to drive the arm, or another plant, as `run`."""
    scenario.require_one_goal()
    began = time.perf_counter()
    world, task = scenario.world, scenario.task
    on_progress("planning")
    world.set_time(0.0)
    try:
        drive = baseline(scenario)
    except PlanningError as error:
        ended = Run.at_rest(task, world, error.outcome, error.detail)
        searched = error.outcome == Outcome.NO_PATH
        return replace(ended, plan_time=time.perf_counter() - began if searched else 0.0)
    elapsed = time.perf_counter() - began
    told = scenario.disturbances if plant is None else None
    pose = scenario.moving_goal
    if drive.goal is not None or pose is not None:
        task = replace(task, goal=drive.goal)
    done = simulate_task(task, world, drive.controller, plant, told, on_progress, pose)
    if done.outcome == Outcome.INFEASIBLE:
        return done
    done = replace(done, plan_time=drive.plan_time, preparation_time=elapsed)
    if (path := drive.path) is None:
        return done
    remark = "; ".join(filter(None, dict.fromkeys([path.remark, done.remark])))
    return replace(done, led_by=path.found_by, stuck=path.stuck, remark=remark)


def by_density(
    scenario: Scenario,
    guide: Guide | None = None,
    *,
    world: World | None = None,
    replans: bool = True,
) -> Drive:
    """Return what drives an arm by the density, in the scenario's form and along its guide.

    A guide replaces the scenario's own, and so does a world. Where the plan loses the arm there is
    a new one, if it `replans`, and torque, not velocity, drives the arm.

    Raises:
        PlanningError: there is no way, or, without a guide's path, the density is stuck at once.
    """
    world = world or scenario.world
    if (pose := scenario.moving_goal) is not None:
        law = scenario.law_options | _regulation(scenario)
        return Drive(GoalOnObstacle(world, pose, scenario.goal_follows, **law))
    found = _planned(scenario, world, scenario.start, guide)
    controller = _controller(scenario, world, found)
    motion = found if isinstance(found, Motion) else None
    goal = scenario.goal if found.goal is None else found.goal
    scenario = replace(scenario, goal=goal, goals=()) if scenario.goals else scenario
    drive = Drive(controller, found.plan_time, motion, found.path, found.goal)
    is_told_velocity = scenario.control.form == ControlForm.VELOCITY
    if not replans or is_told_velocity or (guide is None and scenario.control.guide == "direct"):
        return drive

    def plan_again(predicted: World, q: Array) -> Callable[[Array], Controller]:
        planned = _planned(scenario, predicted, q, guide)
        if isinstance(planned, Motion) and isinstance(controller, DensityTracking):
            return partial(_following, controller, replace(planned, world=world))
        return lambda _: _controller(scenario, world, planned)

    replanning = Replanning(
        scenario.arm,
        goal,
        controller,
        PlanningInLoop(world, plan_again, scenario.simulation.planning_time),
        patience=0.5 * scenario.simulation.stall_time,
        gains=scenario.gains_of(ControlForm.REGULATION),
        period=scenario.simulation.control_period,
    )
    return replace(drive, controller=replanning)


def _following(tracking: DensityTracking, motion: Motion, q: Array) -> Controller:
    tracking.follow(motion, q)
    return tracking


def plan(
    scenario: Scenario,
    guide: Guide | str | None = None,
    *,
    world: World | None = None,
    start: Array | None = None,
) -> Motion:
    """Plan a scenario's motion, whatever its form of control.

    Guide, world and start (nq,) replace the scenario's own.

    Raises:
        PlanningError: there is no motion, with the outcome and the reason.
    """
    scenario.require_one_goal()
    return plan_motion(
        world or scenario.world,
        scenario.start if start is None else start,
        **_asked(scenario, guide),
        period=scenario.simulation.control_period,
        timing=scenario.timing,
        time_limit=scenario.simulation.time_limit,
    )


def _asked(scenario: Scenario, guide: Guide | str | None) -> dict[str, Any]:
    """Return what a scenario asks of `plan_motion` and `plan_path`."""
    options = {"goal": list(scenario.goals) or scenario.goal, **scenario.plan_options}
    return options if guide is None else {**options, "guide": guide}


def _planned(
    scenario: Scenario, world: World, start: Array, guide: Guide | None
) -> PlannedPath | Motion:
    """Return the plan that a scenario's form of control needs."""
    if scenario.control.form in {ControlForm.REGULATION, ControlForm.PLAIN}:
        return plan_path(world, start, **_asked(scenario, guide))
    try:
        return plan(scenario, guide, world=world, start=start)
    except PlanningError as error:
        if error.motion is None:
            raise
        return error.motion  # the arm goes as far as the density leads, which the record shows


def _controller(scenario: Scenario, world: World, planned: PlannedPath | Motion) -> Controller:
    """Return what drives an arm along a plan, in a scenario's form of control."""
    control, law = scenario.control, scenario.law_options
    if isinstance(planned, PlannedPath):
        law |= _regulation(scenario)
        is_plain = control.form == ControlForm.PLAIN
        law["goal_distance"] = None if is_plain else scenario.goal_distance
        return DensityRegulation(world, planned.goal, path=planned.path, plain=is_plain, **law)
    law["goal_distance"] = TorusDistance(scenario.arm, kappa=control.kappa)
    if control.passive_speed is None:
        return DensityTracking(world, planned, **law)
    return PassiveTracking(world, planned, control.passive_speed, **law)


def _regulation(scenario: Scenario) -> dict[str, Any]:
    return {
        "margin": scenario.control.margin,
        "period": scenario.simulation.control_period,
        "speed": scenario.speed,
    }


def records(run: Run) -> tuple[EnergyRecord, RantzerRecord]:
    """Return what is recorded of a run's energy and of Rantzer's condition along it.

    Args:
        run: its density is the plain one of the goal; nothing is recorded without a goal, or
            among obstacles that move.
    """
    if run.task.goal is None:
        reason = "steps have goals of their own" if run.phases else "no goal was given"
        return no_energy(reason), RantzerRecord(str(run.task.density.gauge))
    scenario = Scenario.of_task(run.task)
    world, control = scenario.world, scenario.control
    if world.fastest_obstacle > 0.0:
        reason = "obstacles move, and U with them"
        return no_energy(reason), RantzerRecord(str(run.task.density.gauge))
    goal = inside_limits(SweptCheck(world, control.margin), scenario.goal)
    is_plain = control.form == ControlForm.PLAIN
    density = density_towards(
        world,
        goal,
        margin=control.margin,
        kappa=control.kappa,
        goal_distance=InertiaDistance(scenario.arm, goal) if is_plain else None,
        parameters=scenario.density,
        sensing=scenario.sensing,
    )
    if control.form != ControlForm.REGULATION:
        energy = no_energy(f"control form {str(control.form)!r}, not 'regulation'")
    elif control.guide != "direct":
        energy = no_energy(f"guide {control.guide!r}, whose sub-goals change U, not 'direct'")
    else:
        energy = record_energy(run.task, density, scenario.law_gains, run.q, run.v, run.tau)
    return energy, record_rantzer(run.task, density, run.q)
