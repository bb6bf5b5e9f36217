"""Run a scenario from many random starts that touch nothing: does every run reach the goal?

    python benchmarks/random_starts.py swing_up --starts 1000 --jobs 2 --json swing_up_starts.json
    python benchmarks/random_starts.py swing_up --starts 1000 --curves

Each run is the torque-driven closed loop, planned from its start with the scenario's parameters,
and proved; with --curves each is the integral curve of the density alone, without a planner and
without time, its segments proved clear. The exit status is 1 if a run does not end reached and
certified, or a curve short of the goal.
"""

import argparse
import json
import sys
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

import densarm
from densarm.cli.bench import print_problem_sets
from densarm.planning.density_guide import Legs
from densarm.planning.plan import GUIDES, plan_path
from densarm.study.cluster import in_order
from densarm.study.problems import ProblemResult, ProblemResults, problem_result
from densarm.world.configurations import clear_configurations
from densarm.world.swept_check import SweptCheck


def run(name: str, guide: str | None, item: tuple[int, np.ndarray]) -> ProblemResult:
    index, start = item
    scenario = replace(densarm.load_scenario(name), start=start)
    return problem_result(name, index, partial(densarm.run, scenario, guide))


def curves(scenario: densarm.Scenario, starts: list[np.ndarray]) -> int:
    """Print how many curves of the density reach the goal, and why the others do not."""
    control, check = scenario.control, SweptCheck(scenario.world, scenario.control.margin)
    distance = scenario.goal_distance
    density = replace(scenario.density, alpha=control.planning_alpha)
    legs, reached, left = Legs(check, distance, density, scenario.sensing), 0, 0
    for start in starts:
        path = plan_path(scenario.world, start, scenario.goal, "direct", margin=control.margin).path
        curve = legs.curve(path)
        reached, left = reached + curve.reached, left + bool(curve.remark)
        if not curve.reached:
            print(f"from {scenario.arm.angles(start).tolist()}: {legs.why_stuck(curve)}")
    print(f"{reached} of {len(starts)} curves reach the goal; {left} left a critical point")
    return reached


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("scenario", nargs="?", default="swing_up")
    parser.add_argument("--starts", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--guide", choices=GUIDES, help="default: the scenario's own")
    parser.add_argument("--curves", action="store_true", help="of the density, without torque")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    scenario = densarm.load_scenario(options.scenario)
    starts = clear_configurations(
        scenario.world, options.starts, options.seed, scenario.control.margin
    )
    if options.curves:
        return 0 if curves(scenario, starts) == len(starts) else 1
    work = partial(run, options.scenario, options.guide)
    results = ProblemResults(tuple(in_order(work, list(enumerate(starts)), options.jobs)))
    if options.json:
        options.json.write_text(json.dumps(results.to_json(), indent=1), encoding="utf-8")
    print_problem_sets(results)
    return 0 if results.certified == results.total else 1


if __name__ == "__main__":
    sys.exit(main())
