"""How long a run's motion took, and how long the fastest along the same path takes."""

import numpy as np

from densarm.reference.infeasible_timing import InfeasibleTimingError
from densarm.reference.timing_parameters import TimingParameters
from densarm.simulation.fixed_step_loop import REACHED_POSITION, REACHED_VELOCITY
from densarm.trajectory import Trajectory

_ALL = TimingParameters(velocity_share=1.0, acceleration_share=1.0, torque_share=1.0)
_SPACING = 0.02  # of the points that the path is interpolated through [rad or m]
_DEGREE = 3


def motion_time(run: Trajectory) -> float:
    """Return the time from which on the arm is at the goal and at rest [s]; infinite if never."""
    error = np.abs(run.scenario.arm.difference(run.q, run.scenario.goal)).max(axis=1)
    away = (error > REACHED_POSITION) | (np.abs(run.v).max(axis=1) > REACHED_VELOCITY)
    k = int(np.flatnonzero(away).max(initial=-1)) + 1
    return float(run.time[k]) if k < len(run.time) else np.inf


def time_optimal(run: Trajectory) -> float | None:
    """Return the shortest time along the path of a run, from rest to rest [s].

    All of the velocity, acceleration and torque limits may be used, with no regard to stopping.
    The path is a cubic spline through points of the run, and TOPP-RA times it.

    Args:
        run: any run.

    Returns:
        The time, or None for an arm that did not move, or of limits that allow no motion.

    Source: Pham and Pham, A New Approach to Time-Optimal Path Parameterization Based on
        Reachability Analysis, IEEE T-RO 2018.
    """
    # SciPy and TOPP-RA take a second to import.
    from scipy.interpolate import make_interp_spline

    from densarm.reference.smooth_path import SmoothPath
    from densarm.reference.timing import time_path

    arm = run.scenario.arm
    steps = arm.difference(run.q[:-1], run.q[1:])
    arc = np.append(0.0, np.cumsum(np.linalg.norm(steps, axis=1)))
    length = float(arc[-1])
    if length < _SPACING:
        return None
    angles = arm.angles(run.q[0]) + np.vstack([np.zeros(arm.nv), np.cumsum(steps, axis=0)])
    at = np.linspace(0.0, length, max(_DEGREE, round(length / _SPACING)) + 1)
    points = np.column_stack([np.interp(at, arc, column) for column in angles.T])
    path = SmoothPath(make_interp_spline(at / length, points, k=_DEGREE))
    try:
        period = run.scenario.simulation.control_period
        return time_path(arm, path, length, period, _ALL).duration
    except InfeasibleTimingError:
        return None
