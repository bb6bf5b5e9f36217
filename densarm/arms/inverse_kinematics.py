"""Inverse kinematics: joint positions that take a frame to a pose, by Levenberg and Marquardt.

Of what can be installed beside Pinocchio 4.1 nothing serves every pose of every arm:
roboplan-simple-ik takes whole poses alone and ends by the clock, optik takes no continuous joints,
pin-pink misses one pose in ten. One compiled kernel does, and gives the same bits each time.
"""

import math
from collections.abc import Iterator
from typing import NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from densarm.arms.arm import Arm
from densarm.arms.joint_space import compose, joint_rows, place_joints, pose_row
from densarm.arms.models import frame_index
from densarm.arms.pose import AXES, Pose
from densarm.errors import InvalidValueError
from densarm.values.arrays import Array
from densarm.values.cholesky import factorise, solve_factorised
from densarm.values.kernels import compiled, compiled_part

_STARTS = 300  # at random
_FAR = 20.0  # [m], a position that rather is in millimetres
_LENGTH = 0.3  # [m] that an error of position counts as a radian by
_DAMPING = 0.05  # of the squared error, that steps are damped by
_LEAST_DAMPING = 1e-10
_LONGEST_STEP = 1.0  # [rad or m] of a joint
_STEPS = 40  # from one start at most
_PATIENCE = 8  # steps, in which the error must halve
_EXACT = 1e-7  # [rad, or _LENGTH], error at which a pose is reached
_CLOSE = 3e-5  # where no step leads nearer: of five joints whose axes are parallel but for rounding
_PULLS = 30  # steps towards the configuration to be near to, at most
_PULL = 0.5  # share of the way there that a step would go
_PULLED = 1e-3  # [rad or m] of a joint, a pull that gains nothing


class InverseKinematics:
    """Configurations of an arm that take a frame to a pose, inside the position limits.

    Args:
        arm: the arm.
        pose: of one of its frames.

    Raises:
        UnknownNameError: no such frame.
        InvalidValueError: a frame that no joint moves.
    """

    def __init__(self, arm: Arm, pose: Pose) -> None:
        self._arm, self._pose = arm, pose
        self._mechanism, self._target = mechanism_of(arm, pose.frame), _target(arm, pose)

    def solutions(self, near: Array, seed: int) -> Iterator[tuple[Array, ...]]:
        """Yield ways to reach the pose: each a configuration (nq,) and others in its place.

        The first begins near a configuration (nq,), the others anywhere. Of each the one that is
        nearest along the solutions around it comes first. Joints are as few turns away as may be.
        """
        arm, wanted = self._arm, self._arm.angles(near)
        random, limits = np.random.default_rng(seed), arm.limits
        lower = np.where(np.isfinite(limits.lower), limits.lower, -np.pi)
        upper = np.where(np.isfinite(limits.upper), limits.upper, np.pi)
        starts = np.vstack([wanted, random.uniform(lower, upper, (_STARTS, arm.nv))])
        first, out = 0, np.empty((2, arm.nv))
        while (first := solve(self._mechanism, self._target, starts, first, wanted, out)) > 0:
            ways = np.array([self._turned_near(angles, wanted) for angles in out])
            # A pull that meets limits may lead away.
            nearer = np.argsort(np.linalg.norm(ways - wanted, axis=1), kind="stable")
            yield tuple(arm.configurations(ways[nearer]))

    def shortfall(self) -> str:
        """Return, as a phrase, how far the nearest to the pose is that can be reached."""
        alone = Pose(self._pose.frame, self._pose.position)
        position, _ = self._nearest(_target(self._arm, alone))
        if position > _LENGTH * _CLOSE:
            unit = "; positions are in metres" if np.abs(self._pose.position).max() > _FAR else ""
            return f"is out of reach: the nearest found is {position:.3g} m off{unit}"
        position, turn = self._nearest(self._target)
        return (
            "is out of reach, though its position alone is not: the nearest found is "
            f"{1e3 * position:.3g} mm and {np.degrees(turn):.3g}° off"
        )

    def _nearest(self, target: "Target") -> tuple[float, float]:
        """Return how far the target is off where it is least [m, rad]."""
        arm, out = self._arm, np.empty((2, self._arm.nv))
        near = np.clip(0.0, arm.limits.lower, arm.limits.upper)
        low, high = np.clip([arm.limits.lower, arm.limits.upper], -np.pi, np.pi)
        starts = np.random.default_rng(0).uniform(low, high, (_STARTS, arm.nv))
        solve(self._mechanism, target, starts, 0, near, out)
        return reach(self._mechanism, target, out[0])

    def _turned_near(self, angles: Array, near: Array) -> Array:
        """Return joint positions (nv,) with whole turns taken off, where limits allow it."""
        limits, turn = self._arm.limits, 2.0 * np.pi
        fewer = angles - turn * np.rint((angles - near) / turn)
        fewer = np.where(fewer < limits.lower, fewer + turn, fewer)
        fewer = np.where(fewer > limits.upper, fewer - turn, fewer)
        turns = self._mechanism.joints[1:, 15] == 0.0
        return np.where(turns & (limits.excess(fewer) <= 0.0), fewer, angles)


class Mechanism(NamedTuple):
    """What carries a frame, as arrays."""

    parent: NDArray[np.int64]
    """Joint that each joint moves with (njoints,)."""
    joints: Array
    """`joint_rows` of the model (njoints, 16)."""
    last: int
    """The joint that carries the frame."""
    tool: Array
    """Pose of the frame in that of the joint (12,)."""
    limits: Array
    """Lowest and highest joint positions (2, nv) [rad or m]."""


class Target(NamedTuple):
    """What a frame shall do, as arrays."""

    pose: Array
    """Where it shall be, seen from the origin of the models (12,)."""
    axis: Array
    """Axis of the frame about which it may turn (3,), or zeros."""
    turns: bool
    """Whether its orientation counts."""


_MADE: WeakKeyDictionary[Arm, dict[str, Mechanism]] = WeakKeyDictionary()


def mechanism_of(arm: Arm, frame: str) -> Mechanism:
    """Return what carries a frame, kept as long as the arm is.

    Raises:
        UnknownNameError: no such frame.
        InvalidValueError: a frame that no joint moves.
    """
    made = _MADE.setdefault(arm, {})
    if frame not in made:
        made[frame] = _new_mechanism(arm, frame)
    return made[frame]


def _new_mechanism(arm: Arm, frame: str) -> Mechanism:
    carried = arm.model.frames[frame_index(arm.model, frame)]
    if carried.parentJoint == 0:
        raise InvalidValueError("frame", frame, f"one that a joint of {arm.name!r} moves")
    return Mechanism(
        np.array(list(arm.model.parents), np.int64),
        joint_rows(arm.model),
        int(carried.parentJoint),
        pose_row(carried.placement),
        np.stack([arm.limits.lower, arm.limits.upper]),
    )


def _target(arm: Arm, pose: Pose) -> Target:
    placement = pose.placement
    placement.translation -= arm.origin
    axis = np.array([float(pose.free == name) for name in AXES])
    return Target(pose_row(placement), axis, pose.orientation_xyzw is not None)


@compiled
def solve(arm: Mechanism, goal: Target, starts: Array, first: int, near: Array, out: Array) -> int:
    r"""Look for joint positions that reach a target, from one start after the other.

    .. math:: \Delta = d + J^T (J J^T + \lambda I)^{-1} (e - J d), \qquad \lambda \propto e^T e,

    with d = 0 until e is; then d leads along the solutions towards a configuration to be near to.
    Joints that would leave their limits stay there.

    Args:
        arm: what carries the frame.
        goal: the target.
        starts: joint positions to begin at (M, nv) [rad or m].
        first: number of the first start to be used.
        near: joint positions to be near to (nv,) [rad or m].
        out: the solution as it was found, and pulled near, overwritten; or where none was found,
            the best of all starts in the first row (2, nv) [rad or m].

    Returns:
        How many starts were used; minus one if none led to the target.

    Source: T. Sugihara, Solvability-Unconcerned Inverse Kinematics by the Levenberg-Marquardt
        Method, IEEE T-RO 27 (2011); A. Liégeois, IEEE T-SMC 7 (1977), for d.
    """
    nv = near.size
    angles, step = np.empty(nv), np.zeros(nv)
    work = _work(arm.parent.size, nv)
    least = math.inf
    for index in range(first, starts.shape[0]):
        for j in range(nv):
            angles[j] = starts[index, j]
        error, best, waited = math.inf, math.inf, 0
        for _ in range(_STEPS):
            error = _error(arm, goal, angles, step, work)
            if error < least:
                least = error
                for j in range(nv):
                    out[0, j] = angles[j]
            waited += 1
            if error < 0.5 * best:
                best, waited = error, 0
            if error < _EXACT or waited > _PATIENCE:
                break
            _advance(arm, angles, near, 0.0, error, work)
        if not error < _CLOSE:
            continue
        for j in range(nv):
            out[0, j] = out[1, j] = angles[j]
        _pull_near(arm, goal, angles, near, work, out[1])
        return index + 1
    return -1


@compiled_part
def _pull_near(
    arm: Mechanism,
    goal: Target,
    angles: Array,
    near: Array,
    work: tuple[Array, Array, Array, Array, Array],
    out: Array,
) -> None:
    """Write the solution nearest to a configuration along those around angles, overwritten."""
    rest = np.zeros(near.size)
    for _ in range(_PULLS):
        error = _error(arm, goal, angles, rest, work)
        if _advance(arm, angles, near, _PULL, error, work) < _PULLED:
            break
    for _ in range(_STEPS):
        error = _error(arm, goal, angles, rest, work)
        if error < _EXACT:
            for j in range(near.size):
                out[j] = angles[j]
            break
        _advance(arm, angles, near, 0.0, error, work)


@compiled
def reach(arm: Mechanism, goal: Target, angles: Array) -> tuple[float, float]:
    """Return how far a target is off at joint positions (nv,) [m, rad]."""
    work = _work(arm.parent.size, angles.size)
    _error(arm, goal, angles, np.zeros(angles.size), work)
    e = work[2]
    position = math.sqrt(e[0] ** 2 + e[1] ** 2 + e[2] ** 2)
    return _LENGTH * position, math.sqrt(e[3] ** 2 + e[4] ** 2 + e[5] ** 2)


@compiled_part
def _work(n_joints: int, nv: int) -> tuple[Array, Array, Array, Array, Array]:
    """Return room for poses of joints, the frame's, e, J and J Jᵀ + λ I."""
    return np.empty((n_joints, 12)), np.empty(12), np.zeros(6), np.zeros((6, nv)), np.empty((6, 6))


@compiled_part
def _error(
    arm: Mechanism,
    goal: Target,
    angles: Array,
    step: Array,
    work: tuple[Array, Array, Array, Array, Array],
) -> float:
    """Write the error e at joint positions and its Jacobian J; return the norm of e."""
    poses, frame, e, jacobian = work[0], work[1], work[2], work[3]
    place_joints(arm.parent, arm.joints, angles, step, 0.0, poses)
    compose(poses[arm.last], arm.tool, frame)
    for i in range(3):
        e[i] = (goal.pose[9 + i] - frame[9 + i]) / _LENGTH
        e[3 + i] = 0.0
    x = y = z = 0.0  # the free axis in the world
    if goal.turns:
        x, y, z = _write_turn(goal, frame, e)
    for r in range(6):
        for j in range(angles.size):
            jacobian[r, j] = 0.0
    joint = arm.last
    while joint > 0:
        j, pose, row = joint - 1, poses[joint], arm.joints[joint]
        a, b, c = _turned(pose, row[12:15])
        if row[15] > 0.0:
            jacobian[0, j], jacobian[1, j], jacobian[2, j] = a, b, c
        else:
            u, v, w = frame[9] - pose[9], frame[10] - pose[10], frame[11] - pose[11]
            jacobian[0, j], jacobian[1, j] = b * w - c * v, c * u - a * w
            jacobian[2, j] = a * v - b * u
            if goal.turns:
                along = a * x + b * y + c * z
                jacobian[3, j], jacobian[4, j] = a - along * x, b - along * y
                jacobian[5, j] = c - along * z
        for i in range(3):
            jacobian[i, j] /= _LENGTH
        joint = arm.parent[joint]
    square = 0.0
    for r in range(6):
        square += e[r] * e[r]
    return math.sqrt(square)


@compiled_part
def _write_turn(goal: Target, frame: Array, e: Array) -> tuple[float, float, float]:
    """Write the turn to the goal's orientation; return the free axis in the world, or zeros."""
    want, axis = goal.pose, goal.axis
    x, y, z = _turned(frame, axis)
    cosine = -1.0
    if axis[0] + axis[1] + axis[2] > 0.0:
        a, b, c = _turned(want, axis)
        e[3], e[4], e[5] = y * c - z * b, z * a - x * c, x * b - y * a
        cosine = x * a + y * b + z * c
    else:
        # R_goal Rᵀ, whose entries are products of the rows of both.
        for i in range(3):
            k, m = (i + 1) % 3, (i + 2) % 3
            for n in range(3):
                e[3 + i] += 0.5 * want[3 * m + n] * frame[3 * k + n]
                e[3 + i] -= 0.5 * want[3 * k + n] * frame[3 * m + n]
                cosine += want[3 * i + n] * frame[3 * i + n]
        cosine *= 0.5
    sine = math.sqrt(e[3] ** 2 + e[4] ** 2 + e[5] ** 2)
    if sine > 1e-12:
        turn = math.atan2(sine, cosine) / sine
        for i in range(3, 6):
            e[i] *= turn
    elif cosine < 0.0:
        e[3] = math.pi  # any axis will do
    return x, y, z


@compiled_part
def _turned(pose: Array, axis: Array) -> tuple[float, float, float]:
    x, y, z = axis[0], axis[1], axis[2]
    return (
        pose[0] * x + pose[1] * y + pose[2] * z,
        pose[3] * x + pose[4] * y + pose[5] * z,
        pose[6] * x + pose[7] * y + pose[8] * z,
    )


@compiled_part
def _advance(  # noqa: C901  # as it reads
    arm: Mechanism,
    angles: Array,
    near: Array,
    pull: float,
    error: float,
    work: tuple[Array, Array, Array, Array, Array],
) -> float:
    """Make a step by `work` as `_error` left it; return its longest joint [rad or m]."""
    e, jacobian, square = work[2], work[3], work[4]
    nv, longest = angles.size, 0.0
    lower, upper = arm.limits[0], arm.limits[1]
    step, wish = np.empty(nv), np.empty(nv)
    for j in range(nv):
        slope = 0.0
        for r in range(6):
            slope += jacobian[r, j] * e[r]
        wish[j] = pull * (near[j] - angles[j])
        slope = wish[j] if pull > 0.0 else slope
        # At a limit that it presses against.
        if (angles[j] <= lower[j] and slope < 0.0) or (angles[j] >= upper[j] and slope > 0.0):
            wish[j] = 0.0
            for r in range(6):
                jacobian[r, j] = 0.0
    for r in range(6):
        for j in range(nv):
            e[r] -= jacobian[r, j] * wish[j]
        for s in range(r + 1):
            total = 0.0
            for j in range(nv):
                total += jacobian[r, j] * jacobian[s, j]
            square[s, r] = total
        square[r, r] += _DAMPING * error * error + _LEAST_DAMPING
    factorise(square, square)
    solve_factorised(square, e)
    for j in range(nv):
        step[j] = wish[j]
        for r in range(6):
            step[j] += jacobian[r, j] * e[r]
        longest = max(longest, abs(step[j]))
    share = min(1.0, _LONGEST_STEP / longest) if longest > 0.0 else 0.0
    longest = 0.0
    for j in range(nv):
        moved = min(max(angles[j] + share * step[j], lower[j]), upper[j])
        longest = max(longest, abs(moved - angles[j]))
        angles[j] = moved
    return longest
