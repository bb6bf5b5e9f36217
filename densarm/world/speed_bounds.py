"""How fast things may be: bounds on the speed of obstacles for an arm at one state."""

import numpy as np
from numpy.typing import ArrayLike

from densarm.values.arrays import Array
from densarm.values.checks import finite_vector, non_negative, positive
from densarm.world.stopping import HELD_SHARE, StoppingTrajectory
from densarm.world.world import DISTANCE_TOLERANCE, World

_FASTEST = 1e3  # [rad/s or m/s], where joints have no limit


def passive_speeds(
    world: World, q: ArrayLike, v: ArrayLike, margin: float = 0.0, reaction: float = 0.05
) -> Array:
    r"""Return the speeds below which no obstacle can reach an arm before it is at rest.

    .. math:: w_k = \frac{d_k - m - \sum_j r_{kj} |\dot q_j| (T/2 + s)}{T + s}

    An obstacle none of whose points is faster does not come nearer than m, whichever way it takes,
    while the arm goes on at q̇ for a time s and then comes to rest straight and evenly within T,
    the time of its `StoppingTrajectory` from this state.

    Args:
        world: the arm among obstacles.
        q: configuration (nq,).
        v: velocity (nv,) [rad/s or m/s].
        margin: m [m].
        reaction: s [s].

    Returns:
        w_k of each pair (K,) [m/s]: below zero where even what stands may be touched, infinite for
        pairs of the arm's own bodies.

    Raises:
        InvalidValueError: no configuration or velocity of the arm, or a number out of its range.
    """
    q = world.arm.check_configuration("configuration", q)
    v = finite_vector("velocity", v, world.arm.nv)
    stop = StoppingTrajectory(world.arm, HELD_SHARE).duration(q, v)
    reaction = positive("reaction", reaction)
    if not np.isfinite(stop):
        return _of_obstacles(world, np.full(world.n_pairs, -np.inf))
    way = world.motion_bound(v * (0.5 * stop + reaction))
    far = world.distances(q) - DISTANCE_TOLERANCE - non_negative("margin", margin) - way
    return _of_obstacles(world, far / (stop + reaction))


def evasion_speeds(
    world: World, q: ArrayLike, margin: float = 0.0, reaction: float = 0.05
) -> Array:
    r"""Return how fast obstacles may come straight at an arm at rest that flees: a guide.

    .. math::

        w_k = \min\Big(u_k, \frac{u_k}{T}\big(\sqrt{s^2 + 2 T (d_k - m) / u_k} - s\big)\Big),
        \quad u_k = \sum_j |\partial d_k / \partial q_j| \dot q_j^{max}

    After a time s all joints go the way that takes the nearest point of a body along the normal,
    and reach their velocity limits within T = max_j of those over the acceleration limits. What
    comes at w_k then stays m away at least, to first order in that way, with no other obstacle, and
    as far as joint limits and torques allow. What passes by may be faster, since an arm steps
    aside; a body that no joint can move out of the way has zero.

    Args:
        world: the arm among obstacles.
        q: configuration (nq,).
        margin: m [m].
        reaction: s [s].

    Returns:
        w_k of each pair (K,) [m/s], infinite for pairs of the arm's own bodies.

    Raises:
        InvalidValueError: no configuration of the arm, or a number out of its range.
    """
    limits, sample = world.arm.limits, world.clearance(q)
    reaction, margin = non_negative("reaction", reaction), non_negative("margin", margin)
    velocity = np.minimum(limits.velocity, _FASTEST)
    fastest, ramp = np.abs(sample.gradient) @ velocity, (velocity / limits.acceleration).max()
    left = np.maximum(sample.distance - margin, 0.0)
    # The room that is lost until the arm is as fast: w s + w² T / (2 u).
    with np.errstate(divide="ignore", invalid="ignore"):
        scale = fastest / ramp
        found = scale * (np.sqrt(reaction**2 + 2.0 * left / scale) - reaction)
    found = np.where(fastest > 0.0, np.minimum(fastest, found), 0.0)
    return _of_obstacles(world, np.where(np.isfinite(sample.distance), found, np.inf))


def _of_obstacles(world: World, speeds: Array) -> Array:
    is_own = world.pair_shapes[:, 1] < world.arm.collision_model.ngeoms
    return np.where(is_own, np.inf, speeds)
