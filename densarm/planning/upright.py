"""Ways on which a frame stays upright: a search on what keeps it so, each edge of it proved."""

import math
import time

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from densarm.arms.arm import Arm
from densarm.arms.models import frame_index
from densarm.arms.upright import Upright
from densarm.density.sub_goals import GuidePath
from densarm.planning.goals import Goal, candidates, goal_list, way_cost
from densarm.planning.guide import FreeSpace, PlannedPath, PlanningParameters
from densarm.planning.motion import PlanningError
from densarm.planning.path_margins import ends_between
from densarm.planning.rounding import rounded
from densarm.planning.sampling import Bounds, SamplingBounds
from densarm.planning.shortening import shortened
from densarm.values.arrays import Array
from densarm.values.outcome import Outcome
from densarm.world.configurations import infeasibility
from densarm.world.separating_planes import SeparatingPlanes
from densarm.world.swept_check import SweptCheck

_PATH_SHARE = 0.8  # of the angle, that a polyline takes; the rest is for what is smooth near it
_RIGHTED_SHARE = 0.4  # of the angle, to which samples are righted, so that edges have room
_FLOOR = 1e-3  # [rad] that joints tilt at most on a segment which is not halved any more
_STEPS = 0.1, 0.3  # [rad or m] of edges at least and at most
_RIGHTINGS = 5  # tries to right a sample
_DAMPING = 1e-4
_MET = 1e-9  # [rad or m] from one configuration to another that is the same
_LEAST_GAIN = 1e-3  # [rad or m] of an edge towards its target
_NEAR_SHARE = 0.3  # of the samples, that are drawn near both ends
_IN_WORLD = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
_ATTEMPTS = ((1.0, 300), (0.25, 700), (0.05, 1500))  # shares of the path margin, iterations
_BENDS = 1500


class UprightSpace:
    r"""Free space in which a frame is upright as well, proved like distances.

    A segment keeps it within an angle β if, θ the tilt and r_j its rates,

    .. math:: \theta(q_a) + \theta(q_b) + \sum_j r_j |\Delta q_j| < 2 \beta;

    else its halves are asked.

    Args:
        arm: the arm.
        freedom: proves that nothing is touched.
        upright: what is kept so, within four fifths of its angle.
    """

    def __init__(self, arm: Arm, freedom: FreeSpace, upright: Upright) -> None:
        self.arm, self.upright = arm, upright
        self.most = _PATH_SHARE * upright.within
        self._freedom, self._rates = freedom, upright.rates(arm)
        self._index = frame_index(arm.model, upright.frame)

    def configuration_is_clear(self, q: Array) -> bool:
        """Return whether the frame is upright at q (nq,), and nothing touched."""
        return self.segment_is_clear(q, q)

    def segment_is_clear(self, q_a: Array, q_b: Array) -> bool:
        """Return whether that is proved for a whole segment, ends (nq,)."""
        begin = self.arm.angles(q_a)
        ends = np.stack([begin, begin + self.arm.difference(q_a, q_b)])
        return self._stays_upright(ends) and self._freedom.segment_is_clear(q_a, q_b)

    def polyline_is_clear(self, angles: Array) -> bool:
        """Return whether it is for all segments between joint positions (N, nv) [rad or m]."""
        return self._stays_upright(angles) and self._freedom.polyline_is_clear(angles)

    def righted(self, q: Array) -> Array:
        """Return a configuration near q (nq,) at which the frame is upright, if one is found."""
        arm, model, data = self.arm, self.arm.model, self.arm.data
        for _ in range(_RIGHTINGS):
            pin.computeJointJacobians(model, data, q)
            turn = pin.updateFramePlacement(model, data, self._index).rotation
            up = turn @ self.upright.up
            sine = math.hypot(up[0], up[1])
            excess = math.atan2(sine, up[2]) - _RIGHTED_SHARE * self.upright.within
            if excess <= 0.0:
                break
            jacobian = pin.getFrameJacobian(model, data, self._index, _IN_WORLD)[3:5]
            wanted = excess / sine * np.array([up[1], -up[0]])
            square = jacobian @ jacobian.T + _DAMPING * np.eye(2)
            q = arm.integrate(q, jacobian.T @ np.linalg.solve(square, wanted))
        return q

    def _stays_upright(self, angles: Array) -> bool:
        tilt = self._tilts(angles)
        begin, end, tilts = angles[:-1], angles[1:], np.stack([tilt[:-1], tilt[1:]])
        while (tilt <= self.most).all():
            way = np.abs(end - begin) @ self._rates
            unproved = tilts.sum(axis=0) + way >= 2.0 * self.most
            if not unproved.any():
                return True
            if way[unproved].max() < _FLOOR:
                return False
            begin, end, tilts = begin[unproved], end[unproved], tilts[:, unproved]
            middle = 0.5 * (begin + end)
            tilt = self._tilts(middle)
            begin, end = np.vstack([begin, middle]), np.vstack([middle, end])
            tilts = np.hstack([[tilts[0], tilt], [tilt, tilts[1]]])
        return False

    def _tilts(self, angles: Array) -> Array:
        return self.upright.tilts(self.arm, self.arm.configurations(angles))


def planned_upright(
    check: SweptCheck,
    start: ArrayLike,
    goal: Goal,
    upright: Upright,
    path_margin: float,
    search: PlanningParameters,
    seed: int,
) -> PlannedPath:
    """Plan to the goal that is soonest reached on ways that keep a frame upright.

    Args:
        check: the world and the safety margin.
        start: configuration (nq,).
        goal: configurations and poses, of which any will do.
        upright: what is kept upright, by start and goal too.
        path_margin: distance that ways keep beyond the margin [m].
        search: how long and how finely.
        seed: of all.

    Raises:
        PlanningError: no goal is feasible or upright, or none is reached.
    """
    began, arm = time.perf_counter(), check.arm
    start, goals = arm.check_configuration("start", start), goal_list(arm, goal)
    if fault := infeasibility(check, {"start": start}):
        raise PlanningError(Outcome.INFEASIBLE, fault)
    found = candidates(check, start, goals, seed, search.solutions, path_margin)
    tilts = upright.tilts(arm, np.stack([start, *(q for q, *_ in found)]))
    most = _PATH_SHARE * upright.within
    told = f"of {upright.frame!r}, of which plans take {most:.3g} rad at most"
    if tilts[0] > most:
        raise PlanningError(Outcome.INFEASIBLE, f"start: a tilt of {tilts[0]:.3g} rad {told}")
    level = [goal for goal, tilt in zip(found, tilts[1:], strict=True) if tilt <= most]
    if not level:
        raise PlanningError(Outcome.INFEASIBLE, f"goal: a tilt of {tilts[1:].min():.3g} rad {told}")
    for share, iterations in _ATTEMPTS:
        for q, *_ in level[: search.goals]:
            ends = ends_between(check, start, q)
            kept = np.minimum(share * path_margin, ends.least)
            planes = SeparatingPlanes(check.world, check.margin, kept)
            space = UprightSpace(arm, planes, upright)
            points = _path(space, ends.depart, ends.arrive, search, iterations, seed)
            if points is None:
                continue
            way = GuidePath(points, is_clear=True, found_by="a search that keeps it upright")
            took, cost = time.perf_counter() - began, way_cost(arm, points)
            return PlannedPath(way, kept, took, q, cost, is_rounded=True, upright=upright)
    tried = f"{min(len(level), search.goals)} goals"
    within = f"{upright.frame!r} stays within {upright.within:.3g} rad of upright"
    raise PlanningError(Outcome.NO_PATH, f"no way to {tried} was found on which {within}")


def _path(
    space: UprightSpace,
    start: Array,
    goal: Array,
    search: PlanningParameters,
    iterations: int,
    seed: int,
) -> Array | None:
    """Return a way (W, nq) of edges that are proved, shortened and rounded; None if none is found.

    Two trees of righted configurations grow towards samples and each other, as RRT-Connect's.

    Source: D. Berenson, S. Srinivasa, D. Ferguson, J. Kuffner, Manipulation Planning on Constraint
        Manifolds, ICRA 2009.
    """
    arm, rng = space.arm, np.random.default_rng(seed)
    if space.segment_is_clear(start, goal):
        return np.stack([start, goal])
    bounds = SamplingBounds(arm, search, start, goal)
    trees, near = [_Tree(space, bounds.everywhere, q) for q in (start, goal)], bounds.near
    target = trees[1].q[0]
    for k in range(iterations):
        own, other = trees[k % 2], trees[1 - k % 2]
        at = own.grow(target)
        met = other.grow(own.q[at])
        if np.abs(arm.difference(own.q[at], other.q[met])).max() < _MET:
            ways = own.way(at), other.way(met)
            first, second = ways if k % 2 == 0 else ways[::-1]
            points = np.vstack([first, second[::-1][1:]])
            points = shortened(arm, space, points, search.shortcuts, rng)
            return rounded(arm, space, points, _BENDS, rng)
        box = near if k < _NEAR_SHARE * iterations else bounds.everywhere
        target = arm.configurations(box.draw(rng))
    return None


class _Tree:
    """Configurations that are joined by proved edges.

    Args:
        space: proves them.
        bounds: where they are.
        root: the first (nq,).
    """

    def __init__(self, space: UprightSpace, bounds: Bounds, root: Array) -> None:
        self._space, self._bounds = space, bounds
        self.q, self._parents = root[np.newaxis], [0]
        self._step = float(np.clip(2.0 * space.upright.within, *_STEPS))

    def grow(self, target: Array) -> int:
        """Grow towards a configuration (nq,) as far as is clear, and return the nearest one."""
        arm, space = self._space.arm, self._space
        steps = arm.difference(self.q, target)
        at = int(np.linalg.norm(steps, axis=1).argmin())
        left, step = math.inf, steps[at]
        while (now := float(np.linalg.norm(step))) > _MET and now < left - _LEAST_GAIN:
            q = arm.integrate(self.q[at], step * min(1.0, self._step / now))
            if now > self._step:
                q = space.righted(q)
            angles = arm.angles(q)
            if (angles < self._bounds.lower).any() or (angles > self._bounds.upper).any():
                break
            if not space.segment_is_clear(self.q[at], q):
                break
            self._parents.append(at)
            self.q, at = np.vstack([self.q, q]), len(self.q)
            left, step = now, arm.difference(q, target)
        return at

    def way(self, at: int) -> Array:
        """Return the configurations from the root to one of them (W, nq)."""
        rows = [at]
        while rows[-1]:
            rows.append(self._parents[rows[-1]])
        return self.q[rows[::-1]]
