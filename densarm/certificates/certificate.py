"""Certificate: what is proved about a recorded run."""

from dataclasses import dataclass

import numpy as np

from densarm.arm import Arm
from densarm.arrays import Array
from densarm.certificates.replay import REPLAY_TOLERANCE, replay_error
from densarm.clearance import Clearance
from densarm.scenario import Scenario
from densarm.simulation.fixed_step_loop import REACHED_POSITION, REACHED_VELOCITY
from densarm.swept_bound import SweptBound
from densarm.swept_check import SweptCheck, SweptResult, SweptVerdict

_ROUNDING = 1e-9  # [rad, rad/s, N·m], room for rounding in comparisons with limits


@dataclass(frozen=True)
class Check:
    """One part of a certificate."""

    name: str
    holds: bool
    detail: str
    """What was found, in a phrase."""


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
    goal, joint limits, and one-step replay of the dynamics.

    Args:
        scenario: arm, scene, start, goal and integrator.
        time: (N,) [s].
        q: configurations (N, nq).
        v: velocities (N, nv) [rad/s or m/s].
        tau: torque held from each sample to the next (N, nv) [N·m or N].
    """
    return Certificate(
        (
            _swept(scenario, q, v),
            _start(scenario, q, v, time),
            _goal(scenario, q, v),
            _limits(scenario.arm, q, v, tau),
            _replay(scenario, q, v, tau),
        )
    )


def swept_result(scenario: Scenario, q: Array, v: Array) -> SweptResult:
    """Return the swept check of a recorded motion; arguments as `certify`.

    Between samples the true motion departs from the chord by at most a Δt²/8, a the largest
    acceleration of the step and its neighbours.
    """
    dt = scenario.simulation.dt
    acceleration = np.abs(np.diff(v, axis=0)) / dt
    around = np.maximum(
        acceleration,
        np.maximum(
            np.vstack([acceleration[:1], acceleration[:-1]]),
            np.vstack([acceleration[1:], acceleration[-1:]]),
        ),
    )
    bound = SweptBound(Clearance(scenario.arm, scenario.scene))
    return SweptCheck(bound).check(q, around * dt**2 / 8.0)


def _swept(scenario: Scenario, q: Array, v: Array) -> Check:
    result = swept_result(scenario, q, v)
    if result.verdict == SweptVerdict.CLEAR:
        return Check("swept", True, f"proved clear from {result.evaluations} configurations")
    at = result.index * scenario.simulation.dt
    pairs = ", ".join(f"{a}-{b}" for a, b in result.pairs[:3])
    return Check("swept", False, f"{result.verdict} at t = {at:.3f} s: {pairs}")


def _start(scenario: Scenario, q: Array, v: Array, time: Array) -> Check:
    error = float(np.abs(scenario.arm.difference(scenario.start, q[0])).max())
    speed = float(np.abs(v[0]).max())
    shift = float(np.abs(time - scenario.simulation.dt * np.arange(len(time))).max())
    holds = error <= _ROUNDING and speed == 0.0 and shift <= _ROUNDING
    detail = f"{error:.2g} from the start at {speed:.2g} rad/s, {shift:.2g} s off the time grid"
    return Check("start", holds, detail)


def _goal(scenario: Scenario, q: Array, v: Array) -> Check:
    error = float(np.abs(scenario.arm.difference(scenario.goal, q[-1])).max())
    speed = float(np.abs(v[-1]).max())
    holds = error <= REACHED_POSITION and speed <= REACHED_VELOCITY
    return Check("goal", holds, f"ends {error:.2g} from the goal at {speed:.2g} rad/s")


def _limits(arm: Arm, q: Array, v: Array, tau: Array) -> Check:
    limits, angles = arm.limits, arm.angles(q)
    ratios = {
        "velocity": np.abs(v) / limits.velocity,
        "torque": np.abs(tau) / limits.effort,
    }
    outside = np.maximum(limits.lower - angles, angles - limits.upper).max()
    parts = [f"{name} {ratio.max():.0%}" for name, ratio in ratios.items()]
    holds = outside <= _ROUNDING and all(r.max() <= 1.0 + _ROUNDING for r in ratios.values())
    return Check("limits", bool(holds), f"peaks: {', '.join(parts)} of the limits")


def _replay(scenario: Scenario, q: Array, v: Array, tau: Array) -> Check:
    simulation = scenario.simulation
    error = replay_error(scenario.arm, simulation.dt, simulation.integrator, q, v, tau)
    return Check("replay", error <= REPLAY_TOLERANCE, f"one-step replay within {error:.1g}")
