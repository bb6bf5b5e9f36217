"""A joint space of bounded and circle joints, without a robot."""

from collections.abc import Sequence
from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest

from densarm.arrays import Array


@dataclass
class JointSpace:
    """What the density reads of an arm: one letter per joint, b(ounded) or c(ircle)."""

    kinds: str
    lower: Sequence[float] = ()
    upper: Sequence[float] = ()

    def __post_init__(self):
        self.is_circle = np.array([kind == "c" for kind in self.kinds])
        sizes = np.where(self.is_circle, 2, 1)
        self.idx_q = np.cumsum(sizes) - sizes
        self.nq, self.nv = int(sizes.sum()), len(self.kinds)
        free = np.full(self.nv, np.inf)
        self.limits = SimpleNamespace(
            lower=np.array(self.lower) if len(self.lower) else -free,
            upper=np.array(self.upper) if len(self.upper) else free,
        )

    def configuration(self, angles) -> Array:
        q = np.zeros(self.nq)
        q[self.idx_q] = np.where(self.is_circle, np.cos(angles), angles)
        circle = self.idx_q[self.is_circle]
        q[circle + 1] = np.sin(np.asarray(angles)[self.is_circle])
        return q

    def angles(self, q) -> Array:
        angles = q[self.idx_q].copy()
        circle = self.idx_q[self.is_circle]
        angles[self.is_circle] = np.arctan2(q[circle + 1], q[circle])
        return angles

    def integrate(self, q, step) -> Array:
        return self.configuration(self.angles(q) + step)


def central_difference(function, q, nv, integrate=np.add, step=1e-6) -> Array:
    """Gradient of a scalar function along `integrate`."""
    return np.array(
        [
            (function(integrate(q, axis)) - function(integrate(q, -axis))) / (2 * step)
            for axis in step * np.eye(nv)
        ]
    )


@pytest.fixture(scope="session")
def joint_space():
    return JointSpace


@pytest.fixture(scope="session")
def numerical_gradient():
    return central_difference


@pytest.fixture(scope="session")
def disc():
    """h and s of the disc of radius 1 with sensing radius 2, on a squared scale."""

    def squared_radius(offset):
        return lambda x: (float(x @ x - offset), 2.0 * x)

    return squared_radius(1.0), squared_radius(4.0)
