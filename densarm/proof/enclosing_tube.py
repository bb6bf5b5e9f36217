"""Enclosing tube: a segment of joint space with all that is near it, around given points."""

from typing import NamedTuple

import numpy as np

from densarm.arrays import Array


class Tube(NamedTuple):
    """All points within a radius per joint of a segment; a convex set."""

    begin: Array
    """One end of the segment (nv,) [rad or m]."""
    step: Array
    """From there to the other end (nv,) [rad or m]."""
    radius: Array
    """How far each joint may be off the segment (nv,) [rad or m]."""


def enclosing_tube(points: Array, step: Array) -> Tube:
    """Return a tube along a step from the first of some points that holds them all.

    Being convex it holds the segments between them as well.

    Args:
        points: joint positions (N, nv) [rad or m].
        step: joint motion (nv,) [rad or m].
    """
    offset, square = points - points[0], float(step @ step)
    share = np.clip(offset @ step / square, 0.0, 1.0) if square > 0.0 else np.zeros(len(points))
    off = offset - np.outer(share, step)
    low, high = off.min(axis=0), off.max(axis=0)
    return Tube(points[0] + 0.5 * (low + high), step, 0.5 * (high - low))
