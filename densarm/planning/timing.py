"""Time-optimal timing of a path under velocity, acceleration and torque limits, by TOPP-RA."""

import math
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from densarm.arms.arm import Arm
from densarm.arms.dynamics import JointTorques, holding_ratios, holding_torque
from densarm.planning.motion import Motion, PlanningError, TimingParameters
from densarm.planning.smoothing import SmoothPath
from densarm.values.arrays import Array
from densarm.values.outcome import Outcome
from densarm.world.stopping import StoppingCheck


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

_UNLIMITED = 1e4  # stands for an infinite limit, which TOPP-RA's solver does not take
_DURATIONS = 0.25, 4.0  # [s]; its tolerances are absolute, and too small or large for others
_MOST_PERIODS = 1_000_000  # of a motion, so that its arrays fit into memory
_GRID_STEP = 0.0125  # [rad] between grid points at most
_GRID = (200, 1000)
_GRID_SHARE = 0.98  # of the limits at grid points; the rest is for what lies between them
_SLOWDOWNS = 50  # tried in turn until the limits hold at every sample
_LEAST_SLOWDOWN = 1.002
_CHECKED = 4  # samples from one whose stopping is checked to the next
_ROUNDS = 12  # of slowing down where stopping is not proved
_HALVINGS = 7  # of the range that the largest speed to stop from is in
_CAP_SHARE = 0.98  # of that speed; the rest is for what lies between grid points

_Timing = tuple[Motion, Array, Array]
"""A motion, and path positions (N,) and speeds (N,) [1/s] at its knots."""


def time_path(
    arm: Arm,
    path: SmoothPath,
    length: float,
    period: float,
    parameters: TimingParameters,
    stopping: StoppingCheck | None = None,
    time_limit: float = math.inf,
) -> Motion:
    """Return the fastest motion along a path, from rest to rest.

    The grid follows from the path's length [rad]; the motion has a knot in each period [s]. Where
    stopping from every fourth of them is not proved clear, the path is slowed down until it is,
    there alone.

    Raises:
        PlanningError: no speed meets the limits somewhere on the path, none was found that the
            arm could stop from, or the motion takes longer than the time limit [s] or 10⁶ periods.

    Source: Pham and Pham, A New Approach to Time-Optimal Path Parameterization Based on
        Reachability Analysis, IEEE T-RO 2018.
    """
    pieces = len(np.unique(path.knots)) - 1
    parts = math.ceil(np.clip(length / _GRID_STEP, *_GRID) / pieces)
    grid = np.linspace(0.0, 1.0, parts * pieces + 1)
    slope = np.abs(path(grid, 1))
    travel = slope.mean(axis=0)
    shortest = _least_duration(arm, travel, parameters)
    unit = float(shortest.max() / np.clip(shortest.max(), *_DURATIONS))  # of time [s], to TOPP-RA
    limits = _limits(arm, path, grid, unit, parameters)
    # No joint gets faster than √(a travel) from rest to rest, which TOPP-RA's solver does not see.
    reached = np.minimum(arm.limits.velocity, 2.0 * np.sqrt(arm.limits.acceleration * travel))
    with np.errstate(divide="ignore", invalid="ignore"):
        cap = _bounded(parameters.velocity_share * reached) / slope
    cap[slope == 0.0] = np.inf
    cap = np.minimum(unit * cap.min(axis=1), _UNLIMITED)  # path speeds [1/unit]
    longest = min(time_limit, _MOST_PERIODS * period)
    for _ in range(_ROUNDS):
        squares = np.column_stack([np.zeros_like(cap), cap**2])
        capped = _Constraint(arm.nv, (*[None] * 6, squares))
        fastest = toppra.algorithm.TOPPRA([limits, capped], path, grid)
        _, speed, _ = fastest.compute_parameterization(0.0, 0.0)
        if speed is None or not np.isfinite(speed).all():
            _require_strength(arm, path, grid, parameters)
            # Its solver takes lines that are nearly parallel, as those of a straight path are, for
            # contradicting ones at times. Speeding up evenly, then braking, is a guess to slow.
            even = np.sqrt(8.0 * np.minimum(grid, 1.0 - grid)) / shortest.max()
            speed = np.minimum(unit * even, cap)
        timing = _timing_within_limits(
            arm, path, grid, speed / unit, period, parameters, shortest, longest
        )
        motion, _, _ = timing
        if stopping is None:
            return motion
        q = arm.configurations(motion.position[::_CHECKED])
        failing = _CHECKED * stopping.check(q, motion.velocity[::_CHECKED]).failing
        if not failing.size:
            return motion
        _lower(cap, unit, stopping, arm, grid, timing, failing)
    raise _unstoppable(arm, motion.position[failing[0]])


def _least_duration(arm: Arm, travel: Array, parameters: TimingParameters) -> Array:
    """Return how long each joint at least takes for its travel (nv,) [rad or m], in seconds."""
    speed = parameters.velocity_share * arm.limits.velocity
    acceleration = parameters.acceleration_share * arm.limits.acceleration
    return np.maximum(travel / speed, 2.0 * np.sqrt(travel / acceleration))


def _timing_within_limits(
    arm: Arm,
    path: SmoothPath,
    grid: Array,
    speed: Array,
    period: float,
    parameters: TimingParameters,
    shortest: Array,
    longest: float,
) -> _Timing:
    for _ in range(_SLOWDOWNS):
        duration = float(_times(grid, speed)[-1])
        if duration > longest:
            raise _too_slow(arm, shortest, duration, period, longest)
        timing = _sampled(path, grid, speed, period)
        used = _largest_share(arm, timing[0], parameters)
        if used <= 1.0:
            return timing
        # A short motion is stretched to whole periods: slower is one of more of them.
        more = (timing[0].duration + 0.5 * period) / duration
        speed = speed / max(_LEAST_SLOWDOWN, math.sqrt(used), more)
    _require_strength(arm, path, grid, parameters)
    detail = "no speed was found on the planned path at which all limits hold"
    raise PlanningError(Outcome.INFEASIBLE, f"arm {arm.name!r}: {detail}")


def _require_strength(
    arm: Arm, path: SmoothPath, grid: Array, parameters: TimingParameters
) -> None:
    """Raise `PlanningError` where the arm cannot hold itself within its torque limits' share."""
    q, share = arm.configurations(path(grid)), parameters.torque_share
    heaviest = max(q, key=lambda row: float(holding_ratios(arm, row).max()))
    if holding_ratios(arm, heaviest).max() > share:
        raise PlanningError(
            Outcome.INFEASIBLE,
            f"arm {arm.name!r}: its torque limits allow no motion along the planned path, of which "
            f"planning uses {share:.0%}; {holding_torque(arm, heaviest)}",
        )


def _too_slow(
    arm: Arm, shortest: Array, duration: float, period: float, longest: float
) -> PlanningError:
    limit = f"time_limit = {longest:.6g} s: raise it"
    if longest == _MOST_PERIODS * period:
        limit = f"{_MOST_PERIODS} periods of {period:.3g} s: take longer ones"
    joint = int(shortest.argmax())
    return PlanningError(
        Outcome.TIMED_OUT,
        f"the motion takes {duration:.4g} s, more than {limit}, or raise the limits of joint "
        f"{arm.joint_names[joint]!r}, which alone takes {shortest[joint]:.4g} s",
    )


def _times(grid: Array, speed: Array) -> Array:
    """Return when each point of the grid is passed [s]; ṡ² is linear on each interval."""
    return np.append(0.0, np.cumsum(2.0 * np.diff(grid) / (speed[:-1] + speed[1:])))


def _sampled(path: SmoothPath, grid: Array, speed: Array, period: float) -> _Timing:
    """Sample a timing, stretched to a whole number of periods."""
    time = _times(grid, speed)
    count = max(2, int(np.ceil(time[-1] / period)))  # one would not show its acceleration
    stretch = count * period / time[-1]
    at = np.linspace(0.0, time[-1], count + 1)
    k = np.clip(np.searchsorted(time, at, side="right") - 1, 0, len(grid) - 2)
    elapsed = at - time[k]
    acceleration = np.diff(speed**2)[k] / (2.0 * np.diff(grid)[k])
    s = np.clip(grid[k] + elapsed * (speed[k] + 0.5 * acceleration * elapsed), 0.0, 1.0)
    s_rate = np.maximum(speed[k] + acceleration * elapsed, 0.0) / stretch
    s[-1], s_rate[[0, -1]] = 1.0, 0.0
    return Motion(period, path(s), path(s, 1) * s_rate[:, np.newaxis]), s, s_rate


def _lower(
    cap: Array,
    unit: float,
    stopping: StoppingCheck,
    arm: Arm,
    grid: Array,
    timing: _Timing,
    failing: NDArray[np.int64],
) -> None:
    """Lower the caps on path speed around failing samples to speeds that the arm can stop from.

    The caps are per unit of time, all else is per second.
    """
    motion, s, speed = timing
    cell = np.clip(np.searchsorted(grid, s[failing], side="right") - 1, 0, len(grid) - 2)
    cell, first = np.unique(cell, return_index=True)
    failing = failing[first]
    q, v = arm.configurations(motion.position[failing]), motion.velocity[failing]
    low, high = np.zeros(len(failing)), np.ones(len(failing))
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        holds = stopping.check(q, middle[:, np.newaxis] * v).holds
        low, high = np.where(holds, middle, low), np.where(holds, high, middle)
    if (low == 0.0).any():
        raise _unstoppable(arm, motion.position[failing[low.argmin()]])
    allowed = _CAP_SHARE * low * speed[failing] * unit
    np.minimum.at(cap, cell, allowed)
    np.minimum.at(cap, cell + 1, allowed)


def _largest_share(arm: Arm, motion: Motion, parameters: TimingParameters) -> float:
    """Return the largest share of what it may use of its limits that a motion uses at a sample."""
    v, limits = motion.velocity, arm.limits
    a = np.diff(v, axis=0) / motion.period
    torque = JointTorques(arm)(arm.configurations(motion.position[:-1]), v[:-1], a)
    used = (
        np.abs(v) / (parameters.velocity_share * limits.velocity),
        np.abs(a) / (parameters.acceleration_share * limits.acceleration),
        np.abs(torque) / (parameters.torque_share * limits.effort),
    )
    return max(float(share.max()) for share in used)


def _unstoppable(arm: Arm, angles: Array) -> PlanningError:
    where = ", ".join(f"{angle:.4g}" for angle in angles)
    return PlanningError(
        Outcome.INFEASIBLE,
        f"arm {arm.name!r}: no speed was found from which it could stop in free space at joint "
        f"positions ({where}) of the planned path",
    )


def _bounded(limit: Array) -> Array:
    return np.minimum(_GRID_SHARE * limit, _UNLIMITED)


def _limits(
    arm: Arm, path: SmoothPath, grid: Array, unit: float, parameters: TimingParameters
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
        _bounded(parameters.acceleration_share * arm.limits.acceleration),
        _bounded(parameters.torque_share * arm.limits.effort[weak]),
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
