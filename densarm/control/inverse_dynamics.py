"""InverseDynamics: torque for wanted accelerations, of an arm that is not quite its model."""

import math

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from densarm.arms.arm import Arm
from densarm.arms.dynamics import Kinematics, mass_entry
from densarm.control.disturbance_observer import (
    AHEAD_ANGLE,
    AHEAD_VELOCITY,
    DISTURBANCE,
    ELAPSED,
    FREE,
    FREE_INERTIA,
    N_ROWS,
    ActuationParameters,
    DisturbanceObserver,
    observe,
)
from densarm.values.arrays import Array
from densarm.values.kernels import compiled, compiled_part

# Rows of the kernels' table, after those of the observer: accelerations, the torques that they
# need, limits, and the result.
BRAKE, ATTRACT, _BRAKE_TORQUE, _ATTRACT_TORQUE, _OFFSET = (N_ROWS + k for k in range(5))
_ACCELERATION_LIMIT, EFFORT_LIMIT, RATE_LIMIT = N_ROWS + 5, N_ROWS + 6, N_ROWS + 7
VELOCITY_LIMIT, INERTIA_FLOOR, _ZERO, TORQUE = N_ROWS + 8, N_ROWS + 9, N_ROWS + 10, N_ROWS + 11
TORQUE_RATE, EMERGENCY_RATE = N_ROWS + 12, N_ROWS + 13

DynamicsArrays = tuple[Array, Array, Array, Array, Array, Array, NDArray[np.int64]]
"""M (upper triangle), H, gravity, rows, sent torques, numbers, and joint index: what kernels of
inverse dynamics share."""

_FASTEST = 1e3  # [rad/s or m/s], where joints have no limit
LARGEST_LAG = 0.6
"""Of K_v (M + D) / M times the lag."""

_FEEDBACK_RATE = 0.5  # of the torque rate, that feedback reckons with

TRUSTED = ActuationParameters(bandwidth=0.0, inertia_floor=0.0)
"""An arm that is its model, and whose torque acts at once."""


class InverseDynamics:
    r"""Turns a braking and an attracting part into torque, so that saturation spares braking.

    .. math::

        \tau = H(q, \dot q) + M(q) (\gamma\, a_{brake} + \beta\, a_{attract}) - \hat d

    β in [0, 1] is the largest for which acceleration and torque limits hold with γ = 1; where
    there is none, β = 0 and γ is the largest that holds them, which leaves a brake straight.
    d̂ is what the `DisturbanceObserver` finds that the model does not explain. What is sent then
    differs from what was sent before, both without gravity, by the torque rate limit at most.

    Args:
        arm: its dynamics and torque limits.
        acceleration_limit: on the sum of both parts (nv,) [rad/s² or m/s²]; may be infinite.
        kinematics: M, which its owner updates to q before each `update`; None for its own.
        period: time between two torques [s].
        actuation: delay and observer.

    Attributes:
        arrays: M, H and gravity of the last update, and all that kernels write.
        rows: table of the kernels (N, nv).
        sent: torques of the last periods, the last one last (N, nv) [N·m or N].

    Raises:
        RobotDescriptionError: the arm has links without a mass.

    Source: [ZNV] eq. 16-17; saturation [ZNV] eq. 13-14, applied to the attraction alone.
    """

    def __init__(
        self,
        arm: Arm,
        acceleration_limit: Array,
        kinematics: Kinematics | None = None,
        period: float = 0.001,
        actuation: ActuationParameters = TRUSTED,
    ) -> None:
        arm.require_masses("torque")
        self._arm = arm
        self._period = period
        self._updates_kinematics = kinematics is None
        self._kinematics = kinematics or Kinematics(arm)
        self.rows: Array = np.zeros((N_ROWS + 14 + arm.nv, arm.nv))
        self.rows[_ACCELERATION_LIMIT] = acceleration_limit
        self.rows[EFFORT_LIMIT] = arm.limits.effort
        self.rows[VELOCITY_LIMIT] = np.minimum(arm.limits.velocity, _FASTEST)
        self.rows[INERTIA_FLOOR] = actuation.inertia_floor
        self.rows[TORQUE_RATE], self.rows[RATE_LIMIT] = arm.limits.torque_rate, math.inf
        self.rows[EMERGENCY_RATE] = arm.limits.emergency_torque_rate
        self._observer = observer = DisturbanceObserver(arm, period, actuation, self.rows)
        self.sent: Array = observer.sent
        mass, data = self._kinematics.mass_matrix, self._kinematics.data
        own = self.rows, self.sent, observer.numbers
        self.arrays: DynamicsArrays = (mass, data.nle, data.g, *own, arm.joint_index)

    def load(self) -> None:
        """Load, or compile, the kernels before a control loop."""
        rest = np.zeros(self._arm.nv)
        for t in (0.0, self._period):
            self.update(t, self._arm.configurations(rest), rest)
            self.send(self.torque(self.rows[_ZERO], self.rows[_ZERO]))
        self.update(math.nan, self._arm.configurations(rest), rest)

    def update(self, t: float, q: Array, v: Array) -> float:
        """Compute M, H and gravity at the state, q (nq,) and v (nv,), at a time [s].

        NaN for the time begins anew, with rates as in an emergency. Returned is the time since the
        last update [s], a period where that is not known.
        """
        if self._updates_kinematics:
            self._kinematics.update(q)
        self.compute_terms(q, v)
        self._observer.reckon(t)
        _take_in(float(t), q, v, self.arrays)  # another number would have it compiled again
        return self.elapsed

    def compute_terms(self, q: Array, v: Array) -> None:
        """Compute H and gravity alone, for a kernel that goes on by `take_in`."""
        model, data = self._kinematics.model, self._kinematics.data
        pin.nonLinearEffects(model, data, q, v)
        pin.computeGeneralizedGravity(model, data, q)

    @property
    def elapsed(self) -> float:
        """The time between the last two updates, or a period [s]."""
        return float(self._observer.numbers[ELAPSED])

    def expect(self, tau: Array) -> None:
        """Reckon with a torque (nv,), no disturbance, that acts while the one sent last does."""
        self._observer.expect(tau)

    def begins(self, t: float) -> bool:
        """Return whether an update at a time [s] knows of none before."""
        return self._observer.begins(t)

    def take_over(self, other: "InverseDynamics", t: float) -> None:
        """Go on from another's disturbance and torques, of the same arm, as if known at t [s]."""
        self._observer.take_over(other._observer, t)

    def move_to(self, q: Array, v: Array, disturbance: Array | None = None) -> None:
        """Take the arm to be at q (nq,) with v (nv,), under another disturbance (nv,) if given."""
        self._observer.move_to(self._arm.angles(q), v)
        if disturbance is not None:
            self.rows[DISTURBANCE] = disturbance

    def set_bandwidth(self, bandwidth: float) -> None:
        """Find disturbances with another bandwidth [1/s], as that of `ActuationParameters`."""
        self._observer.set_bandwidth(bandwidth)

    @property
    def velocity(self) -> Array:
        """The velocity when a torque sent now acts (nv,) [rad/s or m/s]."""
        return np.array(self.rows[AHEAD_VELOCITY])

    @property
    def angles(self) -> Array:
        """The joint positions then (nv,) [rad or m]."""
        return np.array(self.rows[AHEAD_ANGLE])

    @property
    def disturbance(self) -> Array:
        """The torque d̂ that acts beside that which is sent (nv,) [N·m or N]."""
        return np.array(self.rows[DISTURBANCE])

    def mass_matrix(self) -> Array:
        """Return M (nv, nv) at the updated state."""
        upper = np.triu(self._kinematics.mass_matrix)
        return np.asarray(upper + np.triu(upper, 1).T)

    def brake_torque(self, v: Array, duration: float, shortest: float) -> Array:
        """Return the torque (nv,) that stops from v (nv,) along a straight line, in a duration [s].

        It counts as `shortest` where it is shorter, or infinite: as hard as the limits allow.
        """
        longest = max(duration, shortest) if math.isfinite(duration) else shortest
        return self.torque(-v / longest, self.rows[_ZERO])

    def torque(self, brake: Array, attract: Array) -> Array:
        """Return torque (nv,) for accelerations (nv,) [rad/s²] at the updated state."""
        self.rows[BRAKE], self.rows[ATTRACT] = brake, attract
        _limited_torque(self.arrays)
        return np.array(self.rows[TORQUE])

    def send(self, tau: Array, *, is_emergency: bool = False) -> Array:
        """Return a torque (nv,) as far as its rate allows, and remember it as sent.

        In an emergency its rate does not matter, but to arms on which the limit is hard.
        """
        self.rows[TORQUE] = tau
        if is_emergency:
            self.rows[RATE_LIMIT] = self.elapsed * self.rows[EMERGENCY_RATE]
        _send(self.arrays)
        return np.array(self.rows[TORQUE])


@compiled
def _take_in(t: float, q: Array, v: Array, arrays: DynamicsArrays) -> None:
    take_in(t, q, v, arrays)


@compiled_part
def take_in(t: float, q: Array, v: Array, arrays: DynamicsArrays) -> bool:
    """Act as `InverseDynamics.update`, terms being known; return whether all begins anew."""
    mass, nonlinear, gravity, rows, sent, numbers, joint_index = arrays
    terms = mass, nonlinear, gravity
    begins = observe(t, q, v, joint_index, terms, rows, sent, numbers)
    for i in range(v.size):
        kind = EMERGENCY_RATE if math.isnan(t) else TORQUE_RATE
        rows[RATE_LIMIT, i] = numbers[ELAPSED] * rows[kind, i]
    return begins


@compiled
def _limited_torque(arrays: DynamicsArrays) -> None:
    mass, nonlinear, rows = arrays[0], arrays[1], arrays[3]
    gamma, beta = _shares(rows[_ZERO], rows[BRAKE], rows[ATTRACT], rows[_ACCELERATION_LIMIT])
    offset = rows[_OFFSET]
    for i in range(nonlinear.shape[0]):
        brake, attract = 0.0, 0.0
        for j in range(nonlinear.shape[0]):
            entry = mass_entry(mass, i, j)
            brake += entry * gamma * rows[BRAKE, j]
            attract += entry * beta * rows[ATTRACT, j]
        rows[_BRAKE_TORQUE, i] = brake
        rows[_ATTRACT_TORQUE, i] = attract
        offset[i] = nonlinear[i] - rows[DISTURBANCE, i]
    gamma, beta = _shares(offset, rows[_BRAKE_TORQUE], rows[_ATTRACT_TORQUE], rows[EFFORT_LIMIT])
    for i in range(nonlinear.shape[0]):
        tau = offset[i] + gamma * rows[_BRAKE_TORQUE, i] + beta * rows[_ATTRACT_TORQUE, i]
        rows[TORQUE, i] = _clipped(tau, rows[EFFORT_LIMIT, i])


@compiled
def _send(arrays: DynamicsArrays) -> None:
    send(arrays)


@compiled_part
def send(arrays: DynamicsArrays) -> None:
    """Limit the change of `TORQUE` beside gravity (nv,) to `RATE_LIMIT`, and keep it as sent.

    Where the rate binds, the change keeps its direction: an arm in which each joint changes by as
    much as it may would accelerate elsewhere than it is told.
    """
    gravity, rows, sent = arrays[2], arrays[3], arrays[4]
    share = 1.0
    for i in range(gravity.shape[0]):
        change = abs(rows[TORQUE, i] - rows[FREE, i] - gravity[i])
        if change * share > rows[RATE_LIMIT, i]:
            share = rows[RATE_LIMIT, i] / change
    for i in range(gravity.shape[0]):
        tau, before = rows[TORQUE, i], rows[FREE, i] + gravity[i]
        if share < 1.0:
            tau = before + share * (tau - before)
        tau = _clipped(tau, rows[EFFORT_LIMIT, i])
        rows[TORQUE, i] = tau
        sent[-1, i] = tau


@compiled_part
def robust_torque(gain: float, elapsed: float, late: float, arrays: DynamicsArrays) -> None:
    r"""Write the torque of a reference's acceleration and of a feedback that no cap weakens.

    .. math::

        \tau = H + M a_{brake} + (M + D)\, \varphi(a_{attract}) - \hat d, \qquad
        \varphi_i(a) = \operatorname{sign}(a_i) \min\{|a_i|, \sqrt{2 J_i |a_i| / K_v}\}

    joint by joint within the torque limits. J_i is the jerk of which half the torque rate is
    capable: feedback that asks for more overshoots. D is smaller where it would let the lag of a
    torque make the loop unstable: K_v (1 + D M⁻¹) stays below a bound over the lag, on the
    diagonal, M⁻¹ being large where M is nearly singular.

    Args:
        gain: K_v [1/s].
        elapsed: period of `RATE_LIMIT` [s].
        late: time from a state to the end of the torque that answers it [s].
        arrays: of their rows `BRAKE`, the reference's acceleration, and `ATTRACT`, the feedback,
            are read; `TORQUE` is written.
    """
    mass, nonlinear, rows = arrays[0], arrays[1], arrays[3]
    n = nonlinear.shape[0]
    feedback, bound = rows[_ATTRACT_TORQUE], LARGEST_LAG / (gain * late) - 1.0
    for i in range(n):
        inertia = mass[i, i]
        floor = min(rows[INERTIA_FLOOR, i], max(bound, 0.0) * rows[FREE_INERTIA, i])
        a = rows[ATTRACT, i]
        jerk = _FEEDBACK_RATE * rows[RATE_LIMIT, i] / (elapsed * (inertia + floor))
        feedback[i] = _clipped(a, math.sqrt(2.0 * jerk * abs(a) / gain))
        rows[_BRAKE_TORQUE, i] = floor * feedback[i]
    for i in range(n):
        tau = nonlinear[i] - rows[DISTURBANCE, i] + rows[_BRAKE_TORQUE, i]
        for j in range(n):
            entry = mass_entry(mass, i, j)
            tau += entry * (rows[BRAKE, j] + feedback[j])
        rows[TORQUE, i] = _clipped(tau, rows[EFFORT_LIMIT, i])


@compiled_part
def _clipped(x: float, most: float) -> float:
    return most if x > most else -most if x < -most else x


@compiled_part
def _shares(offset: Array, brake: Array, attract: Array, limit: Array) -> tuple[float, float]:
    """Return (γ, β) that keep |offset + γ brake + β attract| ≤ limit, as the class says."""
    low, high, share = 0.0, 1.0, 1.0
    for i in range(limit.shape[0]):
        base, most = offset[i] + brake[i], math.copysign(limit[i], attract[i])
        # Without attraction these are infinite, of a sign that tells whether the limit holds.
        least, largest = (-most - base) / attract[i], (most - base) / attract[i]
        if least > low:
            low = least
        if largest < high:
            high = largest
        if brake[i] != 0.0:
            allowed = (math.copysign(limit[i], brake[i]) - offset[i]) / brake[i]
            if allowed < share:
                share = allowed
    if low <= high:
        return 1.0, high
    return (share if share > 0.0 else 0.0), 0.0
