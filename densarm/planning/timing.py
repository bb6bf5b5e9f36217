"""Timing of a path: time-optimal by TOPP-RA, and smoothed for limits of jerk and torque rate."""

import math
from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from densarm.arms.arm import Arm
from densarm.arms.dynamics import JointTorques, holding_ratios, holding_torque
from densarm.planning.motion import Motion, PlanningError, TimingParameters
from densarm.planning.smoothing import SmoothPath
from densarm.planning.topp_ra import GRID_SHARE, UNLIMITED, ToppRa, bounded
from densarm.values.arrays import Array
from densarm.values.outcome import Outcome
from densarm.world.stopping import StoppingCheck

_DURATIONS = 0.25, 4.0  # [s]; TOPP-RA's tolerances are absolute, too small or large for others
_MOST_PERIODS = 1_000_000  # of a motion, so that its arrays fit into memory
_GRID_STEP = 0.025  # [rad] between grid points at most
_GRID = (100, 1000)
_SLOWDOWNS = 50  # tried in turn until the limits hold at every sample
_LEAST_SLOWDOWN = 1.002
_CHECKED = 4  # samples from one whose stopping is checked to the next
_ROUNDS = 12  # of slowing down where stopping is not proved
_HALVINGS = 7  # of the range that the largest speed to stop from is in
_CAP_SHARE = 0.98  # of that speed; the rest is for what lies between grid points

_FIRST_WINDOW, _LARGEST_WINDOW = 0.01, 0.5  # of the motion's duration
_GROWTHS = math.inf, 1.1  # of the window at most, from one that is tried to the next
_NEAR_ENOUGH = 0.95, 1.005  # share of the limits with which no other is tried
_BENDS = 4  # rounds of slowing down where the window is not enough
_BEARABLE, _TOO_FAST = 1.015, 1.5  # outside of which all is slowed down by what a few samples need
_SEARCHED = 400  # samples that show well enough what a window does
_SEARCH_SHARE = 0.985  # of the limits there; the rest is for what lies between them
_WIDENINGS = 3  # of the window, which cost less than slowing down

_WEIGHED = 8  # samples from one whose torque of gravity is computed to the next

_Timing = tuple[Motion, Array, Array]
"""A motion, and path positions (N,) and speeds (N,) [1/s] at its knots, unsmoothed if less."""


class _Rates(NamedTuple):
    """What a motion may use of the limits of rates, infinite where there are none."""

    jerk: Array
    """Of acceleration (nv,) [rad/s³ or m/s³]."""
    torque: Array
    """Of torque, but for gravity's (nv,) [N·m/s or N/s]."""
    torques: JointTorques
    """Of the arm."""


class _Shares(NamedTuple):
    """What the samples of a motion use of what it may."""

    used: Array
    """Of limits of velocity, acceleration and torque (N,)."""
    rate: Array
    """Of limits of rates, to the sample before or after (N,)."""

    @property
    def needed(self) -> Array:
        """By how much each should be slower (N,)."""
        return np.maximum(np.sqrt(self.used), np.cbrt(self.rate))


def time_path(
    arm: Arm,
    path: SmoothPath,
    length: float,
    period: float,
    parameters: TimingParameters,
    stopping: StoppingCheck | None = None,
    time_limit: float = math.inf,
    *,
    has_rates: bool = True,
    grid_share: float = GRID_SHARE,
) -> Motion:
    """Return the fastest motion along a path, from rest to rest.

    The grid follows from the path's length [rad]; the motion has a knot in each period [s]. Where
    stopping from every fourth of them is not proved clear, the path is slowed down until it is,
    there alone. For limits of jerk and torque rate, which may be left out, the path's parameter is
    averaged over a window of time: the path stays, and takes as much longer as the window. Where
    samples exceed a limit, the rarer the smaller the share of it at grid points, all is slowed.

    Raises:
        PlanningError: no speed meets the limits somewhere on the path, none was found that the
            arm could stop from, or the motion takes longer than the time limit [s] or 10⁶ periods.

    Source: Pham and Pham, A New Approach to Time-Optimal Path Parameterization Based on
        Reachability Analysis, IEEE T-RO 2018.
    """
    pieces = len(np.unique(path.knots)) - 1
    parts = math.ceil(np.clip(length / _GRID_STEP, *_GRID) / pieces)
    grid = np.linspace(0.0, 1.0, parts * pieces + 1)
    ways = path(grid, 1)
    slope = np.abs(ways)
    travel = slope.mean(axis=0)
    shortest = _least_duration(arm, travel, parameters)
    unit = float(shortest.max() / np.clip(shortest.max(), *_DURATIONS))  # of time [s], to TOPP-RA
    topp_ra = ToppRa(arm, path, grid, unit, parameters, grid_share)
    # No joint gets faster than √(a travel) from rest to rest, which TOPP-RA's solver does not see.
    fastest = arm.limits.fastest(path(grid), ways)
    reached = np.minimum(fastest, 2.0 * np.sqrt(arm.limits.acceleration * travel))
    with np.errstate(divide="ignore", invalid="ignore"):
        cap = bounded(parameters.velocity_share * reached, grid_share) / slope
    cap[slope == 0.0] = np.inf
    cap = np.minimum(unit * cap.min(axis=1), UNLIMITED)  # path speeds [1/unit]
    longest = min(time_limit, _MOST_PERIODS * period)
    rates, least = _rate_limits(arm, parameters) if has_rates else None, shortest
    if rates:
        least = np.maximum(shortest, np.cbrt(32.0 * travel / rates.jerk))
    window, bends = 0.0, _BENDS if rates else 0
    for _ in range(_ROUNDS + bends):
        speed = topp_ra.speeds(cap)
        if speed is None:
            _require_strength(arm, path, grid, parameters)
            # Its solver takes lines that are nearly parallel, as those of a straight path are, for
            # contradicting ones at times. Speeding up evenly, then braking, is a guess to slow.
            even = np.sqrt(8.0 * np.minimum(grid, 1.0 - grid)) / shortest.max()
            speed = np.minimum(unit * even, cap)
        speed = speed / unit
        duration = float(_times(grid, speed)[-1])
        if bends and duration <= longest:

            @cache
            def coarse(window: float, speed: Array = speed, duration: float = duration) -> _Shares:
                step = max(period, (duration + window) / _SEARCHED)
                motion, _, _ = _sampled(path, grid, speed, step, window)
                shares = _shares(arm, motion, parameters, rates)
                return _Shares(*(share / _SEARCH_SHARE for share in shares))

            window, bends = window or _window(duration, coarse), bends - 1
            shares = coarse(window)
            if _BEARABLE < shares.needed.max() < _TOO_FAST:
                _lower_at_bends(cap, unit, grid, speed, window, shares.needed)
                window *= min(max(1.0, float(shares.rate.max())), _GROWTHS[-1])
                continue
            bends = 0
        timing = _timing_within_limits(
            arm, path, grid, speed, period, parameters, rates, window, least, longest
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


def _rate_limits(arm: Arm, parameters: TimingParameters) -> _Rates | None:
    """Return the limits of rates, None without any."""
    jerk = np.minimum(arm.limits.jerk, parameters.jerk or math.inf)
    torque = parameters.torque_rate_share * arm.limits.torque_rate
    return _Rates(jerk, torque, JointTorques(arm)) if np.isfinite([jerk, torque]).any() else None


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
    rates: _Rates | None,
    window: float,
    shortest: Array,
    longest: float,
) -> _Timing:
    for attempt in range(_SLOWDOWNS):
        duration = float(_times(grid, speed)[-1]) + window
        if duration > longest:
            raise _too_slow(arm, shortest, duration, period, longest)
        timing = _sampled(path, grid, speed, period, window)
        shares = _shares(arm, timing[0], parameters, rates)
        used, rate = float(shares.used.max()), float(shares.rate.max())
        if used <= 1.0 and rate <= 1.0:
            return timing
        if used <= 1.0 and attempt < _WIDENINGS:
            window *= _LEAST_SLOWDOWN * rate
            continue
        # A short motion is stretched to whole periods: slower is one of more of them.
        more = (timing[0].duration + 0.5 * period) / duration
        slower = max(_LEAST_SLOWDOWN, math.sqrt(used), math.cbrt(rate), more)
        speed, window = speed / slower, slower * window
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


def _window(duration: float, coarse: Callable[[float], _Shares]) -> float:
    """Return over which time [s] to smooth a timing.

    Its length divides the steps of acceleration. What else rates have, of bends that are passed
    too fast, it leaves.
    """
    window, most = _FIRST_WINDOW * duration, _LARGEST_WINDOW * duration
    for growth in _GROWTHS:
        rate = float(coarse(window).rate.max())
        if _NEAR_ENOUGH[0] < rate < _NEAR_ENOUGH[1]:
            break
        window = min(min(rate, growth) * window, most)
    return window


def _lower_at_bends(
    cap: Array, unit: float, grid: Array, speed: Array, window: float, needed: Array
) -> None:
    """Lower the caps on path speed [1/unit] where samples need to be slower by factors (N,).

    A sample of a timing averaged over a window [s] is of all speeds [1/s] in it.
    """
    time = _times(grid, speed)
    at = np.linspace(0.0, time[-1] + window, len(needed) + 1)
    first = np.maximum(np.searchsorted(time, at[:-1] - window) - 1, 0)
    last = np.searchsorted(time, at[1:]) + 1
    slower = np.ones_like(cap)
    for k in np.flatnonzero(needed > 1.0):
        cells = slice(first[k], last[k])
        slower[cells] = np.maximum(slower[cells], needed[k])
    cap[:] = np.where(slower > 1.0, np.minimum(cap, unit * speed / slower), cap)


def _sampled(
    path: SmoothPath, grid: Array, speed: Array, period: float, window: float = 0.0
) -> _Timing:
    """Sample a timing, averaged over a window [s] and stretched to a whole number of periods."""
    time = _times(grid, speed)
    end = time[-1] + window
    count = max(2, int(np.ceil(end / period)))  # one would not show its acceleration
    stretch = count * period / end
    at = np.linspace(0.0, end, count + 1)
    s, s_rate, area = _passed(grid, speed, time, at)
    if window > 0.0:
        before, _, area_before = _passed(grid, speed, time, at - window)
        s_rate = (s - before) / window
        s = np.clip((area - area_before) / window, 0.0, 1.0)
    s_rate /= stretch
    s[-1], s_rate[[0, -1]] = 1.0, 0.0
    motion = Motion(period, path(s), path(s, 1) * s_rate[:, np.newaxis])
    if window > 0.0:
        s_rate = np.minimum(s_rate, np.interp(s, grid, speed) / stretch)
    return motion, s, s_rate


def _passed(grid: Array, speed: Array, time: Array, at: Array) -> tuple[Array, Array, Array]:
    """Return path positions, speeds, and the integral of positions, each (N,), at times (N,) [s].

    The path's start is kept before it is left, its end after it is reached.
    """
    acceleration, width = np.diff(speed**2) / (2.0 * np.diff(grid)), np.diff(time)
    area = width * (grid[:-1] + width * (0.5 * speed[:-1] + acceleration * width / 6.0))
    area = np.append(0.0, np.cumsum(area))
    within = np.clip(at, 0.0, time[-1])
    k = np.clip(np.searchsorted(time, within, side="right") - 1, 0, len(grid) - 2)
    elapsed, a, v = within - time[k], acceleration[k], speed[k]
    s = np.clip(grid[k] + elapsed * (v + 0.5 * a * elapsed), 0.0, 1.0)
    area = area[k] + elapsed * (grid[k] + elapsed * (0.5 * v + a * elapsed / 6.0))
    return s, np.maximum(v + a * elapsed, 0.0), area + np.maximum(at - time[-1], 0.0)


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


def _shares(
    arm: Arm, motion: Motion, parameters: TimingParameters, rates: _Rates | None
) -> _Shares:
    """Return what a motion uses at its knots.

    Accelerations are the means up to the next knot, as for torques that are held; with limits of
    rates also those at the knot itself. It rests before and after.
    """
    limits, period, v = arm.limits, motion.period, motion.velocity
    q, start, end = arm.configurations(motion.position[:-1]), v[:-1], v[1:]
    torques = rates.torques if rates else JointTorques(arm)
    a = (np.diff(v, axis=0) / period)[np.newaxis]
    if rates:
        rise = np.diff(motion.position, axis=0) / period
        a = np.append(a, [(6.0 * rise - 4.0 * start - 2.0 * end) / period], axis=0)
    torque = torques(np.array([q] * len(a)), np.array([start] * len(a)), a)
    fastest = limits.fastest(motion.position[:-1], start)
    used = np.abs(start) / (parameters.velocity_share * fastest)
    for rows, limit in (
        (a[:1], parameters.acceleration_share * limits.acceleration),
        (torque[:1], parameters.torque_share * limits.effort),
    ):
        used = np.maximum(used, (np.abs(rows) / limit).max(axis=0))
    rate = np.zeros_like(used)
    if rates:
        # Gravity's torque has no corners, unlike the rest.
        known = np.unique(np.append(np.arange(0, len(q), _WEIGHED), len(q) - 1))
        weights = torques(q[known], 0.0 * start[known], 0.0 * start[known])
        weight = [np.interp(np.arange(len(q)), known, column) for column in weights.T]
        for rows, limit in ((a, rates.jerk), (torque - np.transpose(weight), rates.torque)):
            steps = np.abs(np.diff(rows, axis=1, prepend=0.0, append=0.0)).max(axis=0)
            rate = np.maximum(rate, np.maximum(steps[:-1], steps[1:]) / (period * limit))
    return _Shares(used.max(axis=1), rate.max(axis=1))


def _unstoppable(arm: Arm, angles: Array) -> PlanningError:
    where = ", ".join(f"{angle:.4g}" for angle in angles)
    return PlanningError(
        Outcome.INFEASIBLE,
        f"arm {arm.name!r}: no speed was found from which it could stop in free space at joint "
        f"positions ({where}) of the planned path",
    )
