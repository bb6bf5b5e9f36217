"""Evasion: the velocity nearest to a wanted one with which nothing that moves is touched."""

import math
import os
from dataclasses import dataclass

import daqp
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from densarm.density.inverse_bump import log_inverse_bump
from densarm.values.arrays import Array
from densarm.values.checks import non_negative, positive
from densarm.values.documented import documented
from densarm.values.kernels import compiled
from densarm.world.active_pairs import ActivePairs, pair_motion
from densarm.world.distance_view import add_pair_gradient, pair_rate
from densarm.world.pair_queries import PairQueries
from densarm.world.stopping import HELD_SHARE
from densarm.world.world import World

_AHEAD = 6  # times at which misses are looked for, one a call in turn
_LAG = 0.04  # [s] until a velocity that is asked for is reached
_FASTEST = 1e3  # [rad/s or m/s], where joints have no limit
_JOINT_DECAY = 4.0  # [1/s] at which what is left to a joint limit may shrink
_SOFTNESS = 1e-4  # of rows
_STANDING_DECAY = 30.0  # γ of pairs that do not move [1/s]
_MISS_REACH = 0.25  # [m] beyond which a miss is no row


@documented
@dataclass(frozen=True)
class EvasionParameters:
    """How far from things that move, and how long before, the arm gives way.

    Raises:
        InvalidValueError: a value out of its range.
    """

    distance: float = 0.5
    """Sensing distance σ of pairs whose obstacle moves [m]."""
    decay: float = 8.0
    """γ: ln Ψ_k of a pair falls by at most this [1/s]."""
    margin: float = 0.01
    """Distance to keep from what moves, beside the motion's own margin [m]."""
    reaction: float = 0.03
    """Time in which what comes nearer is taken to go on before the arm reacts [s]."""
    horizon: float = 0.5
    """How far ahead misses are looked for [s]; zero for not at all."""
    miss: float = 0.03
    """Distance that is to be kept then [m]."""
    standing: float = 0.5
    """Sensing distance σ of all other pairs [m]."""

    def __post_init__(self) -> None:
        for name in ("distance", "decay", "standing"):
            positive(name, getattr(self, name))
        for name in ("margin", "reaction", "horizon", "miss"):
            non_negative(name, getattr(self, name))


P = {"rho": 1e-4, "lag": 0.04, "wa": 1.0, "inertia": 0, "sd": 30.0, "reach": 0.25, "fast": 1.0, "ws": 10.0, "share": 0.5, "kd": 10.0}
for item in os.environ.get("EV", "").split():
    k, val = item.split("=")
    P[k] = float(val)


class Evasion:
    def __init__(
        self,
        world: World,
        pairs: ActivePairs,
        margin: float,
        parameters: EvasionParameters = EvasionParameters(),
    ) -> None:
        arm = world.arm
        self.parameters = parameters
        self._world, self._arm, self._pairs, self._margin = world, arm, pairs, margin
        self._version, self._way_before = 0, world.obstacle_way.copy()
        self._is_moving = np.zeros(world.n_pairs, bool)
        self._is_needed = False
        n, k = arm.nv, world.n_pairs
        self._rows = np.zeros(((_AHEAD + 1) * k, n + 1))
        self._chosen = np.zeros_like(self._rows)
        self._count = np.zeros(_AHEAD + 1, np.int64)
        self._turn = 0
        self._near = np.zeros(k, np.int64)
        self._hessian = np.eye(n)
        self._sense = np.full(n + len(self._rows), 8, np.int32)
        self._sense[:n] = 0
        self._upper = np.full(n + len(self._rows), 1e30)
        self._data = arm.model.createData()
        self._jacobian = self._data.J.reshape(6, n)
        self._queries = PairQueries(
            arm.model, world.geometry_model, world.pair_shapes, remembers=False
        )
        limits = arm.limits
        free = arm.continuous
        lower, upper = np.where(free, -np.inf, limits.lower), np.where(free, np.inf, limits.upper)
        speed = np.minimum(limits.velocity, _FASTEST)
        self._limits = np.array([lower, upper, speed, HELD_SHARE * limits.acceleration])
        self.solves = 0

    def is_needed(self) -> bool:
        world = self._world
        if world.version != self._version:
            self._version = world.version
            self._is_moving[:] = (world.obstacle_way != self._way_before) | world.has_motion
            self._is_needed = bool(self._is_moving.any())
            if self._is_needed:
                p = self.parameters
                _widen(
                    self._pairs.reach, self._is_moving, world.twist,
                    np.array([p.distance + self._margin + p.margin, p.reaction, p.horizon, p.standing + self._margin]),
                )
        return self._is_needed

    def velocity(self, q: Array, v: Array, nominal: Array, gain: float) -> tuple[Array, bool]:
        world, pairs, p = self._world, self._pairs, self.parameters
        n, count = self._arm.nv, self._count
        numbers = np.array([self._margin, p.distance, p.decay, p.margin, p.reaction, p.standing, P["share"], P["ws"]])
        count[0] = _density_rows(
            pairs.state, pairs.rows, pairs.kinematics.jacobian, world.sign, world.twist,
            self._is_moving, numbers, v, self._limits[3], self._rows,
        )
        if p.horizon > 0.0:
            self._turn = (self._turn + 1) % _AHEAD
            self._look_ahead(q, v, p.horizon * (self._turn + 1) / _AHEAD)
        angles = self._arm.angles(q)
        low, high, wanted = _bounds(angles, v, nominal, gain, self._limits)
        some, violated = _binding(self._rows, count, world.n_pairs, low, high, wanted, self._chosen)
        if not violated:
            return wanted, False
        a, b = self._chosen[:some, :n].copy(), self._chosen[:some, n]
        self.solves += 1
        h = self._hessian
        if P["inertia"]:
            M = pairs.kinematics.mass_matrix
            h = np.triu(M) + np.triu(M, 1).T
            h = h / h.diagonal().max() + P["inertia"] * np.eye(n)
        m = n + len(b)
        upper, lower = np.append(high, self._upper[n:m]), np.append(low, b)
        x, _, flag, _ = daqp.solve(h, -h @ nominal, a, upper, lower, self._sense[:m], rho_soft=P["rho"])
        return (np.clip(x, low, high) if flag > 0 else wanted), True

    def _look_ahead(self, q: Array, v: Array, ahead: float) -> None:
        world, pairs, arm, p = self._world, self._pairs, self._arm, self.parameters
        miss = self._margin + p.miss
        n = _may_meet(pairs.state, pairs.rows, self._is_moving, world.lipschitz, world.twist, np.abs(v) * ahead, ahead, miss + P["reach"], self._near)
        self._count[self._turn + 1] = 0
        if not n:
            return
        near, data = self._near[:n], self._queries.data
        angles = np.minimum(np.maximum(arm.angles(q) + ahead * v, self._limits[0]), self._limits[1])
        pin.computeJointJacobians(arm.model, self._data, arm.configurations(angles))
        pin.updateGeometryPlacements(arm.model, self._data, world.geometry_model, data)
        moved = set()
        for k in near.tolist():
            shape = int(world.pair_shapes[k, 1])
            if shape not in moved:
                moved.add(shape)
                pose, twist = data.oMg[shape], world.twist[k]
                x = pose.translation
                step = ahead * (twist[:3] + np.cross(twist[3:], x)) if twist[3:].any() else ahead * twist[:3]
                data.oMg[shape] = pin.SE3(pose.rotation, x + step)
        self._queries.ask(near)
        begin = (self._turn + 1) * world.n_pairs
        self._count[self._turn + 1] = _miss_rows(
            near, self._queries.rows, self._jacobian, world.sign, v, np.array([miss, P["reach"], max(ahead - P["lag"], 0.03), P["wa"]]), self._rows[begin:]
        )


@compiled
def _widen(reach: Array, is_moving: NDArray[np.bool_], twist: Array, numbers: Array) -> None:
    for k in range(reach.shape[0]):
        wanted = numbers[3]
        if is_moving[k]:
            speed = math.sqrt(twist[k, 0] ** 2 + twist[k, 1] ** 2 + twist[k, 2] ** 2)
            wanted = numbers[0] + speed * max(numbers[1], numbers[2])
        reach[k] = max(reach[k], wanted)


@compiled
def _bounds(angles, v, nominal, gain, limits):
    n = v.size
    low, high, wanted = np.empty(n), np.empty(n), np.empty(n)
    for i in range(n):
        change = limits[3, i] / gain
        least = max(-limits[2, i], -_JOINT_DECAY * max(angles[i] - limits[0, i], 0.0))
        most = min(limits[2, i], _JOINT_DECAY * max(limits[1, i] - angles[i], 0.0))
        low[i] = min(max(least, v[i] - change), v[i] + change)
        high[i] = min(max(most, v[i] - change), v[i] + change)
        wanted[i] = min(max(nominal[i], low[i]), high[i])
    return low, high, wanted


@compiled
def _may_meet(state, rows, is_moving, lipschitz, twist, way, ahead, reach, near):
    count = 0
    for k in range(state.shape[0]):
        if state[k] == 0 or not is_moving[k]:
            continue
        x, y, z = twist[k, 0], twist[k, 1], twist[k, 2]
        gone = math.sqrt(x * x + y * y + z * z) * ahead + pair_motion(lipschitz, k, way)
        if rows[k, 0] - gone < reach:
            near[count] = k
            count += 1
    return count


@compiled
def _miss_rows(near, rows, jacobian, sign, v, numbers, table):
    count, n = 0, v.size
    for k in near:
        h = rows[k, 0] - numbers[0]
        if h > numbers[1]:
            continue
        row, weight = table[count], numbers[3]
        for j in range(n):
            row[j] = 0.0
        add_pair_gradient(rows[k], jacobian, sign[k], weight, row[:n])
        bound = -weight * h / numbers[2]
        for j in range(n):
            bound += row[j] * v[j]
        row[n] = bound
        count += 1
    return count


@compiled
def _binding(rows, count, n_pairs, low, high, wanted, chosen):
    some, violated, n = 0, False, low.size
    for block in range(count.size):
        for k in range(block * n_pairs, block * n_pairs + count[block]):
            least, now = 0.0, 0.0
            for j in range(n):
                slope = rows[k, j]
                least += slope * (low[j] if slope > 0.0 else high[j])
                now += slope * wanted[j]
            if least < rows[k, n]:
                violated |= now < rows[k, n]
                for j in range(n + 1):
                    chosen[some, j] = rows[k, j]
                some += 1
    return some, violated


@compiled
def _density_rows(state, rows, jacobian, sign, twist, is_moving, numbers, v, most, table):
    count, n = 0, sign.shape[1]
    for k in range(state.shape[0]):
        if state[k] == 0:
            continue
        h = rows[k, 0] - numbers[0]
        if is_moving[k]:
            rate, width, decay = pair_rate(rows[k], twist[k]), numbers[1], numbers[2]
            h -= numbers[3] + numbers[4] * max(0.0, -rate)
            if h >= width:
                continue
            weight = 1.0
        elif h >= numbers[5]:
            continue
        else:
            rate, width, decay, weight = 0.0, 1.0, 0.0, numbers[7]
        for j in range(n):
            table[count, j] = 0.0
        add_pair_gradient(rows[k], jacobian, sign[k], weight, table[count, :n])
        if is_moving[k]:
            slope = log_inverse_bump(max(h, 1e-5 * width), width, 0.0)[1]
            bound = -decay / max(slope, 1e-9) - rate - 4.0 * min(h, 0.0)
        else:
            speed, brake = 0.0, 0.0
            for j in range(n):
                speed -= table[count, j] * v[j] / weight
                brake += abs(table[count, j]) * most[j] / weight
            left = max(h - 0.03 * max(speed, 0.0), 0.0)
            bound = -min(10.0 * left, math.sqrt(2.0 * numbers[6] * brake * left))
        table[count, n] = weight * bound
        count += 1
    return count
