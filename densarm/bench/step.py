"""The cost of one control step, against the calls of Pinocchio and coal that it cannot avoid."""

import gc
import resource
import sys
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
from densarm.validation import positive_integer

_OFF_REFERENCE = 1e-3  # of the states in every joint [rad or m]
_BLOCK = 499  # states between two turns; no divisor of a visit to all, so that turns shift
_PERCENT = (50.0, 99.0, 99.9)

Step = Callable[[float, Array, Array], object]
State = tuple[float, Array, Array]
Percentiles = tuple[float, float, float]


@dataclass(frozen=True)
class StepTiming:
    """Times of one control step along a motion.

    The bare calls are what Pinocchio and coal do for a step that asks for the distances of all
    pairs: computeJointJacobians, updateGeometryPlacements, computeDistances and rnea.
    """

    step_us: float
    """The whole `controller.torque`, median [µs]."""
    bare_us: float
    """The bare calls on all pairs, median [µs]."""
    ratio: float
    """The first in units of the second."""
    pairs: int
    """Geometry pairs."""
    steps: int
    """Timed steps, and as many turns of the bare calls."""
    step_percentiles_us: Percentiles
    """50, 99 and 99.9 % of the step, in processor time of its thread [µs]."""
    bare_percentiles_us: Percentiles
    """The same of the bare calls [µs]."""
    undisturbed_percentiles_us: Percentiles
    """As `step_percentiles_us`, of the least time that each state took in all its visits: without
    what other processes do to caches and clocks. A visit to all states takes 4002 steps [µs]."""
    memory_growth_kb: float
    """By how much the process's peak memory grew during the steps [kB]."""
    collections: int
    """Runs of Python's garbage collector during the steps."""

    def to_json(self) -> dict[str, Any]:
        """Return the timing as JSON data."""
        return asdict(self)


def time_step(arm: str, shapes: str = "hull", pairs: int = 64, steps: int = 20_000) -> StepTiming:
    """Time one control step of the tracking controller.

    The arm swings to and fro among spheres that it passes closely, at 1 kHz, so that pairs wake
    and fall asleep as they do at work.

    Args:
        arm: a known name.
        shapes: "hull" or "capsule".
        pairs: geometry pairs: arm to sphere, filled up by the arm's own.
        steps: number of steps to be timed.

    Raises:
        UnknownNameError: no such arm or shapes.
        InvalidValueError: a number of pairs that the arm cannot have, or of steps below 1.
    """
    steps = positive_integer("steps", steps)
    loaded = load_arm(arm, shapes=shapes)
    reference = swing(loaded)
    clearance = clearance_among_spheres(loaded, reference, pairs)
    density = full_sensing_density(clearance, loaded.configuration(reference.position[-1]))
    step = DensityTracking(loaded, density, reference, Gains()).torque
    bare, states = _bare_calls(clearance), _states(loaded, reference)
    turns, seconds = (step, bare), np.full((2, 2, steps), np.nan)  # pages are touched here
    warm_up = np.empty((2, _BLOCK))
    for calls in turns:
        _seconds(calls, states[:_BLOCK], warm_up)
    memory, collections = _peak_memory(), _collections()
    to_and_fro = [*states, *states[::-1]]
    for begin in range(0, steps, _BLOCK):
        count = min(_BLOCK, steps - begin)
        block = [to_and_fro[k % len(to_and_fro)] for k in range(begin, begin + count)]
        for calls, record in zip(turns, seconds, strict=True):
            _seconds(calls, block, record[:, begin:])
    step_us, bare_us = (float(np.median(record[0])) * 1e6 for record in seconds)
    return StepTiming(
        step_us,
        bare_us,
        step_us / bare_us,
        clearance.n_pairs,
        steps,
        _percentiles(seconds[0, 1]),
        _percentiles(seconds[1, 1]),
        _percentiles(_least_of_visits(seconds[0, 1], len(to_and_fro))),
        _peak_memory() - memory,
        _collections() - collections,
    )


def _percentiles(seconds: Array) -> Percentiles:
    low, middle, high = (1e6 * np.percentile(seconds, _PERCENT)).tolist()
    return low, middle, high


def _least_of_visits(seconds: Array, period: int) -> Array:
    visits = -(-len(seconds) // period)
    rows = np.pad(seconds, (0, visits * period - len(seconds)), constant_values=np.inf)
    least = rows.reshape(visits, period).min(axis=0)
    return np.asarray(least[np.isfinite(least)])


def _seconds(step: Step, states: list[State], out: Array) -> Array:
    """Time every call by itself; write wall and processor time (2, at least N) into `out`."""
    for k, state in enumerate(states):
        began_processor = time.thread_time()
        began = time.perf_counter()
        step(*state)
        out[0, k] = time.perf_counter() - began
        out[1, k] = time.thread_time() - began_processor
    return out


def _peak_memory() -> float:
    """Return the largest resident memory of the process so far [kB]."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / 1024.0 if sys.platform == "darwin" else float(peak)


def _collections() -> int:
    return sum(generation["collections"] for generation in gc.get_stats())


def full_sensing_density(clearance: Clearance, goal: Array) -> NavigationDensity[TorusDistance]:
    """Return a density that senses as far as it does by default, wherever the arm is to move.

    Args:
        clearance: its pairs.
        goal: configuration (nq,), which a controller that tracks moves.
    """
    arm, sensing = clearance.arm, SensingParameters()
    unsafe: list[UnsafeSet] = [
        NearClearanceSet(NearPairs(SweptBound(clearance)), 0.0, sensing.distance),
        JointLimitSet(arm, sensing.joint),
    ]
    return NavigationDensity(unsafe, TorusDistance(arm, goal), DensityParameters())


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


def _states(arm: Arm, reference: Reference) -> list[State]:
    times = reference.period * np.arange(len(reference.position))
    q = arm.configurations(reference.position + _OFF_REFERENCE)
    return list(zip(times.tolist(), q, reference.velocity, strict=True))
