"""``densarm bench``: benchmarks."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from densarm.cli.exit_status import ExitStatus
from densarm.cli.json_file import write_json
from densarm.cli.output_option import output_option
from densarm.cli.progress import progress
from densarm.errors import FileContentError

if TYPE_CHECKING:
    from densarm.bench.problem import Problem
    from densarm.bench.problem_results import ProblemResults


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
@click.option(
    "--shapes",
    type=click.Choice(["hull", "capsule"]),
    default="hull",
    show_default=True,
    help="The arm's collision geometry.",
)
@click.option(
    "--pairs",
    type=click.IntRange(min=1),
    default=64,
    show_default=True,
    help="Geometry pairs: arm to sphere, filled up by the arm's own.",
)
@click.option(
    "--steps",
    type=click.IntRange(min=1),
    default=20_000,
    show_default=True,
    help="Steps to be timed, at 1 kHz along a motion.",
)
@output_option("--json", "FILE", "Write the result as JSON.")
def step(arm: str, shapes: str, pairs: int, steps: int, json: Path | None) -> int:
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
        from densarm.bench.first_call import time_first_calls
        from densarm.bench.step import time_step

        result = time_step(arm, shapes, pairs, steps)
        report("compiling in a new process")
        first = time_first_calls(arm, shapes, pairs)
        if json:
            write_json(json, {**result.to_json(), "first_calls": first.to_json()})
    click.echo(f"controller.torque  {result.step_us:.1f} µs")
    click.echo(f"bare calls         {result.bare_us:.1f} µs")
    click.echo(f"ratio              {result.ratio:.2f}")
    click.echo(f"pairs              {result.pairs}")
    for name, times in (
        ("controller.torque", result.step_percentiles_us),
        ("  undisturbed", result.undisturbed_percentiles_us),
        ("  steady", result.steady_percentiles_us or ()),
        ("bare calls", result.bare_percentiles_us),
    ):
        if not times:
            continue
        at = ", ".join(f"{time:.1f}" for time in times)
        click.echo(f"{name:<18} {at} µs at 50, 99, 99.9 %")
    for name, call in (("compiled", first.compiled), ("loaded from disk", first.loaded)):
        made = f"{call.preparation_s:.2f} s before it, kernels {name}"
        click.echo(f"first call         {call.torque_us:.0f} µs, all pairs queried; {made}")
    click.echo(f"resumed step       {result.resumed_us:.0f} µs, after other work")
    click.echo(f"core taken away    {result.switches} times")
    click.echo(f"memory growth      {result.memory_growth_kb:.0f} kB")
    click.echo(f"collections        {result.collections}")
    return ExitStatus.SUCCESS


def _set_options(command: Callable[..., int]) -> Callable[..., int]:
    """Add the options of commands that run a set of problems."""
    options = (
        click.option(
            "--guide",
            type=click.Choice(["path", "direct", "both"]),
            default="path",
            show_default=True,
            help="What supplies the sub-goals; both: path, and what direct reaches beside it.",
        ),
        click.option(
            "--time-optimal",
            is_flag=True,
            help="Compare each motion with the fastest along its path, by TOPP-RA.",
        ),
        click.option(
            "--jobs", type=click.IntRange(min=1), default=1, show_default=True, help="Processes."
        ),
        click.option(
            "--save-dir",
            type=click.Path(path_type=Path, file_okay=False),
            help="Keep every run here; those that are here already are not run again.",
        ),
        output_option("--json", "FILE", "Write every problem's result and the figures as JSON."),
    )
    for option in reversed(options):
        command = option(command)
    return command


@bench.command("random")
@click.option("--arm", default="panda", show_default=True, help="A name of `densarm list`.")
@click.option(
    "--scenes",
    type=click.Choice(["mixed", "spheres", "boxes", "wall", "shelf", "none"]),
    default="mixed",
    show_default=True,
    help="What is in the way; mixed: the next four in turn.",
)
@click.option(
    "--problems",
    type=click.IntRange(min=1),
    default=50,
    show_default=True,
    help="Number of problems.",
)
@click.option(
    "--seed",
    type=click.IntRange(min=0),
    default=0,
    show_default=True,
    help="Seed of scenes, starts, goals and the planner.",
)
@_set_options
def random(
    arm: str,
    scenes: str,
    problems: int,
    seed: int,
    jobs: int,
    **options: Any,
) -> int:
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
        from densarm.bench.random_problems import random_problems

        chosen = random_problems(arm, problems, seed, scenes, jobs, report)
        finish = _run_set(chosen, report, jobs=jobs, **options)
    finish()
    return ExitStatus.SUCCESS


@bench.command()
@click.option(
    "--problems",
    type=click.Path(path_type=Path, dir_okay=False),
    required=True,
    help="JSON file of problems.",
)
@click.option(
    "--every",
    type=click.IntRange(min=1),
    default=1,
    show_default=True,
    help="Run one problem of so many.",
)
@_set_options
def motionbenchmaker(problems: Path, every: int, **options: Any) -> int:
    """Run problems of MotionBenchMaker's collection.

    Each problem is planned, run as a torque-driven closed loop, and proved. An interrupted
    benchmark goes on where it was with the same --save-dir.

    The exit status is 0 when all problems were run, whatever was reached.

    \b
    Example:
      densarm bench motionbenchmaker --problems panda.json --every 10 --json results.json
    """  # noqa: D301
    with progress() as report:
        report("loading")
        from densarm.bench.problem import as_problems
        from densarm.scene_files import load_problems

        chosen = as_problems(load_problems(problems)[::every])
        finish = _run_set(chosen, report, **options)
    finish()
    return ExitStatus.SUCCESS


def _run_set(
    problems: Sequence[Problem],
    report: Callable[[str], None],
    *,
    guide: str,
    time_optimal: bool,
    jobs: int,
    save_dir: Path | None,
    json: Path | None,
) -> Callable[[], None]:
    """Run problems and write what came of them; return what prints it."""
    from densarm.bench.problem_results import RunOptions, run_problems
    from densarm.cli.problem_table import print_problem_sets
    from densarm.scenario import GuideKind

    def run(kind: GuideKind, folder: Path | None) -> ProblemResults:
        if folder:
            _make_folder(folder)
        return run_problems(problems, jobs, report, RunOptions(kind, folder, time_optimal))

    results = run(GuideKind("path" if guide == "both" else guide), save_dir)
    direct = run(GuideKind.DIRECT, save_dir and save_dir / "direct") if guide == "both" else None
    if json:
        beside = {"direct": direct.to_json()} if direct else {}
        write_json(json, {**results.to_json(), **beside})
    return partial(print_problem_sets, results, direct)


def _make_folder(path: Path) -> None:
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FileContentError(path, error.strerror or "cannot be made") from None
