"""Point clouds: the control step, updates beside it, and MotionBenchMaker's scenes as clouds.

    python benchmarks/point_clouds.py
    python benchmarks/point_clouds.py --problems panda.json --every 10

Without problems, Panda leaves the shelf of panda_shelf, a cloud of 20,000 points, again and again,
first with nothing beside the loop, then with a thread that replaces all points 30 times a second. A
step is the controller's torque, called every millisecond.

With problems, each obstacle becomes points on its faces, 10 mm apart, as balls of 8 mm, which cover
the faces. A problem whose start or goal the cloud makes a contact of is left out. Runs are the
torque-driven closed loop, proved against the cloud; contacts are those with the obstacles' own
shapes.
"""

import argparse
import gc
import sys
import threading
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from densarm.control.tracking import DensityTracking
from densarm.planning.plan import plan_motion
from densarm.scenarios.run import run
from densarm.scenarios.scenario import load_scenario
from densarm.scene.loading import MotionProblem, load_problems
from densarm.scene.obstacles import Box, Cylinder, Obstacle, obstacle_pose
from densarm.scene.point_cloud import PointCloud
from densarm.scene.scene import Scene
from densarm.study.problems import scenario_of
from densarm.values.arrays import Array
from densarm.values.outcome import Outcome
from densarm.world.configurations import infeasibility
from densarm.world.near_pairs import smallest_distances
from densarm.world.swept_check import SweptCheck
from densarm.world.world import World

SPACING, RADIUS = 0.01, 0.008  # [m]
PERIOD = 1e-3  # [s]


def grid(length: float) -> Array:
    return np.linspace(-0.5, 0.5, 1 + int(np.ceil(length / SPACING))) * length


def faces(obstacle: Obstacle) -> Array:
    """Return points on the surface of a box or cylinder in the world (N, 3) [m]."""
    found = []
    if isinstance(obstacle, Box):
        size = np.array(obstacle.size)
        for axis in range(3):
            u, v = np.meshgrid(*(grid(length) for length in np.delete(size, axis)))
            for side in (-0.5, 0.5):
                flat = np.stack([u.ravel(), v.ravel()])
                found.append(np.insert(flat, axis, side * size[axis], axis=0).T)
    elif isinstance(obstacle, Cylinder):
        for radius in np.linspace(
            0.0, obstacle.radius, 1 + int(np.ceil(obstacle.radius / SPACING))
        ):
            count = max(1, int(np.ceil(2.0 * np.pi * radius / SPACING)))
            angle = 2.0 * np.pi * np.arange(count) / count
            z = grid(obstacle.length)
            heights = z if radius == obstacle.radius else z[[0, -1]]
            ring = np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])
            found += [np.column_stack([ring, np.full(count, height)]) for height in heights]
    else:
        raise TypeError(type(obstacle))
    pose = obstacle_pose(obstacle)
    return np.asarray(np.vstack(found) @ pose.rotation.T + pose.translation)


def seen(problem: MotionProblem) -> MotionProblem:
    """Return a problem with a cloud in the place of its obstacles."""
    points = np.vstack([faces(obstacle) for obstacle in problem.scene])
    cloud = PointCloud(name="cloud", points=points, radius=RADIUS)
    return replace(problem, scene=Scene([cloud], problem.scene.attachments))


def time_steps(points: int, seconds: float, interval: float) -> None:
    """Print how long steps take, alone and with updates beside them."""
    scenario, random = load_scenario("panda_shelf"), np.random.default_rng(0)
    surface = np.vstack([faces(obstacle) for obstacle in scenario.scene])
    surface = surface[random.choice(len(surface), points)]
    cloud = PointCloud(name="cloud", points=surface, radius=RADIUS)
    world = World(scenario.arm, Scene([cloud]))
    motion = plan_motion(world, scenario.start, scenario.goal)
    controller = DensityTracking(world, motion)
    rows = motion.samples(PERIOD)
    sys.setswitchinterval(interval)
    frames = [surface + random.normal(0.0, 1e-3, surface.shape) for _ in range(8)]
    for beside in (False, True):
        stop, spent = threading.Event(), list[float]()
        thread = threading.Thread(target=update, args=(world, frames, stop, spent))
        if beside:
            thread.start()
        durations, late, due = list[float](), list[float](), time.perf_counter()
        gc.disable()
        for k in range(int(seconds / PERIOD)):
            i = k % len(rows.position)
            q, v = scenario.arm.configurations(rows.position[i]), rows.velocity[i]
            due += PERIOD
            while (left := due - time.perf_counter()) > 0.0:
                time.sleep(max(0.0, left - 2e-4))
            begun = time.perf_counter()
            controller.torque(i * PERIOD, q, v)
            ended = time.perf_counter()
            durations.append(ended - begun)
            late.append(ended - due)
            due = max(due, begun)
        gc.enable()
        stop.set()
        if beside:
            thread.join()
        times, ends = 1e6 * np.array(durations), 1e6 * np.array(late)
        told = "beside updates" if beside else "alone"
        median, most = np.percentile(times, [50, 99.9])
        print(f"{points} points, {told}: step 50 / 99.9 %: {median:.0f} / {most:.0f} us, ", end="")
        late_most, largest = np.percentile(ends, 99.9), ends.max()
        print(f"ended after its time 99.9 %: {late_most:.0f}, largest {largest:.0f} us")
        if not beside:  # what no pause of the machine made slower each time
            laps = times[: len(times) // len(rows.position) * len(rows.position)]
            least = laps.reshape(-1, len(rows.position)).min(axis=0)
            median, most = np.percentile(least, [50, 99.9])
            print(f"the fastest of {len(laps) // len(least)} laps, sample by sample: ", end="")
            print(f"{median:.0f} / {most:.0f}, largest {least.max():.0f} us")
        if spent:
            times = 1e3 * np.array(spent)
            print(f"{len(spent)} updates: {np.median(times):.1f}, largest {times.max():.1f} ms")


def update(world: World, frames: list[Array], stop: threading.Event, spent: list[float]) -> None:
    due = time.perf_counter()
    while not stop.is_set():
        begun = time.perf_counter()
        world.update_cloud("cloud", frames[len(spent) % len(frames)])
        spent.append(time.perf_counter() - begun)
        due += 1.0 / 30.0
        time.sleep(max(0.0, due - time.perf_counter()))


def run_problems(path: Path, every: int) -> bool:
    plans, reached, contacts, free, sizes = list[float](), 0, 0, 0, list[int]()
    for problem in load_problems(path)[::every]:
        scenario = scenario_of(seen(problem))
        sizes += [len(body.points) for body in scenario.scene if isinstance(body, PointCloud)]
        name = f"{problem.scene_name} {problem.index}"
        ends = {"start": scenario.start, "goal": scenario.goal}
        if fault := infeasibility(SweptCheck(scenario.world), ends):
            print(f"{name}: left out, {fault}"[:120], flush=True)
            continue
        done, free = run(scenario), free + 1
        smallest = float(smallest_distances(World(scenario.arm, problem.scene), done.q).min())
        is_good = done.outcome == Outcome.REACHED and done.certified
        reached, contacts = reached + is_good, contacts + (smallest <= 0.0)
        plans.append(done.plan_time)
        words = f"{done.outcome}, certified {done.certified}, plan {1e3 * done.plan_time:.0f} ms"
        print(
            f"{name}: {sizes[-1]} points, {words}, {1e3 * smallest:.1f} mm",
            flush=True,
        )
    median, high = 1e3 * np.percentile(plans, [50, 98])
    print(f"points in a cloud: median {np.median(sizes):.0f}, largest {max(sizes)}")
    print(f"still free: {free} of {len(sizes)}; reached and certified: {reached}")
    print(f"contacts with the obstacles' own shapes: {contacts}")
    print(f"plan, 50 / 98 %: {median:.0f} / {high:.0f} ms")
    return reached >= 0.98 * free and contacts == 0


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--problems", type=Path)
    parser.add_argument("--every", type=int, default=1)
    parser.add_argument("--points", type=int, default=20_000)
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--switch-interval", type=float, default=1e-4, help="of Python [s]")
    options = parser.parse_args()
    if options.problems is None:
        time_steps(options.points, options.seconds, options.switch_interval)
        return 0
    return 0 if run_problems(options.problems, options.every) else 1


if __name__ == "__main__":
    sys.exit(main())
