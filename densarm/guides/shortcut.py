"""Shortcuts on a path of joint space."""

from itertools import pairwise

import numpy as np

from densarm.arm import Arm
from densarm.arrays import Array
from densarm.guides.guide import FreeSpace

_LEAST_GAIN = 1e-3  # of the path's length; less is not worth a check


def shortcut(
    arm: Arm, freedom: FreeSpace, path: Array, steps: int, rng: np.random.Generator
) -> Array:
    """Shorten a path by straight segments between random points of it, each proved clear.

    Args:
        arm: the arm, for the geometry of its joint space.
        freedom: proves the segments.
        path: (W, nq) waypoints joined by clear segments.
        steps: pairs of points to try.
        rng: source of the pairs.

    Returns:
        (W', nq) waypoints with the same ends, joined by clear segments, not longer than `path`.
    """
    step, length, arc = _arc_length(arm, path)
    for share in np.sort(rng.uniform(size=(steps, 2))):
        s = share * arc[-1]
        segment = np.searchsorted(arc[1:-1], s, side="right")
        fraction = (s - arc[segment]) / length[segment]
        a, b = arm.integrate(path[segment], fraction[:, None] * step[segment])
        gain = (s[1] - s[0]) - np.linalg.norm(arm.difference(a, b))
        if gain > _LEAST_GAIN * arc[-1] and freedom.segment_is_clear(a, b):
            path = np.vstack([path[: segment[0] + 1], a, b, path[segment[1] + 1 :]])
            step, length, arc = _arc_length(arm, path)
    return _without_needless_waypoints(freedom, path)


def _arc_length(arm: Arm, path: Array) -> tuple[Array, Array, Array]:
    """Return the steps of a path, their lengths, and the length up to each waypoint."""
    step = arm.difference(path[:-1], path[1:])
    length = np.linalg.norm(step, axis=1)
    return step, length, np.concatenate([[0.0], np.cumsum(length)])


def _without_needless_waypoints(freedom: FreeSpace, path: Array) -> Array:
    kept = [path[0]]
    for waypoint, after in pairwise(path[1:]):
        if not freedom.segment_is_clear(kept[-1], after):
            kept.append(waypoint)
    return np.stack([*kept, path[-1]])
