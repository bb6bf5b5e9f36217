"""DensityTracking: the density inverse-dynamics controller along a motion."""

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike

from densarm.arms.dynamics import Kinematics
from densarm.control.controller import Gains, ToldByGoal, checked_state
from densarm.control.disturbance_observer import (
    AHEAD_ANGLE,
    AHEAD_VELOCITY,
    DISTURBANCE,
    ELAPSED,
    ActuationParameters,
)
from densarm.control.evasion import Evasion
from densarm.control.inverse_dynamics import (
    ATTRACT,
    BRAKE,
    EFFORT_LIMIT,
    EMERGENCY_RATE,
    RATE_LIMIT,
    TORQUE,
    TORQUE_RATE,
    VELOCITY_LIMIT,
    DynamicsArrays,
    InverseDynamics,
    robust_torque,
    send,
    take_in,
)
from densarm.control.reference_clock import (
    CHANGE,
    EMERGENCY,
    LEAST_SHARE,
    N_CLOCK,
    RATE,
    TIME,
    ReferenceClock,
    advance_clock,
    set_rate,
)
from densarm.control.sensing import (
    SensingDistances,
    require_smooth_goal,
    sensing_distances,
    sets_off,
)
from densarm.density.goal_distance import GoalDistance, TorusDistance, torus_distance
from densarm.density.navigation_density import (
    DensityParameters,
    NavigationDensity,
    write_gauge_gradient,
)
from densarm.density.unsafe_sets import SensingParameters, UnsafeSet
from densarm.errors import InvalidValueError
from densarm.planning.motion import Motion, write_sample
from densarm.values.arrays import Array
from densarm.values.kernels import compiled, entry_point
from densarm.world.active_pairs import ActivePairs
from densarm.world.stopping import HELD_SHARE
from densarm.world.world import World

TRACKING_GAINS = Gains(position=1400.0, velocity=80.0)
"""Of tracking, whose feedback no cap on accelerations weakens."""


class DensityTracking(ToldByGoal):
    r"""Track q_d(t), obstacles acting at the true configuration.

    .. math::

        \tau = H + M \ddot q_d + (M + D)\, \varphi\big( K_p \nabla(-1/\rho) - K_v \dot e \big)
        - \hat d, \qquad e = q \ominus q_d, \quad \rho = \Psi(q) / V(e)

    [ZNV] has ∇ρ(e), singular at e = 0; this feedback tends to -K_p e there, and obstacles act at q,
    where they are. It is added for an arm that is not its model: D and d̂ (`ActuationParameters`),
    φ, which asks for no more than the torque rate can follow, and each joint saturates by itself.
    The attraction is at most K_v times a quarter of the velocity limit, so that no push is answered
    by a return faster than that. The torque's rate is limited, but after a push by more than 0.5
    rad/s until the arm is back within 0.05 rad. Every sensing distance is below what the motion
    keeps from the unsafe set, so that Ψ = 1 on it and obstacles act only on an arm that was pushed
    off it; those that move, of which the motion knows nothing, act from the largest sensing
    distance on. The torque is taken to be held for the motion's period: q̈_d is its mean over that
    time. State and reference are those of the time when it acts.

    The reference waits for an arm that is held up, by its `ReferenceClock`. Where obstacles move,
    its velocity, and that of a return to it, is led by `Evasion`, and a servo follows that inside
    the acceleration limits, until the arm is back.

    `velocity` tracks it with a plant that is told velocities, which needs no masses:

    .. math::

        u = \bar{\dot q}_d + \frac{K_p}{K_v} \nabla(-1/\rho)

    with the mean of q̇_d over a period, inside the limits of velocity and acceleration.

    Args:
        world: the arm among obstacles.
        motion: q_d(t), as `plan_motion` makes it.
        gains: K_p and K_v.
        goal_distance: V; None for a `TorusDistance`.
        unsafe_sets: what else must not be entered, beside pairs of bodies and joint limits.
        density: α, θ and gauge; tracking lives at e = 0, where nothing may be singular or flat.
        sensing: largest sensing distances, and their share of the distance kept on the way.
        actuation: how late torque is, and how far the model is trusted.
        evasion: makes what gives way to obstacles that move, as the class `Evasion`.

    Attributes:
        motion, goal: as given or followed, and where it ends (nq,).
        tracking_error: largest |e| of a joint at the last call, zero before the first [rad or m].

    Raises:
        InvalidValueError: a density that is singular, flat or blended at e = 0.

    Source: [ZNV] eq. 17, with what docs/departures.md tells.
    """

    def __init__(
        self,
        world: World,
        motion: Motion,
        *,
        gains: Gains = TRACKING_GAINS,
        goal_distance: GoalDistance | None = None,
        unsafe_sets: Sequence[UnsafeSet] = (),
        density: DensityParameters = DensityParameters(),
        sensing: SensingParameters = SensingParameters(),
        actuation: ActuationParameters = ActuationParameters(),
        evasion: Callable[[World, ActivePairs, float], Evasion] = Evasion,
    ) -> None:
        require_smooth_goal(density, may_blend=False)
        arm = world.arm
        self.tracking_error, self._is_evading = 0.0, False
        self._arm, self._world, self._sensing, self._gains = arm, world, sensing, gains
        self._kinematics = Kinematics(arm)
        self._pairs, self._joints = sets_off(world, motion.margin, sensing, self._kinematics)
        self._take(motion, sensing_distances(world, motion, sensing))
        distance = goal_distance or TorusDistance(arm)
        unsafe: list[UnsafeSet] = [self._pairs, self._joints, *unsafe_sets]
        self._density = NavigationDensity(arm, self.goal, unsafe, distance, density)
        self._numbers = np.zeros(_END)
        self._clock = ReferenceClock(self._numbers[:N_CLOCK])
        if arm.links_without_mass:
            self.velocity(0.0, self.goal, np.zeros(arm.nv))
            return
        unlimited = np.full(arm.nv, math.inf)
        self._evasion = evasion(world, self._pairs.pairs, motion.margin)
        self._dynamics = InverseDynamics(arm, unlimited, self._kinematics, motion.period, actuation)
        kappa = distance.kappa if isinstance(distance, TorusDistance) else math.nan
        self._numbers[_PERIOD:-2] = motion.period, actuation.delay, kappa
        self._numbers[-2:] = gains.position, gains.velocity
        self._sample, rows = np.zeros((6, arm.nv)), self._dynamics.rows
        own, still = (self._numbers, self._sample, self._dynamics.arrays), np.zeros(arm.nv)
        self._arrays = self._density.log_psi_gradient, *own
        self._sample[_WEIGHTS] = getattr(distance, "weights", 1.0)
        self._sample[_MOST] = _PAUSE_SHARE * arm.limits.acceleration
        types = 0.0, self.goal, still, 0.0, motion.knots, *self._arrays
        self._kernel = entry_point(_tracking_torque, *types)
        self._back = self._numbers, rows, self._sample, gains.rate, arm.limits.acceleration
        self._return = entry_point(_return, *self._back, still)
        for t in (0.0, motion.period, math.nan):  # kernels are loaded before a control loop
            self.torque(t, self.goal, still)
        self.tracking_error = 0.0

    def torque(self, t: float, q: ArrayLike, v: ArrayLike) -> Array:
        """Act as `Controller.torque`.

        Raises:
            RobotDescriptionError: the arm has links without a mass.
        """
        self._arm.require_masses("torque")
        q, v = checked_state(self._arm, q, v)
        self._kinematics.update(q)
        self._dynamics.compute_terms(q, v)
        if math.isnan(self._numbers[_KAPPA]):  # asked twice, since the first tells σ
            self._act(float(t), q, v)
            ahead = self.reference_time + self._numbers[_DELAY] * self._numbers[RATE]
            self._dynamics.rows[ATTRACT] = self._attraction(q, self.motion.sample(ahead).position)
        else:
            self._density.update_psi(q)
        self._act(float(t), q, v)
        if self._evasion.is_needed():
            self._evade(q)
        return np.array(self._dynamics.rows[TORQUE])

    def _act(self, t: float, q: Array, v: Array) -> None:
        """Send the torque at a state, of which all terms and Ψ are known."""
        knots, log_psi = self.motion.knots, self._density.log_psi
        self.tracking_error = self._kernel(t, q, v, log_psi, knots, *self._arrays)

    def _evade(self, q: Array) -> None:
        """Replace the torque by one that gives way, and that returns to the reference.

        It returns no faster than it can stop, and hands over where little is left to return.
        """
        numbers, rows = self._numbers, self._dynamics.rows
        wanted = np.empty(self._arm.nv)
        is_off = self._return(*self._back, wanted)
        is_off |= self.is_moving and abs(1.0 - numbers[RATE]) > _HANDED_OVER[1]
        wanted, gives_way = self._evasion.velocity(q, rows[AHEAD_VELOCITY], wanted)
        self._is_evading = gives_way or (self._is_evading and bool(is_off))
        if self._is_evading:
            numbers[EMERGENCY] = min(numbers[EMERGENCY], 0.0)
            rows[RATE_LIMIT] = self._dynamics.elapsed * rows[TORQUE_RATE]
            self._evasion.send_torque(self._dynamics, wanted, None if gives_way else rows[BRAKE])

    @property
    def is_evading(self) -> bool:
        """Whether an obstacle moves, and the arm gave way at the last call, or still returns."""
        return self._is_evading and self._evasion.sees_motion

    def _take(self, motion: Motion, sensed: SensingDistances) -> None:
        self.motion, self.goal = motion, self._arm.configurations(motion.position[-1])
        self._pairs.set_sensing_distance(sensed.pairs)
        self._joints.set_sensing_distance(sensed.joints)

    def follow(self, motion: Motion, q: ArrayLike, sensed: SensingDistances | None = None) -> None:
        """Track another motion from the next call on, its reference at rest where it is nearest.

        Args:
            motion: of the same period and margin.
            q: configuration of the arm (nq,), which may move; torques change no faster than ever.
            sensed: what `sensing_distances` has for it; None to compute it, in some 10 ms.

        Raises:
            InvalidValueError: a motion of another period or margin.
        """
        for name in ("period", "margin"):
            given, own = getattr(motion, name), getattr(self.motion, name)
            if given != own:
                raise InvalidValueError(f"{name} of the motion", given, f"{own}, as before")
        self._take(motion, sensed or sensing_distances(self._world, motion, self._sensing))
        self.resume(q)
        self._clock.join()

    def pause(self) -> None:
        """Let the reference's clock come to rest, so that the arm rests on the motion."""
        self._clock.pause()

    def lead_clock(self, to: float) -> None:
        """Take the rate that the clock is to have a period nearer to another, between 0 and 1."""
        self._clock.lead(to, self.motion, self._arm.limits.acceleration)

    def resume(self, q: ArrayLike | None = None, within: float | Array = math.inf) -> bool:
        """Let the reference go on after a pause, or after the arm was stopped by another.

        Args:
            q: configuration (nq,) where the arm rests, from which nearest place on the motion the
                reference is to go on, at any time of the next call; None for where it paused.
            within: how far off that place the joints may be (nv,) [rad or m].

        Returns:
            Whether it goes on: it does not from farther off.
        """
        time = None
        if q is not None:
            wanted = self._arm.configurations(self.motion.position)
            off = np.abs(self._arm.difference(wanted, np.asarray(q, np.float64)))
            nearest = int((off / np.where(np.isinf(within), 1.0, within)).max(axis=1).argmin())
            if not (off[nearest] <= within).all():
                return False
            time = nearest * self.motion.period
        self._clock.resume(time)
        return True

    @property
    def is_paused(self) -> bool:
        """Whether the reference was made to pause, and rests."""
        return self._clock.is_paused

    @property
    def dynamics(self) -> InverseDynamics:
        """What is known of disturbance and torques."""
        return self._dynamics

    @property
    def reference_time(self) -> float:
        """The reference's own time σ at the last call [s]: it waits where the arm is held up."""
        return self._clock.time

    @property
    def reference(self) -> Array:
        """The joint positions (nv,) that were wanted at the last call [rad or m]."""
        return self.motion.sample(self.reference_time).position

    @property
    def is_moving(self) -> bool:
        """Whether the reference still moves."""
        return self.reference_time < self.motion.duration

    def velocity(self, t: float, q: ArrayLike, v: ArrayLike) -> Array:
        """Act as `VelocityController.velocity`, v being the velocity commanded last."""
        q, v = checked_state(self._arm, q, v)
        self._kinematics.update(q)
        motion, limits, self._numbers[TIME] = self.motion, self._arm.limits, t
        now, then = motion.sample(t), motion.sample(t + motion.period)
        follow = (then.position - now.position) / motion.period
        wanted = follow + self._gains.rate * self._attraction(q, now.position)
        change = motion.period * HELD_SHARE * limits.acceleration
        reached = np.clip(wanted, v - change, v + change)
        return np.asarray(np.clip(reached, -limits.velocity, limits.velocity))

    def describe_stall(self, q: Array) -> str:
        """Return, as a phrase, why the arm rests short of the goal."""
        return self.motion.detail

    @property
    def remark(self) -> str:
        """As `Motion.remark`."""
        return self.motion.remark

    def _attraction(self, q: Array, wanted: Array) -> Array:
        """Return ∇ρ (nv,) at q (nq,) towards joint positions (nv,), and keep the error."""
        density, attract = self._density, np.empty(self._arm.nv)
        density.set_goal(self._arm.configurations(wanted))
        density.update(q)
        density.write_gradient(density.parameters.gauge, attract)
        self.tracking_error = float(np.abs(density.error(q)).max())
        return attract


_POSITION, _VELOCITY, _ACCELERATION, _ERROR, _WEIGHTS, _MOST = 0, 1, 2, 3, 4, 5  # rows of a sample
# Numbers of the kernel after those of the clock.
_PERIOD, _DELAY, _KAPPA, _POSITION_GAIN, _VELOCITY_GAIN, _END = range(N_CLOCK, N_CLOCK + 6)

_EVADED_SHARE = 0.5  # of twice the acceleration limits, with which a return to the reference stops
_HANDED_OVER = 0.001, 0.02  # of error, and of velocity or rate, that tracking takes over from
_PAUSE_SHARE = 0.95  # of the acceleration limits, that pausing takes with the motion
_FREE_LOAD = 0.05  # of the torque left, which unknown torque may take without slowing the reference
_RETURN_SHARE = 0.25  # of the velocity limits, at which an arm returns from a push
_PUSHED, _RETURNED = 0.5, 0.05  # velocity off by a push [rad/s or m/s], error after it [rad or m]
_LARGEST_GAIN = 0.4  # of K_v times the time that a torque is late


@compiled
def _return(
    numbers: Array, rows: Array, sample: Array, gain: float, most: Array, wanted: Array
) -> bool:
    """Write the velocity back to the reference; return whether the arm is off it."""
    rate, is_off = numbers[RATE], False
    for i in range(most.size):
        error, follow = sample[_ERROR, i], rate * sample[_VELOCITY, i]
        off = abs(error)
        back = math.copysign(min(gain * off, math.sqrt(_EVADED_SHARE * most[i] * off)), error)
        wanted[i] = follow - back
        is_off |= off > _HANDED_OVER[0]
        is_off |= abs(rows[AHEAD_VELOCITY, i] - follow) > _HANDED_OVER[1]
    return is_off


@compiled
def _tracking_torque(
    t: float,
    q: Array,
    v: Array,
    log_psi: float,
    knots: Array,
    log_psi_gradient: Array,
    numbers: Array,
    sample: Array,
    arrays: DynamicsArrays,
) -> float:
    """Send the torque of `DensityTracking`, by one call, which has its cost; return the error."""
    nonlinear, rows, joint_index, begins = arrays[1], arrays[3], arrays[6], take_in(t, q, v, arrays)
    period, elapsed = numbers[_PERIOD], arrays[5][ELAPSED]
    advance_clock(t, begins, elapsed, numbers)
    rate = numbers[RATE]
    late = elapsed + numbers[_DELAY]
    u = (numbers[TIME] + rate * numbers[_DELAY]) / period
    write_sample(u, u + 0.5 * rate * elapsed / period, period, knots, sample)
    error, attract, largest, left, n = sample[_ERROR], rows[ATTRACT], 0.0, 1.0, nonlinear.size
    fastest, slowest = 0.0, -math.inf  # the latter of σ̈, for accelerations to keep their limits
    for i in range(n):
        off = rows[AHEAD_ANGLE, i] - sample[_POSITION, i]
        if joint_index[1, i]:
            off -= 2.0 * math.pi * math.floor(off / (2.0 * math.pi) + 0.5)
        error[i], largest = off, max(largest, abs(off))
        fastest = max(fastest, abs(rows[AHEAD_VELOCITY, i] - rate * sample[_VELOCITY, i]))
        limit = rows[EFFORT_LIMIT, i]
        room = max(limit - abs(nonlinear[i]), LEAST_SHARE * limit)
        left = min(left, 1.0 + _FREE_LOAD - abs(rows[DISTURBANCE, i]) / room)
    if not math.isnan(numbers[_KAPPA]):
        distance = torus_distance(error, joint_index, sample[_WEIGHTS], numbers[_KAPPA])
        # In the reciprocal gauge with α = 1, as `require_smooth_goal` has it.
        write_gauge_gradient(log_psi_gradient, distance, error, 1.0, log_psi, 0.0, -1.0, attract)
    weaker = min(1.0, _LARGEST_GAIN / (numbers[_VELOCITY_GAIN] * late))
    stiffness, damping = numbers[_POSITION_GAIN] * weaker**2, numbers[_VELOCITY_GAIN] * weaker
    for i in range(n):
        velocity, most = sample[_VELOCITY, i], damping * _RETURN_SHARE * rows[VELOCITY_LIMIT, i]
        pull = min(max(stiffness * attract[i], -most), most)
        attract[i] = pull - damping * (rows[AHEAD_VELOCITY, i] - rate * velocity)
        a = rate * rate * sample[_ACCELERATION, i]
        rows[BRAKE, i] = a + numbers[CHANGE] * velocity
        if velocity != 0.0:
            least = -(sample[_MOST, i] + math.copysign(a, a * velocity)) / abs(velocity)
            slowest = max(slowest, min(least, 0.0))
    if numbers[EMERGENCY] < 0.0:
        numbers[EMERGENCY] += elapsed
    elif fastest > _PUSHED or largest < _RETURNED:
        numbers[EMERGENCY] = fastest > _PUSHED
    for i in range(n if numbers[EMERGENCY] > 0.0 else 0):
        rows[RATE_LIMIT, i] = elapsed * rows[EMERGENCY_RATE, i]
    robust_torque(damping, elapsed, late, arrays)
    send(arrays)
    set_rate(largest, left, slowest, elapsed, numbers)
    return largest
