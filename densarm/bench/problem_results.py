"""Problems run one by one or in several processes, and what came of them."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from densarm.bench.motion_time import motion_time, time_optimal
from densarm.bench.problem import Problem
from densarm.bench.problem_result import ProblemResult
from densarm.bench.processes import in_processes
from densarm.closed_loop import simulate
from densarm.errors import FileContentError
from densarm.outcome import FAILED, RUN_ENDS, Outcome
from densarm.scenario import GuideKind
from densarm.trajectory import Trajectory

PERCENTILES = (50, 95, 98)

MEASURES = (
    "plan_time_s",
    "preparation_time_s",
    "duration_s",
    "motion_s",
    "optimal_ratio",
    "path_length_rad",
)
"""What percentiles are taken of, as `ProblemResult` calls it."""

_FIELDS = {field.name for field in fields(ProblemResult)}


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

    @property
    def sets(self) -> tuple[str, ...]:
        """Names of the sets that the problems belong to."""
        return tuple(dict.fromkeys(result.scene for result in self.results))

    def of(self, scene: str | None) -> "ProblemResults":
        """Return the results of one set of problems; of all without a name."""
        return ProblemResults(tuple(r for r in self.results if scene in (None, r.scene)))

    def count(self, outcome: str) -> int:
        """Return the number of runs that ended so."""
        return sum(r.outcome == outcome for r in self.results)

    def percentiles(self, measure: str) -> list[float] | None:
        """Return the `PERCENTILES` of a measure over the runs that reached the goal, if any.

        Args:
            measure: one of `MEASURES`; runs in which it is not known do not count.
        """
        reached = [getattr(r, measure) for r in self.results if r.outcome == Outcome.REACHED]
        known = [value for value in reached if value is not None]
        return np.percentile(known, PERCENTILES).tolist() if known else None

    def to_json(self) -> dict[str, Any]:
        """Return JSON data: every problem, the figures of all, and those of each set."""
        return {
            "problems": [dict(vars(result)) for result in self.results],
            **self.figures(),
            "sets": {name: self.of(name).figures() for name in self.sets},
        }

    def figures(self) -> dict[str, Any]:
        """Return counts, and the `PERCENTILES` of each measure, as JSON data."""
        return {
            "reached": self.count(Outcome.REACHED),
            "certified": self.certified,
            "total": self.total,
            "outcomes": {outcome: self.count(outcome) for outcome in RUN_ENDS},
            **{measure: self.percentiles(measure) for measure in MEASURES},
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
    time_optimal: bool = False
    """Whether to compute the shortest time along each run's path."""


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
    for result in in_processes(run, problems, jobs):
        results.append(result)
        on_progress(f"{len(results)} of {len(problems)} problems run")
    return ProblemResults(tuple(results))


def run_problem(problem: Problem, options: RunOptions | None = None) -> ProblemResult:
    """Plan a problem, run its closed loop and prove it; an error becomes a result."""
    options = options or RunOptions()
    run = partial(_run, problem, options)
    return problem_result(problem.scene_name, problem.index, run, options.time_optimal)


def problem_result(
    scene: str, index: int, simulate: Callable[[], Trajectory], is_compared: bool = False
) -> ProblemResult:
    """Return how a run ends; an error becomes a result.

    Args:
        scene: the set that the problem belongs to.
        index: its place in the set.
        simulate: runs it.
        is_compared: whether to compute the shortest time along the run's path.
    """
    try:
        run = simulate()
        steps = run.scenario.arm.difference(run.q[:-1], run.q[1:])
        reached = run.outcome == Outcome.REACHED
        return ProblemResult(
            scene=scene,
            index=index,
            detail=run.detail,
            motion_s=motion_time(run) if reached else None,
            optimal_s=time_optimal(run) if reached and is_compared else None,
            path_length_rad=float(np.linalg.norm(steps, axis=1).sum()),
            **{key: value for key, value in run.summary().items() if key in _FIELDS},
        )
    except (ValueError, ArithmeticError, RuntimeError) as error:
        return ProblemResult(scene, index, FAILED, str(error))


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
