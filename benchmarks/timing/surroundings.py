"""The machine and the versions that a measurement was made with."""

import os
import platform
from collections.abc import Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import densarm

SINGLE_THREAD = {
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
    "MKL_NUM_THREADS": "1",
    "NUMBA_NUM_THREADS": "1",
    "XLA_FLAGS": "--xla_cpu_multi_thread_eigen=false",
    "JAX_ENABLE_X64": "1",
    "JAX_PLATFORMS": "cpu",
}
"""Environment variables that keep every library to one thread; to be set before their import."""


def surroundings(packages: Sequence[str]) -> dict[str, Any]:
    """Return processor, cores, load and versions as JSON data; None for a missing package."""
    return {
        "processor": _processor(),
        "cores": os.cpu_count(),
        "load_average": [round(load, 2) for load in os.getloadavg()],
        "python": platform.python_version(),
        "versions": {
            "densarm": densarm.__version__,
            **{package: _version(package) for package in packages},
        },
    }


def print_surroundings(found: dict[str, Any]) -> None:
    versions = ", ".join(f"{name} {number or '-'}" for name, number in found["versions"].items())
    load = " ".join(f"{value:.2f}" for value in found["load_average"])
    print(f"{found['processor']}, {found['cores']} cores, load {load}, Python {found['python']}")
    print(versions)


def _version(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None


def _processor() -> str:
    info = Path("/proc/cpuinfo")
    lines = info.read_text().splitlines() if info.is_file() else []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.machine()
