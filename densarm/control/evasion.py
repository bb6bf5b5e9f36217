"""Evasion: the velocity nearest to a wanted one with which nothing that moves is touched."""

import math
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from densarm.arms.dynamics import mass_entry
from densarm.control.disturbance_observer import AHEAD_VELOCITY, DISTURBANCE, FREE
from densarm.control.inverse_dynamics import (
    EFFORT_LIMIT,
    RATE_LIMIT,
    TORQUE,
    DynamicsArrays,
    InverseDynamics,
)
from densarm.control.misses import MissesAhead, write_slope
from densarm.control.soft_rows import nearest_in_box
from densarm.density.inverse_bump import log_inverse_bump
from densarm.values.arrays import Array
from densarm.values.checks import non_negative, positive
from densarm.values.documented import documented
from densarm.values.kernels import compiled, entry_point
from densarm.world.active_pairs import ActivePairs, pair_motion
from densarm.world.distance_view import obstacle_speed, pair_rate
from densarm.world.stopping import HELD_SHARE
from densarm.world.world import World

EVADING_GAIN = 40.0
"""K_v of the servo that follows an evading velocity [1/s]."""

_LIMIT_SHARE = 0.9  # of velocities and accelerations, since torque lags behind by its rate
_TIMES = 8  # at which misses are looked for, one every other call in turn
_FASTEST = 1e3  # [rad/s or m/s], where joints have no limit
_RECOVERY = 4.0  # [1/s] of a margin that is lost, and at which the way to a joint limit shrinks
_STANDING_RATE = 10.0  # [1/s] at which the distance to what stands may shrink
_STANDING_GAP = 1e-3  # [m] that soft rows may give up before what stands is touched
_BRAKE_SHARE = 0.5  # of the accelerations, that a stop before what stands reckons with
_REACH_SHARE = 1.1  # of what accelerations reach, since reach is of the next step
_WEIGHT = 1e4  # of a row's lack
_FIRMNESS = 30.0  # of rows of what stands, as if they lacked so many times as much
_LEAST_SHARE = 1e-5  # of σ, of h where the bump is evaluated
_LEAST_LEVER = 1e-9  # [m], of a row that some joint can do something about
_CLOSING = np.arange(0.0, 20.0, 0.05)  # [m/s], for which it is known how near a row asks for more

# Of pairs: whether awake, distances, Jacobian, sign, Lipschitz constants, twists, whether they
# move, and reach.
_Now = tuple[NDArray[np.int64], Array, Array, Array, Array, Array, NDArray[np.bool_], Array]


@documented
@dataclass(frozen=True)
class EvasionParameters:
    """How far from things that move, and how long before, the arm gives way.

    Raises:
        InvalidValueError: a value out of its range.
    """

    distance: float = 0.5
    """Sensing distance σ of pairs, whether their obstacle moves or stands [m]."""
    decay: float = 20.0
    """γ: ln Ψ_k of a pair whose obstacle moves falls by at most this [1/s]."""
    margin: float = 0.01
    """Distance to keep from what moves, beside the motion's own margin [m]."""
    reaction: float = 0.03
    """Time for which what comes nearer goes on before the arm has reacted [s]."""
    horizon: float = 0.7
    """How far ahead misses are looked for [s]; zero for not at all."""
    miss: float = 0.06
    """By how much things that move are to be missed, beside the motion's margin [m]."""

    def __post_init__(self) -> None:
        for name in ("distance", "decay"):
            positive(name, getattr(self, name))
        for name in ("margin", "reaction", "horizon", "miss"):
            non_negative(name, getattr(self, name))


class Evasion:
    r"""The velocity nearest to a wanted one for which one row of every near pair holds.

    .. math::

        \min_{\dot q} \|\dot q - \dot q_{nom}\|^2 \quad \text{with} \quad
        \nabla h_k \cdot \dot q + n_k \cdot w_k \ge -\frac{\gamma}{\partial \ln\Psi_k / \partial h}
        \quad \text{(what moves)}, \\
        \nabla h_k \cdot \dot q \ge -\sqrt{2 a_k (h_k - \epsilon)} \quad
        \text{(what stands)}, \qquad
        \hat h_k + (\tau - \tau_0) \nabla \hat h_k \cdot (\dot q - v) \ge 0 \quad
        \text{(misses ahead)}

    The first keeps d ln Ψ_k/dt ≥ -γ, pair by pair: gradients of several pairs in one sum would
    cancel. It tells the arm to run from what comes, along its way. The last row tells it to
    step aside: ĥ_k is the clearance at the time t + τ if arm and obstacle go on as they do, its
    gradient that there, and τ_0 the time in which a velocity is reached; where something is to be
    missed, what stands is as well. Times up to the horizon take turns. a_k is half of what the
    accelerations make along ∇h_k, so that the arm stops in time where it flees. Bounds on q̇ are
    those of velocities, of what accelerations reach within 1/K_v, and of the way to joint limits.
    Rows are soft, since not all can hold at times, each measured along its gradient [rad/s or m/s],
    those of what stands 30 times: into a wall no ball may drive the arm. What they give up then
    comes out of ε = 1 mm, and where that is lost they ask for it back. Bounds hold always. Rows
    that hold for all velocities in reach are left out, and where q̇_nom keeps all there is no
    problem to solve.

    Args:
        world: the pairs; obstacles count as moving that have a motion, or were moved since now.
        pairs: updated by their owner, awake as far as their rows may matter while something moves.
        margin: to keep from everything [m].
        parameters: distances and times.

    Source: the rows of misses are akin to J. van den Berg et al., Reciprocal n-Body Collision
        Avoidance, ISRR 2009.
    """

    def __init__(
        self,
        world: World,
        pairs: ActivePairs,
        margin: float,
        parameters: EvasionParameters = EvasionParameters(),
    ) -> None:
        arm, p = world.arm, parameters
        self._world, self._arm, self._pairs, self.parameters = world, arm, pairs, p
        self._version, self._way_before = -1, world.obstacle_way.copy()
        self._is_moving, self._is_needed = np.zeros(world.n_pairs, bool), False
        n, size = arm.nv, (_TIMES + 2) * world.n_pairs
        # Blocks of rows of what moves, of misses at each time, and of what stands; how many in
        # each; all in reach.
        self._rows, self._count = np.zeros((size, n + 1)), np.zeros(_TIMES + 2, np.int64)
        self._chosen = np.zeros((size, n + 1))
        self._turn, self._looks = 0, False
        limits, turns = arm.limits, arm.continuous
        lower, upper = np.where(turns, -np.inf, limits.lower), np.where(turns, np.inf, limits.upper)
        speed = _LIMIT_SHARE * np.minimum(limits.velocity, _FASTEST)
        self._limits = np.array([lower, upper, speed, _LIMIT_SHARE * limits.acceleration])
        is_moving, miss = self._is_moving, margin + p.miss
        self._misses = MissesAhead(world, pairs, is_moving, self._limits, margin, miss)
        self._reaches = np.full((2, world.n_pairs), np.nan)
        slopes = pairs.kinematics.jacobian, world.sign, world.lipschitz
        self._now = pairs.state, pairs.rows, *slopes, world.twist, is_moving, pairs.reach
        numbers = np.array([margin, p.distance, p.decay, p.margin, p.reaction])
        self._density = numbers, _farthest(p.distance, p.decay)
        self._most, self._none = HELD_SHARE * limits.acceleration, np.zeros(n)
        # Kernels are loaded, or compiled, before a control loop.
        rows = self._now, self._density, self._none, self._limits, self._reaches, self._rows
        self._density_rows = entry_point(_density_rows, *rows)
        box = self._limits, self._rows, self._count, self._chosen
        self._nearest = entry_point(_nearest, *(self._none,) * 3, *box, self._none)
        self._moves = self._is_moving, world.has_motion, world.obstacle_way, self._way_before
        self._note_moving = entry_point(_note_moving, *self._moves)
        arrays = InverseDynamics(arm, limits.acceleration).arrays
        self._send = entry_point(_send, arrays, self._none, self._none, self._most)

    def is_needed(self) -> bool:
        """Return whether any obstacle moves, or was moved."""
        world = self._world
        if world.version != self._version:
            self._version = world.version
            self._is_needed = self._note_moving(*self._moves)
        return self._is_needed

    @property
    def sees_motion(self) -> bool:
        """Whether any obstacle has a velocity now."""
        return bool(self._world.twist.any())

    def velocity(self, q: Array, v: Array, nominal: Array) -> tuple[Array, bool]:
        """Return the velocity to follow (nv,) [rad/s or m/s], and whether it is an evading one.

        Args:
            q: configuration (nq,), to which the pairs are updated.
            v: velocity (nv,) [rad/s or m/s].
            nominal: q̇_nom (nv,), of which only what the bounds allow is returned.
        """
        angles, found = self._arm.angles(q), np.empty(self._arm.nv)
        self._write_rows(v, angles)
        self._pairs.look_again()  # since reach was written to
        gives_way = self._nearest(
            angles, v, nominal, self._limits, self._rows, self._count, self._chosen, found
        )
        return found, gives_way

    def send_torque(
        self, dynamics: InverseDynamics, wanted: Array, ahead: Array | None = None
    ) -> None:
        """Send the torque that leads to a velocity (nv,), by K_v and an acceleration (nv,) ahead.

        Its accelerations are those nearest to what is wanted, in shares of their limits, that
        torque limits and the torque rate of the dynamics allow.
        """
        ahead = self._none if ahead is None else ahead
        self._send(dynamics.arrays, wanted, ahead, self._most)

    def _write_rows(self, v: Array, angles: Array) -> None:
        """Write ∇h · q̇ ≥ b of all rows, [∇h, b] (nv + 1,), in blocks of the number of pairs."""
        horizon, limits = self.parameters.horizon, self._limits
        self._count[0], self._count[-1] = self._density_rows(
            self._now, self._density, v, limits, self._reaches, self._rows
        )
        self._looks = not self._looks and horizon > 0.0
        if self._looks:
            self._turn = self._turn % _TIMES + 1
            table = self._rows[self._turn * self._world.n_pairs :]
            ahead = horizon * self._turn / _TIMES
            self._count[self._turn] = self._misses.write(angles, v, ahead, table)


@compiled
def _note_moving(
    is_moving: NDArray[np.bool_], has_motion: NDArray[np.bool_], way: Array, way_before: Array
) -> bool:
    """Note which pairs have an obstacle that moves, and return if any has."""
    some = False
    for k in range(is_moving.shape[0]):
        is_moving[k] = has_motion[k] or way[k] != way_before[k]
        some |= is_moving[k]
    return some


@cache
def _farthest(width: float, decay: float) -> Array:
    """Return up to which h [m] a row of what moves asks for more than each of `_CLOSING`."""
    h = np.linspace(_LEAST_SHARE, 1.0, 2000, endpoint=False) * width
    slope = np.array([log_inverse_bump(x, width, 0.0)[1] for x in h])
    with np.errstate(divide="ignore"):  # towards σ there is none
        return np.asarray(np.interp(_CLOSING, decay / slope, h, right=width))


@compiled
def _nearest(
    angles: Array,
    v: Array,
    nominal: Array,
    limits: Array,
    rows: Array,
    count: NDArray[np.int64],
    chosen: Array,
    found: Array,
) -> bool:
    """Write the velocity within the bounds that the rows ask for; return whether they do so."""
    some, holds, n = 0, True, v.size
    low, high = np.empty(n), np.empty(n)
    for i in range(n):
        change, most = limits[3, i] / EVADING_GAIN, limits[2, i]
        least = -min(most, _RECOVERY * max(angles[i] - limits[0, i], 0.0))
        most = min(most, _RECOVERY * max(limits[1, i] - angles[i], 0.0))
        low[i] = min(max(least, v[i] - change), v[i] + change)
        high[i] = min(max(most, v[i] - change), v[i] + change)
        found[i] = min(max(nominal[i], low[i]), high[i])
    size = rows.shape[0] // count.size
    for block in range(count.size):
        for k in range(block * size, block * size + count[block]):
            least, now, lever = 0.0, 0.0, 0.0
            for j in range(n):
                slope = rows[k, j]
                least += slope * (low[j] if slope > 0.0 else high[j])
                now += slope * found[j]
                lever += slope * slope
            if least < rows[k, n] and lever > _LEAST_LEVER**2:
                holds &= now >= rows[k, n]
                scale = (_FIRMNESS if block == count.size - 1 else 1.0) / math.sqrt(lever)
                for j in range(n + 1):
                    chosen[some, j] = scale * rows[k, j]
                some += 1
    if not holds:
        nearest_in_box(nominal, chosen[:some, :n], chosen[:some, n], low, high, _WEIGHT, found)
    return not holds


@compiled
def _send(arrays: DynamicsArrays, wanted: Array, ahead: Array, most: Array) -> None:
    """Write the torque that is sent: where one joint's is at its limit, the others go on."""
    mass, nonlinear, gravity, rows, sent = arrays[:5]
    n, holds = most.size, True
    a, low, high, offset = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    table, least = np.empty((2 * n, n)), np.empty(2 * n)
    for i in range(n):
        pull = EVADING_GAIN * (wanted[i] - rows[AHEAD_VELOCITY, i]) + ahead[i]
        a[i] = min(max(pull / most[i], -1.0), 1.0)
        before, limit = rows[FREE, i] + gravity[i], rows[EFFORT_LIMIT, i]
        low[i] = max(-limit, before - rows[RATE_LIMIT, i])
        high[i] = max(low[i], min(limit, before + rows[RATE_LIMIT, i]))
        offset[i] = nonlinear[i] - rows[DISTURBANCE, i]
    for i in range(n):
        tau, length = offset[i], 0.0
        for j in range(n):
            table[i, j] = most[j] * mass_entry(mass, i, j)
            tau += table[i, j] * a[j]
            length += table[i, j] * table[i, j]
        holds &= low[i] <= tau <= high[i]
        rows[TORQUE, i], length = tau, math.sqrt(length)
        least[i], least[n + i] = (low[i] - offset[i]) / length, (offset[i] - high[i]) / length
        for j in range(n):
            table[i, j] /= length
            table[n + i, j] = -table[i, j]
    if not holds:
        most_share, found = np.ones(n), np.empty(n)
        nearest_in_box(a, table, least, -most_share, most_share, _WEIGHT, found)
        for i in range(n):
            tau = offset[i]
            for j in range(n):
                tau += most[j] * mass_entry(mass, i, j) * found[j]
            rows[TORQUE, i] = min(max(tau, low[i]), high[i])
    for i in range(n):
        sent[-1, i] = rows[TORQUE, i]


@compiled
def _density_rows(
    now: _Now, density: tuple[Array, Array], v: Array, limits: Array, reaches: Array, table: Array
) -> tuple[int, int]:
    """Write rows that some velocity in reach may break, and how far pairs are to be awake for them.

    `reaches` are reach as others have it, and as it was written last (2, K) [m]. How many rows of
    what moves and of what stands there are is returned; the latter are the last block.
    """
    state, rows, jacobian, sign, lipschitz, twist, is_moving, reach = now
    numbers, farthest = density
    margin, width, decay, extra, reaction = numbers
    count, standing, n = 0, table.shape[0] - state.shape[0], v.size
    fastest, soonest = np.empty(n), 0.0
    for j in range(n):
        fastest[j] = abs(v[j]) + _REACH_SHARE * limits[3, j] / EVADING_GAIN
        soonest = max(soonest, fastest[j] / (2.0 * _BRAKE_SHARE * limits[3, j]))
    for k in range(state.shape[0]):
        closing, h = pair_motion(lipschitz, k, fastest), rows[k, 0] - margin
        if is_moving[k]:
            speed = obstacle_speed(twist[k])
            index = min((closing + speed) / _CLOSING[1] + 1.0, farthest.size - 1.0)
            far = extra + reaction * speed + farthest[int(index)]
        else:
            far = min((reaction + max(1.0 / _STANDING_RATE, soonest)) * closing, width)
        if reach[k] != reaches[1, k]:
            reaches[0, k] = reach[k]
        reach[k] = reaches[1, k] = max(reaches[0, k], margin + far)
        if state[k] == 0 or (h >= far and not is_moving[k]):
            continue
        if not is_moving[k]:
            row, brake = table[standing], 0.0
            speed = write_slope(rows[k], jacobian, sign[k], v, row)
            for j in range(n):
                brake += abs(row[j]) * limits[3, j]
            left = h - _STANDING_GAP - reaction * max(-speed, 0.0)
            most = math.sqrt(2.0 * _BRAKE_SHARE * brake * max(left, 0.0))
            row[n] = -_STANDING_RATE * left if left < 0.0 else -min(_STANDING_RATE * left, most)
            standing += 1
        else:
            rate = pair_rate(rows[k], twist[k])
            h -= extra + reaction * max(-rate, 0.0)
            if h >= width:
                continue
            slope = log_inverse_bump(max(h, _LEAST_SHARE * width), width, 0.0)[1]
            least = -decay / slope - rate - _RECOVERY * min(h, 0.0)
            if least > -closing:
                write_slope(rows[k], jacobian, sign[k], v, table[count])
                table[count, n] = least
                count += 1
    return count, standing - (table.shape[0] - state.shape[0])
