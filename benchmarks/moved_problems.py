"""Run MotionBenchMaker's problems moved a little, which nobody tuned on, with another planner seed.

    python benchmarks/moved_problems.py --problems panda.json --every 4 --seed 1 --json moved.json

Each obstacle is moved by up to 10 mm along every axis and each joint of start and goal by up to
0.05 rad, evenly at random, again and again until start and goal touch nothing. Whether a moved
problem has a solution is not known. Each run is the torque-driven closed loop, and is proved.
"""

import argparse
import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from densarm.cli.bench import print_problem_sets
from densarm.planning.plan import GUIDES
from densarm.scene.loading import MotionProblem, load_problems
from densarm.scene.scene import Scene
from densarm.study.problems import ProblemResults, run_problem, scenario_of
from densarm.world.configurations import infeasibility
from densarm.world.swept_check import SweptCheck

SHIFT, TURN = 0.01, 0.05  # [m], [rad]
DRAWS = 200


def moved(problem: MotionProblem, random: np.random.Generator) -> MotionProblem | None:
    def near(values: ArrayLike, most: float) -> tuple[float, ...]:
        return tuple(np.add(values, random.uniform(-most, most, np.size(values))).tolist())

    for _ in range(DRAWS):
        obstacles = [replace(item, position=near(item.position, SHIFT)) for item in problem.scene]
        scene = Scene(obstacles, problem.scene.attachments)
        start, goal = near(problem.start, TURN), near(problem.goal, TURN)
        other = replace(problem, scene=scene, start=start, goal=goal)
        try:
            scenario = scenario_of(other)
        except ValueError:  # beyond a position limit
            continue
        ends = {"start": scenario.start, "goal": scenario.goal}
        if not infeasibility(SweptCheck(scenario.world), ends):
            return other
    return None


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--problems", type=Path, required=True)
    parser.add_argument("--every", type=int, default=4)
    parser.add_argument("--seed", type=int, default=1, help="of what is moved, and of the planner")
    parser.add_argument("--guide", choices=GUIDES, default="auto")
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    results = []
    for index, problem in enumerate(load_problems(options.problems)[:: options.every]):
        other = moved(problem, np.random.default_rng([options.seed, index]))
        if other is None:
            print(f"{problem.scene_name} {problem.index}: start or goal stays in contact")
            continue
        results.append(run_problem(other, options.seed, options.guide))
    found = ProblemResults(tuple(results))
    if options.json:
        options.json.write_text(json.dumps(found.to_json(), indent=1), encoding="utf-8")
    print_problem_sets(found)
    longest = max(r.plan_time_s or 0.0 for r in results)
    print(f"Longest planning: {longest:.2f} s.")
    return 0 if found.certified == found.total else 1


if __name__ == "__main__":
    sys.exit(main())
