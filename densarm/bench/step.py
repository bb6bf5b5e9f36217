"""The cost of one control step, against the calls of Pinocchio and coal that it cannot avoid."""

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from densarm.arm import Arm, load_arm
from densarm.arrays import Array
from densarm.bench.swing_among_spheres import clearance_among_spheres, swing
from densarm.clearance import COAL_TOLERANCE, Clearance
from densarm.control.density_tracking import DensityTracking
from densarm.control.gains import Gains
from densarm.density import (
    DensityParameters,
    JointLimitSet,
    NavigationDensity,
    NearClearanceSet,
    NearPairs,
    TorusDistance,
    UnsafeSet,
)
from densarm.fields.sub_goal_chain import SensingParameters
from densarm.proof.swept_bound import SweptBound
from densarm.reference.reference import Reference

_OFF_REFERENCE = 1e-3  # of the states in every joint [rad or m]
_BLOCK = 100  # consecutive states between two turns

Step = Callable[[float, Array, Array], object]


@dataclass(frozen=True)
class StepTiming:
    """Median times of one control step."""

    step_us: float
    """The whole `controller.torque` [µs]."""
    bare_us: float
    """The bare calls [µs]."""
    ratio: float
    """The first in units of the second."""
    pairs: int
    """Geometry pairs."""

    def to_json(self) -> dict[str, Any]:
        """Return the timing as JSON data."""
        return asdict(self)


def time_step(arm: str, shapes: str = "hull", pairs: int = 64, rounds: int = 3) -> StepTiming:
    """Time one control step of the tracking controller.

    Args:
        arm: a known name.
        shapes: "hull" or "capsule".
        pairs: geometry pairs: arm to sphere, filled up by the arm's own.
        rounds: how often each state is visited.

    Raises:
        UnknownNameError: no such arm or shapes.
        InvalidValueError: a number of pairs that the arm cannot have.
    """
    loaded = load_arm(arm, shapes=shapes)
    reference = swing(loaded)
    clearance = clearance_among_spheres(loaded, reference, pairs)
    step, bare = _controller(clearance, reference).torque, _bare_calls(clearance)
    states = _states(loaded, reference)
    blocks = [states[k : k + _BLOCK] for k in range(0, len(states), _BLOCK)]
    times: tuple[list[float], list[float]] = ([], [])
    for block in blocks[:1] + rounds * blocks:
        for calls, record in zip((step, bare), times, strict=True):
            record.extend(_seconds(calls, block))
    step_us, bare_us = (float(np.median(record[_BLOCK:])) * 1e6 for record in times)
    return StepTiming(step_us, bare_us, step_us / bare_us, clearance.n_pairs)


def _seconds(step: Step, states: list[tuple[float, Array, Array]]) -> list[float]:
    """Time every call by itself, so that what interrupts some of them leaves the median alone."""
    seconds = []
    for state in states:
        began = time.perf_counter()
        step(*state)
        seconds.append(time.perf_counter() - began)
    return seconds


def _controller(clearance: Clearance, reference: Reference) -> DensityTracking:
    arm, sensing = clearance.arm, SensingParameters()
    goal_distance = TorusDistance(arm, arm.configuration(reference.position[-1]))
    unsafe: list[UnsafeSet] = [
        NearClearanceSet(NearPairs(SweptBound(clearance)), 0.0, sensing.distance),
        JointLimitSet(arm, sensing.joint),
    ]
    density = NavigationDensity(unsafe, goal_distance, DensityParameters())
    return DensityTracking(arm, density, reference, Gains())


def _bare_calls(clearance: Clearance) -> Step:
    model, geometry = clearance.arm.model, clearance.geometry_model
    data, geometry_data = model.createData(), geometry.createData()
    for request in geometry_data.distanceRequests:
        request.gjk_tolerance = request.epa_tolerance = COAL_TOLERANCE
    acceleration = np.zeros(model.nv)

    def call(t: float, q: Array, v: Array) -> None:  # noqa: ARG001
        pin.computeJointJacobians(model, data, q)
        pin.updateGeometryPlacements(model, data, geometry, geometry_data)
        pin.computeDistances(geometry, geometry_data)
        pin.rnea(model, data, q, v, acceleration)

    return call


def _states(arm: Arm, reference: Reference) -> list[tuple[float, Array, Array]]:
    times = reference.period * np.arange(len(reference.position))
    q = arm.configurations(reference.position + _OFF_REFERENCE)
    return list(zip(times.tolist(), q, reference.velocity, strict=True))
