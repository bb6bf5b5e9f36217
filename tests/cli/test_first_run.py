"""A second process compiles where nothing was compiled before, and only there."""

import subprocess
import sys
from typing import Any

import pytest

from densarm.cli import first_run

Processes = list[subprocess.Popen[bytes]]


@pytest.fixture
def processes(monkeypatch: pytest.MonkeyPatch) -> Processes:
    """The processes that are started."""
    started: Processes = []

    class Started(subprocess.Popen[bytes]):
        def __init__(self, command: list[str], **options: Any) -> None:
            started.append(self)
            super().__init__([command[0], "-c", "import time; time.sleep(60)"], **options)

    monkeypatch.setattr("subprocess.Popen", Started)
    monkeypatch.setattr("os.cpu_count", lambda: 2)
    return started


def test_no_process_where_kernels_are_compiled(processes: Processes) -> None:
    first_run.compile_meanwhile()
    with first_run.compiling_meanwhile():
        pass
    assert not processes


@pytest.mark.parametrize("cores", [1, 2])
def test_the_process_ends_with_the_run(
    processes: Processes, monkeypatch: pytest.MonkeyPatch, cores: int
) -> None:
    monkeypatch.setattr(first_run, "_is_compiled", lambda: False)
    monkeypatch.setattr("os.cpu_count", lambda: cores)
    with first_run.compiling_meanwhile():
        assert len(processes) == cores - 1
        assert all(process.poll() is None for process in processes)
    assert all(process.returncode is not None for process in processes)


@pytest.mark.slow
def test_what_follows_planning_is_compiled_without_planning() -> None:
    """No proof of a segment, but the kernels of steps and pictures, for the arguments of runs."""
    code = (
        "from densarm.cli.first_run import compile_meanwhile\n"
        "compile_meanwhile()\n"
        "from densarm.control.tracking import _tracking_torque\n"
        "from densarm.visualization.rasterizer import _fill\n"
        "from densarm.world.separating_planes import _polyline_is_clear\n"
        "assert _tracking_torque.signatures and _fill.signatures\n"
        "assert not _polyline_is_clear.signatures\n"
        "from densarm.scenarios.run import run\n"
        "from densarm.visualization.picture import Picture\n"
        "from densarm.visualization.render_scene import RenderScene\n"
        "signatures = len(_tracking_torque.signatures), len(_fill.signatures)\n"
        "done = run('swing_up')\n"
        "Picture(RenderScene(done), 48, 32).frame(0)\n"
        "assert signatures == (len(_tracking_torque.signatures), len(_fill.signatures))\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
