"""InverseDynamics: torque for wanted accelerations, of an arm that is not quite its model."""

import math

import numpy as np
import pinocchio as pin

from densarm.arms.arm import Arm
from densarm.arms.dynamics import Kinematics
from densarm.control.disturbance_observer import (
    AHEAD_ANGLE,
    AHEAD_VELOCITY,
    DISTURBANCE,
    FREE,
    FREE_INERTIA,
    N_ROWS,
    ActuationParameters,
    DisturbanceObserver,
)
from densarm.values.arrays import Array
from densarm.values.kernels import compiled, compiled_part

# Rows of the kernels' table, after those of the observer: accelerations, the torques that they
# need, limits, and the result.
BRAKE, ATTRACT, _BRAKE_TORQUE, _ATTRACT_TORQUE, _OFFSET = (N_ROWS + k for k in range(5))
_ACCELERATION_LIMIT, EFFORT_LIMIT, RATE_LIMIT = N_ROWS + 5, N_ROWS + 6, N_ROWS + 7
VELOCITY_LIMIT, INERTIA_FLOOR, _ZERO, TORQUE = N_ROWS + 8, N_ROWS + 9, N_ROWS + 10, N_ROWS + 11

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
        terms: M (upper triangle), H and gravity of the last update.
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
        self._period = self._elapsed = period
        self._updates_kinematics = kinematics is None
        self._kinematics = kinematics or Kinematics(arm)
        data = self._kinematics.data
        self.terms: tuple[Array, Array, Array] = (self._kinematics.mass_matrix, data.nle, data.g)
        self.rows: Array = np.zeros((N_ROWS + 12, arm.nv))
        self.rows[_ACCELERATION_LIMIT] = acceleration_limit
        self.rows[EFFORT_LIMIT] = arm.limits.effort
        self.rows[VELOCITY_LIMIT] = np.minimum(arm.limits.velocity, _FASTEST)
        self.rows[INERTIA_FLOOR] = actuation.inertia_floor
        self.rows[RATE_LIMIT] = math.inf
        self._limits_rate = bool(np.isfinite(arm.limits.torque_rate).any())
        self._observer = DisturbanceObserver(arm, period, actuation, self.rows)
        self.sent: Array = self._observer.sent

    def load(self) -> None:
        """Load, or compile, the kernels before a control loop."""
        rest = np.zeros(self._arm.nv)
        for t in (0.0, self._period):
            self.update(t, self._arm.configurations(rest), rest)
            self.send(self.torque(self.rows[_ZERO], self.rows[_ZERO]))
        self.update(math.nan, self._arm.configurations(rest), rest)

    def update(self, t: float, q: Array, v: Array) -> float:
        """Compute M, H and gravity at the state, q (nq,) and v (nv,), at a time [s].

        NaN for the time begins anew, and leaves rates unlimited. The time since the last update is
        returned [s], a period where that is not known.
        """
        kinematics = self._kinematics
        if self._updates_kinematics:
            kinematics.update(q)
        pin.nonLinearEffects(kinematics.model, kinematics.data, q, v)
        if begins := self._observer.begins(t):
            self._elapsed = self._period
        if self._limits_rate or begins:
            pin.computeGeneralizedGravity(kinematics.model, kinematics.data, q)
        self._elapsed = elapsed = self._observer.update(t, q, v, *self.terms) or self._elapsed
        if self._limits_rate:
            rate = self._arm.limits.torque_rate
            self.rows[RATE_LIMIT] = math.inf if math.isnan(t) else elapsed * rate
        return elapsed

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
        _limited_torque(self.terms[0], self.terms[1], self.rows)
        return np.array(self.rows[TORQUE])

    def send(self, tau: Array, *, is_emergency: bool = False) -> Array:
        """Return a torque (nv,) as far as its rate allows, and remember it as sent.

        In an emergency its rate does not matter.
        """
        self.rows[TORQUE] = tau
        if is_emergency:
            self.rows[RATE_LIMIT] = math.inf
        _send(self.terms[2], self.rows, self.sent)
        return np.array(self.rows[TORQUE])


@compiled
def _limited_torque(mass: Array, nonlinear: Array, rows: Array) -> None:
    gamma, beta = _shares(rows[_ZERO], rows[BRAKE], rows[ATTRACT], rows[_ACCELERATION_LIMIT])
    offset = rows[_OFFSET]
    for i in range(nonlinear.shape[0]):
        brake, attract = 0.0, 0.0
        for j in range(nonlinear.shape[0]):
            entry = mass[i, j] if i <= j else mass[j, i]  # crba fills the upper triangle
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
def _send(gravity: Array, rows: Array, sent: Array) -> None:
    send(gravity, rows, sent)


@compiled_part
def send(gravity: Array, rows: Array, sent: Array) -> None:
    """Limit the change of `TORQUE` beside gravity (nv,) to `RATE_LIMIT`, and keep it as sent.

    Where the rate binds, the change keeps its direction: an arm in which each joint changes by as
    much as it may would accelerate elsewhere than it is told.
    """
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
def robust_torque(
    mass: Array, nonlinear: Array, gain: float, elapsed: float, late: float, rows: Array
) -> None:
    r"""Write the torque of a reference's acceleration and of a feedback that no cap weakens.

    .. math::

        \tau = H + M a_{brake} + (M + D)\, \varphi(a_{attract}) - \hat d, \qquad
        \varphi_i(a) = \operatorname{sign}(a_i) \min\{|a_i|, \sqrt{2 J_i |a_i| / K_v}\}

    joint by joint within the torque limits. J_i is the jerk of which half the torque rate is
    capable: feedback that asks for more overshoots. D is smaller where it would let the lag of a
    torque make the loop unstable: K_v (1 + D M⁻¹) stays below a bound over the lag, on the
    diagonal, M⁻¹ being large where M is nearly singular.

    Args:
        mass: M, upper triangle (nv, nv).
        nonlinear: H (nv,).
        gain: K_v [1/s].
        elapsed: period of `RATE_LIMIT` [s].
        late: time from a state to the end of the torque that answers it [s].
        rows: `BRAKE`, the reference's acceleration, and `ATTRACT`, the feedback; `TORQUE` is
            written.
    """
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
            entry = mass[i, j] if i <= j else mass[j, i]
            tau += entry * (rows[BRAKE, j] + feedback[j])
        rows[TORQUE, i] = _clipped(tau, rows[EFFORT_LIMIT, i])


@compiled
def straight_torque(
    mass: Array, nonlinear: Array, gravity: Array, rows: Array, sent: Array
) -> None:
    """Write and send the torque of two accelerations.

    Args:
        mass: M, upper triangle (nv, nv).
        nonlinear: H (nv,).
        gravity: of it (nv,).
        rows: `BRAKE` and `ATTRACT`; `TORQUE` is written.
        sent: as `InverseDynamics.sent`.
    """
    n = nonlinear.shape[0]
    for i in range(n):
        tau = nonlinear[i] - rows[DISTURBANCE, i]
        for j in range(n):
            entry = mass[i, j] if i <= j else mass[j, i]
            tau += entry * (rows[BRAKE, j] + rows[ATTRACT, j])
        rows[TORQUE, i] = _clipped(tau, rows[EFFORT_LIMIT, i])
    send(gravity, rows, sent)


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
