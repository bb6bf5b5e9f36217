"""Barriers of two arms, each beside a ball, and configurations of theirs."""

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import ArrayLike

from densarm.arms.arm import Arm, load_arm
from densarm.scene.obstacles import Sphere
from densarm.scene.scene import Scene
from densarm.study.fields import Barriers
from densarm.values.arrays import Array
from densarm.world.world import World

BALLS = {
    "panda": ("ready", Sphere(name="ball", radius=0.1, position=(0.5, 0.1, 0.4))),
    "two_link": ("upright", Sphere(name="ball", radius=0.2, position=(1.5, 0.0, -0.5))),
}
"""The posture to reach, and what is in the way, by the arm's name."""

BarriersAndGoal = tuple[Barriers, Array]


@pytest.fixture(scope="session")
def barriers_of() -> Callable[[str], BarriersAndGoal]:
    """Return a maker of an arm's barriers, and of its goal, by the arm's name."""

    def make(name: str) -> BarriersAndGoal:
        posture, ball = BALLS[name]
        arm = load_arm(name, shapes="capsule" if name == "panda" else "hull")
        return Barriers(World(arm, Scene([ball])), 0.0), arm.postures[posture]

    return make


@pytest.fixture(scope="session")
def within_limits() -> Callable[[Arm, ArrayLike], Array]:
    """Return what makes a configuration from shares of the limits, or of a whole turn."""

    def make(arm: Arm, share: ArrayLike) -> Array:
        lower = np.where(arm.continuous, -np.pi, arm.limits.lower)
        upper = np.where(arm.continuous, np.pi, arm.limits.upper)
        return arm.configuration(lower + np.resize(share, arm.nv) * (upper - lower))

    return make
