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
from numpy.typing import NDArray

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
# States between two turns: so many that the first of a turn, which finds nothing in the caches,
# does not matter to the 99.9 %; no divisor of a visit to all, so that turns shift.
_BLOCK = 4999
_PERCENT = (50.0, 99.0, 99.9)
_THIS_THREAD = getattr(resource, "RUSAGE_THREAD", resource.RUSAGE_SELF)  # macOS has the second

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
    steady_percentiles_us: Percentiles | None
    """As `step_percentiles_us`, of the steps that follow a step directly: not the first of a turn,
    nor one in or before which another process had the core. Whatever else runs takes the caches,
    and the next step fetches all again [µs]. None if there was no such step."""
    resumed_us: float
    """The first step of a turn, after the bare calls have had the caches: median [µs]."""
    switches: int
    """How often another process took the core from the steps."""
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
    step = full_sensing_controller(clearance, reference).torque
    bare, states = _bare_calls(clearance), _states(loaded, reference)
    turns, record = (step, bare), np.full((2, 3, steps), np.nan)  # pages are touched here
    warm_up = np.empty((3, _BLOCK))
    for calls in turns:
        _timed(calls, states[:_BLOCK], warm_up)
    memory, collections = _peak_memory(), _collections()
    to_and_fro = [*states, *states[::-1]]
    _take_turns(turns, to_and_fro, record)
    (step_us, bare_us), processor = 1e6 * np.median(record[:, 0], axis=1), record[:, 1]
    switches = record[0, 2]
    steady = processor[0, _follows_a_step(switches)]
    return StepTiming(
        float(step_us),
        float(bare_us),
        float(step_us / bare_us),
        clearance.n_pairs,
        steps,
        _percentiles(processor[0]),
        _percentiles(processor[1]),
        _percentiles(_least_of_visits(processor[0], len(to_and_fro))),
        _percentiles(steady) if steady.size else None,
        1e6 * float(np.median(processor[0, ::_BLOCK])),
        int(switches.sum()),
        _peak_memory() - memory,
        _collections() - collections,
    )


def _take_turns(turns: tuple[Step, Step], states: list[State], record: Array) -> None:
    """Fill a record (2, 3, N) with blocks of the states, each visited by one after the other."""
    steps = record.shape[-1]
    for begin in range(0, steps, _BLOCK):
        count = min(_BLOCK, steps - begin)
        block = [states[k % len(states)] for k in range(begin, begin + count)]
        for calls, of_calls in zip(turns, record, strict=True):
            _timed(calls, block, of_calls[:, begin:])


def _percentiles(seconds: Array) -> Percentiles:
    low, middle, high = (1e6 * np.percentile(seconds, _PERCENT)).tolist()
    return low, middle, high


def _least_of_visits(seconds: Array, period: int) -> Array:
    visits = -(-len(seconds) // period)
    rows = np.pad(seconds, (0, visits * period - len(seconds)), constant_values=np.inf)
    least = rows.reshape(visits, period).min(axis=0)
    return np.asarray(least[np.isfinite(least)])


def _follows_a_step(switches: Array) -> NDArray[np.bool_]:
    """Return which steps (N,) follow a step of their turn, both without a switch."""
    switched = switches > 0.0
    follows = ~switched
    follows[1:] &= ~switched[:-1]
    follows[::_BLOCK] = False
    return follows


def _timed(step: Step, states: list[State], out: Array) -> Array:
    """Time every call by itself.

    Into `out` (3, at least N) go wall and processor time of each, and how often another process
    took the core in it or between it and the one before.
    """
    before = _switches()
    for k, state in enumerate(states):
        began_processor = time.thread_time()
        began = time.perf_counter()
        step(*state)
        out[0, k] = time.perf_counter() - began
        out[1, k] = time.thread_time() - began_processor
        after = _switches()
        out[2, k] = after - before
        before = after
    return out


def _switches() -> int:
    """Return how often the scheduler took the core from this thread."""
    return resource.getrusage(_THIS_THREAD).ru_nivcsw


def _peak_memory() -> float:
    """Return the largest resident memory of the process so far [kB]."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / 1024.0 if sys.platform == "darwin" else float(peak)


def _collections() -> int:
    return sum(generation["collections"] for generation in gc.get_stats())


def full_sensing_controller(clearance: Clearance, reference: Reference) -> DensityTracking:
    """Return the controller that is timed.

    Args:
        clearance: its pairs.
        reference: what it tracks.
    """
    arm = clearance.arm
    density = full_sensing_density(clearance, arm.configuration(reference.position[-1]))
    return DensityTracking(arm, density, reference, Gains())


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
