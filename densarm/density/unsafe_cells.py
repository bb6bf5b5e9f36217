"""Unsafe components: where in the joint space an arm may touch something, cell by cell."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from densarm.arm import Arm
from densarm.arrays import Array
from densarm.errors import InvalidValueError
from densarm.proof.swept_bound import SweptBound
from densarm.validation import positive_integer

MAX_JOINTS = 3
"""The number of cells grows as their number per joint to this power."""

Cell = tuple[int, ...]


@dataclass(frozen=True)
class UnsafeComponent:
    """Cells of the joint space, connected by their faces, edges or corners."""

    centre: Array
    """Centres (C, nv) [rad or m]; on continuous joints unwrapped, so that neighbours are near."""
    half_width: Array
    """Half of a cell's width along each joint, shape (nv,) [rad or m]."""
    pairs: NDArray[np.int64]
    """Indices of the geometry pairs that may touch in these cells."""

    @property
    def corners(self) -> Array:
        """The corners of the cells, each once, shape (M, nv) [rad or m]."""
        steps = np.round((self.centre - self.centre[0]) / (2.0 * self.half_width)).astype(np.int64)
        ends = np.array(list(product((0, 1), repeat=len(self.half_width))))
        corner = np.unique((steps[:, np.newaxis] + ends).reshape(-1, ends.shape[1]), axis=0)
        origin = self.centre[0] - self.half_width
        return np.asarray(origin + 2.0 * self.half_width * corner)


def unsafe_components(bound: SweptBound, depth: int = 8) -> tuple[UnsafeComponent, ...]:
    r"""Map the unsafe set to joint space by coal: the cells that are not proved free of contact.

    The joint space is halved along every joint, `depth` times. A cell with centre c and half
    width η is clear of pair k, and dropped, where

    .. math:: d_k(c) > m + \sum_j r_{kj} \eta_j,

    m and r the margin and levers of the swept bound: every unsafe configuration lies in a cell
    that is kept.

    Args:
        bound: the swept bound of an arm with at most `MAX_JOINTS` joints, and the margin.
        depth: number of halvings; 2^depth cells per joint.

    Returns:
        The connected components of the cells that are left.

    Raises:
        InvalidValueError: too many joints, a joint with an infinite range, or a component that
            winds around a continuous joint.
    """
    arm = bound.arm
    lower, span = _ranges(arm)
    index = np.zeros((1, arm.nv), dtype=np.int64)
    halves = np.array(list(product((0, 1), repeat=arm.nv)))
    for level in range(1, positive_integer("depth", depth) + 1):
        index = (2 * index[:, np.newaxis] + halves).reshape(-1, arm.nv)
        width = span / 2.0**level
        centre = arm.configurations(lower + (index + 0.5) * width)
        slack = np.reshape([bound.slack(q) for q in centre], (-1, bound.clearance.n_pairs))
        near = slack <= bound.motion(0.5 * width)
        index, near = index[near.any(axis=1)], near[near.any(axis=1)]
    row_of = {cell: row for row, cell in enumerate(map(tuple, index.tolist()))}
    period = np.where(arm.is_circle, 2**depth, 0)
    return tuple(
        UnsafeComponent(
            lower + (np.array(list(member.values())) + 0.5) * width,
            0.5 * width,
            np.flatnonzero(near[[row_of[cell] for cell in member]].any(axis=0)),
        )
        for member in _connected(set(row_of), period, arm)
    )


def _ranges(arm: Arm) -> tuple[Array, Array]:
    """Return where each joint's range begins and how long it is, (nv,) each [rad or m]."""
    if arm.nv > MAX_JOINTS:
        raise InvalidValueError("number of joints", arm.nv, f"at most {MAX_JOINTS}")
    lower = np.where(arm.is_circle, -np.pi, arm.limits.lower)
    span = np.where(arm.is_circle, 2.0 * np.pi, arm.limits.upper - lower)
    if not np.isfinite(span).all():
        raise InvalidValueError("range of the joints", span, "finite")
    return lower, span


def _connected(left: set[Cell], period: NDArray[np.int64], arm: Arm) -> Iterator[dict[Cell, Cell]]:
    """Yield components as cell to unwrapped cell; `period` is 0 for a joint that is no circle."""
    neighbours = list(product((-1, 0, 1), repeat=arm.nv))
    while left:
        first = min(left)
        left.remove(first)
        unwrapped, border = {first: first}, [first]
        while border:
            here = unwrapped[border.pop()]
            for offset in neighbours:
                there = tuple(a + b for a, b in zip(here, offset, strict=True))
                cell = tuple(a % n if n else a for a, n in zip(there, period.tolist(), strict=True))
                if cell in left:
                    left.remove(cell)
                    unwrapped[cell] = there
                    border.append(cell)
                elif unwrapped.get(cell, there) != there:
                    raise InvalidValueError(
                        "unsafe component",
                        f"around joint {_changed(arm, unwrapped[cell], there)}",
                        "one that does not wind around a continuous joint",
                    )
        yield unwrapped


def _changed(arm: Arm, a: Cell, b: Cell) -> str:
    return arm.joint_names[int(np.flatnonzero(np.subtract(a, b))[0])]
