"""Evasion: the velocity nearest to a wanted one with which nothing that moves is touched."""

import math
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from densarm.control.disturbance_observer import AHEAD_VELOCITY
from densarm.control.inverse_dynamics import ATTRACT, BRAKE, InverseDynamics, straight_torque
from densarm.control.soft_rows import nearest_in_box
from densarm.density.inverse_bump import log_inverse_bump
from densarm.values.arrays import Array
from densarm.values.checks import non_negative, positive
from densarm.values.documented import documented
from densarm.values.kernels import compiled, compiled_part
from densarm.world.active_pairs import ActivePairs
from densarm.world.distance_view import add_pair_gradient, pair_rate, shape_positions
from densarm.world.pair_queries import PairQueries
from densarm.world.stopping import HELD_SHARE
from densarm.world.world import World

EVADING_GAIN = 40.0
"""K_v of the servo that follows an evading velocity [1/s]."""

_LIMIT_SHARE = 0.85  # of velocities and accelerations, since torque lags behind by its rate
_TIMES = 6  # at which misses are looked for, one every other call in turn
_LAG = 0.04  # [s] until a velocity that is asked for is reached
_SOONEST = 0.03  # [s] in which a miss is made good
_FASTEST = 1e3  # [rad/s or m/s], where joints have no limit
_RECOVERY = 4.0  # [1/s] of a margin that is lost, and at which the way to a joint limit shrinks
_STANDING_RATE = 10.0  # [1/s] at which the distance to what stands may shrink
_BRAKE_SHARE = 0.5  # of the accelerations, that a stop before what stands reckons with
_STANDING_WEIGHT = 10.0  # of what is known for sure, where not all rows can hold
_WEIGHT = 1e4  # of a row's lack [rad or m]
_LEAST_SHARE = 1e-5  # of σ, of h where the bump is evaluated
_MISS_REACH = 0.12  # [m] beyond which a miss is no row
_LEAST_LEVER = 1e-9  # [m], of a row that some joint can do something about


@documented
@dataclass(frozen=True)
class EvasionParameters:
    """How far from things that move, and how long before, the arm gives way.

    Raises:
        InvalidValueError: a value out of its range.
    """

    distance: float = 0.5
    """Sensing distance σ of pairs, whether their obstacle moves or stands [m]."""
    decay: float = 8.0
    """γ: ln Ψ_k of a pair whose obstacle moves falls by at most this [1/s]."""
    margin: float = 0.01
    """Distance to keep from what moves, beside the motion's own margin [m]."""
    reaction: float = 0.03
    """Time for which what comes nearer goes on before the arm has reacted [s]."""
    horizon: float = 0.5
    """How far ahead misses are looked for [s]; zero for not at all."""
    miss: float = 0.03
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
        \nabla h_k \cdot \dot q \ge -\sqrt{2 a_k h_k} \quad \text{(what stands)}, \qquad
        \hat h_k + (\tau - \tau_0) \nabla \hat h_k \cdot (\dot q - v) \ge 0 \quad
        \text{(misses ahead)}

    The first keeps d ln Ψ_k/dt ≥ -γ, pair by pair: gradients of several pairs in one sum would
    cancel. It tells the arm to run from what comes, along its way. The last row tells it to
    step aside: ĥ_k is the clearance at the time t + τ if arm and obstacle go on as they do, its
    gradient that there, and τ_0 the time in which a velocity is reached. Times up to the horizon
    take turns. a_k is half of what the accelerations make along ∇h_k, so that the arm stops in time
    where it flees. Bounds on q̇ are those of velocities, of what accelerations reach within 1/K_v,
    and of the way to joint limits. Rows are soft, since not all can hold at times: those of what
    stands weigh ten times as much, bounds hold always. Rows that hold for all velocities in reach
    are left out, and where q̇_nom keeps all there is no problem to solve.

    Args:
        world: the pairs; obstacles count as moving that have a motion, or were moved since now.
        pairs: updated by their owner, whose reach is widened while something moves.
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
        arm, p, self._margin = world.arm, parameters, margin
        self._world, self._arm, self._pairs, self.parameters = world, arm, pairs, p
        self._version, self._way_before = 0, world.obstacle_way.copy()
        self._is_moving, self._is_needed = np.zeros(world.n_pairs, bool), False
        self._ahead = np.array([margin + p.margin + p.distance, p.reaction + p.horizon])
        n, size = arm.nv, (_TIMES + 1) * world.n_pairs
        # Blocks of rows of the density, and of misses at each time; how many in each; all in reach.
        self._rows, self._count = np.zeros((size, n + 1)), np.zeros(_TIMES + 1, np.int64)
        self._chosen = np.zeros((size, n + 1))
        self._turn, self._looks = 0, False
        # Shapes of obstacles, and a pair of each.
        self._bodies = np.array(np.unique(world.pair_shapes[:, 1], return_index=True)).T
        self._near = np.zeros(world.n_pairs, np.int64)
        self._data = arm.model.createData()
        self._jacobian = self._data.J.reshape(6, n)
        geometry = world.geometry_model
        self._queries = PairQueries(arm.model, geometry, world.pair_shapes, remembers=False)
        self._places, self._came = shape_positions(self._queries.data), 0
        self._there, self._radius = np.zeros(n), np.zeros(geometry.ngeoms)
        limits, turns = arm.limits, arm.continuous
        lower, upper = np.where(turns, -np.inf, limits.lower), np.where(turns, np.inf, limits.upper)
        speed = _LIMIT_SHARE * np.minimum(limits.velocity, _FASTEST)
        self._limits = np.array([lower, upper, speed, _LIMIT_SHARE * limits.acceleration])
        self._density = np.array([margin, p.distance, p.decay, p.margin, p.reaction])
        self._most, self._none = HELD_SHARE * limits.acceleration, np.zeros(n)

    def is_needed(self) -> bool:
        """Return whether any obstacle moves, or was moved; pairs are awake in time from then on."""
        world = self._world
        if world.version != self._version:
            self._version = world.version
            self._is_needed, came = _note_moving(
                self._is_moving,
                world.changes,
                world.has_motion,
                world.obstacle_way,
                self._way_before,
                world.twist,
                self._ahead,
                self._pairs.reach,
            )
            if came != self._came:
                self._came = came
                for k, item in enumerate(world.geometry_model.geometryObjects):
                    item.geometry.computeLocalAABB()
                    off = np.linalg.norm(item.geometry.aabb_center)
                    self._radius[k] = item.geometry.aabb_radius + off
        return self._is_needed

    def velocity(self, q: Array, v: Array, nominal: Array) -> tuple[Array, bool]:
        """Return the velocity to follow (nv,) [rad/s or m/s], and whether it is an evading one.

        Args:
            q: configuration (nq,), to which the pairs are updated.
            v: velocity (nv,) [rad/s or m/s].
            nominal: q̇_nom (nv,), of which only what the bounds allow is returned.
        """
        angles, found = self._arm.angles(q), np.empty(self._arm.nv)
        self._write_rows(q, v, angles)
        gives_way = _nearest(
            angles, v, nominal, self._limits, self._rows, self._count, self._chosen, found
        )
        return found, gives_way

    def send_torque(
        self, dynamics: InverseDynamics, wanted: Array, ahead: Array | None = None
    ) -> None:
        """Send the torque that leads to a velocity (nv,), by K_v and an acceleration (nv,) ahead.

        Accelerations are kept within their limits, before the torque rate of the dynamics.
        """
        _send(*dynamics.terms, dynamics.rows, dynamics.sent, wanted, self._none if ahead is None else ahead, self._most)

    def _write_rows(self, q: Array, v: Array, angles: Array) -> None:
        """Write ∇h · q̇ ≥ b of all rows, [∇h, b] (nv + 1,), in blocks of the number of pairs."""
        world, pairs, horizon = self._world, self._pairs, self.parameters.horizon
        self._count[0] = _density_rows(
            pairs.state,
            pairs.rows,
            pairs.kinematics.jacobian,
            world.sign,
            world.twist,
            self._is_moving,
            self._density,
            v,
            self._limits,
            self._rows,
        )
        self._looks = not self._looks and horizon > 0.0
        if self._looks:
            self._turn = self._turn % _TIMES + 1
            self._count[self._turn] = self._look_ahead(v, angles, horizon * self._turn / _TIMES)

    def _look_ahead(self, v: Array, angles: Array, ahead: float) -> int:
        """Write the rows of misses in some time [s], and return how many."""
        world, pairs, arm = self._world, self._pairs, self._arm
        miss = self._margin + self.parameters.miss
        reach, there = miss + _MISS_REACH, self._there
        n, turns = _may_meet(
            pairs.state,
            pairs.rows,
            self._is_moving,
            world.lipschitz,
            world.twist,
            angles,
            v,
            self._limits,
            ahead,
            reach,
            self._near,
            there,
        )
        if not n:
            return 0
        queries, data = self._queries, self._queries.data
        pin.computeJointJacobians(arm.model, self._data, arm.configurations(there))
        pin.updateGeometryPlacements(arm.model, self._data, world.geometry_model, data)
        for shape, k in self._bodies.tolist() if turns else ():
            if world.twist[k, 3:].any():
                data.oMg[shape].rotation = pin.exp3(ahead * world.twist[k, 3:]) @ data.oMg[shape].rotation
        n = _meet(
            self._near[:n],
            self._bodies,
            world.pair_shapes,
            self._places,
            self._radius,
            world.twist,
            ahead,
            reach,
        )
        near, begin, soon = self._near[:n], self._turn * world.n_pairs, max(ahead - _LAG, _SOONEST)
        queries.ask(near)
        table = self._rows[begin:]
        return int(
            _miss_rows(near, queries.rows, self._jacobian, world.sign, v, miss, soon, table)
        )


@compiled
def _note_moving(
    is_moving: NDArray[np.bool_],
    changes: NDArray[np.int64],
    has_motion: NDArray[np.bool_],
    way: Array,
    way_before: Array,
    twist: Array,
    ahead: Array,
    reach: Array,
) -> tuple[bool, int]:
    """Note which pairs have an obstacle that moves; if any has, widen the reach of all.

    Returns:
        Whether any has, and which change of the world the last obstacle came with.
    """
    some, came = False, 0
    for k in range(reach.shape[0]):
        came = max(came, changes[k])
        is_moving[k] = has_motion[k] or way[k] != way_before[k]
        some |= is_moving[k]
    for k in range(reach.shape[0] if some else 0):
        far = ahead[0]
        if is_moving[k]:
            far += ahead[1] * math.sqrt(twist[k, 0] ** 2 + twist[k, 1] ** 2 + twist[k, 2] ** 2)
        reach[k] = max(reach[k], far)
    return some, came


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
                for j in range(n + 1):
                    chosen[some, j] = rows[k, j] / math.sqrt(lever)
                some += 1
    if not holds:
        nearest_in_box(nominal, chosen[:some, :n], chosen[:some, n], low, high, _WEIGHT, found)
    return not holds


@compiled
def _send(
    mass: Array,
    nonlinear: Array,
    gravity: Array,
    rows: Array,
    sent: Array,
    wanted: Array,
    ahead: Array,
    most: Array,
) -> None:
    for i in range(most.size):
        a = EVADING_GAIN * (wanted[i] - rows[AHEAD_VELOCITY, i]) + ahead[i]
        rows[ATTRACT, i], rows[BRAKE, i] = min(max(a, -most[i]), most[i]), 0.0
    straight_torque(mass, nonlinear, gravity, rows, sent)


@compiled
def _may_meet(
    state: NDArray[np.int64],
    rows: Array,
    is_moving: NDArray[np.bool_],
    lipschitz: Array,
    twist: Array,
    angles: Array,
    v: Array,
    limits: Array,
    ahead: float,
    reach: float,
    near: NDArray[np.int64],
    there: Array,
) -> tuple[int, bool]:
    """Write which pairs may be within reach after some time, and where the joints are then.

    Returns:
        How many, and whether the obstacle of any of them turns.
    """
    count, turns = 0, False
    for k in range(state.shape[0]):
        if state[k] == 0 or not is_moving[k]:
            continue
        speed = math.sqrt(twist[k, 0] ** 2 + twist[k, 1] ** 2 + twist[k, 2] ** 2)
        left = rows[k, 0] - speed * ahead
        for j in range(v.size):
            left -= lipschitz[k, j] * abs(v[j]) * ahead
        if left < reach:
            near[count] = k
            count += 1
            turns |= twist[k, 3] != 0.0 or twist[k, 4] != 0.0 or twist[k, 5] != 0.0
    for j in range(v.size):
        there[j] = min(max(angles[j] + ahead * v[j], limits[0, j]), limits[1, j])
    return count, turns


@compiled
def _meet(
    near: NDArray[np.int64],
    bodies: NDArray[np.int64],
    pair_shapes: NDArray[np.int64],
    places: Array,
    radius: Array,
    twist: Array,
    ahead: float,
    reach: float,
) -> int:
    """Move obstacles on, and keep pairs whose balls are within reach; return how many are left."""
    for b in range(bodies.shape[0]):
        shape, k = bodies[b]
        x, y, z = places[shape]
        wx, wy, wz = twist[k, 3:]
        places[shape, 0] += ahead * (twist[k, 0] + (wy * z - wz * y))
        places[shape, 1] += ahead * (twist[k, 1] + (wz * x - wx * z))
        places[shape, 2] += ahead * (twist[k, 2] + (wx * y - wy * x))
    count = 0
    for k in near:
        first, second = pair_shapes[k]
        gap = -radius[first] - radius[second]
        gap += math.sqrt(((places[first] - places[second]) ** 2).sum())
        if not gap > reach:  # a half-space has no middle
            near[count] = k
            count += 1
    return count


@compiled
def _miss_rows(
    near: NDArray[np.int64],
    rows: Array,
    jacobian: Array,
    sign: Array,
    v: Array,
    miss: float,
    soon: float,
    table: Array,
) -> int:
    count, n = 0, v.size
    for k in near:
        h = rows[k, 0] - miss
        if h <= _MISS_REACH:
            table[count, n] = _write_slope(rows[k], jacobian, sign[k], v, table[count])
            table[count, n] -= h / soon
            count += 1
    return count


@compiled
def _density_rows(
    state: NDArray[np.int64],
    rows: Array,
    jacobian: Array,
    sign: Array,
    twist: Array,
    is_moving: NDArray[np.bool_],
    numbers: Array,
    v: Array,
    limits: Array,
    table: Array,
) -> int:
    margin, width, decay, extra, reaction = numbers
    count, n = 0, v.size
    for k in range(state.shape[0]):
        h, rate = rows[k, 0] - margin, 0.0
        if is_moving[k]:
            rate = pair_rate(rows[k], twist[k])
            h -= extra + reaction * max(-rate, 0.0)
        if state[k] == 0 or h >= width:
            continue
        row = table[count]
        speed = _write_slope(rows[k], jacobian, sign[k], v, row)
        if is_moving[k]:
            slope = log_inverse_bump(max(h, _LEAST_SHARE * width), width, 0.0)[1]
            row[n] = -decay / slope - rate - _RECOVERY * min(h, 0.0)
        else:
            brake = 0.0
            for j in range(n):
                brake += abs(row[j]) * limits[3, j]
            left = max(h - reaction * max(-speed, 0.0), 0.0)
            row[n] = -min(_STANDING_RATE * left, math.sqrt(2.0 * _BRAKE_SHARE * brake * left))
            for j in range(n + 1):
                row[j] *= _STANDING_WEIGHT
        count += 1
    return count


@compiled_part
def _write_slope(distance: Array, jacobian: Array, sign: Array, v: Array, row: Array) -> float:
    """Write the gradient of a distance, and return how fast the arm changes it [m/s]."""
    speed, n = 0.0, v.size
    for j in range(n):
        row[j] = 0.0
    add_pair_gradient(distance, jacobian, sign, 1.0, row[:n])
    for j in range(n):
        speed += row[j] * v[j]
    return speed
