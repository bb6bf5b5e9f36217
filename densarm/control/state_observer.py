"""StateObserver: where the dynamics say that an arm is."""

import math
from collections import deque
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from densarm.arms.arm import Arm
from densarm.arms.joint_space import joint_error, write_configuration
from densarm.control.controller import checked_state, is_plausible
from densarm.values.arrays import Array
from densarm.values.checks import positive
from densarm.values.documented import documented
from densarm.values.kernels import compiled

FARTHEST = 1e6
"""Beyond it a number is no position [rad or m]."""

State = tuple[Array, Array]


@documented
@dataclass(frozen=True)
class Tolerances:
    """How far state and clock may be off before a supervisor stops the arm.

    A model whose accelerations come to be wrong by δa at once lets the observed velocity lag by
    δa · `memory` / e: the defaults allow 130 rad/s², Coulomb friction of 1 N·m in a wrist.

    Raises:
        InvalidValueError: a value that is not positive.
    """

    position: float = 0.0025
    """Largest difference of a joint from where the dynamics put it [rad or m]."""
    velocity: float = 0.5
    """Largest difference of its velocity [rad/s or m/s]."""
    memory: float = 0.01
    """Time in which the observed state forgets such a difference [s]."""
    tracking: float = 0.02
    """Largest distance of a joint from the controller's reference, if it has one [rad or m], and
    its motion no tube."""
    gap: float = 0.005
    """Longest time between two calls [s]; at least one and a half periods."""
    delay: float = 0.05
    """Time for which a state that came unexplained must agree with itself to be believed [s]."""

    def __post_init__(self) -> None:
        for name in ("position", "velocity", "memory", "tracking", "gap", "delay"):
            positive(name, getattr(self, name))


class StateObserver:
    r"""Propagates a state by the dynamics, and draws it towards measurements that agree with it.

    .. math::

        \hat v^- = \hat v + \Delta t\, \big( M^{-1} ((1 - \kappa) \tau - H) + \hat a \big), \quad
        r = v - \hat v^-, \quad \hat v = \hat v^- + (1 - \lambda^2)\, r, \quad
        \hat a \mathrel{+}= \frac{(1 - \lambda)^2}{\Delta t} r, \quad \lambda = e^{-\Delta t / T}

    and q̂ as v̂. κ and â are what the model does not explain, so that a wrong model does not look
    like a jump: κ, as if all masses were wrong alike, takes from â over 30 ms what it can, for it
    holds while the arm stops too. A measurement agrees if each joint's differences are within the
    tolerances. One that does not is left out: the observed state then follows the dynamics alone.

    Args:
        arm: its dynamics.
        fastest: bound on the observed velocity (nv,) [rad/s or m/s].
        tolerances: T is their `memory`.

    Attributes:
        learns: whether κ and â are observed; see `doubt`.

    Source: D. G. Luenberger, An introduction to observers, IEEE TAC 1971; J. Han, as in
        `DisturbanceObserver`.
    """

    def __init__(self, arm: Arm, fastest: Array, tolerances: Tolerances) -> None:
        self._arm = arm
        self._data = arm.model.createData()
        self._tolerances = tolerances
        self._fastest = fastest
        self._joint_index = arm.joint_index
        self.learns = True
        self._angles, self._off, self._none = np.zeros((3, arm.nv))
        # Rows: â, τ, M⁻¹ τ, κ alone, and the mean of â over a while.
        self._unexplained = np.zeros((5, arm.nv))
        self.q: Array = arm.configurations(self._angles)
        """Observed configuration (nq,), overwritten by the next call."""
        self.v: Array = np.zeros(arm.nv)
        """Observed velocity (nv,) [rad/s or m/s], overwritten by the next call."""
        # Kernels are loaded, or compiled, here rather than in a control loop.
        self.advance(0.0, 1.0, self.v)
        self.agrees(self.q, self.v, 0.0)

    def start(self, q: Array, v: Array) -> None:
        """Begin at a state, q (nq,) and v (nv,)."""
        self.q[:], self.v[:], self._angles[:] = q, v, self._arm.angles(q)

    def doubt(self, known: "StateObserver") -> None:
        """Learn no more: take what another knew for long of κ and â, with stricter tolerances.

        What a wrong state has shaped is not to explain it.
        """
        self.learns = False
        self._unexplained[:] = known._unexplained
        self._unexplained[_UNEXPLAINED] = self._unexplained[_MEAN]

    def advance(self, time: float, step: float, tau: Array) -> None:
        """Follow the dynamics for a time [s] by steps [s] of at most so long, tau (nv,) held."""
        model, data, known = self._arm.model, self._data, self._unexplained
        n = max(math.ceil(time / step - 1e-6), 1)
        for _ in range(n):
            free = np.array(pin.aba(model, data, self.q, self.v, self._none))
            a = pin.aba(model, data, self.q, self.v, tau)
            known[_TORQUE], known[_PUSH] = tau, a - free
            a = a + known[_UNEXPLAINED] - known[_SCALE, 0] * known[_PUSH]
            _advance(time / n, a, self._fastest, self._joint_index, self._angles, self.v, self.q)

    def agrees(self, q: Array, v: Array, time: float) -> bool:
        """Return whether q (nq,) and v (nv,) agree; if so, draw the observed state towards them.

        The time is that since the last measurement [s], zero for one that tells nothing new.
        """
        memory, velocity = self._tolerances.memory, self._tolerances.velocity
        if not self.learns:
            memory, velocity = _LATER_MEMORY * memory, _LATER_VELOCITY * velocity
        return _draw(
            q,
            v,
            np.array([time, memory, self._tolerances.position, velocity, float(self.learns)]),
            self._joint_index,
            self._angles,
            self.v,
            self.q,
            self._off,
            self._unexplained,
        )


class ByPositions:
    """Replaces velocities that are not those of the positions, once it has seen nine of these.

    Positions that repeat tell nothing: those of an arm at rest differ in some bit.

    Args:
        arm: the arm.
        fastest: bound on a velocity (nv,) [rad/s or m/s].

    Attributes:
        replaces: whether it replaced the velocity of the last state.
    """

    def __init__(self, arm: Arm, fastest: Array) -> None:
        self._arm, self._fastest, self._rest = arm, fastest, np.zeros(arm.nv)
        self._past: deque[tuple[Array, float]] = deque(maxlen=_DIFFERENCES + 1)
        self.replaces = False

    def clear(self) -> None:
        """Forget what was seen."""
        self.replaces = False
        self._past.clear()

    def state(self, measured: State | None, q: ArrayLike, dt: float) -> State | None:
        """Return a state as measured, or of q (nq,) as given and its differences.

        The time is that since the last call [s].
        """
        self.replaces = False
        try:
            position = np.array(checked_state(self._arm, q, self._rest)[0])
        except Exception:  # noqa: BLE001  # a caller may give anything
            position = np.full(self._arm.nq, np.inf)
        repeats = bool(self._past) and np.array_equal(self._past[-1][0], position)
        if repeats or not is_plausible(position, self._rest, FARTHEST, self._fastest):
            self.clear()
            return measured
        self._past.append((position, dt))
        time = sum(step for _, step in list(self._past)[1:])
        if len(self._past) <= _DIFFERENCES or not time > 0.0:
            return measured
        v = self._arm.difference(self._past[0][0], position) / time
        if measured is None or not np.abs(v - measured[1]).max() <= _DIFFERENT:
            self.replaces, measured = True, (position, v)
        return measured


_DIFFERENCES, _DIFFERENT = 8, 0.25  # of positions, and of velocities [rad/s or m/s]

_UNEXPLAINED, _TORQUE, _PUSH, _SCALE, _MEAN = 0, 1, 2, 3, 4
_LATER_MEMORY, _LATER_VELOCITY = 5.0, 0.25  # parts of the tolerances without learning
_SCALE_TIME = 0.03  # [s]
_LARGEST_SCALE = 0.5  # of κ
_MEAN_TIME = 0.1  # [s]


@compiled
def _advance(
    dt: float,
    a: Array,
    fastest: Array,
    joint_index: NDArray[np.int64],
    angles: Array,
    v: Array,
    q: Array,
) -> None:
    for i in range(v.size):
        if math.isfinite(a[i]):
            v[i] += dt * a[i]
            if abs(v[i]) > fastest[i]:
                v[i] = math.copysign(fastest[i], v[i])
        angles[i] += dt * v[i]
    write_configuration(angles, joint_index, q)


@compiled
def _draw(
    q: Array,
    v: Array,
    numbers: Array,
    joint_index: NDArray[np.int64],
    angles: Array,
    v_observed: Array,
    q_observed: Array,
    off: Array,
    known: Array,
) -> bool:
    time, memory, position, velocity, learns = numbers
    joint_error(q_observed, q, joint_index, off)
    for i in range(v.size):
        if abs(off[i]) > position or abs(v[i] - v_observed[i]) > velocity:
            return False
    learn = 1.0 - math.exp(-time / memory)
    keep = learn * (2.0 - learn)
    unexplained, tau, push = known[_UNEXPLAINED], known[_TORQUE], known[_PUSH]
    explained, power = 0.0, 0.0
    for i in range(v.size):
        r = v[i] - v_observed[i]
        angles[i] += keep * off[i]
        v_observed[i] += keep * r
        if learns > 0.0 and time > 0.0:
            unexplained[i] += learn * learn / time * r
        explained -= tau[i] * unexplained[i]
        power += tau[i] * push[i]
    if learns > 0.0 and power > 0.0:  # least squares in the metric M, as M⁻¹ τ is the push
        scale = known[_SCALE, 0] + min(time / _SCALE_TIME, 1.0) * explained / power
        scale = min(max(scale, -_LARGEST_SCALE), _LARGEST_SCALE)
        for i in range(v.size):
            unexplained[i] += (scale - known[_SCALE, 0]) * push[i]
            known[_MEAN, i] += min(time / _MEAN_TIME, 1.0) * (unexplained[i] - known[_MEAN, i])
        known[_SCALE, 0] = scale
    write_configuration(angles, joint_index, q_observed)
    return True
