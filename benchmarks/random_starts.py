"""Run a scenario from many random starts that touch nothing: does every run reach the goal?

    python benchmarks/random_starts.py swing_up --starts 1000 --jobs 2 --json swing_up_starts.json

Each run is the torque-driven closed loop, planned from its start with the scenario's parameters,
and proved. The exit status is 1 if a run does not end reached and certified.
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
from densarm.study.problems import ProblemResult, ProblemResults, in_processes, problem_result
from densarm.world.configurations import clear_configurations


def run(name: str, guide: str, item: tuple[int, np.ndarray]) -> ProblemResult:
    index, start = item
    scenario = replace(densarm.load_scenario(name), start=start)
    return problem_result(name, index, partial(densarm.run, scenario, guide))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("scenario", nargs="?", default="swing_up")
    parser.add_argument("--starts", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--guide", choices=["path", "direct"], default="path")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    scenario = densarm.load_scenario(options.scenario)
    starts = clear_configurations(
        scenario.world, options.starts, options.seed, scenario.control.margin
    )
    work = partial(run, options.scenario, options.guide)
    results = ProblemResults(tuple(in_processes(work, list(enumerate(starts)), options.jobs)))
    if options.json:
        options.json.write_text(json.dumps(results.to_json(), indent=1), encoding="utf-8")
    print_problem_sets(results)
    return 0 if results.certified == results.total else 1


if __name__ == "__main__":
    sys.exit(main())
