"""A second process compiles where nothing was compiled before, and only there."""

import subprocess
import sys

import pytest

from densarm.cli import first_run


@pytest.fixture
def processes(monkeypatch):
    """The processes that are started."""
    started = []

    class Started(subprocess.Popen):
        def __init__(self, command, **options):
            started.append(self)
            super().__init__([command[0], "-c", "import time; time.sleep(60)"], **options)

    monkeypatch.setattr(first_run.subprocess, "Popen", Started)
    monkeypatch.setattr(first_run.os, "cpu_count", lambda: 2)
    return started


def test_no_process_where_kernels_are_compiled(processes):
    first_run.compile_meanwhile()
    with first_run.compiling_meanwhile():
        pass
    assert not processes


def test_the_process_ends_with_the_run(processes, monkeypatch):
    monkeypatch.setattr(first_run, "_is_compiled", lambda: False)
    with first_run.compiling_meanwhile():
        assert processes[0].poll() is None
    assert processes[0].returncode is not None


def test_what_follows_planning_is_compiled_without_planning():
    """No proof of a segment, but its largest part, and the kernels of steps and pictures."""
    code = (
        "from densarm.cli.first_run import compile_meanwhile as work\n"
        "import sys; work()\n"
        "from densarm.control.density_tracking import write_torque\n"
        "from densarm.visualization.rasterizer import _fill\n"
        "from densarm.proof.separation import separation\n"
        "assert write_torque.signatures and _fill.signatures and separation.signatures\n"
        "assert not any(m.endswith('arc_proof') and sys.modules[m].append_unproved.signatures\n"
        "               for m in list(sys.modules))\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
