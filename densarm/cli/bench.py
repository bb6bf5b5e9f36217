"""``densarm bench``: benchmarks."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from densarm.cli.options import (
    choice_option,
    number_option,
    output_option,
    plant_options,
    read_disturbances,
    together,
    worker_options,
)
from densarm.cli.output import print_table, progress, write_json
from densarm.errors import FileContentError
from densarm.values.outcome import Outcome

if TYPE_CHECKING:
    from densarm.scene.loading import MotionProblem
    from densarm.study.problems import ProblemResults


@click.group(no_args_is_help=False)
def bench() -> None:
    """Measure densarm on this machine.

    \b
    Example:
      densarm bench step --arm panda --shapes hull --pairs 64 --json step.json
      densarm bench random --arm ur5 --problems 50 --jobs 2 --json random.json
      densarm bench motionbenchmaker --problems panda.json --jobs 2 --json results.json
    """  # noqa: D301


@bench.command()
@click.option("--arm", default="panda", show_default=True, help="A name of `densarm list`.")
@choice_option("--shapes", ["hull", "pieces", "capsule"], "The arm's collision geometry.")
@number_option("--pairs", 64, "Geometry pairs: arm to sphere, filled up by the arm's own.")
@number_option("--steps", 20_000, "Steps to be timed, at 1 kHz along a motion.")
@number_option("--moving", 0, "Spheres that move in a third turn, which are evaded.", least=0)
@output_option("--json", "FILE", "Write the result as JSON.")
def step(arm: str, shapes: str, pairs: int, steps: int, moving: int, json: Path | None) -> None:
    """Time one control step of the density tracking controller.

    The whole `controller.torque` is compared with bare calls of Pinocchio and coal for the
    distances of all pairs (computeJointJacobians, updateGeometryPlacements, computeDistances, rnea)
    in the same states, in turns, while the arm swings to and fro among spheres. Percentiles are
    of processor time; undisturbed ones of the least time that each state took in its visits,
    steady ones of steps that follow a step directly, with nothing else in the caches. The first
    call, for which kernels are compiled or loaded from disk when the controller is made, is timed
    in new processes.

    \b
    Example:
      densarm bench step --arm panda --shapes capsule --pairs 64 --json step.json
    """  # noqa: D301
    with progress() as report:
        report("measuring")
        from densarm.study.step import time_first_calls, time_step

        result = time_step(arm, shapes, pairs, steps, moving)
        report("compiling in a new process")
        compiled, loaded = time_first_calls(arm, shapes, pairs)
        if json:
            first_calls = {"compiled": asdict(compiled), "loaded": asdict(loaded)}
            write_json(json, {**asdict(result), "first_calls": first_calls})
    click.echo(f"controller.torque  {result.step_us:.1f} µs")
    click.echo(f"bare calls         {result.bare_us:.1f} µs")
    click.echo(f"ratio              {result.ratio:.2f}")
    if result.evading_us is not None:
        ratio = f"{result.evading_ratio:.2f} of the step, {moving} spheres moving"
        click.echo(f"evading            {result.evading_us:.1f} µs, {ratio}")
    click.echo(f"pairs              {result.pairs}")
    for name, times in (
        ("controller.torque", result.step_percentiles_us),
        ("  undisturbed", result.undisturbed_percentiles_us),
        ("  steady", result.steady_percentiles_us),
        ("bare calls", result.bare_percentiles_us),
        ("evading", result.evading_percentiles_us),
    ):
        if times:
            at = ", ".join(f"{time:.1f}" for time in times)
            click.echo(f"{name:<18} {at} µs at 50, 99, 99.9 %")
    for name, call in (("compiled", compiled), ("loaded from disk", loaded)):
        made = f"{call.preparation_s:.2f} s before it, kernels {name}"
        click.echo(f"first call         {call.torque_us:.0f} µs, all pairs queried; {made}")
    click.echo(f"resumed step       {result.resumed_us:.0f} µs, after other work")
    click.echo(f"core taken away    {result.switches} times")
    click.echo(f"memory growth      {result.memory_growth_kb:.0f} kB")
    click.echo(f"collections        {result.collections}")


_set_options = together(
    choice_option(
        "--guide",
        ["auto", "density", "direct", "path", "both"],
        "What supplies the sub-goals; both: auto, and what direct reaches beside it.",
    ),
    click.option(
        "--time-optimal",
        is_flag=True,
        help="Compare each motion with the fastest along its path, by TOPP-RA.",
    ),
    plant_options,
    click.option(
        "--draw",
        multiple=True,
        callback=read_disturbances,
        metavar="NAME=SIZE",
        help="Disturb each joint of each problem by an own number: mass_scale=0.1 from 0.9 to 1.1, "
        "all others, as coulomb=0.5, from 0 to their size.",
    ),
    click.option(
        "--acceleration",
        type=float,
        help="Limit of every joint, in place of the arm's own [rad/s² or m/s²].",
    ),
    click.option("--jerk", type=float, help="The same [rad/s³ or m/s³]."),
    worker_options,
    click.option(
        "--save-dir",
        type=click.Path(path_type=Path, file_okay=False),
        help="Keep every run here; those that are here already are not run again.",
    ),
    output_option("--json", "FILE", "Write every problem's result and the figures as JSON."),
)


@bench.command("random")
@click.option("--arm", default="panda", show_default=True, help="A name of `densarm list`.")
@choice_option(
    "--scenes",
    ["mixed", "spheres", "boxes", "wall", "shelf", "none"],
    "What is in the way; mixed: the next four in turn.",
)
@number_option("--problems", 50, "Number of problems.")
@number_option("--seed", 0, "Seed of scenes, starts, goals and the planner.", least=0)
@_set_options
def random(arm: str, scenes: str, problems: int, seed: int, **options: Any) -> None:
    """Move an arm between random configurations among random obstacles.

    Spheres, boxes, a wall with a gap or a shelf, in proportion to the arm's reach. Starts and
    goals are drawn evenly within the position limits, continuous joints from a whole turn, and
    touch nothing; a problem is kept if a search of 100,000 samples finds a path that keeps 0.25 %
    of the reach from contact. Each is planned, run as a torque-driven closed loop, and proved.

    The exit status is 0 when all problems were run, whatever was reached.

    \b
    Example:
      densarm bench random --arm ur5 --problems 50 --jobs 2 --json random.json
      densarm bench random --arm ur5 --problems 50 --scenes none
    """  # noqa: D301
    with progress() as report:
        report("loading")
        from densarm.study.random_problems import random_problems

        chosen = random_problems(
            arm, problems, seed, scenes, options["jobs"], report, options["scheduler"]
        )
        finish = _run_set(chosen, report, seed=seed, **options)
    finish()


@bench.command()
@click.option(
    "--problems",
    type=click.Path(path_type=Path, dir_okay=False),
    required=True,
    help="JSON file of problems.",
)
@number_option("--every", 1, "Run one problem of so many.")
@choice_option(
    "--goals",
    ["configuration", "pose"],
    "What is to be reached: the goal of the file, or the hand's pose at it, by any configuration.",
)
@_set_options
def motionbenchmaker(problems: Path, every: int, **options: Any) -> None:
    """Run problems of MotionBenchMaker's collection.

    Each problem is planned, run as a torque-driven closed loop, and proved. An interrupted
    benchmark goes on where it was with the same --save-dir.

    The exit status is 0 when all problems were run, whatever was reached.

    \b
    Example:
      densarm bench motionbenchmaker --problems panda.json --every 10 --json results.json
      densarm bench motionbenchmaker --problems panda.json --goals pose
      densarm bench motionbenchmaker --problems panda.json --acceleration 15 --jerk 500
      densarm bench motionbenchmaker --problems panda.json --plant mujoco --draw mass_scale=0.1
    """  # noqa: D301
    with progress() as report:
        report("loading")
        from densarm.scene.loading import load_problems

        finish = _run_set(load_problems(problems)[::every], report, **options)
    finish()


@bench.command()
@click.option("--arm", default="panda", show_default=True, help="A name of `densarm list`.")
@number_option("--obstacles", 1, "Balls; from two on around a table and a wall.")
@click.option("--speed", type=float, default=1.0, show_default=True, help="Of the balls [m/s].")
@number_option("--trials", 20, "Trials of each method.")
@number_option("--seed", 0, "Seed of the first trial, the next one's being one more.", least=0)
@click.option(
    "--methods",
    default="density,damper_qp,stop_and_go",
    show_default=True,
    help="What gives way, separated by commas; also density_near, without looking ahead, "
    "plan_again, which stops and plans around what is near, passive, which rests before anything "
    "of the balls' speed can reach it, and, with their packages (pip install 'densarm[peers]'), "
    "mink and cbfpy.",
)
@click.option("--resting", is_flag=True, help="The arm is to stay where it is.")
@click.option(
    "--estimated",
    is_flag=True,
    help="Velocities are not told, but estimated from positions at 100 Hz that err by 5 mm.",
)
@worker_options
@click.option(
    "--save-dir",
    type=click.Path(path_type=Path, file_okay=False),
    help="Keep what came of every run here; those that are here already are not run again.",
)
@output_option("--json", "FILE", "Write the figures as JSON.")
def moving(
    methods: str,
    trials: int,
    seed: int,
    jobs: int,
    scheduler: str | None,
    save_dir: Path | None,
    json: Path | None,
    **options: Any,
) -> None:
    """Aim balls of 80 mm radius at an arm, by one method after another.

    Each ball is aimed at a link where the motion has it, and would hit it. Trials are the same for
    all methods, which differ in what gives way alone. A contact ends a run; it has reached if the
    arm is at the goal within 4 s after the balls have passed. An interrupted benchmark goes on
    where it was with the same --save-dir.

    The exit status is 0 when all trials were run, whatever was touched.

    \b
    Example:
      densarm bench moving --arm ur5 --obstacles 4 --speed 1.0 --trials 50 --json moving.json
    """  # noqa: D301
    with progress() as report:
        report("loading")
        from densarm.study.moving import Cell, run_trials, to_json

        cell, chosen = Cell(**options), [name.strip() for name in methods.split(",")]
        outcomes = run_trials(cell, trials, seed, chosen, jobs, save_dir, report, scheduler)
        if json:
            write_json(json, to_json(cell, outcomes))
    rows = [
        {
            "method": method,
            "contacts": str(found.contacts),
            "while moving": str(found.moving_contacts),
            "reached": str(found.reached),
            "of": str(found.trials),
            "step [µs]": f"{found.step_us:.0f}",
        }
        for method, found in outcomes.items()
    ]
    print_table(rows, "")


@bench.command()
@click.argument("names", nargs=-1)
@number_option("--poses", 200, "Poses of each kind.")
@number_option("--seed", 0, "Seed of poses and searches.", least=0)
@output_option("--json", "FILE", "Write the figures as JSON.")
def ik(names: tuple[str, ...], poses: int, seed: int, json: Path | None) -> None:
    """Time inverse kinematics, of arms and in scenarios by NAMES, or of all.

    Poses are those of configurations drawn evenly within the limits, so that each can be reached;
    in a scenario what is found touches nothing. Found is within 0.1 mm and 1 mrad; times are of
    the processor.

    \b
    Example:
      densarm bench ik panda ur5_bin --poses 200 --json ik.json
    """  # noqa: D301
    with progress() as report:
        report("loading")
        from densarm.study.inverse_kinematics import time_poses

        results = time_poses(names, poses, seed, report)
        if json:
            write_json(json, {"results": [asdict(result) for result in results]})
    rows = [
        {
            "arm or scenario": result.where,
            "asked": result.asked,
            "found": str(result.found),
            "of": str(result.total),
            "50 %\n[ms]": f"{result.median_ms:.2f}",
            "98 %\n[ms]": f"{result.p98_ms:.2f}",
            "longest\n[ms]": f"{result.longest_ms:.1f}",
        }
        for result in results
    ]
    print_table(rows, "")


def _run_set(
    problems: Sequence[MotionProblem],
    report: Callable[[str], None],
    *,
    guide: str,
    jobs: int,
    scheduler: str | None,
    save_dir: Path | None,
    json: Path | None,
    plant: str | None,
    disturb: dict[str, Any],
    draw: dict[str, float],
    **options: Any,
) -> Callable[[], None]:
    """Run problems and write what came of them; return what prints it."""
    from densarm.simulation.disturbances import Disturbances
    from densarm.study.problems import run_problems
    from densarm.values.tables import parse_table

    parse_table("disturbances", Disturbances, {**disturb, **draw})  # refused before work is done
    options |= {"plant": plant or "pinocchio", "disturb": disturb, "draw": draw}

    def run(guide: str, folder: Path | None) -> ProblemResults:
        try:
            if folder:
                folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise FileContentError(folder, error.strerror or "cannot be made") from None
        given = {"guide": guide, "save_dir": folder, **options}
        return run_problems(problems, jobs, report, scheduler, **given)

    results = run("auto" if guide == "both" else guide, save_dir)
    direct = run("direct", save_dir and save_dir / "direct") if guide == "both" else None
    if json:
        beside = {"direct": direct.to_json()} if direct else {}
        write_json(json, {**results.to_json(), **beside})
    return partial(print_problem_sets, results, direct)


def print_problem_sets(results: ProblemResults, direct: ProblemResults | None = None) -> None:
    """Print one row a set of problems: how its runs ended, and percentiles of their measures.

    Args:
        results: of all sets.
        direct: of the same problems without a planner, if they were run so too.
    """
    print_table(
        [
            {"set": name or "all", **_row(results.of(name), direct and direct.of(name))}
            for name in (*results.sets, None)
        ],
        "Medians over the runs that reached the goal; planning 50, 95 and 98 %.",
    )
    led_by = ", ".join(f"{count} by {what}" for what, count in results.led_by.items() if what)
    click.echo(f"Led: {led_by or 'none'}.")
    for result in results.results:
        if result.outcome != Outcome.REACHED or not result.certified:
            word = "not certified" if result.outcome == Outcome.REACHED else result.outcome
            detail = f": {result.detail}" if result.detail else ""
            click.echo(f"{result.scene} {result.index} {word}{detail}")


def _row(part: ProblemResults, direct: ProblemResults | None) -> dict[str, str]:
    ends = (Outcome.REACHED, Outcome.COLLIDED, Outcome.STUCK, Outcome.NO_PATH)
    reached, collided, stuck, no_path = counts = [part.count(outcome) for outcome in ends]
    smallest = part.min_clearance
    return {
        "reach-\ned": str(reached),
        "certi-\nfied": str(part.certified),
        "colli-\nded": str(collided),
        "stuck": str(stuck),
        "no\npath": str(no_path),
        "else": str(part.total - sum(counts)),
        "of": str(part.total),
        "planning\n[s]": _percentiles(part, "plan_time_s", 3),
        "first\nmotion": _percentiles(part, "preparation_time_s"),
        "motion\n[s]": _percentiles(part, "motion_s"),
        "/ opti-\nmal": _percentiles(part, "optimal_ratio"),
        "path\n[rad]": _percentiles(part, "path_length_rad"),
        "clear\n[mm]": "" if smallest is None else f"{smallest * 1e3:.1f}",
        "di-\nrect": "" if direct is None else str(direct.count(Outcome.REACHED)),
    }


def _percentiles(part: ProblemResults, measure: str, count: int = 1) -> str:
    return " ".join(f"{value:.2f}" for value in (part.percentiles(measure) or [])[:count])
