"""The first run on a machine compiles kernels, a part of them in a second process."""

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def compiling_meanwhile() -> Iterator[None]:
    """Let a second process compile for control and pictures, where nothing was compiled.

    This one compiles for proofs meanwhile, which takes about as long, and finds the rest on disk
    when it gets that far.
    """
    if _is_compiled() or os.cpu_count() == 1:
        yield
        return
    process = subprocess.Popen(
        [sys.executable, "-m", "densarm.cli.first_run"],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,  # Ctrl-C is for the run, which ends this
    )
    try:
        yield
    finally:
        process.kill()
        process.wait()


def compile_meanwhile() -> None:
    """Hold an arm still and draw a line, which proves no segment and searches no path."""
    import numpy as np

    from densarm.control.tracking import DensityTracking
    from densarm.planning.motion import Motion
    from densarm.scenarios.run import records
    from densarm.scenarios.scenario import load_scenario
    from densarm.simulation.simulate import simulate
    from densarm.visualization.camera import Camera
    from densarm.visualization.rasterizer import Rasterizer

    scenario = load_scenario("swing_up")
    world, start = scenario.world, scenario.start
    rest = np.tile(scenario.arm.angles(start), (2, 1))
    motion = Motion(scenario.simulation.control_period, rest, np.zeros_like(rest))
    records(simulate(world, DensityTracking(world, motion), start, start))
    corners = np.eye(3)
    picture = Rasterizer(Camera.facing(corners), 8, 8)
    picture.lines(corners[np.newaxis, :2], color=(0.0, 0.0, 0.0), width=1.0, opacity=1.0)


def _is_compiled() -> bool:
    from densarm.control.tracking import _tracking_torque

    folder = Path(_tracking_torque.stats.cache_path or "")
    return any(folder.glob("tracking._tracking_torque-*.nbi"))


if __name__ == "__main__":
    compile_meanwhile()
