"""Certificate: what is proved about a recorded run."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from densarm.arms.arm import Arm
from densarm.certificates.task import (
    PLANTS,
    REACHED_POSITION,
    REACHED_VELOCITY,
    Input,
    Integrator,
    Task,
)
from densarm.values.arrays import Array
from densarm.values.documented import documented
from densarm.world.near_pairs import NearPairs, smallest_distances
from densarm.world.stopping import StoppingCheck, StoppingTrajectory
from densarm.world.swept_check import SweptCheck, SweptResult, SweptVerdict
from densarm.world.world import DISTANCE_TOLERANCE, World

REPLAY_TOLERANCE = 1e-9
"""Largest difference of a replayed state from the recorded one [rad, rad/s or m, m/s]."""

_ROUNDING = 1e-9  # [rad, rad/s, N·m], room for rounding in comparisons with limits
_OF_SENSORS = {"encoder_noise", "velocity_noise", "seed"}  # which leave the plant as it is
_RESTS = 20  # ends of stopping trajectories at most whose distances are told


@dataclass(frozen=True)
class Check:
    """One part of a certificate."""

    name: str
    holds: bool | None
    """None where it does not apply, so that nothing is claimed of it."""
    detail: str
    """What was found, in a phrase, with the margin's unit and place."""
    margin: float | None
    """What was to spare where least was: a distance [m] (swept, stopping), a share of the limits
    (limits) or of the tube, else a part of the tolerance [rad, rad/s]; negative where it fails,
    None if unknown."""
    time: float
    """Where that was [s]."""


@documented
@dataclass(frozen=True)
class Certificate:
    """The parts of a certificate; the run is certified when all hold that apply."""

    checks: tuple[Check, ...]
    """One for each part."""

    def __repr__(self) -> str:
        failed = [check.name for check in self.checks if check.holds is False]
        parts = failed or [check.name for check in self.checks if check.holds]
        return f"Certificate({'not ' * (not self.certified)}proved: {', '.join(parts)})"

    @property
    def certified(self) -> bool:
        """Whether every part holds that applies."""
        return all(check.holds is not False for check in self.checks)

    @property
    def within(self) -> str:
        """What is certified beside the run, as a phrase: what keeps as near to its reference."""
        tube = next((check for check in self.checks if check.name == "tube"), None)
        return tube.detail.split(";")[0] if self.certified and tube and tube.holds else ""


def certify(
    task: Task,
    time: Array,
    q: Array,
    v: Array,
    tau: Array,
    reference: Array | None = None,
    tube: Array | None = None,
) -> Certificate:
    """Return what is proved about a run, from its record alone, whose arrays are as in `Run`.

    The parts: swept check of the whole motion against the scene and the arm itself, start and
    goal, limits of position, velocity, acceleration and torque, one-step replay of the dynamics,
    and a clear stopping trajectory within the limits from every sample. Obstacles with a motion
    are where it has them at each time, between samples too; stopping is proved until the arm
    is at rest, not that nothing runs into it afterwards. Torque limits do not apply to commanded
    velocities, nor to an arm without masses, whose dynamics nothing can replay; nor is a plant
    replayed that is disturbed, or MuJoCo's.

    With a reference and a tube, as in `Run` too, one more part: whatever keeps as near to the
    reference, or to a stopping trajectory from it, is clear, and this run does. With a declared
    speed, one more: nothing of that speed could reach the arm before it could be at rest.
    """
    world = World(task.arm, task.scene)
    checks = [
        _swept(task, world, q, v),
        _start(task, q, v, time),
        _goal(task, q, v),
        _limits(task, q, v, tau),
        _replay(task, q, v, tau),
        _stopping(task, world, q, v),
    ]
    if reference is not None and tube is not None:
        checks.append(_tube(task, world, q, reference, tube))
    if task.passive_speed is not None:
        checks.append(_passive(task, world, task.passive_speed, q, v))
    return Certificate(tuple(checks))


def swept_result(
    world: World, q: Array, v: Array, dt: float, kept: float | Array = 0.0
) -> SweptResult:
    """Return the swept check of a motion recorded each dt [s], q (N, nq) and v (N, nv).

    Pairs count as apart beyond a distance, each its own (K,), or one for all [m]. Obstacles with a
    motion are where it has them.
    """
    time = dt * np.arange(len(q), dtype=np.float64)
    return SweptCheck(world, kept=kept).check(q, departure(v, dt), time)


def departure(v: Array, dt: float) -> Array:
    """Return how far a motion recorded each dt [s] departs from its chords (N - 1, nv) [rad or m].

    Between samples, of velocities (N, nv), that is at most a Δt²/8, a the largest acceleration of
    the step and its neighbours.
    """
    acceleration = np.abs(np.diff(v, axis=0)) / dt
    k = np.arange(len(acceleration))
    around = np.max([acceleration[np.clip(k + by, 0, len(k) - 1)] for by in (-1, 0, 1)], axis=0)
    return np.asarray(around * dt**2 / 8.0)


def replay_errors(task: Task, q: Array, v: Array, tau: Array) -> Array:
    """Return how far each recorded state is off the step that leads to it (N - 1,).

    The largest difference [rad, rad/s or m, m/s] counts. Where the plant was told velocities, the
    step is that of the velocity it then had.
    """
    arm, dt, angles = task.arm, task.simulation.dt, task.arm.angles(q[:-1])
    acceleration = _acceleration(arm, tau[:-1])
    if task.input == Input.TORQUE and task.simulation.integrator == Integrator.RK4:
        position, velocity = _rk4(acceleration, dt, angles, v[:-1])
    else:
        is_told = task.input == Input.VELOCITY
        velocity = v[1:] if is_told else v[:-1] + dt * acceleration(angles, v[:-1])
        position = angles + dt * velocity
    position = arm.difference(arm.configurations(position), q[1:])
    largest = np.maximum(np.abs(position), np.abs(velocity - v[1:]))
    return np.asarray(largest.max(axis=1))


_Acceleration = Callable[[Array, Array], Array]


def _acceleration(arm: Arm, tau: Array) -> _Acceleration:
    """Return the acceleration under torques (N, nv), of joint positions and velocities (N, nv)."""
    pool, columns = pin.ModelPool(arm.model, 1), np.asfortranarray(tau.T)

    def at(angles: Array, v: Array) -> Array:
        q = np.asfortranarray(arm.configurations(angles).T)
        found = pin.abaInParallel(1, pool, q, np.asfortranarray(v.T), columns)
        # Pinocchio drops the axis of a single joint, and of a single state.
        return np.asarray(found).T.reshape(v.shape)

    return at


def _rk4(acceleration: _Acceleration, dt: float, angles: Array, v: Array) -> tuple[Array, Array]:
    a1 = acceleration(angles, v)
    v2 = v + 0.5 * dt * a1
    a2 = acceleration(angles + 0.5 * dt * v, v2)
    v3 = v + 0.5 * dt * a2
    a3 = acceleration(angles + 0.5 * dt * v2, v3)
    v4 = v + dt * a3
    a4 = acceleration(angles + dt * v3, v4)
    mean_v, mean_a = v + 2.0 * v2 + 2.0 * v3 + v4, a1 + 2.0 * a2 + 2.0 * a3 + a4
    return angles + dt / 6.0 * mean_v, v + dt / 6.0 * mean_a


def _swept(task: Task, world: World, q: Array, v: Array) -> Check:
    result = swept_result(world, q, v, task.simulation.dt)
    at = result.index * task.simulation.dt
    if result.verdict != SweptVerdict.CLEAR:
        pairs = ", ".join(f"{a}-{b}" for a, b in result.pairs[:3])
        return Check("swept", False, f"{result.verdict} at t = {at:.3f} s: {pairs}", None, at)
    found = f"{_nearest(result.distance, at)} of {len(result.evaluated)} configurations"
    return Check("swept", True, f"proved clear, {found}", _finite(result.distance), at)


def _start(task: Task, q: Array, v: Array, time: Array) -> Check:
    error = float(np.abs(task.arm.difference(task.start, q[0])).max())
    begun = np.zeros(task.arm.nv) if task.start_velocity is None else task.start_velocity
    speed = float(np.abs(v[0] - begun).max())
    shift = float(np.abs(time - task.simulation.dt * np.arange(len(time))).max())
    holds = error <= _ROUNDING and speed == 0.0 and shift <= _ROUNDING
    off = f"{shift:.2g} s off the time grid"
    if begun.any():
        off = f"at the speed of the phase before, {off}"
    detail = f"{error:.2g} from the start at {speed:.2g} rad/s, {off}"
    return Check("start", holds, detail, _finite(_ROUNDING - max(error, speed, shift)), 0.0)


def _goal(task: Task, q: Array, v: Array) -> Check:
    end = (len(q) - 1) * task.simulation.dt
    if task.goal is None:
        return Check("goal", False, "no goal was given", None, end)
    error, speed = task.goal_error(q[-1]), float(np.abs(v[-1]).max())
    holds = error <= REACHED_POSITION and speed <= REACHED_VELOCITY
    margin = min(REACHED_POSITION - error, REACHED_VELOCITY - speed)
    detail = f"ends {error:.2g} from the goal at {speed:.2g} rad/s"
    return Check("goal", holds, detail, _finite(margin), end)


def _limits(task: Task, q: Array, v: Array, tau: Array) -> Check:
    arm, dt = task.arm, task.simulation.dt
    limits, angles = arm.limits, arm.angles(q)
    ratios = {
        "velocity": np.abs(v) / limits.fastest(angles, v),
        "acceleration": np.abs(np.diff(v, axis=0, append=v[-1:])) / dt / limits.acceleration,
    }
    if limited := task.input == Input.TORQUE and not arm.links_without_mass:
        ratios["torque"] = np.abs(tau) / limits.effort
    outside = limits.excess(angles)
    peaks = {name: _peak(ratio) for name, ratio in ratios.items()}
    parts = [
        f"{name} {peak:.0%} ({arm.joint_names[joint]}, t = {at * dt:.3f} s)"
        for name, (peak, at, joint) in peaks.items()
    ]
    detail = f"peaks of the limits: {', '.join(parts)}"
    if not limited:
        detail += "; torque limits do not apply"
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


def _replay(task: Task, q: Array, v: Array, tau: Array) -> Check:
    if task.input == Input.TORQUE and task.arm.links_without_mass:
        lacking = ", ".join(task.arm.links_without_mass)
        return Check("replay", False, f"torque tells nothing: no mass of {lacking}", None, 0.0)
    disturbed = sorted(set(task.disturbances) - _OF_SENSORS)
    if task.plant != PLANTS[0] or disturbed:
        by = f", disturbed by {', '.join(disturbed)}" if disturbed else ""
        detail = f"does not apply: the record says that the plant is {task.plant}{by}"
        return Check("replay", None, detail, None, 0.0)
    errors = np.append(replay_errors(task, q, v, tau), 0.0)
    worst = int(np.argmax(errors))
    error, at = float(errors[worst]), worst * task.simulation.dt
    detail = f"one-step replay within {error:.1g}"
    if not error <= REPLAY_TOLERANCE:
        detail += f" at t = {at:.3f} s"
    return Check("replay", error <= REPLAY_TOLERANCE, detail, _finite(REPLAY_TOLERANCE - error), at)


def _stopping(task: Task, world: World, q: Array, v: Array) -> Check:
    arm, dt = task.arm, task.simulation.dt
    moves = world.fastest_obstacle > 0.0
    world.set_time(0.0)
    time = dt * np.arange(len(q), dtype=np.float64) if moves else None
    result = StoppingCheck(world, StoppingTrajectory(arm)).check(q, v, time)
    failing = result.failing
    if failing.size:
        first = int(failing[0])
        why = "comes too near to a body"
        if not result.inside[first]:
            why = "leaves the position limits"
        if not np.isfinite(result.duration[first]):
            why = "needs more torque than there is"
        detail = f"stopping from t = {first * dt:.3f} s {why}; {failing.size} of {len(q)} fail"
        return Check("stopping", False, detail, None, first * dt)
    looked_at = np.arange(0, len(q), 1 + len(q) // _RESTS)
    ends = arm.configurations(result.end[looked_at])
    ended = None if time is None else (time + result.duration)[looked_at]
    rest = smallest_distances(world, ends, ended)
    at, longest = float(looked_at[rest.argmin()] * dt), int(np.argmax(result.duration))
    detail = (
        f"proved clear from {len(q)} samples, longest stop {result.duration[longest]:.2g} s at "
        f"t = {longest * dt:.3f} s, {_nearest(rest.min(), at)} of {len(ends)} ends"
    )
    if moves:
        detail += "; until at rest, obstacles moving on"
    if arm.links_without_mass:
        detail += "; by acceleration limits alone"
    elif set(task.disturbances) - _OF_SENSORS:
        detail += "; by the torque of the arm's model, not of the disturbed plant"
    return Check("stopping", True, detail, _finite(rest.min()), at)


def _tube(task: Task, world: World, q: Array, reference: Array, tube: Array) -> Check:
    """Prove clear what is within ε of a reference, and of stopping trajectories from it."""
    arm, dt = task.arm, task.simulation.dt
    if world.fastest_obstacle > 0.0:
        return Check("tube", None, "does not apply: obstacles move", None, 0.0)
    if not (tube > 0.0).all():
        return Check("tube", False, "a bound on the error is not positive", None, 0.0)
    wanted = arm.configurations(reference)
    steps = np.diff(reference, axis=0)
    bend = np.abs(np.diff(steps, axis=0, prepend=0.0, append=0.0))
    departure, kept = np.maximum(bend[:-1], bend[1:]) / 8.0, world.lipschitz @ tube
    result = SweptCheck(world, kept=kept).check(wanted, departure)
    within = f"within ±{tube.min():.2g} to ±{tube.max():.2g} rad or m of the reference"
    if result.verdict != SweptVerdict.CLEAR:
        pairs, at = ", ".join(f"{a}-{b}" for a, b in result.pairs[:3]), result.index * dt
        return Check("tube", False, f"not clear {within} at t = {at:.3f} s: {pairs}", None, at)
    check = StoppingCheck(world, StoppingTrajectory(arm), kept=kept)
    stopped = check.check(wanted[:-1], steps / dt)
    if stopped.failing.size:
        at = float(stopped.failing[0]) * dt
        return Check("tube", False, f"stopping not clear {within} at t = {at:.3f} s", None, at)
    share, k, joint = _peak(np.abs(arm.difference(wanted, q)) / tube)
    used = f"{arm.joint_names[joint]} used {share:.0%} of it at t = {k * dt:.3f} s"
    if share > 1.0:
        detail = f"does not apply: clear {within}, which the run left; {used}"
        return Check("tube", None, detail, 1.0 - share, k * dt)
    return Check("tube", True, f"clear {within}; {used}", 1.0 - share, k * dt)


def _passive(task: Task, world: World, speed: float, q: Array, v: Array) -> Check:
    """Prove that what moves at a speed [m/s], whatever way it goes, meets the arm at rest alone.

    Of the recorded motions only where things are at each sample is believed.
    """
    dt, moves = task.simulation.dt, world.has_motion
    if not moves.any():
        return Check("passive", None, "does not apply: no obstacle moves", None, 0.0)
    if not (fastest := world.fastest_obstacle) <= speed * (1.0 + _ROUNDING):
        detail = f"an obstacle may have {fastest:.3g} m/s, and {speed:.3g} m/s are declared"
        return Check("passive", False, detail, None, 0.0)
    fast = np.maximum(np.abs(v), np.abs(np.vstack([v[1:], v[-1:]])))  # until the next sample
    duration = StoppingTrajectory(task.arm).durations(q, v)
    need = (0.5 * duration[:, np.newaxis] * np.abs(v) + dt * fast) @ world.lipschitz.T
    need += (speed * (duration + dt) + task.margin + DISTANCE_TOLERANCE)[:, np.newaxis]
    moving = np.flatnonzero(~(fast.max(axis=1) <= REACHED_VELOCITY))
    near, least, at, failing = NearPairs(world), np.inf, 0, 0
    for k in moving:
        world.set_time(float(k * dt))
        limit = np.where(moves, need[k] + max(least, 0.0), -np.inf)
        pairs, distance = near.below(q[k], limit)
        spare = float((distance - need[k, pairs]).min(initial=np.inf))
        spare = spare if np.isfinite(need[k]).all() else -np.inf
        failing += not spare > 0.0
        if not spare >= least:
            least, at = spare, int(k)
    told = f"what moves by up to {speed:.3g} m/s"
    if failing:
        detail = f"{told} could reach the moving arm at t = {at * dt:.3f} s; {failing} of {len(q)}"
        return Check("passive", False, f"{detail} samples fail", _finite(least), at * dt)
    detail = f"at rest before {told} can reach it, from {len(moving)} samples in motion"
    if np.isfinite(least):
        detail += f", {least * 1e3:.3g} mm to spare at t = {at * dt:.3f} s"
    return Check("passive", True, detail, _finite(least), at * dt)


def _nearest(distance: float, at: float) -> str:
    """Return the smallest distance of those that were looked at, as a phrase."""
    return f"smallest distance {distance * 1e3:.3g} mm at t = {at:.3f} s"


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
