"""Ways to tamper with the file of a run."""

import json
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from densarm import Run
from tampering.kind import ROWS, NotPossibleError


def reloaded(run: Run, change: Callable[[dict[str, Any]], None]) -> Run:
    """Return the run from a file whose arrays were changed."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "run.npz"
        run.save(path)
        with np.load(path, allow_pickle=False) as data:
            arrays = {name: data[name] for name in data}
        change(arrays)
        np.savez(path, **arrays)
        return Run.load(path)


def not_finite(run: Run, rng: np.random.Generator) -> Run:
    def change(arrays: dict[str, Any]) -> None:
        array = arrays[rng.choice(ROWS[:4])]
        array.flat[rng.integers(array.size)] = rng.choice([np.nan, np.inf, -np.inf])

    return reloaded(run, change)


def missing_row(run: Run, rng: np.random.Generator) -> Run:
    def change(arrays: dict[str, Any]) -> None:
        name = rng.choice(ROWS)
        arrays[name] = np.delete(arrays[name], rng.integers(len(arrays[name])), axis=0)

    return reloaded(run, change)


def other_mesh(run: Run, rng: np.random.Generator) -> Run:
    def change(arrays: dict[str, Any]) -> None:
        scenario = json.loads(str(arrays["scenario"]))
        if not scenario["mesh_sha256"]:
            raise NotPossibleError
        name = rng.choice(sorted(scenario["mesh_sha256"]))
        scenario["mesh_sha256"][name] = "0" * 64
        arrays["scenario"] = np.array(json.dumps(scenario))

    return reloaded(run, change)
