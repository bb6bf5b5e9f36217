"""Configurations that an arm can be at: why not, and random ones."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from densarm.arms.arm import Arm
from densarm.arms.dynamics import holding_ratios, holding_torque
from densarm.arms.joint_space import sliding_joints
from densarm.arms.joints import POSITION_TOLERANCE
from densarm.errors import DensarmError
from densarm.values.arrays import Array
from densarm.world.swept_check import SweptCheck
from densarm.world.world import World

_DRAWS = 10_000
_TOLD = 2  # links in a cloud


def infeasibility(check: SweptCheck, ends: Mapping[str, Array]) -> str:
    """Return what makes an end of a motion infeasible, as a phrase; empty if nothing does.

    That is a position outside the limits, a weight that the arm cannot hold, or a contact.

    Args:
        check: the world, and the margin that counts as contact.
        ends: configurations (nq,) by what errors call them.
    """
    return "; ".join(
        f"{name}: {fault}"
        for name, q in ends.items()
        for fault in [
            *_limit_faults(check.arm, q),
            *_holding_faults(check.arm, q),
            *_contact_faults(check, q),
        ]
    )


def clear_configurations(
    world: World, count: int, seed: int | Sequence[int], margin: float = 0.0
) -> list[Array]:
    """Draw configurations evenly within the position limits, and keep those that are clear.

    Joints without limits are drawn from a whole turn. The first ones stay the same when more are
    drawn.

    Args:
        world: the arm among obstacles.
        count: number of configurations.
        seed: whole number >= 0, or several.
        margin: distance that every pair must exceed [m].

    Returns:
        Configurations (nq,).

    Raises:
        DensarmError: almost no configuration is clear.
    """
    random, arm = np.random.default_rng(seed), world.arm
    lower, upper = drawn_between(arm)

    def draw() -> Array:
        for _ in range(_DRAWS):
            q = arm.configurations(random.uniform(lower, upper))
            if world.distances_within(q, margin).min(initial=np.inf) > margin:
                return q
        raise DensarmError(
            f"robot {arm.name!r}: none of {_DRAWS} random configurations keeps "
            f"{1e3 * margin:g} mm from contact"
        )

    return [draw() for _ in range(count)]


def drawn_between(arm: Arm) -> tuple[Array, Array]:
    """Return the joint positions (nv,) that random ones are drawn between [rad or m]."""
    lower = np.where(np.isfinite(arm.limits.lower), arm.limits.lower, -np.pi)
    return lower, np.where(np.isfinite(arm.limits.upper), arm.limits.upper, np.pi)


def _limit_faults(arm: Arm, q: Array) -> Iterator[str]:
    limits, angles, turns = arm.limits, arm.angles(q), ~sliding_joints(arm.model)
    for j in np.flatnonzero(limits.excess(angles) > POSITION_TOLERANCE):
        # Digits enough to tell a position from the limit that it exceeds by the tolerance.
        allowed = f"[{limits.lower[j]:.12g}, {limits.upper[j]:.12g}]"
        asked = turns[j] and abs(angles[j]) > 2.0 * np.pi
        hint = ": are these degrees?" if asked else ""
        yield f"joint {arm.joint_names[j]!r} at {angles[j]:.12g} is outside {allowed}{hint}"


def _holding_faults(arm: Arm, q: Array) -> Iterator[str]:
    if holding_ratios(arm, q).max() > 1.0:
        yield holding_torque(arm, q)


def _contact_faults(check: SweptCheck, q: Array) -> Iterator[str]:
    distance = check.world.distances_within(q, check.margin)
    clouds = {slot.obstacle.name: list[int]() for slot in check.world.clouds}
    near = np.flatnonzero(distance <= check.margin)
    for k in near[np.argsort(distance[near])].tolist():
        names, gap = check.world.pair_names(k), distance[k] * 1e3
        if gap <= 0.0 and names[1] in clouds:
            clouds[names[1]].append(k)
            continue
        pair = " and ".join(names)
        yield f"{pair} overlap by {-gap:.3g} mm" if gap <= 0.0 else f"{pair} are {gap:.3g} mm apart"
    for name, inside in clouds.items():
        if inside:
            links = ", ".join(check.world.pair_names(k)[0] for k in inside[:_TOLD])
            more = f" and {len(inside) - _TOLD} more" if len(inside) > _TOLD else ""
            gap = 1e3 * distance[inside[0]]
            hint = "are its points the arm's own? A CloudFilter takes them out"
            yield f"{links}{more} overlap the cloud {name} by up to {-gap:.3g} mm: {hint}"
