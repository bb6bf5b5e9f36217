"""What a new process pays before a control loop, and in its first step."""

import json
import os
import subprocess
import sys
import time
from dataclasses import asdict, dataclass
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from densarm.arm import load_arm
from densarm.bench.step import full_sensing_controller
from densarm.bench.swing_among_spheres import clearance_among_spheres, swing


@dataclass(frozen=True)
class FirstCall:
    """Times of a controller in a new process."""

    preparation_s: float
    """Making the controller and its density, which loads or compiles every kernel [s]."""
    torque_us: float
    """Its first `torque`, in which all pairs are queried [µs]."""


@dataclass(frozen=True)
class FirstCalls:
    """First calls in two new processes."""

    compiled: FirstCall
    """Where nothing was compiled before."""
    loaded: FirstCall
    """Where compiled code is on disk."""

    def to_json(self) -> dict[str, Any]:
        """Return the times as JSON data."""
        return asdict(self)


def time_first_calls(arm: str, shapes: str = "hull", pairs: int = 64) -> FirstCalls:
    """Time the first call of the tracking controller, in processes of its own.

    Args:
        arm: a known name.
        shapes: "hull" or "capsule".
        pairs: geometry pairs, as `time_step` has them.

    Raises:
        OSError: no process can be started.
    """
    with TemporaryDirectory() as folder:
        compiled, loaded = (_in_new_process(folder, arm, shapes, pairs) for _ in range(2))
    return FirstCalls(compiled, loaded)


def _in_new_process(folder: str, arm: str, shapes: str, pairs: int) -> FirstCall:
    done = subprocess.run(
        [sys.executable, "-m", "densarm.bench.first_call", arm, shapes, str(pairs)],
        env={**os.environ, "NUMBA_CACHE_DIR": folder},
        stdout=subprocess.PIPE,
        check=True,
    )
    return FirstCall(**json.loads(done.stdout))


def _time_first_call(name: str, shapes: str, pairs: int) -> FirstCall:
    arm = load_arm(name, shapes=shapes)
    reference = swing(arm)
    clearance = clearance_among_spheres(arm, reference, pairs)
    q, v = arm.configurations(reference.position[:1])[0], np.zeros(arm.nv)
    began = time.perf_counter()
    controller = full_sensing_controller(clearance, reference)
    made = time.perf_counter()
    controller.torque(0.0, q, v)
    called = time.perf_counter()
    return FirstCall(made - began, 1e6 * (called - made))


if __name__ == "__main__":
    name, shapes, pairs = sys.argv[1:]
    sys.stdout.write(json.dumps(asdict(_time_first_call(name, shapes, int(pairs)))))
