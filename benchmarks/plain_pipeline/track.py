"""The method for densarm's closed loop: search, time, track."""

import math

import numpy as np
import pinocchio as pin
import toppra
import toppra.algorithm
import toppra.constraint

from densarm.arm import Arm
from densarm.arrays import Array
from densarm.clearance import Clearance
from densarm.closed_loop import Drive
from densarm.control.computed_torque import ComputedTorque
from densarm.guides.guide import NoPath
from densarm.reference.reference import Reference
from densarm.reference.timing_parameters import TimingParameters
from densarm.scenario import Scenario
from plain_pipeline.search import search


def plain_pipeline(scenario: Scenario, clearance: Clearance) -> Drive | NoPath:
    """Search a path, time it under densarm's shares of the limits, track it by computed torque."""
    waypoints = search(scenario, clearance)
    if waypoints is None:
        return NoPath("RRT-Connect found none")
    period = scenario.simulation.control_period
    reference = _timed(scenario.arm, waypoints, period, scenario.timing)
    if reference is None:
        return NoPath("TOPP-RA found no timing")
    controller = ComputedTorque(scenario.arm, reference, scenario.gains)
    return Drive(controller, lambda _: "at rest", reference)


def _timed(arm: Arm, waypoints: Array, period: float, shares: TimingParameters) -> Reference | None:
    length = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(waypoints, axis=0), axis=1)))
    path = toppra.SplineInterpolator(length, waypoints)
    instance = toppra.algorithm.TOPPRA(_constraints(arm, shares), path)
    timed = instance.compute_trajectory(0.0, 0.0)
    if timed is None:
        return None
    count = math.ceil(timed.duration / period)
    at = np.linspace(0.0, timed.duration, count + 1)
    velocity = timed(at, 1) * timed.duration / (count * period)
    velocity[[0, -1]] = 0.0
    return Reference(period, timed(at), velocity)


def _constraints(arm: Arm, shares: TimingParameters) -> list[toppra.constraint.Constraint]:
    model, data, limits = arm.model, arm.model.createData(), arm.limits

    def inverse_dynamics(q: Array, v: Array, a: Array) -> Array:
        return pin.rnea(model, data, q, v, a)

    def both(limit: Array) -> Array:
        return np.column_stack([-limit, limit])

    return [
        toppra.constraint.JointVelocityConstraint(both(shares.velocity_share * limits.velocity)),
        toppra.constraint.JointAccelerationConstraint(
            both(shares.acceleration_share * limits.acceleration)
        ),
        toppra.constraint.JointTorqueConstraint(
            inverse_dynamics, both(shares.torque_share * limits.effort), np.zeros(arm.nv)
        ),
    ]
