"""Time-optimal timing of a path under velocity, acceleration and torque limits, by TOPP-RA."""

import numpy as np
import pinocchio as pin
import toppra
import toppra.algorithm
import toppra.constraint

from densarm.arm import Arm
from densarm.arrays import Array
from densarm.reference.infeasible_timing import InfeasibleTimingError
from densarm.reference.reference import Reference
from densarm.reference.smooth_path import SmoothPath
from densarm.reference.timing_parameters import TimingParameters

_UNLIMITED = 1e4  # stands for an infinite limit, which TOPP-RA's solver does not take
_GRID_STEP = 0.01  # [rad] between grid points
_GRID = (100, 1000)
_GRID_SHARE = 0.98  # of the limits at grid points; the rest is for what lies between them
_SLOWDOWNS = 1.02 ** np.arange(50)  # tried in turn until the limits hold at every sample

toppra.setup_logging("CRITICAL")


def time_path(
    arm: Arm, path: SmoothPath, length: float, period: float, parameters: TimingParameters
) -> Reference:
    """Return the fastest reference along a path, from rest to rest.

    Args:
        arm: its limits and dynamics.
        path: joint positions over [0, 1].
        length: of the path [rad], which sets the grid.
        period: time between the reference's samples [s].
        parameters: shares of the limits.

    Raises:
        InfeasibleTimingError: no speed meets the limits somewhere on the path.

    Source: Pham and Pham, A New Approach to Time-Optimal Path Parameterization Based on
        Reachability Analysis, IEEE T-RO 2018.
    """
    count = int(np.clip(length / _GRID_STEP, *_GRID))
    instance = toppra.algorithm.TOPPRA(
        _constraints(arm, parameters),
        _ToppraPath(path, arm.nv),
        gridpoints=np.linspace(0.0, 1.0, count + 1),
        parametrizer="ParametrizeConstAccel",
    )
    timed = instance.compute_trajectory(0.0, 0.0)
    for slowdown in _SLOWDOWNS if timed is not None else ():
        reference = _sampled(timed, slowdown * timed.duration, period)
        if _is_within_limits(arm, reference, parameters):
            return reference
    raise InfeasibleTimingError(
        f"arm {arm.name!r}: its torque limits allow no motion along the planned path"
    )


def _sampled(timed: toppra.ParametrizeConstAccel, duration: float, period: float) -> Reference:
    """Sample a timing, stretched to a whole number of periods not below the duration."""
    count = max(1, int(np.ceil(duration / period)))
    at = np.linspace(0.0, timed.duration, count + 1)
    velocity = timed(at, 1) * timed.duration / (count * period)
    velocity[[0, -1]] = 0.0
    return Reference(period, timed(at, 0), velocity)


def _is_within_limits(arm: Arm, reference: Reference, parameters: TimingParameters) -> bool:
    """Check all samples: TOPP-RA holds the limits at its grid points only."""
    limits, data = arm.limits, arm.model.createData()
    if (np.abs(reference.velocity) > parameters.velocity_share * limits.velocity).any():
        return False
    acceleration = np.diff(reference.velocity, axis=0) / reference.period
    if (np.abs(acceleration) > parameters.acceleration_share * limits.acceleration).any():
        return False
    states = zip(
        arm.configurations(reference.position[:-1]),
        reference.velocity[:-1],
        acceleration,
        strict=True,
    )
    torque = np.array([pin.rnea(arm.model, data, *state) for state in states])
    return bool((np.abs(torque) <= parameters.torque_share * limits.effort).all())


def _constraints(arm: Arm, parameters: TimingParameters) -> list[toppra.constraint.Constraint]:
    limits, data = arm.limits, arm.model.createData()

    def torque(theta: Array, v: Array, a: Array) -> Array:
        return np.array(pin.rnea(arm.model, data, arm.configuration(theta), v, a))

    return [
        toppra.constraint.JointVelocityConstraint(
            _both_sides(limits.velocity * parameters.velocity_share)
        ),
        toppra.constraint.JointAccelerationConstraint(
            _both_sides(limits.acceleration * parameters.acceleration_share)
        ),
        toppra.constraint.JointTorqueConstraint(
            torque, _both_sides(limits.effort * parameters.torque_share), np.zeros(arm.nv)
        ),
    ]


def _both_sides(limit: Array) -> Array:
    bounded = np.minimum(_GRID_SHARE * limit, _UNLIMITED)
    return np.column_stack([-bounded, bounded])


class _ToppraPath(toppra.interpolator.AbstractGeometricPath):
    """A SmoothPath as TOPP-RA asks for it."""

    def __init__(self, path: SmoothPath, dof: int) -> None:
        self._path = path
        self._dof = dof

    def __call__(self, path_positions: float | Array, order: int = 0) -> Array:
        return self._path(path_positions, order)

    @property
    def dof(self) -> int:
        return self._dof

    @property
    def path_interval(self) -> Array:
        return np.array([0.0, 1.0])
