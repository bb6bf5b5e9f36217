"""Time-optimal timing of a path under velocity, acceleration and torque limits, by TOPP-RA."""

import math
from typing import Any, NamedTuple

import numpy as np
import toppra
import toppra.algorithm
import toppra.constraint
from numpy.typing import NDArray
from toppra.constraint import canlinear_colloc_to_interpolate

from densarm.arm import Arm
from densarm.arrays import Array
from densarm.holding_torque import holding_ratios, holding_torque
from densarm.joint_torques import JointTorques
from densarm.proof.stopping_check import StoppingCheck
from densarm.reference.infeasible_timing import InfeasibleTimingError
from densarm.reference.reference import Reference
from densarm.reference.smooth_path import SmoothPath
from densarm.reference.timing_parameters import TimingParameters

_UNLIMITED = 1e4  # stands for an infinite limit, which TOPP-RA's solver does not take
_GRID_STEP = 0.0125  # [rad] between grid points at most
_GRID = (200, 1000)
_GRID_SHARE = 0.98  # of the limits at grid points; the rest is for what lies between them
_SLOWDOWNS = 50  # tried in turn until the limits hold at every sample
_LEAST_SLOWDOWN = 1.002
_CHECKED = 4  # samples from one brake that is checked to the next
_ROUNDS = 12  # of slowing down where stopping is not proved
_HALVINGS = 7  # of the range that the largest speed to stop from is in
_CAP_SHARE = 0.98  # of that speed; the rest is for what lies between grid points

toppra.setup_logging("CRITICAL")


def time_path(
    arm: Arm,
    path: SmoothPath,
    length: float,
    period: float,
    parameters: TimingParameters,
    stopping: StoppingCheck | None = None,
) -> Reference:
    """Return the fastest reference along a path, from rest to rest.

    Where a straight brake is not proved clear, the path is slowed down until it is, there alone.

    Args:
        arm: its limits and dynamics.
        path: joint positions over [0, 1].
        length: of the path [rad], which sets the grid.
        period: time between the reference's samples [s].
        parameters: shares of the limits.
        stopping: proves the brakes from every fourth sample; None to do without.

    Raises:
        InfeasibleTimingError: no speed meets the limits somewhere on the path, or none was found
            that the arm could stop from.

    Source: Pham and Pham, A New Approach to Time-Optimal Path Parameterization Based on
        Reachability Analysis, IEEE T-RO 2018.
    """
    pieces = len(np.unique(path.knots)) - 1
    parts = math.ceil(np.clip(length / _GRID_STEP, *_GRID) / pieces)
    grid = np.linspace(0.0, 1.0, parts * pieces + 1)
    limits, cap = _Limits(arm, path, grid, parameters), _velocity_cap(arm, path, grid, parameters)
    toppra_path, where = _ToppraPath(path, arm.nv), path(0.0)
    for _ in range(_ROUNDS):
        fastest = toppra.algorithm.TOPPRA([limits, _SpeedCap(arm.nv, cap)], toppra_path, grid)
        _, speed, _ = fastest.compute_parameterization(0.0, 0.0)
        timing = _timing_within_limits(arm, path, grid, speed, period, parameters)
        if timing is None:
            raise _too_weak(arm, arm.configurations(path(grid)), parameters.torque_share)
        failing = _failing(stopping, arm, timing)
        if stopping is None or not failing.size:
            return timing.reference
        where = timing.reference.position[failing[0]]
        _lower(cap, stopping, arm, grid, timing, failing)
    raise _unstoppable(arm, where)


class _Timing(NamedTuple):
    """A reference and where on the path its samples are."""

    reference: Reference
    s: Array
    """Path positions of the samples (N,)."""
    speed: Array
    """Path speeds of the samples (N,) [1/s]."""


def _timing_within_limits(
    arm: Arm,
    path: SmoothPath,
    grid: Array,
    speed: Array | None,
    period: float,
    parameters: TimingParameters,
) -> _Timing | None:
    if speed is None or not np.isfinite(speed).all():
        return None
    for _ in range(_SLOWDOWNS):
        timing = _sampled(path, grid, speed, period)
        used = _largest_share(arm, timing.reference, parameters)
        if used <= 1.0:
            return timing
        speed = speed / max(_LEAST_SLOWDOWN, math.sqrt(used))
    return None


def _sampled(path: SmoothPath, grid: Array, speed: Array, period: float) -> _Timing:
    """Sample a timing, stretched to a whole number of periods; ṡ² is linear on each interval."""
    time = np.append(0.0, np.cumsum(2.0 * np.diff(grid) / (speed[:-1] + speed[1:])))
    count = max(1, int(np.ceil(time[-1] / period)))
    stretch = count * period / time[-1]
    at = np.linspace(0.0, time[-1], count + 1)
    k = np.clip(np.searchsorted(time, at, side="right") - 1, 0, len(grid) - 2)
    elapsed = at - time[k]
    acceleration = np.diff(speed**2)[k] / (2.0 * np.diff(grid)[k])
    s = np.clip(grid[k] + elapsed * (speed[k] + 0.5 * acceleration * elapsed), 0.0, 1.0)
    s_rate = np.maximum(speed[k] + acceleration * elapsed, 0.0) / stretch
    s[-1], s_rate[[0, -1]] = 1.0, 0.0
    reference = Reference(period, path(s), path(s, 1) * s_rate[:, np.newaxis])
    return _Timing(reference, s, s_rate)


def _failing(stopping: StoppingCheck | None, arm: Arm, timing: _Timing) -> NDArray[np.int64]:
    """Return the samples from which stopping is not proved."""
    if stopping is None:
        return np.zeros(0, dtype=np.int64)
    q = arm.configurations(timing.reference.position[::_CHECKED])
    return _CHECKED * stopping.check(q, timing.reference.velocity[::_CHECKED]).failing


def _lower(
    cap: Array,
    stopping: StoppingCheck,
    arm: Arm,
    grid: Array,
    timing: _Timing,
    failing: NDArray[np.int64],
) -> None:
    """Lower the caps on path speed around failing samples to speeds that the arm can stop from."""
    cell = np.clip(np.searchsorted(grid, timing.s[failing], side="right") - 1, 0, len(grid) - 2)
    cell, first = np.unique(cell, return_index=True)
    failing = failing[first]
    q = arm.configurations(timing.reference.position[failing])
    v = timing.reference.velocity[failing]
    low, high = np.zeros(len(failing)), np.ones(len(failing))
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        holds = stopping.check(q, middle[:, np.newaxis] * v).holds
        low, high = np.where(holds, middle, low), np.where(holds, high, middle)
    if (low == 0.0).any():
        raise _unstoppable(arm, timing.reference.position[failing[low.argmin()]])
    allowed = _CAP_SHARE * low * timing.speed[failing]
    np.minimum.at(cap, cell, allowed)
    np.minimum.at(cap, cell + 1, allowed)


def _largest_share(arm: Arm, reference: Reference, parameters: TimingParameters) -> float:
    """Return how much of what it may use a reference uses at most; TOPP-RA knows grid points only.

    The limits are those of velocity, acceleration and torque, at all samples.
    """
    v, limits = reference.velocity, arm.limits
    a = np.diff(v, axis=0) / reference.period
    torque = JointTorques(arm)(arm.configurations(reference.position[:-1]), v[:-1], a)
    used = (
        np.abs(v) / (parameters.velocity_share * limits.velocity),
        np.abs(a) / (parameters.acceleration_share * limits.acceleration),
        np.abs(torque) / (parameters.torque_share * limits.effort),
    )
    return max(float(share.max()) for share in used)


def _velocity_cap(arm: Arm, path: SmoothPath, grid: Array, parameters: TimingParameters) -> Array:
    """Return path speeds at grid points (N,) [1/s] within the velocity limits."""
    limit = _bounded(parameters.velocity_share * arm.limits.velocity)
    with np.errstate(divide="ignore"):
        cap = (limit / np.abs(path(grid, 1))).min(axis=1)
    return np.asarray(np.minimum(cap, _UNLIMITED))


def _unstoppable(arm: Arm, angles: Array) -> InfeasibleTimingError:
    where = ", ".join(f"{angle:.4g}" for angle in angles)
    return InfeasibleTimingError(
        f"arm {arm.name!r}: no speed was found from which it could stop in free space at joint "
        f"positions ({where}) of the planned path"
    )


def _too_weak(arm: Arm, q: Array, torque_share: float) -> InfeasibleTimingError:
    """Return what to say of a path through configurations (N, nq)."""
    heaviest = max(q, key=lambda row: float(holding_ratios(arm, row).max()))
    return InfeasibleTimingError(
        f"arm {arm.name!r}: its torque limits allow no motion along the planned path, of which "
        f"planning uses {torque_share:.0%}; {holding_torque(arm, heaviest)}"
    )


def _bounded(limit: Array) -> Array:
    return np.minimum(_GRID_SHARE * limit, _UNLIMITED)


class _ToppraPath(toppra.interpolator.AbstractGeometricPath):
    """A SmoothPath as TOPP-RA asks for it."""

    def __init__(self, path: SmoothPath, dof: int) -> None:
        self._path = path
        self._dof = dof

    def __call__(self, path_positions: float | Array, order: int = 0) -> Array:
        return self._path(path_positions, order)

    @property
    def dof(self) -> int:
        return self._dof

    @property
    def path_interval(self) -> Array:
        return np.array([0.0, 1.0])


class _Limits(toppra.constraint.LinearConstraint):
    """Limits of acceleration and torque, a s̈ + b ṡ² + c, at both ends of every grid interval."""

    def __init__(
        self, arm: Arm, path: SmoothPath, grid: Array, parameters: TimingParameters
    ) -> None:
        super().__init__()
        self.dof, self.identical = arm.nv, True
        theta, slope, bend = (path(grid, order) for order in range(3))
        q, zero = arm.configurations(theta), np.zeros_like(slope)
        torques = JointTorques(arm)
        held, driven, swung = (
            torques(q, v, a) for v, a in ((zero, zero), (zero, slope), (slope, bend))
        )
        shares, limits = parameters, arm.limits
        limit = np.append(
            _bounded(shares.acceleration_share * limits.acceleration),
            _bounded(shares.torque_share * limits.effort),
        )
        self._found = canlinear_colloc_to_interpolate(
            np.hstack([slope, driven - held]),
            np.hstack([bend, swung - held]),
            np.hstack([zero, held]),
            np.vstack([np.eye(len(limit)), -np.eye(len(limit))]),
            np.append(limit, limit),
            None,
            None,
            grid,
            identical=True,
        )

    def compute_constraint_params(self, *_: object) -> Any:
        return self._found


class _SpeedCap(toppra.constraint.LinearConstraint):
    """Upper bounds on the path speed at grid points."""

    def __init__(self, dof: int, cap: Array) -> None:
        super().__init__()
        self.dof = dof
        self._bounds = np.column_stack([np.zeros_like(cap), cap**2])

    def compute_constraint_params(self, *_: object) -> Any:
        return (*[None] * 6, self._bounds)
