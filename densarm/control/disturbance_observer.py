"""DisturbanceObserver: the torque that the model does not explain, and where a delay leads."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from densarm.arms.arm import Arm
from densarm.arms.dynamics import mass_entry
from densarm.values.arrays import Array
from densarm.values.checks import non_negative
from densarm.values.cholesky import factorise, solve_factorised
from densarm.values.documented import documented
from densarm.values.kernels import compiled_part

# Rows of the observer's table: the estimate now, and when a torque sent now acts.
ANGLE, VELOCITY, DISTURBANCE, AHEAD_ANGLE, AHEAD_VELOCITY = 0, 1, 2, 3, 4
FREE = 5  # the torque sent last, without the gravity then
_NONLINEAR, _GRAVITY, _INNOVATION, _ACCELERATION, _LARGEST, _JITTER = 6, 7, 8, 9, 10, 11
FREE_INERTIA = 12  # 1 / (M⁻¹)_ii, what a joint moves where the others give way
_MEASURED_ANGLE, _MEASURED_VELOCITY = 13, 14
N_ROWS = 15

ELAPSED, _BANDWIDTH, _DELAY, _TIME, _PERIOD = 0, 1, 2, 3, 4  # its numbers

_JITTER_SHARE = 0.0012  # of the torque limits, by which noise may move a disturbance in a period
_TRUSTED_SHARE = 0.9  # of the torque limits, that a disturbance may be taken to have
_LONGEST_STEP = 0.1  # [s] between two calls, after which the observer begins anew
_MOST_PERIODS = 1000  # of a delay


@documented
@dataclass(frozen=True)
class ActuationParameters:
    """How torque reaches the joints, and how far the model of the arm is to be trusted.

    Raises:
        InvalidValueError: a negative value.
    """

    delay: float = 0.0
    """Time until a torque that is sent acts, to the nearest period [s]."""
    bandwidth: float = 160.0
    """Poles of the disturbance observer [1/s]; lower where torque is late, or noise would make it
    shake. Zero for none."""
    velocity_noise: float = 0.01
    """Standard deviation of a measured velocity [rad/s or m/s]."""
    inertia_floor: float = 0.03
    """D, inertia that feedback reckons with beside the model's, which leaves out gears and rotors
    [kg·m² or kg]; less where torque is late."""

    def __post_init__(self) -> None:
        for name in ("delay", "bandwidth", "velocity_noise", "inertia_floor"):
            non_negative(name, getattr(self, name))


class DisturbanceObserver:
    r"""Estimates the state and the torque d that acts beside the one that was sent.

    .. math::

        \hat v^- = \hat v + \Delta t\, M^{-1} (\tau + \hat d - H), \quad r = v - \hat v^-, \quad
        \hat v = \hat v^- + (1 - \lambda^2)\, r, \quad
        \hat d \mathrel{+}= M \frac{(1 - \lambda)^2}{\Delta t} r

    τ is what acted since the last call, which a delay makes an older one. λ is a diagonal matrix:
    exp(-L Δt), so that both poles are at L, the bandwidth; or larger, so that the noise of a
    measured velocity moves the disturbance of its joint by no more than a thousandth of the torque
    limit or so in a period. The state when a torque sent now acts is predicted by those
    on their way. It begins anew where time runs back or jumps.

    Args:
        arm: the arm.
        period: time between two calls, if they come in time [s].
        parameters: the delay and L.

    Attributes:
        rows: table of the estimates (N, nv), of which the first `N_ROWS` and the last nv are the
            observer's.
        sent: torques that were sent, the last row for the one to come (N, nv) [N·m or N].
        numbers: what `observe` keeps.

    Source: J. Han, From PID to active disturbance rejection control, IEEE TIE 2009, section IV, in
        discrete time as by G. Franklin et al., Digital Control of Dynamic Systems, ch. 8.
    """

    def __init__(
        self, arm: Arm, period: float, parameters: ActuationParameters, rows: Array
    ) -> None:
        late = min(math.ceil(parameters.delay / period), _MOST_PERIODS)
        self.parameters = parameters
        self.rows = rows
        self.rows[_LARGEST] = _TRUSTED_SHARE * arm.limits.effort
        with np.errstate(divide="ignore"):
            noise = np.float64(parameters.velocity_noise)
            self.rows[_JITTER] = _JITTER_SHARE * arm.limits.effort / noise
        self.sent: Array = np.zeros((late + 2, arm.nv))
        self.numbers: Array = np.array(
            [period, parameters.bandwidth, parameters.delay, math.nan, period]
        )
        self._expected: Array | None = None  # beside each torque that was sent

    def begins(self, t: float) -> bool:
        """Return whether it begins anew at a time [s]."""
        return not 0.0 <= t - self.numbers[_TIME] <= _LONGEST_STEP

    def expect(self, tau: Array) -> None:
        """Reckon with a torque (nv,) that acts while the one sent last does [N·m or N]."""
        if self._expected is None:
            self._expected = np.zeros_like(self.sent)
        self._expected[-1] = tau

    def reckon(self, t: float) -> None:
        """Add what was expected to the torque that has acted, before `observe` at a time [s]."""
        if (expected := self._expected) is None or t == self.numbers[_TIME]:
            return
        if self.begins(t):
            expected[:] = 0.0
            return
        elapsed = t - self.numbers[_TIME]
        late = min(int(self.parameters.delay / elapsed + 0.5), len(self.sent) - 1)
        self.rows[_NONLINEAR] -= expected[-1 - late]
        expected[:-1] = expected[1:]

    def set_bandwidth(self, bandwidth: float) -> None:
        """Use another L [1/s]."""
        self.numbers[_BANDWIDTH] = bandwidth

    def take_over(self, other: "DisturbanceObserver", t: float) -> None:
        """Go on from another's estimates and torques, of the same arm, as if known at t [s]."""
        self.numbers[_TIME] = t
        self.rows[:_LARGEST] = other.rows[:_LARGEST]
        n = min(len(self.sent), len(other.sent))
        self.sent[-n:] = other.sent[-n:]

    def move_to(self, angles: Array, v: Array) -> None:
        """Take the arm to be at joint positions (nv,) with velocities (nv,), all else as it is."""
        self.rows[ANGLE] = self.rows[AHEAD_ANGLE] = angles
        self.rows[VELOCITY] = self.rows[AHEAD_VELOCITY] = v


@compiled_part
def observe(  # noqa: C901  # one kernel, since every call has its cost
    t: float,
    q: Array,
    v: Array,
    joint_index: NDArray[np.int64],
    terms: tuple[Array, Array, Array],
    rows: Array,
    sent: Array,
    numbers: Array,
) -> bool:
    """Take a measured state in; return whether the observer begins anew.

    No disturbance is known then, and the arm is held.

    Args:
        t: when [s]; NaN to begin anew.
        q: configuration (nq,).
        v: velocity (nv,).
        joint_index: `Arm.joint_index` (2, nv).
        terms: M there, upper triangle (nv, nv), H (nv,) and gravity (nv,) [N·m or N].
        rows: of the observer, as are all that follow; the last nv are a workspace.
        sent: as `DisturbanceObserver.sent`.
        numbers: with the time since the last state, a period where that is not known, which is
            written [s].
    """
    mass, nonlinear, gravity = terms
    factor = rows[rows.shape[0] - v.size :]
    dt, delay, size, nv = t - numbers[_TIME], numbers[_DELAY], sent.shape[0], v.size
    begins = not (dt >= 0.0 and dt <= _LONGEST_STEP)
    numbers[_TIME] = t
    if begins:
        numbers[ELAPSED] = numbers[_PERIOD]
    elif dt > 0.0:
        numbers[ELAPSED] = dt
    angle, velocity, disturbance = rows[ANGLE], rows[VELOCITY], rows[DISTURBANCE]
    acceleration, innovation = rows[_ACCELERATION], rows[_INNOVATION]
    factorise(mass, factor)
    _write_free_inertia(factor, acceleration, rows[FREE_INERTIA])
    is_new = begins or dt != 0.0
    for i in range(nv):
        position = _position(q, joint_index, i)
        is_new |= position != rows[_MEASURED_ANGLE, i] or v[i] != rows[_MEASURED_VELOCITY, i]
        rows[_MEASURED_ANGLE, i], rows[_MEASURED_VELOCITY, i] = position, v[i]
    if not is_new:
        return begins
    if begins or dt == 0.0:
        for i in range(nv):
            angle[i], velocity[i] = rows[_MEASURED_ANGLE, i], v[i]
            rows[AHEAD_ANGLE, i], rows[AHEAD_VELOCITY, i] = angle[i], velocity[i]
            if begins:
                rows[_NONLINEAR, i], disturbance[i] = nonlinear[i], 0.0
                for k in range(size):
                    sent[k, i] = gravity[i]
                rows[_GRAVITY, i], rows[FREE, i] = gravity[i], 0.0
        return begins
    acting = size - 1 - min(int(delay / dt + 0.5), size - 1)
    pole = math.exp(-min(numbers[_BANDWIDTH], 1.0 / (dt + delay)) * dt)
    for i in range(nv):
        acceleration[i] = sent[acting, i] + disturbance[i] - rows[_NONLINEAR, i]
    solve_factorised(factor, acceleration)
    for i in range(nv):
        predicted = velocity[i] + dt * acceleration[i]
        learn = min(1.0 - pole, math.sqrt(rows[_JITTER, i] * dt / mass[i, i]))
        keep = 1.0 if numbers[_BANDWIDTH] == 0.0 else learn * (2.0 - learn)
        velocity[i] = predicted + keep * (v[i] - predicted)
        innovation[i] = learn * learn / dt * (v[i] - predicted)
        angle[i] += dt * predicted
        off = rows[_MEASURED_ANGLE, i] - angle[i]
        if joint_index[1, i]:
            off -= 2.0 * math.pi * math.floor(off / (2.0 * math.pi) + 0.5)
        angle[i] += keep * off
    for i in range(nv):
        momentum = 0.0
        for j in range(nv):
            momentum += mass_entry(mass, i, j) * innovation[j]
        most, found = rows[_LARGEST, i], disturbance[i] + momentum
        disturbance[i] = most if found > most else -most if found < -most else found
        rows[AHEAD_ANGLE, i], rows[AHEAD_VELOCITY, i] = angle[i], velocity[i]
        rows[_NONLINEAR, i] = nonlinear[i]
        rows[FREE, i], rows[_GRAVITY, i] = sent[size - 1, i] - rows[_GRAVITY, i], gravity[i]
    for k in range(acting + 1, size):
        for i in range(nv):
            acceleration[i] = sent[k, i] + disturbance[i] - nonlinear[i]
        solve_factorised(factor, acceleration)
        for i in range(nv):
            rows[AHEAD_ANGLE, i] += dt * (rows[AHEAD_VELOCITY, i] + 0.5 * dt * acceleration[i])
            rows[AHEAD_VELOCITY, i] += dt * acceleration[i]
    for k in range(size - 1):
        for i in range(nv):
            sent[k, i] = sent[k + 1, i]
    return begins


@compiled_part
def _position(q: Array, joint_index: NDArray[np.int64], i: int) -> float:
    k = joint_index[0, i]
    return math.atan2(q[k + 1], q[k]) if joint_index[1, i] else q[k]


@compiled_part
def _write_free_inertia(factor: Array, column: Array, out: Array) -> None:
    """Write 1 / (M⁻¹)_ii (nv,), by the columns of L⁻¹."""
    n = out.shape[0]
    for i in range(n):
        square = 0.0
        for j in range(i, n):
            entry = 1.0 if j == i else 0.0
            for k in range(i, j):
                entry -= factor[j, k] * column[k]
            column[j] = entry / factor[j, j]
            square += column[j] * column[j]
        out[i] = 1.0 / square
