"""Make room for more obstacles in a thread, beside a loop of 1 kHz, and swap it in.

python benchmarks/more_room.py --fifo --json more_room.json

Panda tracks a motion among spheres. A thread makes a world with as many spare spheres, and a
controller for it, which then takes over between two steps: its obstacles are brought up to date and
one is added. One thread at a time runs Python; another that waits gets its turn after the switch
interval, or when a call of Pinocchio or coal returns, none of which is interrupted.
"""

import argparse
import sys
import time
from pathlib import Path
from threading import Thread
from typing import Any

from timing.priority import add_fifo_option, take_priority
from timing.spread import Spread
from timing.surroundings import print_surroundings, surroundings

from densarm.arms.arm import load_arm
from densarm.cli.output import write_json
from densarm.control.tracking import DensityTracking
from densarm.planning.motion import Motion
from densarm.scene.obstacles import Sphere
from densarm.scene.scene import Scene
from densarm.study.step import full_sensing_controller, swing, world_among_spheres
from densarm.world.world import World

PERIOD = 0.001  # [s]
STEPS = 200  # with the thread, and as many without


class Loop:
    """A loop at 1 kHz, and what it tells of its steps."""

    def __init__(self, world: World, motion: Motion) -> None:
        self.world, self.motion = world, motion
        q = world.arm.configurations(motion.position)
        self.states = list(zip(q, motion.velocity, strict=True))
        self.controller = full_sensing_controller(world, motion)

    def step(self, k: int) -> None:
        self.controller.torque(k * PERIOD, *self.states[k % len(self.states)])

    def lateness(self) -> list[float]:
        """Run, and return by how much each step ended after it was due [s]."""
        late, due = [], time.perf_counter()
        for k in range(STEPS):
            due = max(due + PERIOD, time.perf_counter())
            time.sleep(max(due - time.perf_counter(), 0.0))
            self.step(k)
            late.append(time.perf_counter() - due)
        return late


def measure(pairs: int, interval: float, rounds: int) -> dict[str, Any]:
    """Measure with so many pairs in the end, half of them spare."""
    sys.setswitchinterval(interval)
    arm = load_arm("panda")
    motion = swing(arm)
    scene = world_among_spheres(arm, motion, pairs // 2).scene
    spare = [Sphere(name=f"spare_{k}", radius=0.05) for k in range(len(scene))]
    found: dict[str, list[float]] = {key: [] for key in KEYS}
    made: list[tuple[World, DensityTracking]] = []

    def make(loop: Loop, scene: Scene) -> None:
        began = time.thread_time()
        larger = World(arm, scene, spare)
        controller = full_sensing_controller(larger, motion)
        controller.torque(0.0, *loop.states[-1])  # so that pairs sleep that are far from there
        made.append((larger, controller))
        found["making_ms"].append(1e3 * (time.thread_time() - began))

    for _ in range(rounds):
        loop = Loop(World(arm, scene), motion)
        found["quiet_ms"].append(1e3 * max(loop.lateness()))
        thread = Thread(target=make, args=[loop, loop.world.scene])
        thread.start()
        found["late_ms"].append(1e3 * max(loop.lateness()))
        thread.join()
        swap(loop, *made[-1], found)
    return {"pairs": pairs, "switch_interval_ms": 1e3 * interval} | {
        key: Spread.of(sample).to_json() for key, sample in found.items()
    }


def swap(
    loop: Loop, larger: World, controller: DensityTracking, found: dict[str, list[float]]
) -> None:
    loop.world.move_obstacle(loop.world.scene.obstacles[0].name, (0.0, 0.0, 2.0))
    new = Sphere(name="new", radius=0.05, position=(0.0, 0.0, 2.2))
    old = loop.world, loop.controller  # to let go of them takes time, which is not the loop's
    began = time.perf_counter()
    larger.change_to(loop.world.scene)
    larger.add_obstacle(new)
    loop.world, loop.controller = larger, controller
    swapped = time.perf_counter()
    loop.step(len(loop.states) - 1)
    found["swap_us"].append(1e6 * (swapped - began))
    found["first_step_us"].append(1e6 * (time.perf_counter() - swapped))
    del old


KEYS = ("quiet_ms", "late_ms", "making_ms", "swap_us", "first_step_us")


def main(arguments: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--pairs", type=int, nargs="*", default=[64, 256, 1024])
    parser.add_argument("--intervals", type=float, nargs="*", default=[0.005, 0.0001])
    parser.add_argument("--rounds", type=int, default=10)
    add_fifo_option(parser)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args(arguments)
    if options.fifo:
        take_priority()
    around = surroundings(["pin", "coal", "numpy", "numba"])
    print_surroundings(around)
    print("medians and largest of the rounds; late: the latest of 200 steps")
    rows = []
    for pairs in options.pairs:
        for interval in options.intervals:
            rows.append(measure(pairs, interval, options.rounds))
            texts = (
                f"{k} {rows[-1][k]['median']:.2f} ({rows[-1][k]['largest']:.2f})" for k in KEYS
            )
            print(f"{pairs} pairs, switch {1e3 * interval:.1f} ms:", ", ".join(texts), flush=True)
    if options.json:
        write_json(options.json, {"surroundings": around, "fifo": options.fifo, "rows": rows})


if __name__ == "__main__":
    main()
