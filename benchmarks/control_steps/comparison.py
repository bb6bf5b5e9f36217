"""The control steps of all peers, timed in turns on one task."""

from collections.abc import Callable
from typing import Any

import numpy as np
from timing.spread import Spread
from timing.turns import blocks_of, ratios, time_in_turns

from control_steps.control_step import ControlStep
from control_steps.densarm_step import DensarmStep
from control_steps.task import ControlTask, panda_task
from densarm.values.arrays import Array

PACKAGES = {"pin-pink": "pink", "mink": "mink", "cbfpy": "cbfpy"}
"""The module of each peer by the name of its package."""

_CLOSEST = 8  # rows of pink's shorter QP
_SEEN = 200  # states from one to the next whose distances are compared
_NEAR = (0.05, 0.1)  # distances within which pairs are counted [m]


def control_steps(task: ControlTask, peers: list[str]) -> list[ControlStep]:
    """Return densarm's step and those of the peers that can do the task."""
    steps: list[ControlStep] = [DensarmStep(task)]
    if "mink" in peers:
        from control_steps.mink_step import MinkStep

        steps += [MinkStep(task, detection) for detection in (0.1, 1.0)]
    if "pin-pink" in peers:
        from control_steps.pink_step import PinkStep

        steps += [PinkStep(task, rows) for rows in (_CLOSEST, task.world.n_pairs)]
    if "cbfpy" in peers:
        from control_steps.cbfpy_step import CbfpyStep

        steps += [CbfpyStep(task, backend) for backend in ("elastiqp", "qpax")]
    return steps


def compare(
    shapes: str,
    n_spheres: int,
    scene: str,
    peers: list[str],
    blocks: tuple[int, int] = (10, 20),
    rounds: int = 1,
    on_progress: Callable[[str], None] = lambda _: None,
) -> dict[str, Any]:
    """Return every step's times and ratios as JSON data.

    Args:
        shapes: of the arm, "hull" or "capsule".
        n_spheres: number of spheres.
        scene: "close" or "scattered".
        peers: names in `PACKAGES`; cbfpy takes part with capsules alone, having no hulls.
        blocks: number and length of the ranges of states.
        rounds: how often each is visited.
        on_progress: told what is being done.
    """
    task = panda_task(shapes, n_spheres, scene)
    steps = control_steps(task, [p for p in peers if p != "cbfpy" or shapes == "capsule"])
    visited = blocks_of(task.visited, *blocks)
    on_progress(f"{shapes}, {scene} spheres: distances and gradients")
    measures = time_in_turns({s.name: s.measure for s in steps}, visited, rounds)
    on_progress(f"{shapes}, {scene} spheres: commands")
    commands = time_in_turns({s.name: s.command for s in steps}, visited, rounds)
    seen = task.visited[::_SEEN]
    exact = np.array([steps[0].distances(k) for k in seen])
    return {
        "shapes": shapes,
        "scene": scene,
        "spheres": n_spheres,
        "pairs": task.world.n_pairs,
        "pairs_within": {f"{r:g} m": float(np.mean(np.sum(exact < r, axis=1))) for r in _NEAR},
        "states": sum(len(block) for block in visited) * rounds,
        "steps": [
            {
                "name": step.name,
                "set_up": step.set_up,
                "measure_us": _spread(measures[step.name]),
                "command_us": _spread(commands[step.name]),
                "measure_ratio": _ratio(measures, step.name, steps[0].name),
                "command_ratio": _ratio(commands, step.name, steps[0].name),
                **_agreement([step.distances(k) for k in seen], exact),
            }
            for step in steps
        ],
    }


def _spread(times: list[list[float]]) -> dict[str, float]:
    return Spread.of([t for visit in times for t in visit], 1e6).to_json()


def _ratio(times: dict[str, list[list[float]]], name: str, unit: str) -> dict[str, float]:
    return ratios(times[name], times[unit]).to_json()


def _agreement(found: list[Array], exact: Array) -> dict[str, float | None]:
    """Return how many distances (N, K) are computed, and how far they are from the exact ones."""
    computed = np.isfinite(found)
    errors = np.abs(np.array(found) - exact)[computed]
    return {
        "pairs_measured": float(np.mean(np.sum(computed, axis=1))),
        "distance_error_m": float(errors.max()) if errors.size else None,
    }
