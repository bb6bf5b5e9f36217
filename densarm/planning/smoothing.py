"""SmoothPath: a twice differentiable curve near the planning system's, proved clear."""

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from densarm.arms.arm import Arm
from densarm.arms.line import Segment
from densarm.arms.upright import Upright
from densarm.planning.guide import WayPoints
from densarm.planning.path_margins import LIMIT_INSET
from densarm.values.arrays import Array
from densarm.world.separating_planes import SeparatingPlanes, configuration_tube
from densarm.world.swept_check import SweptCheck, SweptVerdict
from densarm.world.world import World

STRAIGHT = (2.5e-4, 2.5e-3)
"""Largest distance and turn of a frame from the line that a plan leads it along [m, rad]."""

_ROUNDING = 1e-9  # [rad or m]
_DEGREE = 3
_WIDEST = 0.8  # [rad] between control points at first
_HALVINGS = 9
_SAMPLE = 0.01  # [rad] at most between the samples that the proof uses at first
_PARTS = 4  # at least, that each polynomial piece is sampled in
_LARGEST_GROUP = 64  # chords that are proved at once
_UPRIGHT_PARTS = 64  # of each piece, between which a tilt is bounded
_UPRIGHT_SHARE = 0.9  # of its angle; the rest is for tracking errors
_DOUBLINGS = 5  # of the samples; the spline's departure from its chords falls with their square


class SmoothPath:
    """A cubic B-spline θ(s) in joint positions, s in [0, 1], with its derivatives.

    SciPy has these too, but takes longer to import than a motion takes to plan.

    Args:
        knots: where pieces meet (C + 4,), from 0 to 1, at each end four times.
        control: control points (C, nv) [rad or m].

    Source: de Boor, A Practical Guide to Splines, ch. X.
    """

    path_interval = 0.0, 1.0  # as TOPP-RA calls it

    def __init__(self, knots: Array, control: Array) -> None:
        self.knots = knots
        self.control = control
        self._control = [control]  # of each derivative
        for degree in (_DEGREE, _DEGREE - 1):
            own = self._knots(_DEGREE - degree)
            width = own[degree + 1 : -1] - own[1 : -degree - 1]
            slope = np.diff(self._control[-1], axis=0) / width[:, np.newaxis]
            self._control.append(degree * slope)

    def __call__(self, s: float | Array, order: int = 0) -> Array:
        """Return θ(s), or its derivative of order 1 or 2, shape (..., nv)."""
        degree, knots, control = _DEGREE - order, self._knots(order), self._control[order]
        at = np.asarray(s, dtype=np.float64)
        piece = np.clip(np.searchsorted(knots, at, side="right") - 1, degree, len(control) - 1)
        first = piece - degree
        points = [control[first + j] for j in range(degree + 1)]
        for level in range(1, degree + 1):
            for j in range(degree, level - 1, -1):
                low, high = knots[first + j], knots[piece + j + 1 - level]
                share = np.asarray((at - low) / (high - low))[..., np.newaxis]
                points[j] = (1.0 - share) * points[j - 1] + share * points[j]
        return np.asarray(points[degree])

    def _knots(self, order: int) -> Array:
        """Return the knots of a derivative: each end stands there once less for each order."""
        return self.knots[order : len(self.knots) - order]


def smooth_path(
    world: World,
    margin: float,
    curve: Array,
    kept: float | Array = 0.0,
    line: Segment | None = None,
) -> SmoothPath | None:
    """Return a C² path with the ends of a polyline (N, nq), proved clear.

    It is clear beyond the margin [m] and what each pair, or all, keep beyond that (K,) [m].

    Control points of a clamped uniform cubic B-spline are taken from the polyline at equal
    distances. Each piece of the spline stays in the convex hull of four of them, so that it tends
    to the polyline as they get denser: their distance is halved until the path is proved clear,
    and leads a frame along a line, if any, within `STRAIGHT`. None if even the densest gave none.

    Source: convex hull property: de Boor, A Practical Guide to Splines, ch. IX.
    """
    corner, length = polyline(world.arm, curve)
    proof = _MotionProof(world, margin, kept)
    for halving in range(_HALVINGS):
        count = max(_DEGREE + 1, 1 + int(np.ceil(length[-1] * 2.0**halving / _WIDEST)))
        at = np.linspace(0.0, length[-1], count)
        control = np.column_stack([np.interp(at, length, column) for column in corner.T])
        inner = np.linspace(0.0, 1.0, count - _DEGREE + 1)
        path = SmoothPath(np.pad(inner, _DEGREE, mode="edge"), control)
        if _is_straight(world, path, line) and all(_clear_pieces(proof, path, length[-1])):
            return path
    return None


def blended_path(
    world: World,
    margin: float,
    curve: Array,
    kept: float | Array = 0.0,
    widest: float = _WIDEST,
    way_points: WayPoints | None = None,
    upright: Upright | None = None,
) -> SmoothPath | None:
    """Return a C² path as `smooth_path` does, which blends corners as widely as is clear.

    The knots of its spline get denser only where it is not proved clear, misses a way point or
    tilts a frame, and control points are those of the polyline at averages of three knots, so that
    it goes along straight segments at an even rate: both let a motion be quicker.

    Args:
        world: the arm among obstacles.
        margin: safety margin [m].
        curve: polyline (N, nq).
        kept: what each pair, or all, keep beyond the margin (K,) [m].
        widest: distance between knots at first, on the polyline [rad or m].
        way_points: what the polyline passes, and the path as it does.
        upright: what it keeps upright within nine tenths of its angle, as the polyline does.

    Source: I. J. Schoenberg, On Spline Functions, 1967, for the control points.
    """
    corner, length = polyline(world.arm, curve)
    proof = _MotionProof(world, margin, kept)
    breaks = np.linspace(0.0, length[-1], 1 + max(1, int(np.ceil(length[-1] / widest))))
    for _ in range(_HALVINGS + 1):
        knots = np.pad(breaks, _DEGREE, mode="edge")
        at = (knots[1:-3] + knots[2:-2] + knots[3:-1]) / _DEGREE
        control = np.column_stack([np.interp(at, length, column) for column in corner.T])
        path, missed = SmoothPath(knots / length[-1], control), np.zeros(0)
        if way_points is not None:
            passed = length[way_points.rows]
            path = _passing(path, passed / length[-1], corner[way_points.rows])
            missed = passed[_misses(world.arm, path, passed / length[-1], way_points)]
        halved = ~np.fromiter(_clear_pieces(proof, path, length[-1]), dtype=np.bool_)
        halved |= _near_limits(world.arm, path, corner)
        if upright is not None:
            halved |= ~np.fromiter(_upright_pieces(world.arm, path, upright), dtype=np.bool_)
        for at in missed:
            halved |= (breaks[:-1] <= at) & (at <= breaks[1:])
        if not halved.any():
            return path
        while halved.any():
            middle = 0.5 * (breaks[:-1] + breaks[1:])
            breaks = np.sort(np.append(breaks, middle[halved]))
            # None more than twice as long as one beside it.
            width = np.diff(breaks)
            beside = np.fmin(np.append(width[1:], np.nan), np.append(np.nan, width[:-1]))
            halved = 0.49 * width > beside
    return None


def polyline(arm: Arm, curve: Array) -> tuple[Array, Array]:
    """Return joint positions (N, nv) at the corners of a polyline, and lengths to them (N,)."""
    steps = arm.difference(curve[:-1], curve[1:])
    corner = arm.angles(curve[0]) + np.vstack([np.zeros(arm.nv), np.cumsum(steps, axis=0)])
    return corner, np.append(0.0, np.cumsum(np.linalg.norm(steps, axis=1)))


def _passing(path: SmoothPath, s: Array, points: Array) -> SmoothPath:
    """Return the path nearest to one, by control points, that passes points (M, nv) at s (M,).

    Its ends stay. Where it has too few control points it does not pass all of them.
    """
    control = path.control.copy()
    basis = SmoothPath(path.knots, np.eye(len(control)))(s)[:, 1:-1]
    control[1:-1] += np.linalg.pinv(basis) @ (points - path(s))
    return SmoothPath(path.knots, control)


def _misses(arm: Arm, path: SmoothPath, s: Array, way_points: WayPoints) -> NDArray[np.bool_]:
    """Return of which way points a path is too far off at s (M,)."""
    off = np.abs(arm.difference(way_points.q, arm.configurations(path(s)))).max(axis=1)
    return np.asarray(off > way_points.within + _ROUNDING)


def _near_limits(arm: Arm, path: SmoothPath, corner: Array) -> NDArray[np.bool_]:
    """Return which pieces may come nearer to position limits than the polyline and a little.

    A way along a limit, which a path that passes points may swing out to, cannot be stopped on.
    """
    low = np.minimum(arm.limits.lower + LIMIT_INSET, corner.min(axis=0)) - _ROUNDING
    high = np.maximum(arm.limits.upper - LIMIT_INSET, corner.max(axis=0)) + _ROUNDING
    outside = ((path.control < low) | (path.control > high)).any(axis=1)
    return np.asarray(np.lib.stride_tricks.sliding_window_view(outside, _DEGREE + 1).any(axis=1))


def _is_straight(world: World, path: SmoothPath, line: Segment | None) -> bool:
    """Return whether the path leads a frame along a line, at ten samples for each control point."""
    if line is None:
        return True
    s = np.linspace(0.0, 1.0, 10 * len(path.knots))
    off = line.off(world.arm, world.arm.configurations(path(s)))
    return all(bool((far <= most).all()) for far, most in zip(off, STRAIGHT, strict=True))


def _upright_pieces(arm: Arm, path: SmoothPath, upright: Upright) -> Iterator[bool]:
    """Yield of each polynomial piece if it is proved to keep a frame upright."""
    for begin, end in pairwise(np.unique(path.knots)):
        s = np.linspace(begin, end, _UPRIGHT_PARTS + 1)
        curvature = np.abs(path(s, 2))
        off = np.maximum(curvature[:-1], curvature[1:]) / 8.0 * np.diff(s)[:, np.newaxis] ** 2
        largest = upright.largest_tilts(arm, arm.configurations(path(s)), off)
        yield bool((largest <= _UPRIGHT_SHARE * upright.within).all())


def _clear_pieces(proof: "_MotionProof", path: SmoothPath, length: float) -> Iterator[bool]:
    """Yield of each polynomial piece if it is proved clear, sampled ever finer until decided."""
    for begin, end in pairwise(np.unique(path.knots)):
        parts = max(_PARTS, int(np.ceil(length * (end - begin) / _SAMPLE)))
        for doubling in range(_DOUBLINGS):
            s = np.linspace(begin, end, parts * 2**doubling + 1)
            # The second derivative is linear between samples, so that it is largest at one of them.
            curvature = np.abs(path(s, 2))
            largest = np.maximum(curvature[:-1], curvature[1:])
            verdict = proof.verdict(path(s), largest / 8.0 * np.diff(s)[:, np.newaxis] ** 2)
            if verdict != SweptVerdict.UNDECIDED:
                break
        yield verdict == SweptVerdict.CLEAR


class _MotionProof:
    """Proves what `SweptCheck` does, in configuration tubes around many chords each.

    A chord in no tube that is proved clear is left to `SweptCheck` and its exact distances.
    """

    def __init__(self, world: World, margin: float, kept: float | Array) -> None:
        self._planes = SeparatingPlanes(world, margin, kept)
        self._swept = SweptCheck(world, margin, kept)

    def verdict(self, angles: Array, departure: Array) -> SweptVerdict:
        """Return whether the motion through joint positions (N, nv) [rad or m] is proved clear.

        It departs from each chord by a bound per joint (N - 1, nv) [rad or m] at most.
        """
        last = len(departure)
        waiting = [(a, min(a + _LARGEST_GROUP, last)) for a in range(0, last, _LARGEST_GROUP)]
        while waiting:
            a, b = waiting.pop()
            points, off = angles[a : b + 1], departure[a:b].max(axis=0)
            tube = configuration_tube(points, points[-1] - points[0])
            if self._planes.tube_is_clear(tube._replace(radius=tube.radius + off)):
                continue
            if b - a > 1:
                m = (a + b) // 2
                waiting += [(a, m), (m, b)]
                continue
            q = self._swept.arm.configurations(points)
            result = self._swept.check(q, departure[a:b])
            if result.verdict != SweptVerdict.CLEAR:
                return result.verdict
        return SweptVerdict.CLEAR
