"""Drive an FR3 among obstacles by libfranka's protocol, in franka-sim with every limit enforced.

    pip install '.[franka]'
    python benchmarks/franka_motions.py --simulator ENV/bin/python [--waits] [--json franka.json]

ENV is an environment of its own: see franka_sim_server.py. Motions lead from where the robot is to
random configurations that are clear, one after the other, in a scene of a table, posts, a lamp and
the floor. Judged are the robot's own state after each, and what it says of errors and of lost
commands; the rate is that of commands by the wall clock. With --waits the simulator waits for the
answers of a machine that is not quiet.
"""

import argparse
import json
import os
import subprocess
import time
from pathlib import Path

import numpy as np

import densarm
from densarm.errors import RobotError
from densarm.hardware.drive import drive
from densarm.hardware.franka import FrankaRobot
from densarm.hardware.robot import Reading
from densarm.values.arrays import Array

REACHED, RATE = 2e-3, 900.0  # bars: [rad] of every joint, [Hz]
SEED = 7
SERVER = Path(__file__).with_name("franka_sim_server.py")
RESTS, SETTLES = 0.01, 5.0  # [rad/s], and [s] at most until then
STARTS = 60.0  # [s] at most
POSTS = ((0.6, 0.2), (0.2, 0.5), (0.2, -0.5), (-0.4, 0.3))  # [m]
MARGIN = 0.01  # [m]


class Timed(FrankaRobot):
    """Counts commands, and the time from a state to the command that answers it."""

    def __init__(self, address: str, arm: densarm.Arm) -> None:
        super().__init__(address, arm)
        self.begin()

    def begin(self) -> None:
        self.work: list[float] = []
        self.times: list[float] = []

    def read(self) -> Reading:
        reading = super().read()
        self._read_at = time.perf_counter()
        return reading

    def command(self, u: Array) -> None:
        super().command(u)
        self.times.append(time.perf_counter())
        self.work.append(self.times[-1] - self._read_at)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--simulator", help="python of an environment with franka-sim")
    parser.add_argument("--address", default="127.0.0.1", help="of a robot or simulator that runs")
    parser.add_argument("--waits", action="store_true")
    parser.add_argument("--motions", type=int, default=20)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    server = None
    if options.simulator:
        command = [options.simulator, str(SERVER), "--address", options.address]
        environment = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
        command += ["--waits"] * options.waits
        server = subprocess.Popen(command, env=environment, stderr=subprocess.DEVNULL)
    try:
        measured = measure(options.address, options.motions)
    finally:
        if server is not None:
            server.kill()
    report(measured, waits=options.waits)
    if options.json:
        options.json.write_text(json.dumps(measured, indent=1))


def measure(address: str, count: int) -> list[dict[str, object]]:
    world = scene()
    arm, random = world.arm, np.random.default_rng(SEED)
    robot = connected(address, arm)
    measured: list[dict[str, object]] = []
    while len(measured) < count:
        start, goal = arm.configuration(robot.read().position), clear(world, random)
        try:
            motion = densarm.plan_motion(world, start, goal, margin=MARGIN, period=robot.period)
        except densarm.PlanningError:
            continue  # no way there: another goal
        robot.begin()
        run = drive(robot, world, densarm.DensityTracking(world, motion))
        state = robot.state
        error = float(np.abs(arm.angles(goal) - state.q).max())
        row = {
            "outcome": str(run.outcome),
            "detail": run.detail,
            "certified": run.certified,
            "unproved": [c.name for c in run.certificate.checks if c.holds is False],
            "duration_s": float(run.time[-1]),
            "goal_error_rad": error,
            "tracking_error_rad": run.tracking_error,
            "min_clearance_m": float(run.clearance.min()),
            "success_rate": state.control_command_success_rate,
            "lost": run.remark,
            "rate_hz": (len(robot.times) - 1) / (robot.times[-1] - robot.times[0]),
            "work_us": 1e6 * float(np.median(robot.work[1:])),
            "longest_work_us": 1e6 * max(robot.work[1:]),  # the first takes control
        }
        measured.append(row)
        print(
            f"{len(measured):3} {run.outcome:9} {1e3 * error:6.2f} mrad, track "
            f"{1e3 * (run.tracking_error or 0.0):5.2f} mrad, {row['rate_hz']:4.0f} Hz, "
            f"{row['work_us']:4.0f} us, unproved {row['unproved']} {run.detail} {run.remark}"
        )
        if not settles(robot):
            print(f"the robot still moves {SETTLES} s after its motion: no more are made")
            break
    return measured


def settles(robot: Timed) -> bool:
    """Wait until the robot rests, and clear what it stopped for; return whether it rests.

    After a reflex franka-sim's own hold may let the last joint tremble by 0.08 rad/s for good.
    """
    until = time.monotonic() + SETTLES
    while np.abs(robot.read().velocity).max() > RESTS:
        if time.monotonic() > until:
            return False
    if robot.state.current_errors or robot.state.robot_mode.name == "Reflex":
        robot.recover()
    return True


def scene() -> densarm.World:
    """Return what the robot is told to be among; the floor is in the simulation too."""
    posts = [
        densarm.Box(name=f"post_{k}", size=[0.06, 0.06, 0.8], position=[x, y, 0.4])
        for k, (x, y) in enumerate(POSTS)
    ]
    table = densarm.Box(name="table", size=[0.6, 1.2, 0.04], position=[0.6, 0.0, 0.02])
    lamp = densarm.Sphere(name="lamp", radius=0.1, position=[0.4, 0.0, 0.95])
    floor = densarm.HalfSpace(name="floor")
    return densarm.World(densarm.load_arm("fr3"), densarm.Scene([table, lamp, floor, *posts]))


def clear(world: densarm.World, random: np.random.Generator) -> Array:
    """Return a configuration (nq,) 30 mm from everything, and 0.3 rad from position limits."""
    limits = world.arm.limits
    while True:
        angles = random.uniform(limits.lower + 0.3, limits.upper - 0.3)
        q = world.arm.configuration(angles)
        if world.distances(q).min() > 0.03:
            return q


def connected(address: str, arm: densarm.Arm) -> Timed:
    until = time.monotonic() + STARTS
    while True:
        try:
            return Timed(address, arm)
        except RobotError:
            if time.monotonic() > until:
                raise
            time.sleep(0.2)


def report(measured: list[dict[str, object]], *, waits: bool) -> None:
    def of(key: str) -> Array:
        return np.array([row[key] for row in measured], np.float64)

    reached = sum(row["outcome"] == "reached" for row in measured)
    near = int((of("goal_error_rad") <= REACHED).sum())
    reflexes = sum("reflex" in str(row["detail"]) for row in measured)
    print(f"reached {reached} of {len(measured)}, within {1e3 * REACHED:g} mrad {near}")
    print(f"largest error {1e3 * of('goal_error_rad').max():.2f} mrad, reflexes {reflexes}")
    print(f"certified {sum(bool(row['certified']) for row in measured)}")
    print(f"tracking within {1e3 * of('tracking_error_rad').max():.2f} mrad")
    rate = "the simulator waited" if waits else f"bar {RATE:g}"
    print(f"{np.median(of('rate_hz')):.0f} Hz in the median ({rate})")
    print(f"{np.median(of('work_us')):.0f} us from a state to its command in the median")


if __name__ == "__main__":
    main()
