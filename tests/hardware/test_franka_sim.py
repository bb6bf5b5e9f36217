"""Against libfranka's own network protocol, where franka-sim and pylibfranka can be had."""

import os
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from densarm.control.tracking import DensityTracking
from densarm.errors import RobotError
from densarm.hardware.drive import drive
from densarm.hardware.franka import FrankaRobot
from densarm.planning.plan import plan_motion
from densarm.values.outcome import Outcome
from densarm.world.world import World

SERVER = Path(__file__).parents[2] / "benchmarks" / "franka_sim_server.py"
ADDRESS = f"127.0.{1 + os.getpid() % 200}.1"  # its port is fixed, so each process has its own
STARTS = 60.0  # [s] at most


@pytest.fixture(scope="module")
def robot(posts: World) -> Iterator[FrankaRobot]:
    pytest.importorskip("pylibfranka", reason="pip install 'densarm[franka]'")
    python = os.environ.get("DENSARM_FRANKA_SIM")
    if not python:
        pytest.skip("DENSARM_FRANKA_SIM names no python with franka-sim")
    command = [python, str(SERVER), "--address", ADDRESS, "--waits"]
    environment = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
    with subprocess.Popen(command, env=environment, stderr=subprocess.DEVNULL) as server:
        try:
            yield connected(posts, server)
        finally:
            server.kill()


def connected(posts: World, server: "subprocess.Popen[bytes]") -> FrankaRobot:
    until = time.monotonic() + STARTS
    while True:
        try:
            return FrankaRobot(ADDRESS, posts.arm)
        except RobotError:
            if server.poll() is not None or time.monotonic() > until:
                raise
            time.sleep(0.2)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="all of 127.0.0.0/8 is this machine on Linux")
def test_an_fr3_moves_among_obstacles_without_a_reflex(robot: FrankaRobot, posts: World) -> None:
    arm = posts.arm
    start = arm.configuration(robot.read().position)
    goal = arm.configuration([-0.6, 0.3, -0.3, -1.8, 0.2, 2.0, 0.4])
    motion = plan_motion(posts, start, goal, period=robot.period)
    run = drive(robot, posts, DensityTracking(posts, motion))
    assert run.outcome == Outcome.REACHED, run
    assert run.goal_error < 2e-3
    assert run.certified, str(run.certificate)
    assert robot.state.control_command_success_rate > 0.9
    assert not robot.state.current_errors
