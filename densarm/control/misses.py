"""MissesAhead: rows that make an arm step aside from where it would meet what moves."""

import math

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from densarm.arms.dynamics import by_columns
from densarm.values.arrays import Array
from densarm.values.kernels import compiled, compiled_part, entry_point
from densarm.world.active_pairs import ActivePairs, least_distance, pair_motion
from densarm.world.distance_view import add_pair_gradient, obstacle_speed
from densarm.world.pair_queries import BodyBalls, PairQueries, ball_gap
from densarm.world.world import World

_LAG = 0.04  # [s] until a velocity that is asked for is reached
_SOONEST = 0.03  # [s] in which a miss is made good
_REACH = 0.12  # [m] beyond which a miss is no row

# Of pairs: whether awake, distances, of those asleep ways and numbers for bounds, whether they
# move, Lipschitz constants and twists.
_Now = tuple[NDArray[np.int64], Array, Array, Array, NDArray[np.bool_], Array, Array]


class MissesAhead:
    r"""Rows of pairs that would be too near in some time, if arm and obstacles go on as they do.

    .. math:: \hat h_k + (\tau - \tau_0) \nabla \hat h_k \cdot (\dot q - v) \ge 0

    ĥ_k and its gradient are those at the time t + τ. Asked for are pairs which may be within reach
    then by their Lipschitz constants, and then by balls around their bodies: those whose obstacle
    moves, and, if there are any, those awake of what stands, lest the arm step aside into it.

    Args:
        world: the pairs.
        pairs: the same, updated by their owner.
        is_moving: which pairs have an obstacle that moves (K,), kept by its owner.
        limits: least and largest joint positions, in the first two rows.
        margin: to keep from what stands [m].
        miss: by how much what moves is to be missed [m].
    """

    def __init__(
        self,
        world: World,
        pairs: ActivePairs,
        is_moving: NDArray[np.bool_],
        limits: Array,
        margin: float,
        miss: float,
    ) -> None:
        arm = world.arm
        self._world, self._limits = world, limits
        self._margins, self._reach = np.array([margin, miss]), miss + _REACH
        self._queries = PairQueries(arm.model, world, remembers=False)
        self._data = arm.model.createData()
        self._jacobian = by_columns(self._data.J, (6, arm.nv))
        # Shapes of obstacles, and a pair of each.
        self._bodies = np.array(np.unique(world.pair_shapes[:, 1], return_index=True)).T
        self._there = np.zeros(arm.nv)
        self._near = np.zeros(world.n_pairs, np.int64)
        slept = pairs.way, pairs.slept
        self._now = pairs.state, pairs.rows, *slept, is_moving, world.lipschitz, world.twist
        # Kernels are loaded, or compiled, before a control loop.
        near, there = self._near, self._there
        self._may_meet = entry_point(
            _may_meet, self._now, there, there, limits, 0.0, 0.0, near, there
        )
        self._balls = is_moving, self._bodies, self._queries.body_balls, world.twist
        self._meet = entry_point(_meet, near, *self._balls, 0.0, 0.0)
        self._slopes = is_moving, self._queries.rows, self._jacobian, world.sign
        rows = *self._slopes, there, self._margins, 0.0, np.zeros((1, arm.nv + 1))
        self._miss_rows = entry_point(_miss_rows, near, *rows)

    def write(self, angles: Array, v: Array, ahead: float, table: Array) -> int:
        """Write rows [∇h, b] (nv + 1,) for ∇h · q̇ ≥ b into a table, and return how many.

        Args:
            angles: joint positions (nv,) [rad or m].
            v: velocity (nv,) [rad/s or m/s].
            ahead: τ [s].
            table: rows (at least K, nv + 1).
        """
        world, near, there, reach = self._world, self._near, self._there, self._reach
        n, turns = self._may_meet(self._now, angles, v, self._limits, ahead, reach, near, there)
        if not n:
            return 0
        model, data = world.arm.model, self._queries.data
        pin.computeJointJacobians(model, self._data, world.arm.configurations(there))
        pin.updateGeometryPlacements(model, self._data, world.geometry_model, data)
        for shape, k in self._bodies.tolist() if turns else ():
            turn = pin.exp3(ahead * world.twist[k, 3:])
            data.oMg[shape].rotation = turn @ data.oMg[shape].rotation
        n = self._meet(near[:n], *self._balls, ahead, reach)
        self._queries.ask(near[:n])
        soon = max(ahead - _LAG, _SOONEST)
        return int(self._miss_rows(near[:n], *self._slopes, v, self._margins, soon, table))


@compiled
def _may_meet(
    now: _Now,
    angles: Array,
    v: Array,
    limits: Array,
    ahead: float,
    reach: float,
    near: NDArray[np.int64],
    there: Array,
) -> tuple[int, bool]:
    """Write which pairs may be within reach after some time, and where the joints are then.

    How many is returned, and whether the obstacle of any of them turns.
    """
    state, rows, way, slept, is_moving, lipschitz, twist = now
    count, turns, some, fastest = 0, False, False, np.abs(v)
    for k in range(state.shape[0]):
        if state[k] == 0 and not is_moving[k]:
            continue
        speed, least = obstacle_speed(twist[k]), rows[k, 0]
        if state[k] == 0:
            least = least_distance(lipschitz, k, way, slept)
        if least - (speed + pair_motion(lipschitz, k, fastest)) * ahead < reach:
            near[count] = k
            count += 1
            some |= is_moving[k]
            turns |= speed == math.inf
    for j in range(v.size):
        there[j] = min(max(angles[j] + ahead * v[j], limits[0, j]), limits[1, j])
    return count if some else 0, turns


@compiled
def _meet(
    near: NDArray[np.int64],
    is_moving: NDArray[np.bool_],
    bodies: NDArray[np.int64],
    balls: BodyBalls,
    twist: Array,
    ahead: float,
    reach: float,
) -> int:
    """Move obstacles on, and keep pairs whose balls are within reach; return how many are left."""
    places = balls.positions
    for b in range(bodies.shape[0]):
        shape, k = bodies[b]
        x, y, z = places[shape]
        wx, wy, wz = twist[k, 3:]
        places[shape, 0] += ahead * (twist[k, 0] + (wy * z - wz * y))
        places[shape, 1] += ahead * (twist[k, 1] + (wz * x - wx * z))
        places[shape, 2] += ahead * (twist[k, 2] + (wx * y - wy * x))
    count, some = 0, False
    for k in near:
        if ball_gap(balls, k) <= reach:
            near[count] = k
            count += 1
            some |= is_moving[k]
    return count if some else 0


@compiled
def _miss_rows(
    near: NDArray[np.int64],
    is_moving: NDArray[np.bool_],
    rows: Array,
    jacobian: Array,
    sign: Array,
    v: Array,
    margins: Array,
    soon: float,
    table: Array,
) -> int:
    count, n, some = 0, v.size, False
    for k in near:
        h = rows[k, 0] - margins[int(is_moving[k])]
        if h <= _REACH:
            some |= is_moving[k]
            table[count, n] = write_slope(rows[k], jacobian, sign[k], v, table[count])
            table[count, n] -= h / soon
            count += 1
    return count if some else 0


@compiled_part
def write_slope(distance: Array, jacobian: Array, sign: Array, v: Array, row: Array) -> float:
    """Write the gradient of a distance, and return how fast the arm changes it [m/s]."""
    speed, n = 0.0, v.size
    for j in range(n):
        row[j] = 0.0
    add_pair_gradient(distance, jacobian, sign, 1.0, row[:n])
    for j in range(n):
        speed += row[j] * v[j]
    return speed
