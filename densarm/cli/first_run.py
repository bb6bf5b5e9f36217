"""The first run on a machine compiles kernels, a part of them in a second process."""

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from densarm.arrays import Array
    from densarm.guides.guide import GuidePath


@contextmanager
def compiling_meanwhile() -> Iterator[None]:
    """Let a second process compile for proofs, control and pictures, where nothing was compiled.

    Compiled code is kept on disk, where this process finds it when it gets that far.
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


def _is_compiled() -> bool:
    from densarm.control.density_tracking import write_torque

    folder = Path(write_torque.stats.cache_path or "")
    return any(folder.glob("density_tracking.write_torque-*.nbi"))


def compile_meanwhile() -> None:
    """Do what takes compiled code of many kinds, in the order in which it will be missed."""
    _separate_two_boxes()
    _hold_still_and_draw()


def _separate_two_boxes() -> None:
    import numpy as np

    from densarm.proof.rounded_hulls import rounded_hulls
    from densarm.proof.separation import separation
    from densarm.shapes import box_hull

    hulls = rounded_hulls([box_hull([1.0, 1.0, 1.0])] * 2)
    points, first, *edges, _ = hulls
    poses, corners = np.zeros((2, 12)), np.full((1, 4, 2), -1)
    poses[:, :9], poses[1, 9], corners[0, 0] = np.eye(3).ravel(), 2.0, first[:2]
    space = np.empty((3, 4, 4))
    separation(*(points, *edges, poses, 0, 1, 0.0, 1.0, corners, 0, *space, 0))


def _hold_still_and_draw() -> None:
    from densarm.closed_loop import simulate
    from densarm.scenario import load_scenario
    from densarm.visualization.picture_file import save_picture

    scenario = load_scenario("swing_up")
    run = simulate(replace(scenario, goal=scenario.start), guide=_Stay())
    with TemporaryDirectory() as folder:
        save_picture(run, Path(folder) / "picture.png")


class _Stay:
    """Supplies no way but the start, so that nothing needs a proof."""

    def plan(self, start: "Array", goal: "Array", seed: int) -> "GuidePath":  # noqa: ARG002
        """Act as `Guide.plan`."""
        import numpy as np

        from densarm.guides.guide import GuidePath

        return GuidePath(np.stack([start, goal]), is_clear=True)


if __name__ == "__main__":
    compile_meanwhile()
