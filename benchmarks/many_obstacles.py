"""Thousands of obstacles, few of them near: what world, plan, step and proof take.

    python benchmarks/many_obstacles.py --counts 8 1000

Panda leaves the shelf of panda_shelf; beside its bodies boxes and balls of 20 to 200 mm stand where
it does not go, up to 4 m away. A step is the controller's torque.
"""

import argparse
import sys
import time

import numpy as np

from densarm.arms.arm import Arm
from densarm.control.tracking import DensityTracking
from densarm.planning.plan import plan_motion
from densarm.scenarios.scenario import load_scenario
from densarm.scene.obstacles import Box, Obstacle, Sphere
from densarm.scene.scene import Scene
from densarm.simulation.simulate import simulate
from densarm.values.arrays import Array
from densarm.world.world import World

PERIOD = 1e-3  # [s]


def obstacles(count: int, way: Array, seed: int = 0) -> list[Obstacle]:
    """Return bodies none of which is within 0.3 m of points of a way (N, 3) [m]."""
    random, found = np.random.default_rng(seed), list[Obstacle]()
    while len(found) < count:
        position = random.uniform([-4.0, -4.0, -0.5], [4.0, 4.0, 2.5])
        if np.linalg.norm(way - position, axis=1).min() < 0.45:
            continue
        name, size = f"body{len(found)}", random.uniform(0.02, 0.2, 3)
        found.append(
            Box(name=name, size=size, position=position)
            if len(found) % 2
            else Sphere(name=name, radius=0.5 * size[0], position=position)
        )
    return found


def places(arm: Arm, q: Array) -> Array:
    """Return where the frames of links are (N, 3) [m]."""
    frames = [frame.name for frame in arm.model.frames if "panda_" in frame.name]
    return np.array([arm.pose(row, name).position for row in q for name in frames])


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--counts", type=int, nargs="+", default=[8, 1000])
    options = parser.parse_args()
    scenario = load_scenario("panda_shelf")
    arm = scenario.arm
    free = plan_motion(World(arm, scenario.scene), scenario.start, scenario.goal)
    rows = arm.configurations(free.samples(0.1).position)
    for count in options.counts:
        scene = Scene([*scenario.scene, *obstacles(count, places(arm, rows))])
        begun = time.perf_counter()
        world = World(arm, scene)
        made = time.perf_counter() - begun
        begun = time.perf_counter()
        motion = plan_motion(world, scenario.start, scenario.goal)
        planned = time.perf_counter() - begun
        begun = time.perf_counter()
        controller = DensityTracking(world, motion)
        readied = time.perf_counter() - begun
        samples, spent = motion.samples(PERIOD), list[float]()
        for k in 3 * list(range(len(samples.time))):
            q = arm.configurations(samples.position[k])
            begun = time.perf_counter()
            controller.torque(k * PERIOD, q, samples.velocity[k])
            spent.append(time.perf_counter() - begun)
        begun = time.perf_counter()
        run = simulate(world, DensityTracking(world, motion), scenario.start)
        simulated = time.perf_counter() - begun
        begun = time.perf_counter()
        proved = run.certified
        certified = time.perf_counter() - begun
        median, most = 1e6 * np.percentile(spent, [50, 99.9])
        told = f"{count} bodies, {world.n_pairs} pairs: world {made:.2f}, plan {planned:.2f}, "
        told += f"controller {readied:.2f}, run {simulated:.2f}, certificate {certified:.2f} s "
        told += f"({run.outcome}, {proved}); step 50 / 99.9 %: {median:.0f} / {most:.0f} us"
        print(told, flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
