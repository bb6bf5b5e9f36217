"""Tracking tubes: how far off a motion an arm may be and still touches nothing."""

import math

import numpy as np

from densarm.values.arrays import Array
from densarm.world.stopping import StoppingCheck, StoppingTrajectory
from densarm.world.world import World

_EVERY = 4  # samples from one that is proved to the next
_NARROWEST, _WIDEST = 1e-4, 0.1  # [rad or m], of a joint with levers of 1 m
_HALVINGS = 7  # of the range between, in its logarithm
_PROVED_SHARE = 0.95  # of what is found; the rest is for proofs by other steps
_SHORTEST_LEVER = 0.05  # [m]
_AT_LIMIT = 2.5e-3  # [rad or m] from a position limit, which start or goal may be at


def tracking_tube(world: World, angles: Array, v: Array) -> Array | None:
    r"""Return joint bounds ε (nv,) on the error under which a motion stays proved clear, or None.

    .. math::

        \epsilon_j = s / \sqrt{R_j}, \quad R_j = \max_k r_{kj}, \qquad
        d_k > \mu_k(\epsilon) = \sum_j r_{kj} \epsilon_j

    of every pair k, on the whole motion and on the stopping trajectories from it, with the largest
    s by bisection on the proof: errors of real arms too are larger where levers are shorter. It
    ends at position limits, but for a joint that the motion itself takes to one. There is None
    where obstacles move, or the motion is not clear.

    Args:
        world: the arm among obstacles, as they are now.
        angles: joint positions on the motion (N, nv) [rad or m]; continuous joints count turns.
        v: velocities there (N, nv) [rad/s or m/s].
    """
    arm, limits = world.arm, world.arm.limits
    if world.fastest_obstacle > 0.0:
        return None
    bend = np.abs(np.diff(angles, 2, axis=0)).max(axis=0, initial=0.0)
    departure = bend * _EVERY**2 / 8.0  # from the chord of so many samples
    shown = np.append(np.arange(0, len(angles) - 1, _EVERY), len(angles) - 1)
    angles, v = angles[shown], v[shown]
    stops = StoppingTrajectory(arm)
    travel = 0.5 * stops.durations(arm.configurations(angles), v)[:, np.newaxis] * v
    ends = np.vstack([angles, angles + travel])
    if not np.isfinite(ends).all():
        return None
    room = np.minimum(ends - limits.lower, limits.upper - ends).min(axis=0)
    room[room < _AT_LIMIT] = np.inf
    shape = 1.0 / np.sqrt(np.maximum(world.lipschitz.max(axis=0, initial=0.0), _SHORTEST_LEVER))
    steps = np.diff(angles, axis=0)

    def is_clear(tube: Array) -> bool:
        check = StoppingCheck(world, stops, 0.0, world.lipschitz @ (tube + departure))
        return bool(
            check.are_clear(angles[:-1], steps).all() and check.are_clear(angles, travel).all()
        )

    low, high, found = _NARROWEST, _WIDEST, None
    for _ in range(_HALVINGS):
        middle = math.sqrt(low * high)
        tube = np.minimum(middle * shape, room)
        if is_clear(tube):
            low, found = middle, tube
        else:
            high = middle
    return None if found is None else _PROVED_SHARE * found
