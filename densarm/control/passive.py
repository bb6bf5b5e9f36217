"""PassiveTracking: tracks a motion, and rests before anything that moves can reach the arm."""

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from densarm.control.controller import Gains, ToldByGoal, checked_state
from densarm.control.inverse_dynamics import InverseDynamics
from densarm.control.stopping import StopAndHold
from densarm.control.tracking import DensityTracking
from densarm.planning.motion import Motion
from densarm.scene.scene import Scene
from densarm.values.arrays import Array
from densarm.values.checks import positive
from densarm.world.near_pairs import NearPairs
from densarm.world.stopping import HELD_SHARE, StoppingTrajectory
from densarm.world.swept_check import SweptCheck
from densarm.world.world import DISTANCE_TOLERANCE, World

# Of a straight stop, and of one by the reference's clock: T as the torque of the former has it, how
# much later it ends, and how long the arm may go on at its velocity beside T / 2 [s].
_BRAKE, _PAUSE = (1.0, 0.05, 0.02), (1.5, 0.25, 0.08)
_ROOM = 1.1  # times what a pause needs, before the arm goes on
_LOOK_AHEAD, _INTERVAL = 0.2, 0.01  # [s] of the motion, before the arm goes on; between samples
_SLOW = 0.005  # [rad/s or m/s], at which nothing is braked any more; half of what counts as rest
_FARTHEST = 0.3  # [rad or m] off the motion, from where the arm returns to it
_RETURN_SPEED, _RETURNED = 0.1, 1e-3  # [rad/s or m/s], and [rad or m] from where tracking goes on
_LATE = 1.5  # periods from one call to the next, after which the arm is at a start again


class PassiveTracking(ToldByGoal):
    r"""Tracks q_d(t) while nothing that moves could reach the arm before it has come to rest.

    From q̇ the arm comes to rest within the time T of its `StoppingTrajectory`; an obstacle of speed
    w at most, whatever way it takes, does not reach it before if, with a reaction time s,

    .. math:: d_k > m + \sum_j r_{kj} |\dot q_j| (T / 2 + s) + w (T + s)

    for every pair k whose obstacle may move: one with a motion, or one that was moved, or came,
    since this was made. Before the room is less than its clock needs to come to rest, the reference
    does so, on its motion; where less is left than a straight stop and s = 50 ms need, the arm
    brakes straight. It goes on once there is room for the motion's own velocities in the 0.2 s to
    come, from a straight stop by a slow return to the motion, if that is clear. An arm at rest
    stays where it is, and may be touched there. Nothing is evaded. What stands, and the arm itself,
    the motion is proved clear of, as are the straight lines on which it stops.

    Without anything that moves its torque is that of `DensityTracking`, bit for bit.

    Args:
        world: the arm among obstacles.
        motion: q_d(t), as `plan_motion` makes it.
        speed: w, the largest speed of any point of what moves [m/s].
        options: as those of `DensityTracking`.

    Attributes:
        passive_speed: w [m/s].
        motion: as given.
        goal: where it ends (nq,).

    Raises:
        InvalidValueError: a speed that is not positive, or as `DensityTracking`.
        RobotDescriptionError: the arm has links without a mass.
    """

    def __init__(self, world: World, motion: Motion, speed: float, **options: Any) -> None:
        world.arm.require_masses("torque")
        self.passive_speed = positive("speed", speed)
        self.motion = motion
        scene = world.scene
        standing = Scene([item for item in scene if item.motion is None], scene.attachments)
        self._tracking = DensityTracking(World(world.arm, standing), motion, **options)
        self.goal = self._tracking.goal
        self._arm, self._world, self._near = world.arm, world, NearPairs(world)
        self._way, self._changes = world.obstacle_way.copy(), world.changes.copy()
        self._stopping = StoppingTrajectory(world.arm, HELD_SHARE)
        self._brake = StopAndHold(world.arm, Gains(), motion.period)
        every = max(1, round(_INTERVAL / motion.period))
        self._interval, velocity = every * motion.period, motion.velocity[::every]
        wanted = world.arm.configurations(motion.position[::every])
        stops = self._stopping.durations(wanted, velocity)
        self._needs = _ROOM * self._need(velocity, stops, _PAUSE)
        self._time = math.nan
        self._stands = self._waits = self._is_lost = False
        self._return: tuple[Array, float, bool] | None = None  # where to, when, whether it is clear

    @property
    def is_moving(self) -> bool:
        """Whether the reference still moves, or waits; not where the arm cannot return to it."""
        return not self._is_lost and (self._stands or self._tracking.is_moving)

    @property
    def reference(self) -> Array:
        """As `DensityTracking.reference`; before the arm has tracked anything, the start."""
        has_tracked = math.isfinite(self._tracking.reference_time)
        return self._tracking.reference if has_tracked else self.motion.position[0]

    @property
    def tracking_error(self) -> float:
        """As `DensityTracking.tracking_error`, of the last call that tracked."""
        return self._tracking.tracking_error

    @property
    def remark(self) -> str:
        """As `DensityTracking.remark`."""
        return self._tracking.remark

    def describe_stall(self, q: Array) -> str:
        """Return, as a phrase, why the arm rests short of the goal."""
        if self._is_lost:
            return "braked for what came near, and no clear way back to the motion"
        return self._tracking.describe_stall(q)

    def torque(self, t: float, q: ArrayLike, v: ArrayLike) -> Array:
        """Act as `Controller.torque`."""
        q, v = checked_state(self._arm, q, v)
        dt, self._time = t - self._time, t
        moves = self._world.has_motion | (self._world.obstacle_way != self._way)
        moves |= self._world.changes != self._changes
        if not 0.0 <= dt <= _LATE * self.motion.period:
            is_first = math.isnan(dt)
            if not (is_first and self._may_go(q, moves, 0.0)):
                self._stop(q, v)
            dt = 0.0
        if self._stands:
            self._leave_rest(t - dt, q, v, moves)
        else:
            self._watch(q, v, moves)
        if self._stands:
            return self._brake.torque(q, v, dt)
        return self._tracking.torque(t, q, v)

    def _watch(self, q: Array, v: Array, moves: Array) -> None:
        """Brake, or let the reference wait or go on, as the distances of what moves allow."""
        if moves.any():
            stop = self._stopping.durations(q[np.newaxis], v[np.newaxis])
            early, last = (self._need(v[np.newaxis], stop, by)[0] for by in (_PAUSE, _BRAKE))
            pairs, distance = self._near.below(q, np.where(moves, early, -np.inf))
            if np.abs(v).max() > _SLOW and (distance <= last[pairs]).any():
                self._stop(q, v, self._tracking.dynamics)
                return
            self._waits |= bool((distance <= early[pairs]).any())
        if self._waits:
            self._waits = not self._may_go(q, moves, self._tracking.reference_time)
        self._tracking.lead_clock(0.0 if self._waits else 1.0)

    def _stop(self, q: Array, v: Array, known: InverseDynamics | None = None) -> None:
        self._brake.begin(q, v, known)
        self._stands, self._waits, self._return = True, False, None

    def _leave_rest(self, last: float, q: Array, v: Array, moves: Array) -> None:
        """Return from a straight stop to the nearest place on the motion, and go on there."""
        if not self._brake.is_holding or self._is_lost:
            return
        if self._return is None:
            wanted = self._arm.configurations(self.motion.position)
            nearest = int(np.abs(self._arm.difference(wanted, q)).max(axis=1).argmin())
            self._return = wanted[nearest], nearest * self.motion.period, False
        place, time, is_clear = self._return
        if not self._may_go(q, moves, time):
            return
        off = float(np.abs(self._arm.difference(place, q)).max())
        if off <= _RETURNED:
            if np.abs(v).max() <= _SLOW:
                self._tracking.dynamics.take_over(self._brake.dynamics, last)
                self._tracking.resume(q)
                self._tracking.pause()
                self._stands = False
            return
        if not is_clear:
            check = SweptCheck(self._world, self.motion.margin)
            self._is_lost = off > _FARTHEST or not check.segment_is_clear(q, place)
            self._return = place, time, True
        if not self._is_lost:
            self._brake.lead(place, _RETURN_SPEED * self.motion.period)

    def _may_go(self, q: Array, moves: Array, time: float) -> bool:
        """Return whether there is room for the motion's velocities from a time of its own on."""
        if not moves.any():
            return True
        first = int(time / self._interval)
        needs = self._needs[first : first + 1 + round(_LOOK_AHEAD / self._interval)]
        need = np.where(moves, needs.max(axis=0, initial=0.0), -np.inf)
        pairs, distance = self._near.below(q, need)
        return not bool((distance <= need[pairs]).any())

    def _need(self, v: Array, stop: Array, by: tuple[float, float, float]) -> Array:
        """Return what distances must exceed (N, K) [m], at v (N, nv), with straight stops (N,) [s].

        The last argument is one of the two ways to stop.
        """
        longer, late, going_on = by
        ways = np.abs(v) * (0.5 * longer * stop + going_on)[:, np.newaxis]
        far = self.motion.margin + self.passive_speed * (longer * stop + late)
        far += DISTANCE_TOLERANCE
        return np.asarray(ways @ self._world.lipschitz.T + far[:, np.newaxis])
