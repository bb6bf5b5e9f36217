"""The first run on a machine compiles kernels, a part of them in a second process."""

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from densarm.planning.guide import GuidePath
    from densarm.values.arrays import Array


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

    from densarm.scenarios.run import run
    from densarm.scenarios.scenario import load_scenario
    from densarm.visualization.camera import Camera
    from densarm.visualization.rasterizer import Rasterizer

    scenario = load_scenario("swing_up")
    control = replace(scenario.control, path_margin=0.0)
    run(replace(scenario, goal=scenario.start, control=control), guide=_Stay())
    corners = np.eye(3)
    picture = Rasterizer(Camera.facing(corners), 8, 8)
    picture.lines(corners[np.newaxis, :2], color=(0.0, 0.0, 0.0), width=1.0, opacity=1.0)


class _Stay:
    """Supplies no way but the start, so that nothing needs a proof."""

    def plan(self, start: "Array", goal: "Array", seed: int) -> "GuidePath":  # noqa: ARG002
        """Act as `Guide.plan`."""
        import numpy as np

        from densarm.planning.guide import GuidePath

        return GuidePath(np.stack([start, goal]), is_clear=True)


def _is_compiled() -> bool:
    from densarm.control.tracking import _tracking_torque

    folder = Path(_tracking_torque.stats.cache_path or "")
    return any(folder.glob("tracking._tracking_torque-*.nbi"))


if __name__ == "__main__":
    compile_meanwhile()
