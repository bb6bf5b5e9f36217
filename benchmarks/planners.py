"""Compare planned motions with those of a plain pipeline on the same problems.

    python benchmarks/planners.py --problems panda.json --every 10 --json planners.json

The plain pipeline is OMPL's RRT-Connect, its motions checked at samples (resolution 0.01 of the
joint space's extent, OMPL's default) by coal's collision tests, OMPL's path simplification, a
spline through waypoints at most 0.1 rad apart, TOPP-RA under the same shares of the velocity,
acceleration and torque limits, and computed torque with the same gains. Both run in densarm's
closed loop, one after the other on each problem. Problems are MotionBenchMaker's, as
`densarm bench motionbenchmaker` reads them, of an arm without continuous joints.

Clearance is that of the motion itself; a motion that touches ends there and counts as contact.
"""

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from plain_pipeline.track import plain_pipeline
from timing.surroundings import print_surroundings, surroundings

from densarm.cli.output import write_json
from densarm.scenarios.run import run, run_by
from densarm.scenarios.scenario import Scenario
from densarm.scene.loading import MotionProblem, load_problems
from densarm.simulation.run import Run
from densarm.study.problems import scenario_of

VERSIONS = ("pin", "coal", "ompl", "toppra", "numpy", "scipy")
PIPELINES: dict[str, Callable[[Scenario], Run]] = {
    "densarm": run,
    "OMPL, TOPP-RA, computed torque": lambda scenario: run_by(scenario, plain_pipeline),
}


def row(problem: MotionProblem, run: Run) -> dict[str, Any]:
    return {
        "scene": problem.scene_name,
        "index": problem.index,
        "outcome": str(run.outcome),
        "detail": run.detail,
        "preparation_time_s": run.preparation_time,
        "duration_s": float(run.time[-1]),
        "min_clearance_m": float(run.clearance.min()),
    }


def summary(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Return counts, and percentiles over the runs that reached the goal."""
    reached = [r for r in rows if r["outcome"] == "reached"]
    return {
        "problems": len(rows),
        "reached": len(reached),
        "contacts": sum(r["outcome"] == "collided" for r in rows),
        **{
            key: np.percentile([r[key] for r in reached], [5, 50, 95]).tolist() if reached else None
            for key in ("preparation_time_s", "duration_s", "min_clearance_m")
        },
        "smallest_clearance_m": min((r["min_clearance_m"] for r in rows), default=None),
    }


def print_summary(name: str, found: dict[str, Any]) -> None:
    def spread(key: str, scale: float, digits: int) -> str:
        if found[key] is None:
            return "-"
        low, median, high = (f"{scale * x:.{digits}f}" for x in found[key])
        return f"{median} ({low}-{high})"

    print(
        f"{name:32}{found['reached']:4} of {found['problems']:<4}{found['contacts']:9}"
        f"{spread('preparation_time_s', 1.0, 2):>22}{spread('duration_s', 1.0, 2):>20}"
        f"{spread('min_clearance_m', 1e3, 1):>20}{1e3 * found['smallest_clearance_m']:12.2f}"
    )


def ratios(rows: dict[str, list[dict[str, Any]]]) -> dict[str, float]:
    """Return medians of the plain pipeline's numbers in units of densarm's, where both arrived."""
    ours, plain = rows.values()
    both = [
        (a, b)
        for a, b in zip(ours, plain, strict=True)
        if a["outcome"] == b["outcome"] == "reached"
    ]
    return {
        key: float(np.median([b[key] / a[key] for a, b in both]))
        for key in ("preparation_time_s", "duration_s", "min_clearance_m")
        if both
    }


def main(arguments: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--problems", type=Path, required=True)
    parser.add_argument("--every", type=int, default=1, help="run one problem of so many")
    parser.add_argument("--json", type=Path)
    options = parser.parse_args(arguments)
    around = surroundings(VERSIONS)
    print_surroundings(around)
    problems = load_problems(options.problems)[:: options.every]
    for pipeline in PIPELINES.values():
        pipeline(scenario_of(problems[0]))  # unrecorded: it imports and compiles
    rows: dict[str, list[dict[str, Any]]] = {name: [] for name in PIPELINES}
    for problem in problems:
        for name, pipeline in PIPELINES.items():
            rows[name].append(row(problem, pipeline(scenario_of(problem))))
    print(
        f"{'median (5-95 %)':32}{'reached':>12}{'contacts':>9}{'first motion [s]':>22}"
        f"{'motion [s]':>20}{'clearance [mm]':>20}{'least [mm]':>12}"
    )
    for name, of_pipeline in rows.items():
        print_summary(name, summary(of_pipeline))
    compared = ratios(rows)
    print("in units of densarm's: ", ", ".join(f"{k} {x:.2f}" for k, x in compared.items()))
    if options.json:
        summaries = {name: summary(of_pipeline) for name, of_pipeline in rows.items()}
        found = {"surroundings": around, "ratios": compared, "summaries": summaries, "runs": rows}
        write_json(options.json, found)


if __name__ == "__main__":
    main()
