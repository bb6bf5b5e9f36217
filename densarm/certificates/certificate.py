"""Certificate: what is proved about a recorded run."""

from dataclasses import dataclass

import numpy as np

from densarm.arrays import Array
from densarm.certificates.replay import REPLAY_TOLERANCE, replay_errors
from densarm.clearance import Clearance
from densarm.proof.stopping_check import StoppingCheck
from densarm.proof.straight_brake import StraightBrake
from densarm.proof.swept_bound import SweptBound
from densarm.proof.swept_check import SweptCheck, SweptResult, SweptVerdict
from densarm.scenario import Scenario
from densarm.simulation.fixed_step_loop import REACHED_POSITION, REACHED_VELOCITY

_ROUNDING = 1e-9  # [rad, rad/s, N·m], room for rounding in comparisons with limits
_RESTS = 20  # ends of brakes at most whose distances are told


@dataclass(frozen=True)
class Check:
    """One part of a certificate."""

    name: str
    holds: bool
    detail: str
    """What was found, in a phrase, with the margin's unit and place."""
    margin: float | None
    """What was to spare where least was: a distance [m] (swept, stopping), a share of the limits
    (limits), else a part of the tolerance [rad, rad/s]; negative where it fails, None if unknown.
    """
    time: float
    """Where that was [s]."""


@dataclass(frozen=True)
class Certificate:
    """The parts of a certificate; the run is certified when all of them hold."""

    checks: tuple[Check, ...]

    @property
    def certified(self) -> bool:
        """Whether every part holds."""
        return all(check.holds for check in self.checks)


def certify(scenario: Scenario, time: Array, q: Array, v: Array, tau: Array) -> Certificate:
    """Return what is proved about a run, from its record alone.

    The parts: swept check of the whole motion against the scene and the arm itself, start and
    goal, limits of position, velocity, acceleration and torque, one-step replay of the dynamics,
    and a clear straight brake within the limits from every sample.

    Args:
        scenario: arm, scene, start, goal and integrator.
        time: (N,) [s].
        q: configurations (N, nq).
        v: velocities (N, nv) [rad/s or m/s].
        tau: torque held from each sample to the next (N, nv) [N·m or N].
    """
    bound = SweptBound(Clearance(scenario.arm, scenario.scene))
    return Certificate(
        (
            _swept(scenario, bound, q, v),
            _start(scenario, q, v, time),
            _goal(scenario, q, v),
            _limits(scenario, q, v, tau),
            _replay(scenario, q, v, tau),
            _stopping(scenario, bound, q, v),
        )
    )


def swept_result(bound: SweptBound, q: Array, v: Array, dt: float) -> SweptResult:
    """Return the swept check of a recorded motion.

    Between samples the true motion departs from the chord by at most a Δt²/8, a the largest
    acceleration of the step and its neighbours.

    Args:
        bound: the pairs and the margin.
        q: configurations (N, nq).
        v: velocities (N, nv) [rad/s or m/s].
        dt: time between samples [s].
    """
    acceleration = np.abs(np.diff(v, axis=0)) / dt
    around = np.maximum(
        acceleration,
        np.maximum(
            np.vstack([acceleration[:1], acceleration[:-1]]),
            np.vstack([acceleration[1:], acceleration[-1:]]),
        ),
    )
    return SweptCheck(bound).check(q, around * dt**2 / 8.0)


def _swept(scenario: Scenario, bound: SweptBound, q: Array, v: Array) -> Check:
    result = swept_result(bound, q, v, scenario.simulation.dt)
    at = result.index * scenario.simulation.dt
    if result.verdict != SweptVerdict.CLEAR:
        pairs = ", ".join(f"{a}-{b}" for a, b in result.pairs[:3])
        return Check("swept", False, f"{result.verdict} at t = {at:.3f} s: {pairs}", None, at)
    found = f"{_nearest(result.distance, at)} of {result.evaluations} configurations"
    return Check("swept", True, f"proved clear, {found}", _finite(result.distance), at)


def _start(scenario: Scenario, q: Array, v: Array, time: Array) -> Check:
    error = float(np.abs(scenario.arm.difference(scenario.start, q[0])).max())
    speed = float(np.abs(v[0]).max())
    shift = float(np.abs(time - scenario.simulation.dt * np.arange(len(time))).max())
    holds = error <= _ROUNDING and speed == 0.0 and shift <= _ROUNDING
    detail = f"{error:.2g} from the start at {speed:.2g} rad/s, {shift:.2g} s off the time grid"
    return Check("start", holds, detail, _finite(_ROUNDING - max(error, speed, shift)), 0.0)


def _goal(scenario: Scenario, q: Array, v: Array) -> Check:
    error = float(np.abs(scenario.arm.difference(scenario.goal, q[-1])).max())
    speed = float(np.abs(v[-1]).max())
    holds = error <= REACHED_POSITION and speed <= REACHED_VELOCITY
    margin = min(REACHED_POSITION - error, REACHED_VELOCITY - speed)
    detail = f"ends {error:.2g} from the goal at {speed:.2g} rad/s"
    return Check("goal", holds, detail, _finite(margin), (len(q) - 1) * scenario.simulation.dt)


def _limits(scenario: Scenario, q: Array, v: Array, tau: Array) -> Check:
    arm, dt = scenario.arm, scenario.simulation.dt
    limits, angles = arm.limits, arm.angles(q)
    ratios = {
        "velocity": np.abs(v) / limits.velocity,
        "acceleration": np.abs(np.diff(v, axis=0, append=v[-1:])) / dt / limits.acceleration,
        "torque": np.abs(tau) / limits.effort,
    }
    outside = np.maximum(limits.lower - angles, angles - limits.upper)
    peaks = {name: _peak(ratio) for name, ratio in ratios.items()}
    parts = [
        f"{name} {peak:.0%} ({arm.joint_names[joint]}, t = {at * dt:.3f} s)"
        for name, (peak, at, joint) in peaks.items()
    ]
    detail = f"peaks of the limits: {', '.join(parts)}"
    largest, at, joint = _peak(outside)
    margin, where = min((1.0 - peak, at) for peak, at, _ in peaks.values())
    if not largest <= _ROUNDING:
        beyond = f"{largest:.2g} outside its range at t = {at * dt:.3f} s"
        detail, margin, where = f"{arm.joint_names[joint]} {beyond}; {detail}", -largest, at
    holds = largest <= _ROUNDING and all(peak <= 1.0 + _ROUNDING for peak, _, _ in peaks.values())
    return Check("limits", bool(holds), detail, _finite(margin), where * dt)


def _peak(values: Array) -> tuple[float, int, int]:
    """Return the largest entry, NaN first, with its row and column."""
    row, column = np.unravel_index(int(np.argmax(values)), values.shape)
    return float(values[row, column]), int(row), int(column)


def _replay(scenario: Scenario, q: Array, v: Array, tau: Array) -> Check:
    simulation = scenario.simulation
    errors = replay_errors(scenario.arm, simulation.dt, simulation.integrator, q, v, tau)
    worst = int(np.argmax(errors)) if errors.size else 0
    error = float(errors[worst]) if errors.size else 0.0
    at = worst * simulation.dt
    detail = f"one-step replay within {error:.1g}"
    if not error <= REPLAY_TOLERANCE:
        detail += f" at t = {at:.3f} s"
    return Check("replay", error <= REPLAY_TOLERANCE, detail, _finite(REPLAY_TOLERANCE - error), at)


def _stopping(scenario: Scenario, bound: SweptBound, q: Array, v: Array) -> Check:
    arm, dt = scenario.arm, scenario.simulation.dt
    result = StoppingCheck(bound, StraightBrake(arm)).check(q, v)
    failing = result.failing
    if failing.size:
        first = int(failing[0])
        why = "comes too near to a body"
        if not result.inside[first]:
            why = "leaves the position limits"
        if not np.isfinite(result.duration[first]):
            why = "needs more torque than there is"
        detail = f"the brake from t = {first * dt:.3f} s {why}; {failing.size} of {len(q)} fail"
        return Check("stopping", False, detail, None, first * dt)
    looked_at = np.arange(0, len(q), 1 + len(q) // _RESTS)
    ends = arm.configurations(result.end[looked_at])
    rest = np.array([bound.clearance.distances(end).min(initial=np.inf) for end in ends])
    at, longest = float(looked_at[rest.argmin()] * dt), int(np.argmax(result.duration))
    detail = (
        f"proved clear from {len(q)} samples, longest brake {result.duration[longest]:.2g} s at "
        f"t = {longest * dt:.3f} s, {_nearest(rest.min(), at)} of {len(ends)} ends"
    )
    return Check("stopping", True, detail, _finite(rest.min()), at)


def _nearest(distance: float, at: float) -> str:
    """Return the smallest distance of those that were looked at, as a phrase."""
    return f"smallest distance {distance * 1e3:.3g} mm at t = {at:.3f} s"


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
