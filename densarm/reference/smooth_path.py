"""SmoothPath: a twice differentiable curve near the planning system's, proved clear."""

import numpy as np
from scipy.interpolate import BSpline

from densarm.arrays import Array
from densarm.proof.swept_bound import SweptBound
from densarm.proof.swept_check import SweptVerdict
from densarm.proof.tube_check import TubeCheck

_DEGREE = 3
_WIDEST = 0.8  # [rad] between control points at first
_HALVINGS = 9
_SAMPLE = 0.01  # [rad] at most between the samples that the proof uses at first
_PARTS = 4  # at least, that each polynomial piece is sampled in
_DOUBLINGS = 5  # of the samples; the spline's departure from its chords falls with their square


class SmoothPath:
    """A cubic B-spline θ(s) in joint positions, s in [0, 1], with its derivatives.

    Args:
        spline: of shape (nv,), on [0, 1].
    """

    def __init__(self, spline: BSpline) -> None:
        self.knots: Array = spline.t
        """Where pieces meet (M,)."""
        self._derivatives = [spline, spline.derivative(1), spline.derivative(2)]

    def __call__(self, s: float | Array, order: int = 0) -> Array:
        """Return θ(s), or its derivative of the given order, shape (..., nv)."""
        return np.asarray(self._derivatives[order](s))


def smooth_path(bound: SweptBound, curve: Array) -> SmoothPath | None:
    """Return a C² path with the ends of a polyline, as smooth as a proof of clearance allows.

    Control points of a clamped uniform cubic B-spline are taken from the polyline at equal
    distances. Each piece of the spline stays in the convex hull of four of them, so that it tends
    to the polyline as they get denser: their distance is halved until a check proves the
    path clear.

    Args:
        bound: the swept bound and the margin to be kept.
        curve: the polyline (N, nq), N >= 2.

    Returns:
        The path, or None if even the densest control points gave none that is proved clear.

    Source: convex hull property: de Boor, A Practical Guide to Splines, ch. IX.
    """
    arm = bound.arm
    steps = arm.difference(curve[:-1], curve[1:])
    corner = arm.angles(curve[0]) + np.vstack([np.zeros(arm.nv), np.cumsum(steps, axis=0)])
    length = np.append(0.0, np.cumsum(np.linalg.norm(steps, axis=1)))
    check = TubeCheck(bound)
    for halving in range(_HALVINGS):
        count = max(_DEGREE + 1, 1 + int(np.ceil(length[-1] * 2.0**halving / _WIDEST)))
        path = _spline(length, corner, count)
        if _is_clear(check, path, length[-1]):
            return path
    return None


def _spline(length: Array, corner: Array, count: int) -> SmoothPath:
    at = np.linspace(0.0, length[-1], count)
    control = np.column_stack([np.interp(at, length, column) for column in corner.T])
    inner = np.linspace(0.0, 1.0, count - _DEGREE + 1)
    knots = np.concatenate([np.zeros(_DEGREE), inner, np.ones(_DEGREE)])
    return SmoothPath(BSpline(knots, control, _DEGREE))


def _is_clear(check: TubeCheck, path: SmoothPath, length: float) -> bool:
    """Return whether the path is proved clear, sampled ever finer until that is decided."""
    pieces = len(np.unique(path.knots)) - 1
    parts = max(_PARTS, int(np.ceil(length / pieces / _SAMPLE)))
    for doubling in range(_DOUBLINGS):
        verdict = _verdict(check, path, parts * 2**doubling)
        if verdict != SweptVerdict.UNDECIDED:
            break
    return verdict == SweptVerdict.CLEAR


def _verdict(check: TubeCheck, path: SmoothPath, parts: int) -> SweptVerdict:
    """Return what is proved of the path, each polynomial piece sampled in parts."""
    pieces = np.unique(path.knots)
    at = np.arange(parts * (len(pieces) - 1) + 1) / parts
    s = np.interp(at, np.arange(len(pieces)), pieces)
    # The second derivative is linear between samples, so that it is largest at one of them.
    curvature = np.abs(path(s, 2))
    largest = np.maximum(curvature[:-1], curvature[1:])
    return check.check(path(s), largest / 8.0 * np.diff(s)[:, np.newaxis] ** 2)
