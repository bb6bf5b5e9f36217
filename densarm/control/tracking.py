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
from densarm.control.sensing import require_smooth_goal, sensed_off
from densarm.density.goal_distance import GoalDistance, TorusDistance, torus_distance
from densarm.density.navigation_density import (
    DensityParameters,
    NavigationDensity,
    write_gauge_gradient,
)
from densarm.density.unsafe_sets import SensingParameters, UnsafeSet
from densarm.planning.motion import Motion, write_sample
from densarm.values.arrays import Array
from densarm.values.kernels import compiled, compiled_part, entry_point
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

    The reference waits for an arm that is held up: its time σ runs by

    .. math::

        \dddot\sigma = \omega^2 (r - \dot\sigma) - 2 \omega \ddot\sigma, \quad
        r = \frac{1}{1 + (|e| / \epsilon)^2} \sqrt{\min_i \Big( 1 - \frac{|\hat d_i|}
        {\tau^{max}_i - |H_i|} \Big)}

    both beyond a dead zone: unknown torque leaves less for accelerations, which go with σ̇².

    Where obstacles move, the velocity of the reference and of a return to it is led by `Evasion`,
    and a servo follows that inside the acceleration limits, until the arm is back.

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
        motion: as given.
        goal: where it ends (nq,).
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
        self.motion = motion
        self.goal: Array = arm.configurations(motion.position[-1])
        self.tracking_error: float = 0.0
        self._is_evading = False
        self._arm = arm
        self._kinematics = Kinematics(arm)
        distance = goal_distance or TorusDistance(arm)
        pairs, joints = sensed_off(world, motion, sensing, self._kinematics)
        unsafe: list[UnsafeSet] = [pairs, joints, *unsafe_sets]
        self._density = NavigationDensity(arm, self.goal, unsafe, distance, density)
        self._gains = gains
        self._numbers = np.full(_N_NUMBERS + _EMERGENCY, math.nan)
        if arm.links_without_mass:
            self.velocity(0.0, self.goal, np.zeros(arm.nv))
            return
        unlimited = np.full(arm.nv, math.inf)
        self._evasion = evasion(world, pairs.pairs, motion.margin)
        self._dynamics = InverseDynamics(arm, unlimited, self._kinematics, motion.period, actuation)
        kappa = distance.kappa if isinstance(distance, TorusDistance) else math.nan
        self._has_own_distance = math.isnan(kappa)
        constants = motion.period, actuation.delay, kappa, gains.position, gains.velocity
        self._numbers[_PERIOD:_N_NUMBERS] = *constants, 1.0
        self._sample = np.zeros((6, arm.nv))
        own = self._numbers, self._sample, motion.knots, self._dynamics.arrays
        self._arrays, still = (self._density.log_psi_gradient, *own), np.zeros(arm.nv)
        self._sample[_WEIGHTS] = getattr(distance, "weights", 1.0)
        self._sample[_MOST] = _PAUSE_SHARE * arm.limits.acceleration
        self._kernel = entry_point(_tracking_torque, 0.0, self.goal, still, 0.0, *self._arrays)
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
        if self._has_own_distance:  # asked twice, since the first tells the reference's time
            self._act(float(t), q, v)
            ahead = self.reference_time + self._numbers[_DELAY] * self._numbers[_RATE]
            self._dynamics.rows[ATTRACT] = self._attraction(q, self.motion.sample(ahead).position)
        else:
            self._density.update_psi(q)
        self._act(float(t), q, v)
        if self._evasion.is_needed():
            self._evade(q)
        tau: Array = self._dynamics.rows[TORQUE].copy()
        return tau

    def _act(self, t: float, q: Array, v: Array) -> None:
        """Send the torque at a state, of which all terms and Ψ are known."""
        self.tracking_error = self._kernel(t, q, v, self._density.log_psi, *self._arrays)

    def _evade(self, q: Array) -> None:
        """Replace the torque by one that gives way, and that returns to the reference.

        It returns no faster than it can stop, and hands over where little is left to return.
        """
        numbers, rows = self._numbers, self._dynamics.rows
        wanted, limits = np.empty(self._arm.nv), self._arm.limits
        is_off = _return(numbers, rows, self._sample, self._gains.rate, limits.acceleration, wanted)
        is_off |= self.is_moving and abs(1.0 - numbers[_RATE]) > _HANDED_OVER[1]
        wanted, gives_way = self._evasion.velocity(q, rows[AHEAD_VELOCITY], wanted)
        self._is_evading = gives_way or (self._is_evading and bool(is_off))
        if self._is_evading:
            numbers[_EMERGENCY] = 0.0
            rows[RATE_LIMIT] = self._dynamics.elapsed * rows[TORQUE_RATE]
            ahead = None if gives_way else rows[BRAKE]
            self._evasion.send_torque(self._dynamics, wanted, ahead)

    @property
    def is_evading(self) -> bool:
        """Whether an obstacle moves, and the arm gave way at the last call, or still returns."""
        return self._is_evading and self._evasion.sees_motion

    def pause(self) -> None:
        """Let the reference's clock come to rest, so that the arm rests on the motion."""
        self._numbers[WANTED_RATE] = 0.0

    def resume(self, q: ArrayLike | None = None, within: float | Array = math.inf) -> bool:
        """Let the reference go on after a pause, or after the arm was stopped by another.

        Args:
            q: configuration (nq,) where the arm rests, from which nearest place on the motion the
                reference is to go on, at any time of the next call; None for where it paused.
            within: how far off that place the joints may be (nv,) [rad or m].

        Returns:
            Whether it goes on: it does not from farther off.
        """
        if q is not None:
            wanted = self._arm.configurations(self.motion.position)
            off = np.abs(self._arm.difference(wanted, np.asarray(q, np.float64)))
            nearest = int((off / np.where(np.isinf(within), 1.0, within)).max(axis=1).argmin())
            if not (off[nearest] <= within).all():
                return False
            self._numbers[_GOES_ON_FROM] = nearest * self.motion.period
        self._numbers[WANTED_RATE] = 1.0
        return True

    @property
    def is_paused(self) -> bool:
        """Whether the reference was made to pause, and rests."""
        return self._numbers[WANTED_RATE] == 0.0 and bool(self._numbers[_RATE] < _PAUSED)

    @property
    def dynamics(self) -> InverseDynamics:
        """What is known of disturbance and torques."""
        return self._dynamics

    @property
    def reference_time(self) -> float:
        """The reference's own time σ at the last call [s]: it waits where the arm is held up."""
        return float(self._numbers[_TIME])

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
        motion, limits, self._numbers[_TIME] = self.motion, self._arm.limits, t
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

# Numbers of the kernel: the reference's time σ, how far it is behind, and its derivatives, which
# are kept as they were at the last time asked for.
_TIME, _LAG, _RATE, _CHANGE, _EMERGENCY, _LAST, _GOES_ON_FROM = 0, 1, 2, 3, 4, 5, 6
_PERIOD, _DELAY, _KAPPA, _POSITION_GAIN, _VELOCITY_GAIN, WANTED_RATE = 7, 8, 9, 10, 11, 12
_N_NUMBERS, _KEPT = 13, 12  # how many, and how far behind the clock its copy is

_EVADED_SHARE = 0.5  # of twice the acceleration limits, with which a return to the reference stops
_HANDED_OVER = 0.001, 0.02  # of error, and of velocity or rate, that tracking takes over from
_CLOCK_RATE = 20.0  # ω [1/s]
_PAUSE_SHARE = 0.95  # of the acceleration limits, that pausing takes with the motion
_PAUSED = 0.01  # σ̇ below which the reference counts as at rest
_WAITING_ERROR, _FREE_ERROR = 0.03, 0.005  # ε, and what the reference does not wait for [rad or m]
_FREE_LOAD = 0.05  # of the torque left, which unknown torque may take without slowing the reference
_LEAST_SHARE = 0.1  # of torque that counts as left
_RETURN_SHARE = 0.25  # of the velocity limits, at which an arm returns from a push
_PUSHED, _RETURNED = 0.5, 0.05  # velocity off by a push [rad/s or m/s], error after it [rad or m]
_LARGEST_GAIN = 0.4  # of K_v times the time that a torque is late


@compiled
def _return(
    numbers: Array, rows: Array, sample: Array, gain: float, most: Array, wanted: Array
) -> bool:
    """Write the velocity back to the reference; return whether the arm is off it."""
    rate, is_off = numbers[_RATE], False
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
    log_psi_gradient: Array,
    numbers: Array,
    sample: Array,
    knots: Array,
    arrays: DynamicsArrays,
) -> float:
    """Write and send the torque of `DensityTracking`; return the tracking error.

    It is one kernel, of few arguments, since every call and every argument has its cost.
    """
    nonlinear, rows, joint_index, begins = arrays[1], arrays[3], arrays[6], take_in(t, q, v, arrays)
    period, elapsed = numbers[_PERIOD], arrays[5][ELAPSED]
    _advance_clock(t, begins, elapsed, numbers)
    rate = numbers[_RATE]
    late = elapsed + numbers[_DELAY]
    u = (numbers[_TIME] + rate * numbers[_DELAY]) / period
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
        room = max(limit - abs(nonlinear[i]), _LEAST_SHARE * limit)
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
        rows[BRAKE, i] = a + numbers[_CHANGE] * velocity
        if velocity != 0.0:
            least = -(sample[_MOST, i] + math.copysign(a, a * velocity)) / abs(velocity)
            slowest = max(slowest, min(least, 0.0))
    if fastest > _PUSHED or largest < _RETURNED:
        numbers[_EMERGENCY] = fastest > _PUSHED
    if numbers[_EMERGENCY] > 0.0:
        for i in range(n):
            rows[RATE_LIMIT, i] = math.inf
    robust_torque(damping, elapsed, late, arrays)
    send(arrays)
    waiting = max(largest - _FREE_ERROR, 0.0) / _WAITING_ERROR
    wanted = numbers[WANTED_RATE] * math.sqrt(max(left, _LEAST_SHARE)) / (1.0 + waiting * waiting)
    step = min(_CLOCK_RATE * elapsed, 1.0)
    change = numbers[_CHANGE] + step * (_CLOCK_RATE * (wanted - rate) - 2.0 * numbers[_CHANGE])
    if wanted == 0.0:
        change = max(change, slowest)
    numbers[_CHANGE], numbers[_RATE] = change, max(rate + elapsed * change, 0.0)
    return largest


@compiled_part
def _advance_clock(t: float, begins: bool, elapsed: float, numbers: Array) -> None:
    """Let the reference's time go on to t, by the rate that the last call found."""
    if not math.isnan(numbers[_GOES_ON_FROM]):
        numbers[_LAG], numbers[_RATE] = t - numbers[_GOES_ON_FROM], 0.0
        numbers[_CHANGE] = numbers[_EMERGENCY] = 0.0
        numbers[_GOES_ON_FROM] = math.nan
    elif begins or math.isnan(numbers[_TIME]):
        numbers[_LAG] = numbers[_CHANGE] = numbers[_EMERGENCY] = 0.0
        numbers[_RATE] = 1.0
    elif t == numbers[_LAST]:  # asked again, which moves no clock
        for k in range(_LAG, _LAST):
            numbers[k] = numbers[k + _KEPT]
    else:
        numbers[_LAG] += (1.0 - numbers[_RATE]) * elapsed
    for k in range(_LAG, _LAST):
        numbers[k + _KEPT] = numbers[k]
    numbers[_LAST], numbers[_TIME] = t, t - numbers[_LAG]
