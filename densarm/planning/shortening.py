"""Shortening of a path by clear ways between points of it."""

from itertools import pairwise

import numpy as np

from densarm.arms.arm import Arm
from densarm.planning.guide import FreeSpace
from densarm.values.arrays import Array

_SPACING = 0.5  # [rad or m] between the points of a path that a try starts and ends at
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
        tries: number of pairs of points.
        rng: draws them.

    Source: R. Geraerts, M. H. Overmars, Creating High-quality Paths for Motion Planning, IJRR 26
        (2007), section 3.
    """
    points = _resampled(arm, path)
    least = _LEAST_GAIN * _length(arm.difference(points[:-1], points[1:])).sum()
    for _ in range(tries):
        joint = rng.integers(arm.nv + 1)
        begin, end = np.sort(rng.integers(len(points), size=2))
        if end - begin < 2:
            continue
        steps = arm.difference(points[begin:end], points[begin + 1 : end + 1])
        length, chord = _length(steps), arm.difference(points[begin], points[end])
        way = np.vstack([np.zeros(arm.nv), np.cumsum(steps, axis=0)])
        share = np.append(0.0, np.cumsum(length))
        is_straight = joint == arm.nv
        chosen = slice(None) if is_straight else slice(joint, joint + 1)
        way[:, chosen] = (share / max(share[-1], 1e-300))[:, np.newaxis] * chord[chosen]
        if not length.sum() - _length(np.diff(way, axis=0)).sum() > least:
            continue
        candidate = arm.integrate(points[begin], way)
        candidate[[0, -1]] = points[[begin, end]]
        checked = candidate[[0, -1]] if is_straight else candidate
        if all(freedom.segment_is_clear(a, b) for a, b in pairwise(checked)):
            points[begin : end + 1] = candidate
    kept = [points[0]]
    for waypoint, after in pairwise(points[1:]):
        if not freedom.segment_is_clear(kept[-1], after):
            kept.append(waypoint)
    return np.stack([*kept, points[-1]])


def _resampled(arm: Arm, path: Array) -> Array:
    """Return a path's waypoints (W, nq) with points between them where they are far apart."""
    steps = arm.difference(path[:-1], path[1:])
    parts = np.maximum(1, np.ceil(_length(steps) / _SPACING).astype(int))
    pieces = [
        arm.integrate(q, np.arange(n)[:, np.newaxis] / n * step)
        for q, step, n in zip(path, steps, parts, strict=False)
    ]
    return np.vstack([*pieces, path[-1:]])


def _length(steps: Array) -> Array:
    return np.asarray(np.linalg.norm(steps, axis=1))
