"""Rounding of a path: it is bent evenly where that makes it quicker, and proved clear."""

import math

import numpy as np
from numpy.typing import NDArray

from densarm.arms.arm import Arm
from densarm.planning.guide import FreeSpace, WayPoints
from densarm.values.arrays import Array
from densarm.values.kernels import compiled, compiled_part

_SPACING = 0.15  # [rad or m] at most between points of a path
_INSET = 0.01  # [rad or m] from position limits, or as much less as the path has
_LEAST_GAIN = 5e-4  # of the time, less than which is not worth a check
_LENGTH_COST = 0.05  # [s/rad or s/m] of a way, so that it does not go far for a little time
_UNLIMITED = 1e6  # stands for limits that are infinite
_SLIGHT = 1e-9


def rounded(
    arm: Arm, freedom: FreeSpace, path: Array, tries: int, rng: np.random.Generator
) -> Array:
    """Return a quicker path with the same ends, of points close to each other, proved clear.

    Between two random points of it all joints, or one while the others go as they went, follow a
    cubic that leaves and arrives in the directions the path has there. What is shortest has
    corners, where an arm must be slow; what makes `way_time` less bends evenly, and may lead
    farther around what is in the way.

    Args:
        arm: the joint space.
        freedom: proves segments.
        path: waypoints (W, nq), W >= 2, joined by clear segments.
        tries: number of pairs of points.
        rng: draws them.

    Source: in the manner of K. Hauser, V. Ng-Thow-Hing, Fast Smoothing of Manipulator Trajectories
        using Optimal Bounded-Acceleration Shortcuts, ICRA 2010, with cubics in the place of timed
        parabolas.
    """
    nothing = WayPoints(np.zeros((0, arm.nq)), 0.0, np.zeros(0, np.int64))
    return rounded_through(arm, freedom, path, nothing, tries, rng)[0]


def rounded_through(
    arm: Arm,
    freedom: FreeSpace,
    path: Array,
    way_points: WayPoints,
    tries: int,
    rng: np.random.Generator,
) -> tuple[Array, WayPoints]:
    """Return a path as `rounded` does, which passes way points as the first does, and its rows.

    Where a cubic would be too far off one, two meet there, so that it is no corner.

    Args:
        arm: the joint space.
        freedom: proves segments.
        path: waypoints (W, nq), as there.
        way_points: what it passes.
        tries: number of pairs of points.
        rng: draws them.
    """
    points, at = _resampled(arm, path)
    rows, within, allowed = at[way_points.rows], way_points.within, _allowed(arm)
    lowest = np.minimum(arm.limits.lower + _INSET, points.min(axis=0))
    highest = np.maximum(arm.limits.upper - _INSET, points.max(axis=0))
    box = np.stack([np.tile(x, (len(points), 1)) for x in (lowest, highest)])
    asked = points[rows] + arm.difference(path[way_points.rows], way_points.q)
    box[0, rows] = np.maximum(lowest, np.minimum(asked - within, points[rows]))
    box[1, rows] = np.minimum(highest, np.maximum(asked + within, points[rows]))
    other, draws = np.empty_like(points), np.empty((tries, 3), np.int64)
    draws[:, :2] = np.sort(rng.integers(len(points), size=(tries, 2)))
    draws[:, 2] = np.minimum(rng.integers(2 * arm.nv, size=tries), arm.nv)
    least, k = _time(points, allowed), 0
    while k := _next_quicker(
        points, draws, k, allowed, rows, box, (1.0 - _LEAST_GAIN) * least, other
    ):
        begin, end = draws[k - 1, 0], draws[k - 1, 1]
        if freedom.polyline_is_clear(other[begin : end + 1]):
            points[begin : end + 1] = other[begin : end + 1]
            least = _time(points, allowed)
    return arm.configurations(points), way_points._replace(rows=rows - len(points))


def way_time(arm: Arm, path: Array) -> float:
    r"""Return about how long a way through configurations (N, nq) takes from rest to rest [s].

    Only limits of velocity and acceleration count, and of ṡ(s), with s the length, so much that

    .. math:: |\theta'_j| \dot s \le v_j, \qquad |\theta'_j \ddot s + \theta''_j \dot s^2| \le a_j

    about holds at points close to each other, a corner at one being a bend of half of the segments
    beside it. A little is added for the length.
    """
    return float(_time(_resampled(arm, path)[0], _allowed(arm)))


def _allowed(arm: Arm) -> Array:
    """Return velocities and accelerations that joints may have (2, nv)."""
    limits: Array = np.stack([arm.limits.velocity, arm.limits.acceleration])
    return np.minimum(limits, _UNLIMITED)


def _resampled(arm: Arm, path: Array) -> tuple[Array, NDArray[np.int64]]:
    """Return joint positions (N, nv) along a path, N >= 3, and its waypoints among them (W,)."""
    steps = arm.difference(path[:-1], path[1:])
    whole = np.ceil(np.linalg.norm(steps, axis=1) / _SPACING - _SLIGHT).astype(int)
    parts = np.maximum(whole, 2 if len(path) == 2 else 1)
    each = np.repeat(steps / parts[:, np.newaxis], parts, axis=0)
    points: Array = arm.angles(path[0]) + np.vstack([np.zeros(arm.nv), np.cumsum(each, axis=0)])
    return points, np.append(0, np.cumsum(parts))


@compiled
def _next_quicker(
    points: Array,
    draws: NDArray[np.int64],
    first: int,
    allowed: Array,
    rows: NDArray[np.int64],
    box: Array,
    most: float,
    out: Array,
) -> int:
    """Write the first way of those drawn that takes less than a time [s], and return its number.

    Args:
        points: joint positions (N, nv) [rad or m].
        draws: two points, and the joint that is bent, nv for all (M, 3).
        first: how many of them were looked at.
        allowed: as `_allowed` returns it.
        rows: points that are passed (M,).
        box: lowest and highest positions of each point (2, N, nv) [rad or m].
        most: the time [s].
        out: the way (N, nv), overwritten.

    Returns:
        How many were looked at, that one included; zero if none of the rest is quicker.
    """
    for k in range(first, draws.shape[0]):
        begin, end, joint = draws[k, 0], draws[k, 1], draws[k, 2]
        if end - begin < 2:
            continue
        _bend(points, begin, end, joint, rows, box, out)
        is_inside = True
        for i in range(begin + 1, end):
            for j in range(points.shape[1]):
                if out[i, j] < box[0, i, j] or out[i, j] > box[1, i, j]:
                    is_inside = False
        if is_inside and _time(out, allowed) < most:
            return k + 1
    return 0


@compiled_part
def _bend(
    points: Array,
    begin: int,
    end: int,
    joint: int,
    rows: NDArray[np.int64],
    box: Array,
    out: Array,
) -> None:
    """Write the path with a cubic between two of its points, of one joint or of all (nv).

    Where that leaves the box of a point that is passed, two meet at the near side of the box, in
    the direction from the beginning of the one to the end of the other.
    """
    n, nv = points.shape
    for i in range(n):
        for j in range(nv):
            out[i, j] = points[i, j]
    before = _way(points, max(begin - 1, 0), begin)
    after = _way(points, end, min(end + 1, n - 1))
    for j in range(nv) if joint == nv else range(joint, joint + 1):
        first, last = points[begin, j], points[end, j]
        slope_a = (first - points[begin - 1, j]) / before if before > _SLIGHT else math.nan
        slope_b = (points[end + 1, j] - last) / after if after > _SLIGHT else math.nan
        _cubic(points, begin, end, j, slope_a, slope_b, out)
        near = begin
        for row in rows:
            if not begin < row < end:
                continue
            at = min(max(out[row, j], box[0, row, j]), box[1, row, j])
            if at != out[row, j]:
                out[row, j] = at
                slope = (last - out[near, j]) / (_way(points, near, end) + _SLIGHT)
                _cubic(points, near, row, j, slope_a, slope, out)
                _cubic(points, row, end, j, slope, slope_b, out)
                near, slope_a = row, slope


@compiled_part
def _way(points: Array, begin: int, end: int) -> float:
    length = 0.0
    for i in range(begin, end):
        length += _apart(points, i, i + 1)
    return length


@compiled_part
def _cubic(
    points: Array, begin: int, end: int, j: int, slope_a: float, slope_b: float, out: Array
) -> None:
    """Write a cubic of a joint between two points that are written, of slopes there or NaN."""
    length = _way(points, begin, end)
    if length < _SLIGHT:
        return
    a, b = out[begin, j], out[end, j]
    slope_a, slope_b = length * slope_a, length * slope_b
    slope_a, slope_b = _known(slope_a, slope_b, b - a), _known(slope_b, slope_a, b - a)
    gone = 0.0
    for i in range(begin + 1, end):
        gone += _apart(points, i - 1, i)
        u = gone / length
        w = 1.0 - u
        out[i, j] = a + u * u * (3.0 - 2.0 * u) * (b - a) + u * w * (w * slope_a - u * slope_b)


@compiled_part
def _known(slope: float, other: float, rise: float) -> float:
    """Return a slope at an end of a cubic, or if it is free the one of no bend there."""
    if not math.isnan(slope):
        return slope
    return rise if math.isnan(other) else 1.5 * rise - 0.5 * other


@compiled_part
def _apart(points: Array, i: int, k: int) -> float:
    square = 0.0
    for j in range(points.shape[1]):
        square += (points[k, j] - points[i, j]) ** 2
    return math.sqrt(square)


@compiled
def _time(points: Array, allowed: Array) -> float:
    """Return about how long a way through joint positions (N, nv) takes, see `way_time`."""
    n, nv = points.shape
    step, per_step, square = np.empty(n), np.empty(n), np.empty(n)  # of lengths, and of speeds
    slope, bend = np.empty((n, nv)), np.empty((n, nv))
    for i in range(n - 1):
        step[i] = _apart(points, i, i + 1) + _SLIGHT
        per_step[i] = 1.0 / step[i]
    for i in range(n):
        before, after = max(i - 1, 0), min(i + 1, n - 1)
        per_both = 1.0 / (step[before] + step[after - 1])
        fastest = _UNLIMITED**2
        for j in range(nv):
            come = (points[i, j] - points[before, j]) * per_step[before]
            go = (points[after, j] - points[i, j]) * per_step[after - 1]
            if before == i or after == i:
                slope[i, j], bend[i, j] = come + go, 0.0
            else:
                slope[i, j] = (come * step[i] + go * step[before]) * per_both
                bend[i, j] = 2.0 * (go - come) * per_both
            # Compared before it is divided, which takes longest.
            steepest, sharpest = max(abs(come), abs(go)) + _SLIGHT, abs(bend[i, j]) + _SLIGHT
            if fastest * steepest * steepest > allowed[0, j] * allowed[0, j]:
                fastest = (allowed[0, j] / steepest) ** 2
            if fastest * sharpest > allowed[1, j]:
                fastest = allowed[1, j] / sharpest
        square[i] = fastest
    square[0] = square[n - 1] = 0.0
    for i in range(1, n):
        _bound(slope, bend, i - 1, i, 2.0 * step[i - 1], square, allowed[1])
    total = 0.0
    for i in range(n - 2, -1, -1):
        _bound(slope, bend, i + 1, i, -2.0 * step[i], square, allowed[1])
        time = 2.0 * step[i] / (math.sqrt(square[i]) + math.sqrt(square[i + 1]) + _SLIGHT)
        total += time + _LENGTH_COST * step[i]
    return total


@compiled_part
def _bound(
    slope: Array, bend: Array, near: int, far: int, twice: float, square: Array, most: Array
) -> None:
    """Bound ṡ² at a point by that at the one near it, under accelerations at both.

    It is twice the way between them times s̈ larger, the way backwards being negative.
    """
    largest, per_twice = square[far], 1.0 / twice
    for j in range(slope.shape[1]):
        for i in (near, far):
            by_rise = slope[i, j] * per_twice + (bend[i, j] if i == far else 0.0)
            constant = bend[i, j] * square[near]
            room = max(0.0, most[j] - math.copysign(constant, constant * by_rise))
            rise = abs(by_rise)
            if rise > _SLIGHT and rise * (largest - square[near]) > room:
                largest = square[near] + room / rise
    square[far] = largest
