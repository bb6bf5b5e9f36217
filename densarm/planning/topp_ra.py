"""TOPP-RA: the fastest speeds along a path under limits of acceleration and torque."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from types import ModuleType
from typing import Any

import numpy as np

from densarm.arms.arm import Arm
from densarm.arms.dynamics import JointTorques
from densarm.planning.motion import TimingParameters
from densarm.planning.smoothing import SmoothPath
from densarm.values.arrays import Array


class _Late(ModuleType):
    """Stands for a module, and for what it holds, until that is used."""

    def __init__(self, module: str, held: str = "") -> None:
        super().__init__(module)
        self._held = held

    def __getattr__(self, name: str) -> Any:
        if self._held:
            return getattr(self._found(), name)
        if name.startswith("__"):
            raise AttributeError(name)
        return _Late(self.__name__, name)

    def __call__(self, *arguments: Any, **options: Any) -> Any:
        return self._found()(*arguments, **options)

    def _found(self) -> Any:
        return getattr(import_module(self.__name__), self._held)


@contextmanager
def _left_for_later(*names: str) -> Iterator[None]:
    """Import what imports modules, which takes longer than all that is planned, without them."""
    late = {name: _Late(name) for name in names if name not in sys.modules}
    for name, module in late.items():
        package, _, own = name.rpartition(".")
        if package in late:
            setattr(late[package], own, module)
    sys.modules |= late
    try:
        yield
    finally:
        for name in late:
            del sys.modules[name]


with _left_for_later("matplotlib", "matplotlib.pyplot", "scipy.interpolate"):
    import toppra
    import toppra.algorithm
    import toppra.constraint
    from toppra.constraint import canlinear_colloc_to_interpolate

UNLIMITED = 1e4
"""Stands for an infinite limit, which the solver of TOPP-RA does not take."""

GRID_SHARE = 0.98
"""Of the limits at grid points; the rest is for what lies between them."""


class ToppRa:
    """The fastest speeds along a path, on a grid of its parameter s.

    Args:
        arm: whose limits count.
        path: θ(s), with its derivatives.
        grid: points of s (N,), from 0 to 1.
        unit: of time [s], in which motions should take about one.
        parameters: shares of the limits that may be used.
        share: of these at grid points.

    Source: Pham and Pham, A New Approach to Time-Optimal Path Parameterization Based on
        Reachability Analysis, IEEE T-RO 2018.
    """

    def __init__(
        self,
        arm: Arm,
        path: SmoothPath,
        grid: Array,
        unit: float,
        parameters: TimingParameters,
        share: float = GRID_SHARE,
    ) -> None:
        self._nv, self._path, self._grid = arm.nv, path, grid
        self._limits = _limits(arm, path, grid, unit, parameters, share)

    def speeds(self, cap: Array) -> Array | None:
        """Return path speeds (N,) [1/unit] from rest to rest, under a cap (N,), or None."""
        squares = np.column_stack([np.zeros_like(cap), cap**2])
        capped = _Constraint(self._nv, (*[None] * 6, squares))
        fastest = toppra.algorithm.TOPPRA([self._limits, capped], self._path, self._grid)
        _, speed, _ = fastest.compute_parameterization(0.0, 0.0)
        return None if speed is None or not np.isfinite(speed).all() else np.asarray(speed)


def bounded(limit: Array, share: float) -> Array:
    """Return a share of limits, as numbers that the solver takes."""
    return np.minimum(share * limit, UNLIMITED)


def _limits(
    arm: Arm,
    path: SmoothPath,
    grid: Array,
    unit: float,
    parameters: TimingParameters,
    share: float,
) -> "_Constraint":
    """Return limits of acceleration and torque, a s̈ + b ṡ² + c, at both ends of all intervals.

    Torques without a limit, which may exceed what stands for infinity, are not among them. The
    path's derivatives are by a unit of time [s].
    """
    theta, slope, bend = (path(grid, order) for order in range(3))
    q, zero = arm.configurations(theta), np.zeros_like(slope)
    speed, slope, bend = slope / unit, slope / unit**2, bend / unit**2
    torques = JointTorques(arm)
    held, driven, swung = (
        torques(q, v, a) for v, a in ((zero, zero), (zero, slope), (speed, bend))
    )
    weak = np.isfinite(arm.limits.effort)
    limit = np.append(
        bounded(parameters.acceleration_share * arm.limits.acceleration, share),
        bounded(parameters.torque_share * arm.limits.effort[weak], share),
    )
    coefficients = canlinear_colloc_to_interpolate(
        np.hstack([slope, (driven - held)[:, weak]]),
        np.hstack([bend, (swung - held)[:, weak]]),
        np.hstack([zero, held[:, weak]]),
        np.vstack([np.eye(len(limit)), -np.eye(len(limit))]),
        np.append(limit, limit),
        None,
        None,
        grid,
        identical=True,
    )
    return _Constraint(arm.nv, coefficients)


class _Constraint(toppra.constraint.LinearConstraint):
    """Limits at grid points by their coefficients, as TOPP-RA asks for them."""

    def __init__(self, dof: int, coefficients: Any) -> None:
        super().__init__()
        self.dof, self.identical = dof, True
        self._coefficients = coefficients

    def compute_constraint_params(self, *_: object) -> Any:
        return self._coefficients
