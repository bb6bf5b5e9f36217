"""Moves through way points, beside those that stop there, and moves that keep a hand upright.

python benchmarks/way_points.py
python benchmarks/way_points.py --problems panda.json --every 9

Without problems Panda and UR5 pass through random configurations above a table, by several blends,
and named arms carry what is in their hands upright from pose to pose around a wall and a post. With
them Panda goes from start to goal through a random configuration between these, and each run is
certified.
"""

import argparse
import time
from collections import Counter
from itertools import pairwise

import numpy as np

import densarm
from densarm.study.problems import scenario_of

BLENDS = 0.01, 0.05, 0.1, 0.2  # [rad]
TILTS = 0.05, 0.1, 0.2  # [rad]
CARRIERS = "panda", "fr3", "xarm7", "ur5"
DOWN = 1.0, 0.0, 0.0, 0.0  # x y z w
HOLD = 0.15  # [s] at the end of each phase
TABLE = densarm.Box(name="table", size=(0.6, 1.2, 0.1), position=(0.6, 0.0, -0.05))
CELL = (
    densarm.Box(name="table", size=(0.8, 1.4, 0.04), position=(0.6, 0.0, 0.1)),
    densarm.Box(name="wall", size=(0.02, 0.3, 0.3), position=(0.42, 0.0, 0.27)),
    densarm.Box(name="post", size=(0.05, 0.05, 0.6), position=(0.35, 0.28, 0.42)),
)


def stopping(world: densarm.World, *points: np.ndarray) -> float:
    """Return how long it takes from each point to the next, with stops [s]."""
    return sum(densarm.plan_motion(world, a, b).duration for a, b in pairwise(points))


def passing(
    world: densarm.World, start: np.ndarray, q: np.ndarray, goal: np.ndarray, *, blend: float
) -> float:
    """Return how long it takes through a configuration (nq,) [s]."""
    return densarm.plan_motion(world, start, goal, through=[q], blend=blend).duration


def blends(name: str, ways: int) -> None:
    """Print the time through a way point in units of that with a stop there, by blend."""
    arm, rng = densarm.load_arm(name), np.random.default_rng(0)
    world, shares = densarm.World(arm, densarm.Scene([TABLE])), list[list[float]]()
    low, high = np.maximum(arm.limits.lower, -3.0), np.minimum(arm.limits.upper, 3.0)
    while len(shares) < ways:
        points = list[np.ndarray]()
        while len(points) < 3:
            q = arm.configuration(
                0.5 * (low + high) + rng.uniform(-0.2, 0.2, arm.nv) * (high - low)
            )
            points += [q] if world.distances(q).min() > 0.03 else []
        try:
            stops = stopping(world, *points)
            shares.append([passing(world, *points, blend=blend) / stops for blend in BLENDS])
        except densarm.PlanningError:
            continue
    medians = ", ".join(f"{x:.2f}" for x in np.median(shares, axis=0))
    print(f"{name}: {medians} of the time with a stop, blends {BLENDS} rad, {ways} ways")


def problems(file: str, every: int, blend: float) -> None:
    """Print how runs through a configuration between start and goal end, and how fast it is."""
    ended, shares, speeds = Counter[str](), list[float](), list[float]()
    for problem in densarm.load_problems(file)[::every]:
        scenario, rng = scenario_of(problem), np.random.default_rng(problem.index)
        world, arm, start, goal = scenario.world, scenario.arm, scenario.start, scenario.goal
        way = arm.difference(start, goal)
        for _ in range(500):
            off = rng.uniform(0.0, 1.0, arm.nv) * way + rng.uniform(-0.5, 0.5, arm.nv)
            q = arm.integrate(start, off)
            inside = arm.limits.excess(arm.angles(q)).max() < -0.01
            if inside and world.distances(q).min() > 0.01:
                break
        else:
            ended["none between"] += 1
            continue
        run = densarm.run_steps(world, start, [densarm.MoveTo(goal, through=[q], blend=blend)])
        ended[f"{run.outcome}, {'' if run.certified else 'not '}certified"] += 1
        if run.certified:
            nearest = int(np.abs(arm.difference(q, run.q)).max(axis=1).argmin())
            speeds.append(float(np.linalg.norm(run.v[nearest])))
            shares.append(float(run.time[-1] - HOLD) / stopping(world, start, q, goal))
    print(dict(ended))
    print(f"{np.median(shares):.2f} of the time with a stop, at {min(speeds):.2f} rad/s at least")


def upright(name: str, pairs: int) -> None:
    """Print how many plans between poses keep a hand upright, and what they take."""
    arm, rng = densarm.load_arm(name), np.random.default_rng(0)
    world, frame = densarm.World(arm, densarm.Scene(CELL)), arm.end_effector
    found, times, shares, done = Counter[float](), list[float](), list[float](), 0

    def pose() -> densarm.Pose:
        where = rng.uniform((0.3, -0.4, 0.25), (0.55, 0.4, 0.45)).tolist()
        return densarm.Pose(frame, where, DOWN, "z")

    while done < pairs:
        try:
            start, goal = world.inverse_kinematics(pose(), 1, 0)[0], pose()
            free = densarm.plan_motion(world, start, goal).duration
        except densarm.DensarmError:
            continue
        done += 1
        for tilt in TILTS:
            began = time.process_time()
            try:
                motion = densarm.plan_motion(world, start, goal, upright=frame, tilt=tilt)
            except densarm.PlanningError:
                continue
            times.append(time.process_time() - began)
            shares.append(motion.duration / free)
            found[tilt] += 1
    told = ", ".join(f"{found[tilt]} within {tilt:g} rad" for tilt in TILTS)
    p50, p90 = np.percentile(times, (50, 90))
    print(
        f"{name}: of {pairs} {told}; {p50:.2f} / {p90:.2f} s (50 / 90 %) of processor time, ",
        end="",
    )
    print(f"{np.median(shares):.2f} times as long as without")


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--problems", help="JSON file of MotionBenchMaker's problems")
    parser.add_argument("--every", type=int, default=9, help="run one problem of so many")
    parser.add_argument("--ways", type=int, default=10, help="ways, or pairs of poses, of each arm")
    given = parser.parse_args()
    if given.problems:
        problems(given.problems, given.every, 0.02)
        return
    for name in ("panda", "ur5"):
        blends(name, given.ways)
    for name in CARRIERS:
        upright(name, given.ways)


if __name__ == "__main__":
    main()
