"""Run the controller in real time for long: missed deadlines, memory, drift.

    python benchmarks/long_run.py --steps 1000000 --json long_run.json

Panda moves among spheres, each second to another goal of a round; the controllers for them are made
beforehand, and change within the step that begins there. Each step waits for its time at 1 kHz,
asleep and for the last bit awake. It misses its deadline if its torque is there more than a period
later; the next steps are then put off by as much. Processor time tells what of that is the step's
own and what the machine's; `--fifo` gives the process the priority that a control loop has on a
robot. The plant is densarm's own, stepped after each torque.
"""

import argparse
import os
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from timing.priority import add_fifo_option, take_priority
from timing.spread import Spread
from timing.surroundings import print_surroundings, surroundings

from densarm.arms.arm import load_arm
from densarm.certificates.task import Integrator
from densarm.cli.output import write_json
from densarm.planning.motion import Motion
from densarm.simulation.plants import PinocchioPlant
from densarm.study.step import full_sensing_controller, swing, world_among_spheres
from densarm.values.arrays import Array

PERIOD = 0.001  # [s]
LEG = 1000  # steps to a goal
GOALS = 10  # of a round
SHARES = (0.2, 0.8)  # of the swing, between which goals lie
AWAKE = 1e-4  # the last bit of a wait [s]
PARTS = 10  # of the run, compared with each other


def motions(swinging: Motion, seed: int) -> Iterator[Motion]:
    """Yield motions from rest to rest, each to a goal at random, and the last to the first one."""
    random = np.random.default_rng(seed)
    low, high = swinging.position[0], swinging.position[-1]
    s = np.linspace(0.0, 1.0, LEG + 1)[:, np.newaxis]
    position = s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
    velocity = 30.0 * (s * (1.0 - s)) ** 2 / (LEG * PERIOD)
    goals = [low + (high - low) * random.uniform(*SHARES) for _ in range(GOALS)]
    for start, goal in zip(goals, [*goals[1:], goals[0]], strict=True):
        yield Motion(PERIOD, start + (goal - start) * position, (goal - start) * velocity)


class Steps:
    """What is kept of every step, in arrays made beforehand."""

    def __init__(self, count: int) -> None:
        # Filled: memory that is only reserved would count as growth when first used.
        self.elapsed: Array = np.full(count, np.nan)
        """Time of the step [s]."""
        self.processor: Array = np.full(count, np.nan)
        """Processor time of the step [s]."""
        self.lateness: Array = np.full(count, np.nan)
        """Of the torque, after the step's time [s]."""
        self.error: Array = np.full(count, np.nan)
        """Largest distance of a joint from the motion [rad]."""


@dataclass
class Memory:
    """Resident memory [MB]."""

    early: float = 0.0
    """After the first tenth of the run."""
    late: float = 0.0
    """At its end."""


def run(count: int, pairs: int, seed: int = 0) -> tuple[Steps, Memory]:
    """Run so many steps of 1 kHz."""
    arm = load_arm("panda")
    swinging = swing(arm)
    world = world_among_spheres(arm, swinging, pairs)
    plant = PinocchioPlant(arm, PERIOD, Integrator.SEMI_IMPLICIT_EULER)
    legs = [full_sensing_controller(world, motion) for motion in motions(swinging, seed)]
    q, v = legs[0].motion.position[0], np.zeros(arm.nv)
    for controller in legs:  # so that pairs sleep that are far away
        controller.torque(0.0, arm.configuration(controller.motion.position[0]), v)
    steps, memory = Steps(count), Memory()
    due = time.perf_counter()
    for k in range(count):
        late = _wait(due)
        began, processor = time.perf_counter(), time.thread_time()
        controller = legs[k // LEG % GOALS]
        tau = controller.torque(k % LEG * PERIOD, q, v)
        steps.processor[k] = time.thread_time() - processor
        steps.elapsed[k] = time.perf_counter() - began
        steps.lateness[k] = late + steps.elapsed[k]
        due += max(PERIOD, steps.lateness[k])
        q, v = plant.step(q, v, tau)
        steps.error[k] = np.abs(q - controller.motion.position[k % LEG + 1]).max()
        if k == count // PARTS:
            memory.early = _resident()
    memory.late = _resident()
    return steps, memory


def report(steps: Steps, memory: Memory) -> dict[str, Any]:
    """Return the figures as JSON data."""
    parts = np.array_split(steps.error, PARTS)
    return {
        "steps": len(steps.error),
        "missed": int((steps.lateness > PERIOD).sum()),
        "missed_by_own_work": int((steps.processor > PERIOD).sum()),
        "elapsed_us": Spread.of(steps.elapsed, 1e6).to_json(),
        "processor_us": Spread.of(steps.processor, 1e6).to_json(),
        "lateness_us": Spread.of(steps.lateness, 1e6).to_json(),
        "memory_mb": [memory.early, memory.late],
        "largest_error_rad": [float(part.max()) for part in parts],
        "median_error_rad": [float(np.median(part)) for part in parts],
    }


def print_report(found: dict[str, Any]) -> None:
    count, missed = found["steps"], found["missed"]
    print(f"{count} steps at 1 kHz, {-(-count // LEG)} motions")
    print(
        f"missed deadlines       {missed} ({100.0 * missed / count:.4f} %), of them"
        f" {found['missed_by_own_work']} by the step's own processor time"
    )
    for key, name in (
        ("elapsed_us", "step, elapsed"),
        ("processor_us", "step, processor"),
        ("lateness_us", "torque after its time"),
    ):
        at = found[key]
        print(
            f"{name:23}{at['median']:.0f} µs, 99 % {at['p99']:.0f}, 99.9 % {at['p999']:.0f},"
            f" largest {at['largest']:.0f}"
        )
    early, late = found["memory_mb"]
    print(f"resident memory        {early:.1f} MB after a tenth, {late:.1f} MB at the end")
    for key in ("median_error_rad", "largest_error_rad"):
        errors = " ".join(f"{1e3 * error:.4f}" for error in found[key])
        print(f"{key.split('_')[0]} tracking error of each tenth [mrad]  {errors}")


def _wait(due: float) -> float:
    """Wait for a time, and return by how much it has passed [s]."""
    if (left := due - time.perf_counter() - AWAKE) > 0.0:
        time.sleep(left)
    while (late := time.perf_counter() - due) < 0.0:
        pass
    return late


def _resident() -> float:
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def main(arguments: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--steps", type=int, default=1_000_000)
    parser.add_argument("--pairs", type=int, default=256)
    add_fifo_option(parser)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args(arguments)
    if options.fifo:
        take_priority()
    around = surroundings(["pin", "coal", "numpy", "numba"])
    print_surroundings(around)
    found = report(*run(options.steps, options.pairs))
    after = os.getloadavg()
    settings = {"pairs": options.pairs, "fifo": options.fifo}
    found = {"surroundings": around, "load_after": list(after), **settings, **found}
    print_report(found)
    print(f"load of the machine after the run {after[0]:.2f}")
    if options.json:
        write_json(options.json, found)


if __name__ == "__main__":
    main()
