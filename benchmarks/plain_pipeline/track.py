"""The baseline for densarm's closed loop: search, time, track."""

import math

import numpy as np
import pinocchio as pin
import toppra
import toppra.algorithm
import toppra.constraint

from densarm.arms.arm import Arm
from densarm.planning.motion import Motion, PlanningError, TimingParameters
from densarm.scenarios.run import Drive
from densarm.scenarios.scenario import Scenario
from densarm.study.baselines import ComputedTorque
from densarm.values.arrays import Array
from densarm.values.outcome import Outcome
from densarm.world.configurations import infeasibility
from densarm.world.swept_check import SweptCheck
from plain_pipeline.search import search


def plain_pipeline(scenario: Scenario) -> Drive:
    """Search a path, time it under densarm's shares of the limits, track it by computed torque.

    Raises:
        PlanningError: an end is infeasible, or there is no path or timing.
    """
    ends = {"start": scenario.start, "goal": scenario.goal}
    if fault := infeasibility(SweptCheck(scenario.world, scenario.control.margin), ends):
        raise PlanningError(Outcome.INFEASIBLE, fault)
    waypoints = search(scenario)
    if waypoints is None:
        raise PlanningError(Outcome.NO_PATH, "RRT-Connect found none")
    period = scenario.simulation.control_period
    motion = _timed(scenario.arm, waypoints, period, scenario.timing)
    if motion is None:
        raise PlanningError(Outcome.NO_PATH, "TOPP-RA found no timing")
    controller = ComputedTorque(scenario.arm, motion, scenario.law_gains)
    return Drive(controller, motion=motion)


def _timed(arm: Arm, waypoints: Array, period: float, shares: TimingParameters) -> Motion | None:
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
    return Motion(period, timed(at), velocity)


def _constraints(arm: Arm, shares: TimingParameters) -> list[toppra.constraint.Constraint]:
    model, data, limits = arm.model, arm.model.createData(), arm.limits

    def inverse_dynamics(q: Array, v: Array, a: Array) -> Array:
        return np.asarray(pin.rnea(model, data, q, v, a), np.float64)

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
