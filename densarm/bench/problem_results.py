"""Problems run one by one or in several processes, and what came of them."""

import signal
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

from densarm.bench.problem import Problem
from densarm.closed_loop import simulate
from densarm.errors import FileContentError
from densarm.outcome import FAILED, RUN_ENDS, Outcome
from densarm.scenario import GuideKind
from densarm.trajectory import Trajectory
from densarm.validation import positive_integer

PERCENTILES = (50, 95, 98)


@dataclass(frozen=True)
class ProblemResult:
    """How one problem's run ended."""

    scene: str
    """The set that the problem belongs to."""
    index: int
    """Its place in the set."""
    outcome: str
    """One of `RUN_ENDS`."""
    detail: str = ""
    """What stood in the way, as a phrase."""
    duration_s: float | None = None
    """Simulated time [s]; None where nothing ran, as in what follows."""
    min_clearance_m: float | None = None
    """Smallest signed distance [m]; None without pairs."""
    goal_error_rad: float | None = None
    """Largest joint error at the end [rad or m]."""
    peak_torque_ratio: float | None = None
    """Largest torque in units of its limit."""
    plan_time_s: float | None = None
    """Wall-clock time of planning [s]."""
    path_length_rad: float | None = None
    """Length of the way in joint space [rad or m]."""
    certified: bool = False
    """Whether the certificate holds in every part."""


@dataclass(frozen=True)
class ProblemResults:
    """How the runs of a set of problems ended."""

    results: tuple[ProblemResult, ...]

    @property
    def total(self) -> int:
        """Number of problems."""
        return len(self.results)

    @property
    def certified(self) -> int:
        """Number of runs that reached the goal and whose certificate holds in every part."""
        return sum(r.outcome == Outcome.REACHED and r.certified for r in self.results)

    @property
    def min_clearance(self) -> float | None:
        """Smallest signed distance of all runs [m]; None without pairs."""
        found = [r.min_clearance_m for r in self.results if r.min_clearance_m is not None]
        return min(found, default=None)

    def by_scene(self) -> "dict[str, ProblemResults]":
        """Return the results of each set of problems, by its name."""
        names = dict.fromkeys(r.scene for r in self.results)
        return {
            name: ProblemResults(tuple(r for r in self.results if r.scene == name))
            for name in names
        }

    def count(self, outcome: str) -> int:
        """Return the number of runs that ended so."""
        return sum(r.outcome == outcome for r in self.results)

    def percentiles(self, measure: str) -> list[float] | None:
        """Return the `PERCENTILES` of a measure over the runs that reached the goal, if any."""
        reached = [getattr(r, measure) for r in self.results if r.outcome == Outcome.REACHED]
        return np.percentile(reached, PERCENTILES).tolist() if reached else None

    def to_json(self) -> dict[str, Any]:
        """Return JSON data."""
        return {
            "problems": [dict(vars(result)) for result in self.results],
            "reached": self.count(Outcome.REACHED),
            "certified": self.certified,
            "total": self.total,
            "outcomes": {outcome: self.count(outcome) for outcome in RUN_ENDS},
            "plan_time_s": self.percentiles("plan_time_s"),
            "duration_s": self.percentiles("duration_s"),
            "path_length_rad": self.percentiles("path_length_rad"),
            "min_clearance_m": self.min_clearance,
        }


@dataclass(frozen=True)
class RunOptions:
    """How to run each problem of a set."""

    guide: GuideKind = GuideKind.PATH
    """What supplies the sub-goals."""
    save_dir: Path | None = None
    """Folder of the recorded runs, SCENE_INDEX.npz; a problem whose record is there already is
    not run again. None to keep none."""


def run_problems(
    problems: Sequence[Problem],
    jobs: int = 1,
    on_progress: Callable[[str], None] = lambda _: None,
    options: RunOptions | None = None,
) -> ProblemResults:
    """Plan each problem, run its torque-driven closed loop and prove it.

    Args:
        problems: what to run.
        jobs: processes to run them in; 1 for this one.
        options: see `RunOptions`.
        on_progress: told what is being done.

    Returns:
        How each run ended, in the order of the problems, whatever the number of processes. A run
        that raises an error counts as failed and stops no other.

    Raises:
        InvalidValueError: a number of processes below one.
    """
    results = []
    run = partial(run_problem, options=options)
    for result in _results(run, problems, positive_integer("jobs", jobs)):
        results.append(result)
        on_progress(f"{len(results)} of {len(problems)} problems run")
    return ProblemResults(tuple(results))


def _results(
    run: Callable[[Problem], ProblemResult], problems: Sequence[Problem], jobs: int
) -> Iterator[ProblemResult]:
    if jobs == 1:
        yield from map(run, problems)
        return
    # Ctrl-C reaches the whole group of processes: it ends these at once, and only this one tells.
    pool = ProcessPoolExecutor(
        jobs, get_context("spawn"), signal.signal, (signal.SIGINT, signal.SIG_DFL)
    )
    try:
        yield from pool.map(run, problems)
    finally:
        pool.shutdown(cancel_futures=True)


def run_problem(problem: Problem, options: RunOptions | None = None) -> ProblemResult:
    """Plan a problem, run its closed loop and prove it; an error becomes a result."""
    try:
        run = _run(problem, options or RunOptions())
        return ProblemResult(
            problem.scene_name,
            problem.index,
            detail=run.detail,
            path_length_rad=_path_length(run),
            **run.summary(),
        )
    except (ValueError, ArithmeticError, RuntimeError) as error:
        return ProblemResult(problem.scene_name, problem.index, FAILED, str(error))


def _run(problem: Problem, options: RunOptions) -> Trajectory:
    """Return the problem's record, or run it."""
    scenario = problem.scenario()
    scenario = replace(scenario, control=replace(scenario.control, guide=options.guide))
    if options.save_dir is None:
        return simulate(scenario)
    file = options.save_dir / f"{problem.scene_name}_{problem.index}.npz"
    if file.is_file():
        recorded = Trajectory.load(file)
        if recorded.scenario.to_json() != scenario.to_json():
            raise FileContentError(file, "the record of another problem: remove it, or its folder")
        return recorded
    run = simulate(scenario)
    run.save(file)
    return run


def _path_length(run: Trajectory) -> float:
    steps = run.scenario.arm.difference(run.q[:-1], run.q[1:])
    return float(np.linalg.norm(steps, axis=1).sum())
