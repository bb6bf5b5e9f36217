"""Rim traps: where a sensing region is not curved enough for the goal distance."""

import numpy as np

from densarm.arm import Arm
from densarm.arrays import Array
from densarm.density.enclosing_ellipsoid import Ellipsoid
from densarm.density.goal_distance import GoalDistance
from densarm.errors import InvalidValueError


def rim(ellipse: Ellipsoid, count: int) -> Array:
    """Return points (count, 2) around an ellipse, in order [rad or m]."""
    turn = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
    squares, directions = np.linalg.eigh(ellipse.shape)
    circle = np.column_stack([np.cos(turn), np.sin(turn)])
    return np.asarray(ellipse.centre + circle * np.sqrt(squares) @ directions.T)


def rim_traps(arm: Arm, ellipse: Ellipsoid, distance: GoalDistance, count: int = 2000) -> Array:
    r"""Return the points of a rim at which V presses inwards and is smallest along the rim.

    .. math:: \nabla V \cdot n > 0, \qquad V \text{ has a local minimum on } \partial E

    n the outward normal. Level sets of Ψ near the rim follow it: at such a point the density has
    a spurious maximum close by, since neither along the rim nor across it does anything lead on.
    Where there is none, what V presses against the rim slides along it and leaves. It is what
    "convex and curved enough" [ZNV Remark 1] asks for, against the level sets of V.

    Args:
        arm: an arm with two joints.
        ellipse: the rim ∂E, in joint positions.
        distance: V.
        count: points looked at.

    Returns:
        Joint positions (T, 2) [rad or m].

    Raises:
        InvalidValueError: an arm with another number of joints.
    """
    if arm.nv != 2:
        raise InvalidValueError("number of joints", arm.nv, "2")
    points = rim(ellipse, count)
    configurations, slope = arm.configurations(points), np.zeros(2)
    value = np.array([distance.evaluate(q, slope) for q in configurations])
    traps = []
    for k in np.flatnonzero((value < np.roll(value, 1)) & (value < np.roll(value, -1))):
        distance.evaluate(configurations[k], slope)
        if slope @ np.linalg.solve(ellipse.shape, points[k] - ellipse.centre) > 0.0:
            traps.append(points[k])
    return np.reshape(traps, (-1, 2))
