"""Drive arms that are not their models, in MuJoCo: do they reach, touch nothing and keep track?

    python benchmarks/real_arm.py panda.json --every 29 --jobs 2 --json real_arm.json
    python benchmarks/real_arm.py --cases "payload 1,coulomb 0.5" --form regulation
    python benchmarks/real_arm.py panda.json --form computed_torque --json computed_torque.json
    python benchmarks/real_arm_figure.py real_arm.json computed_torque.json real_arm.png

The three Panda scenarios, and twelve problems of a MotionBenchMaker file, one of so many (without a
file the scenarios alone; in regulation always). Each motion is planned once and run in every case
at 1 kHz.
Controllers are told nothing but a delay that is declared. Pushes last 20 ms, at random joints and
times from which the arm could still be stopped in free space, as `StoppingCheck` proves.

Errors are medians over the runs: the largest off the motion, as a part of what its tube allows the
joint too, with the runs that stayed inside of it; and that left at the end.
"""

import argparse
import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

import densarm
from densarm.certificates.task import REACHED_POSITION, REACHED_VELOCITY
from densarm.cli.output import print_table
from densarm.control.disturbance_observer import ActuationParameters
from densarm.control.tracking import TRACKING_GAINS
from densarm.planning.plan import plan_path
from densarm.scene.loading import MotionProblem
from densarm.simulation.disturbances import Disturbances, Push
from densarm.study.baselines import ComputedTorque
from densarm.study.cluster import as_completed
from densarm.study.problems import scenario_of
from densarm.values.outcome import Outcome
from densarm.world.stopping import StoppingCheck, StoppingTrajectory

FORMS = ("tracking", "regulation", "computed_torque")
SCENARIOS = ("panda_table", "panda_shelf", "panda_holding_bar")
PROBLEMS = 12  # of the file, at most
PUSHES = 4  # of each problem
PUSH, PUSH_TIME = 2.0, 0.02  # [rad/s], [s]
LONGEST = 5.0  # [s] after the motion's end


def tracking(world: densarm.World, motion: densarm.Motion, delay: float) -> densarm.Controller:
    """The controller of a motion, told a delay [s]."""
    return densarm.DensityTracking(world, motion, actuation=ActuationParameters(delay=delay))


def computed_torque(world: densarm.World, motion: densarm.Motion, delay: float) -> ComputedTorque:  # noqa: ARG001
    """The classical controller of a motion, with the same gains, which knows of no delay."""
    return ComputedTorque(world.arm, motion, TRACKING_GAINS)


def regulation(
    scenario: densarm.Scenario, path: densarm.GuidePath, delay: float
) -> densarm.Controller:
    """The controller to a goal by way of a path, told a delay [s]."""
    return densarm.DensityRegulation(
        scenario.world,
        scenario.goal,
        path=path,
        margin=scenario.control.margin,
        actuation=ActuationParameters(delay=delay),
    )


def off_reference(
    run: densarm.Run, motion: densarm.Motion | None
) -> tuple[float | None, float | None]:
    """Largest error of a joint against the reference where it was then [rad], and of its tube."""
    if motion is None:
        return None, None
    reference = run.reference
    if reference is None:  # of a law whose clock never waits
        reference = np.array([motion.sample(t).position for t in run.time])
    off = np.abs(run.task.arm.angles(run.q) - reference)[:-1]
    return float(off.max()), None if run.tube is None else float((off / run.tube).max())


def torque_rate(run: densarm.Run) -> float:
    """Largest change of torque without gravity in a millisecond, the first included [N·m]."""
    arm = run.task.arm
    gravity = [pin.computeGeneralizedGravity(arm.model, arm.data, q).copy() for q in run.q]
    free = np.vstack([np.zeros(arm.nv), run.tau - gravity])
    return float(np.abs(np.diff(free, axis=0)).max())


def ended_at_goal(run: densarm.Run) -> bool:
    """Whether a run ended at its goal and slow, touching nothing."""
    is_slow = float(np.abs(run.v[-1]).max()) <= REACHED_VELOCITY
    return run.outcome != Outcome.COLLIDED and is_slow and run.goal_error <= REACHED_POSITION


@dataclass(frozen=True)
class Case:
    """What disturbs every run of a row, and the delay that controllers are told [s]."""

    disturbances: Disturbances = Disturbances()
    declared: float = 0.0
    pushes: int = 0


def delayed(delay: float) -> Case:
    return Case(Disturbances(torque_delay=delay), declared=delay)


NOISE: dict[str, Any] = {"encoder_noise": 1e-4, "velocity_noise": 1e-2}
ALL: dict[str, Any] = {
    "mass_scale": 1.1,
    "coulomb": 0.5,
    "viscous": 0.5,
    "torque_delay": 0.002,
    **NOISE,
}
CASES = {
    "exact": Case(),
    "noise": Case(Disturbances(**NOISE)),
    "tilt 2 deg": Case(Disturbances(base_tilt_deg=2.0)),
    "masses +10 %": Case(Disturbances(mass_scale=1.1)),
    "masses -10 %": Case(Disturbances(mass_scale=0.9)),
    "payload 1": Case(Disturbances(payload=1.0)),
    "payload 3": Case(Disturbances(payload=3.0)),
    "viscous 0.1": Case(Disturbances(viscous=0.1)),
    "viscous 0.5": Case(Disturbances(viscous=0.5)),
    "viscous 2": Case(Disturbances(viscous=2.0)),
    "coulomb 0.5": Case(Disturbances(coulomb=0.5)),
    "coulomb 1": Case(Disturbances(coulomb=1.0)),
    "armature 0.1 damping 1": Case(Disturbances(armature=0.1, viscous=1.0)),
    "delay 1 ms": delayed(0.001),
    "delay 2 ms": delayed(0.002),
    "delay 5 ms": delayed(0.005),
    "delay 2 ms undeclared": Case(Disturbances(torque_delay=0.002)),
    "all": Case(Disturbances(**ALL)),
    "pushes": Case(pushes=PUSHES),
}


@dataclass(frozen=True)
class Result:
    """How one run ended."""

    case: str
    problem: str
    outcome: str
    detail: str
    reached: bool
    """Whether it ended at the goal and at rest, touching nothing."""
    error: float | None
    """Largest off the motion [rad]."""
    share: float | None
    """The same as a part of the motion's tube."""
    tube: list[float] | None
    """The tube [rad]."""
    rest: float
    """Left at the end [rad]."""
    clearance: float
    """Smallest, by coal [m]."""
    rate: float
    """Largest change of torque without gravity in a millisecond [N·m]."""
    duration: float
    """Of the run [s]."""


def run_cases(
    form: str, names: Sequence[str], item: tuple[str | MotionProblem, int]
) -> list[Result]:
    """Plan a scenario or problem and run it in cases; the number seeds what is drawn for it."""
    known, seed = item
    scenario = densarm.load_scenario(known) if isinstance(known, str) else scenario_of(known)
    world, law = scenario.world, dict[str, Any](margin=scenario.control.margin, seed=scenario.seed)
    motion, moves = None, LONGEST
    make: Callable[[float], densarm.Controller]
    if form != "regulation":
        motion = densarm.plan_motion(world, scenario.start, scenario.goal, **law)
        law_of = tracking if form == "tracking" else computed_torque
        make, moves = partial(law_of, world, motion), motion.duration
    else:
        path = plan_path(world, scenario.start, scenario.goal, **law).path
        make = partial(regulation, scenario, path)
    results = []
    for name in names:
        for told in told_in(CASES[name], scenario, motion, seed):
            parameters = replace(
                scenario.simulation,
                time_limit=moves + LONGEST,
                stall_time=2.0,
            )
            controller = make(CASES[name].declared)
            run = densarm.simulate(
                world,
                controller,
                scenario.start,
                plant="mujoco",
                disturbances=told,
                parameters=parameters,
            )
            results.append(
                Result(
                    name,
                    scenario.name,
                    str(run.outcome),
                    run.detail,
                    ended_at_goal(run),
                    *off_reference(run, motion),
                    None if run.tube is None else run.tube.tolist(),
                    run.goal_error,
                    float(run.clearance.min()),
                    torque_rate(run),
                    float(run.time[-1]),
                )
            )
    return results


def told_in(
    case: Case, scenario: densarm.Scenario, motion: densarm.Motion | None, seed: int
) -> Iterator[Disturbances]:
    """Yield the disturbances of each run of a case: one, or one for each push."""
    told = replace(case.disturbances, seed=seed)
    if not case.pushes:
        yield told
        return
    if motion is None:
        return
    arm, random = scenario.arm, np.random.default_rng(seed)
    check, left = StoppingCheck(scenario.world, StoppingTrajectory(arm)), case.pushes
    for _ in range(1000):
        time = float(random.uniform(0.1, 0.9)) * motion.duration
        joint, velocity = int(random.integers(arm.nv)), PUSH * float(random.choice([-1.0, 1.0]))
        after, change = motion.sample(time + PUSH_TIME), velocity * np.eye(arm.nv)[joint]
        q = arm.configuration(after.position + 0.5 * PUSH_TIME * change)
        v = after.velocity + change
        if not check.check(q[np.newaxis], v[np.newaxis]).failing.size:
            yield replace(told, pushes=(Push(time, arm.joint_names[joint], velocity, PUSH_TIME),))
            left -= 1
        if not left:
            return


def rows(results: Sequence[Result]) -> list[dict[str, str]]:
    """Return one row of the table for each case."""
    table = []
    for name in dict.fromkeys(result.case for result in results):
        found = [result for result in results if result.case == name]
        errors = [r.error for r in found if r.error is not None]
        shares = [r.share for r in found if r.share is not None]
        table.append(
            {
                "case": name,
                "reached": str(sum(r.reached for r in found)),
                "contacts": str(sum(r.outcome == Outcome.COLLIDED for r in found)),
                "of": str(len(found)),
                "error [mrad]": f"{1e3 * np.median(errors):.2f}" if errors else "",
                "worst": f"{1e3 * np.max(errors):.2f}" if errors else "",
                "tube used": f"{np.median(shares):.0%}" if shares else "",
                "inside": f"{sum(share <= 1.0 for share in shares)}" if shares else "",
                "rest [mrad]": f"{1e3 * np.median([r.rest for r in found]):.2f}",
                "rate [N·m/ms]": f"{np.max([r.rate for r in found]):.2f}",
                "time [s]": f"{np.median([r.duration for r in found]):.2f}",
                "worst rest": f"{1e3 * np.max([r.rest for r in found]):.2f}",
            }
        )
    return table


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("problems", nargs="?", type=Path, help="MotionBenchMaker's, in JSON")
    parser.add_argument("--every", type=int, default=29)
    parser.add_argument("--cases", help=f"names with commas between; of {', '.join(CASES)}")
    parser.add_argument("--form", choices=FORMS, default=FORMS[0])
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    names = chosen(options.cases) if options.cases else list(CASES)
    known: list[str | MotionProblem] = [*SCENARIOS]
    if options.problems and options.form != "regulation":
        known += densarm.load_problems(options.problems)[:: options.every][:PROBLEMS]
    results: list[Result] = []
    items = list(zip(known, range(len(known)), strict=True))
    for done in as_completed(partial(run_cases, options.form, names), items, options.jobs):
        results += done
        print(f"{done[0].problem}: {sum(r.reached for r in done)} of {len(done)}")
    ordered = sorted(results, key=lambda result: names.index(result.case))
    print_table(rows(ordered), "Medians over all runs; worst: the largest.", f"{options.form}")
    for result in ordered:
        if not result.reached:
            print(f"{result.case}: {result.problem} {result.outcome}: {result.detail}")
    if options.json:
        data: dict[str, Any] = {"form": options.form, "rows": rows(ordered)}
        data["runs"] = [vars(result) for result in ordered]
        options.json.write_text(json.dumps(data, indent=1), encoding="utf-8")


def chosen(text: str) -> list[str]:
    """Return the names of cases between commas."""
    names = [name.strip() for name in text.split(",")]
    if unknown := [name for name in names if name not in CASES]:
        raise SystemExit(f"--cases: unknown {unknown[0]!r} (known: {', '.join(CASES)})")
    return names


if __name__ == "__main__":
    main()
