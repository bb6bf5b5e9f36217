"""Shortening of a path by clear ways between points of it."""

import math
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from densarm.arms.arm import Arm
from densarm.planning.guide import FreeSpace
from densarm.values.arrays import Array
from densarm.values.kernels import compiled, compiled_part

_SPACINGS = 0.5, 0.25, 0.125  # [rad or m] at most between points that tries begin at, in turn
_HALF_TURN = math.pi - 1e-9  # [rad], beyond which rounding decides which way round a proof goes
_STRAIGHT = 1e-9  # [rad or m], off a straight line at most
_IN_VAIN = 150  # tries that gain nothing, after which no more are made
_LEAST_GAIN = 3e-4  # of a path's length; a try that gains less is not worth a check


def shortened(
    arm: Arm, freedom: FreeSpace, path: Array, tries: int, rng: np.random.Generator
) -> Array:
    """Return a shorter path with the same ends; what it has in place of segments is proved clear.

    Between two random points of it either all joints go straight, or one does while the others go
    as they went: what a joint does in vain is undone though the arm as a whole is in the way of a
    straight segment.

    Args:
        arm: the joint space.
        freedom: proves segments.
        path: waypoints (W, nq), W >= 2.
        tries: number of pairs of points, at least one for each spacing.
        rng: draws them.

    Source: R. Geraerts, M. H. Overmars, Creating High-quality Paths for Motion Planning, IJRR 26
        (2007), section 3.
    """
    each = tries // len(_SPACINGS)
    for spacing in _SPACINGS:
        path = _straightened(arm, freedom, _resampled(arm, path, spacing), each, rng)
    return path


def _straightened(
    arm: Arm, freedom: FreeSpace, points: Array, tries: int, rng: np.random.Generator
) -> Array:
    """Return what is left of the points of a path (W, nq) once ways between them are shorter."""
    angles, is_continuous = arm.angles(points), arm.continuous
    least = _LEAST_GAIN * _length(arm.difference(points[:-1], points[1:])).sum()
    in_vain, room = 0, np.empty_like(angles)
    joints = rng.integers(arm.nv + 1, size=tries).tolist()
    ends = np.sort(rng.integers(len(points), size=(tries, 2))).tolist()
    for joint, (begin, end) in zip(joints, ends, strict=True):
        if in_vain == _IN_VAIN:
            break
        in_vain += 1
        way = room[: end - begin + 1]
        if not _write_way(angles, is_continuous, begin, end, joint, way) > least:
            continue
        if freedom.polyline_is_clear(way[:: end - begin] if joint == arm.nv else way):
            points[begin + 1 : end] = arm.configurations(way[1:-1])
            angles[begin : end + 1] = way
            in_vain = 0
    kept = [points[0]]
    for waypoint, after in pairwise(points[1:]):
        if _is_between(arm.difference(kept[-1], np.stack([waypoint, after]))):
            continue  # what leads there is clear
        if not freedom.segment_is_clear(kept[-1], after):
            kept.append(waypoint)
    return np.stack([*kept, points[-1]])


def _resampled(arm: Arm, path: Array, spacing: float) -> Array:
    """Return a path's waypoints (W, nq) with points between them where they are farther apart."""
    steps = arm.difference(path[:-1], path[1:])
    parts = np.maximum(1, np.ceil(_length(steps) / spacing).astype(int))
    pieces = [
        np.vstack([q, arm.integrate(q, np.arange(1, n)[:, np.newaxis] / n * step)])
        for q, step, n in zip(path, steps, parts, strict=False)
    ]
    return np.vstack([*pieces, path[-1:]])


def _is_between(steps: Array) -> bool:
    """Return whether the first of two steps (2, nv) is a part of the second."""
    part, whole = steps
    share = float(part @ whole) / max(float(whole @ whole), _STRAIGHT**2)
    return 0.0 <= share <= 1.0 and bool(np.abs(part - share * whole).max() < _STRAIGHT)


def _length(steps: Array) -> Array:
    return np.asarray(np.linalg.norm(steps, axis=1))


@compiled
def _write_way(
    angles: Array,
    is_continuous: NDArray[np.bool_],
    begin: int,
    end: int,
    joint: int,
    out: Array,
) -> float:
    """Write a way between two points on which a joint goes straight, and return what it gains.

    Args:
        angles: joint positions of all points (W, nv) [rad or m].
        is_continuous: joints that go the short way round (nv,).
        begin: index of one point.
        end: index of the other, not before it.
        joint: index of the joint; nv for all of them.
        out: the way (end - begin + 1, nv) [rad or m], overwritten.
    """
    n, nv = end - begin, angles.shape[1]
    share, longer, shorter = np.zeros(n + 1), 0.0, 0.0
    for j in range(nv):  # to assign the row at once takes seconds to compile
        out[0, j] = angles[begin, j]
    for k in range(n):
        square = 0.0
        for j in range(nv):
            step = _turn(angles[begin + k + 1, j] - angles[begin + k, j], is_continuous[j])
            out[k + 1, j] = out[k, j] + step
            square += step * step
        longer += math.sqrt(square)
        share[k + 1] = longer
    for j in range(nv):
        if (j == joint or joint == nv) and longer > 0.0:
            chord = _turn(angles[end, j] - angles[begin, j], is_continuous[j])
            if is_continuous[j] and abs(chord) > _HALF_TURN:
                return 0.0
            for k in range(1, n + 1):
                out[k, j] = out[0, j] + share[k] / longer * chord
    for k in range(n):
        square = 0.0
        for j in range(nv):
            square += (out[k + 1, j] - out[k, j]) ** 2
        shorter += math.sqrt(square)
    return longer - shorter


@compiled_part
def _turn(step: float, is_continuous: bool) -> float:
    return math.atan2(math.sin(step), math.cos(step)) if is_continuous else step
