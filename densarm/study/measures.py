"""Measures of a run: how long its way is, how long it takes, and at least would have to take."""

import numpy as np

from densarm.certificates.task import REACHED_POSITION, REACHED_VELOCITY
from densarm.planning.motion import PlanningError, TimingParameters
from densarm.simulation.run import Run

_ALL = TimingParameters(velocity_share=1.0, acceleration_share=1.0, torque_share=1.0)
_SPACING = 0.02  # of the points that a path is interpolated through [rad or m]
_DEGREE = 3


def path_length(run: Run) -> float:
    """Return the length of a run's way in joint space [rad or m]."""
    steps = run.task.arm.difference(run.q[:-1], run.q[1:])
    return float(np.linalg.norm(steps, axis=1).sum())


def motion_time(run: Run) -> float:
    """Return the time from which on the arm is at the goal and at rest [s]; infinite if never."""
    if run.task.goal is None:
        return np.inf
    error = np.abs(run.task.arm.difference(run.q, run.task.goal)).max(axis=1)
    away = (error > REACHED_POSITION) | (np.abs(run.v).max(axis=1) > REACHED_VELOCITY)
    k = int(np.flatnonzero(away).max(initial=-1)) + 1
    return float(run.time[k]) if k < len(run.time) else np.inf


def shortest_time(run: Run) -> float | None:
    """Return the shortest time along the path of a run, from rest to rest [s].

    All of the velocity, acceleration and torque limits may be used, with no regard to stopping.
    The path is a cubic spline through points of the run, and TOPP-RA times it. None for an arm that
    did not move, or of limits that allow no motion.

    Source: Pham and Pham, A New Approach to Time-Optimal Path Parameterization Based on
        Reachability Analysis, IEEE T-RO 2018.
    """
    # SciPy and TOPP-RA take a second to import.
    from scipy.interpolate import make_interp_spline

    from densarm.planning.smoothing import SmoothPath, polyline
    from densarm.planning.timing import time_path

    arm = run.task.arm
    angles, arc = polyline(arm, run.q)
    length = float(arc[-1])
    if length < _SPACING:
        return None
    at = np.linspace(0.0, length, max(_DEGREE, round(length / _SPACING)) + 1)
    points = np.column_stack([np.interp(at, arc, column) for column in angles.T])
    spline = make_interp_spline(at / length, points, k=_DEGREE)
    path = SmoothPath(spline.t, spline.c)
    try:
        period = run.task.simulation.control_period
        return time_path(arm, path, length, period, _ALL, has_rates=False).duration
    except PlanningError:
        return None
