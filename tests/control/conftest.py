"""Worlds, motions and controllers that the tests of this room share."""

from collections.abc import Callable

import numpy as np
import pytest

from densarm.arms.arm import Arm, load_arm
from densarm.control.controller import Controller
from densarm.control.regulation import DensityRegulation
from densarm.control.tracking import DensityTracking
from densarm.planning.motion import Motion
from densarm.planning.plan import plan_motion
from densarm.scenarios.control import ControlForm
from densarm.scenarios.scenario import Scenario
from densarm.scene.obstacles import Sphere
from densarm.scene.scene import Scene
from densarm.world.world import World


@pytest.fixture(scope="session")
def swing_up_motion(swing_up: Scenario) -> Motion:
    """A planned motion between the two balls."""
    return plan_motion(swing_up.world, swing_up.start, swing_up.goal)


@pytest.fixture(scope="session")
def make_controller(swing_up: Scenario, swing_up_motion: Motion) -> Callable[[str], Controller]:
    """Return a maker of the swing-up's controller in each form, along one path."""

    def make(form: str) -> Controller:
        if form == ControlForm.TRACKING:
            return DensityTracking(swing_up.world, swing_up_motion)
        plain, path = form == ControlForm.PLAIN, swing_up_motion.path
        return DensityRegulation(swing_up.world, swing_up.goal, path=path, plain=plain)

    return make


@pytest.fixture(scope="session")
def panda() -> Arm:
    """The Panda in capsules, its torque as quick as it is asked to be."""
    return load_arm("panda", shapes="capsule", torque_rate=np.inf)


@pytest.fixture(scope="session")
def panda_swing(panda: Arm) -> Motion:
    """The Panda swings all its joints, from rest to rest in two seconds."""
    period = 0.01
    phase = np.linspace(0.0, 2.0 * np.pi, 201)[:, np.newaxis]
    amplitude = np.array([0.4, 0.3, 0.3, 0.4, 0.3, 0.3, 0.5])
    position = panda.angles(panda.postures["ready"]) + amplitude * (0.5 - 0.5 * np.cos(phase))
    velocity = np.pi * amplitude * 0.5 * np.sin(phase)
    velocity[[0, -1]] = 0.0
    return Motion(period, position, velocity)


@pytest.fixture(scope="session")
def among_spheres(panda: Arm, panda_swing: Motion) -> World:
    """The Panda among 32 spheres, each less than five centimetres from where it swings."""
    random = np.random.default_rng(3)
    places = random.uniform([-0.3, -0.7, 0.0], [0.8, 0.7, 1.0], size=(300, 3))
    balls = [Sphere(name=f"ball{k}", radius=0.03, position=place) for k, place in enumerate(places)]
    world = World(panda, Scene(balls))
    apart = np.min(
        [world.distances(q) for q in panda.configurations(panda_swing.position[::10])], axis=0
    )
    least = {ball.name: np.inf for ball in balls}
    for pair, distance in zip(world.pairs, apart, strict=True):
        if pair[1] in least:
            least[pair[1]] = min(least[pair[1]], float(distance))
    return World(panda, Scene([ball for ball in balls if 0.005 < least[ball.name] < 0.05][:32]))
