"""Controllers load or compile their kernels when they are made, none in a control loop."""

import json
import subprocess
import sys

import pytest

PROGRAM = """
import gc, json, os
import numpy as np
from numba.core.dispatcher import Dispatcher
from densarm.arms.arm import load_arm
from densarm.control.controller import Gains
from densarm.control.regulation import DensityRegulation
from densarm.control.replanning import Replanning
from densarm.control.supervisor import Supervisor
from densarm.control.tracking import DensityTracking
from densarm.density.goal_distance import TorusDistance
from densarm.errors import InvalidValueError
from densarm.planning.guide import GuidePath
from densarm.planning.motion import Motion
from densarm.scene.obstacles import Sphere
from densarm.scene.scene import Scene
from densarm.values.kernels import on_compiling
from densarm.world.world import World


def loaded():
    kernels = [item for item in gc.get_objects() if isinstance(item, Dispatcher)]
    own = [item for item in kernels if item.py_func.__module__.startswith("densarm")]
    return {str(item.py_func): len(item.signatures) for item in own if item.signatures}


def states(arm):
    # As a caller may give them: arrays not to be written to, lists, parts of others.
    q, v = arm.configuration([0.4, 0.3]), np.array([0.1, -0.2])
    fixed = q.copy(), v.copy()
    for array in fixed:
        array.flags.writeable = False
    yield 0, *fixed
    yield np.float32(0.001), q.tolist(), [0, 0]
    yield 0.002, np.repeat(q, 2)[::2], np.repeat(v, 2)[::2]


class Still:
    def torque(self, t, q, v):
        return np.zeros(2)


class Own:
    def __init__(self, arm):
        self.distance = TorusDistance(arm)

    def evaluate(self, q, goal, out_gradient):
        return self.distance.evaluate(q, goal, out_gradient)


arm = load_arm("two_link")
ball = Sphere(name="ball", radius=0.2, position=(1.5, 0.0, -0.5))
world = World(arm, Scene([ball]))
start, goal = arm.postures["hanging"], arm.postures["upright"]
motion = Motion(0.001, np.tile([0.4, 0.3], (3, 1)), np.zeros((3, 2)))
path = GuidePath(np.stack([start, goal]), is_clear=False)
gains = Gains()
make = {
    "tracking": lambda: DensityTracking(world, motion),
    "own distance": lambda: DensityTracking(world, motion, goal_distance=Own(arm)),
    "regulation": lambda: DensityRegulation(world, goal, path=path),
    "plain": lambda: DensityRegulation(world, goal, path=path, plain=True),
    "velocity": lambda: DensityRegulation(world, goal),
    "watching": lambda: Supervisor(arm, Still()),
    "trusting": lambda: Supervisor(arm, DensityTracking(world, motion), tolerances=None),
    "replanning": lambda: Replanning(
        arm, goal, DensityTracking(world, motion), None, 10.0, gains, 0.001
    ),
}
NONE = [([0.0], [0.0]), (np.zeros((2, 2)), np.zeros((1, 2))), ([np.nan] * 4, [0.0, 0.0])]


def report(name):
    controller, compiled = make[name](), []
    act = controller.velocity if name == "velocity" else controller.torque
    before = loaded()
    with on_compiling(compiled.append):
        for state in states(arm):
            act(*state)
        for q, v in NONE:
            try:
                act(0.003, q, v)
            except InvalidValueError:
                pass
        if name == "watching":
            controller.stop()
        for state in states(arm):
            act(*state)
    print(json.dumps([name, len(compiled), len(before), before == loaded()]), flush=True)


for name in make:
    if child := os.fork():  # each as the first that its process makes
        os.waitpid(child, 0)
    else:
        report(name)
        os._exit(0)
"""

CONTROLLERS = [
    "tracking",
    "own distance",
    "regulation",
    "plain",
    "velocity",
    "watching",
    "trusting",
    "replanning",
]


@pytest.fixture(scope="module")
def reports() -> dict[str, tuple[int, int, bool]]:
    program = [sys.executable, "-c", PROGRAM]
    result = subprocess.run(program, capture_output=True, text=True, check=True)
    assert result.stderr == ""
    rows = [json.loads(line) for line in result.stdout.splitlines()]
    return {name: (compiled, kernels, same) for name, compiled, kernels, same in rows}


@pytest.mark.slow
@pytest.mark.parametrize("name", CONTROLLERS)
def test_no_call_loads_or_compiles_a_kernel(
    reports: dict[str, tuple[int, int, bool]], name: str
) -> None:
    compiled, kernels, same = reports[name]
    assert compiled == 0
    assert kernels >= 5
    assert same
