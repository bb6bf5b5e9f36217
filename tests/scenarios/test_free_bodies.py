"""Free bodies: the density of Rⁿ, narrow gaps, and proofs that fail."""

from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from densarm.arms.arm import Arm
from densarm.arms.free_body import free_body
from densarm.certificates.task import SimulationParameters
from densarm.control.regulation import DensityRegulation
from densarm.density.goal_distance import TorusDistance
from densarm.density.navigation_density import Gauge, NavigationDensity
from densarm.density.unsafe_sets import ClearanceSet
from densarm.euclidean.density import EuclideanDensity
from densarm.euclidean.implicit import Lowered, UnsafeRegion
from densarm.planning.plan import plan_path
from densarm.scenarios.control import ControlForm, ControlParameters
from densarm.scenarios.run import run
from densarm.scenarios.scenario import Scenario
from densarm.scene.obstacles import Box, Capsule, Sphere
from densarm.scene.scene import Scene
from densarm.simulation.plants import SingleIntegrator
from densarm.simulation.run import Run
from densarm.simulation.simulate import simulate
from densarm.values.arrays import Array
from densarm.values.outcome import Outcome
from densarm.world.swept_check import SweptCheck, SweptVerdict
from densarm.world.world import World

SQUARE, CUBE = [(-2.0, 2.0)] * 2, [(-2.0, 2.0)] * 3
ALONG_X = (0.0, np.sqrt(0.5), 0.0, np.sqrt(0.5))  # turns z to x

Densities = tuple[EuclideanDensity, NavigationDensity]


class Circle:
    """The signed distance to a circle about the origin."""

    def __init__(self, radius: float) -> None:
        self.radius = radius

    def __call__(self, x: Array) -> Array:
        return np.asarray(np.linalg.norm(x, axis=-1) - self.radius)

    def gradient(self, x: Array) -> Array:
        return np.asarray(x / np.linalg.norm(x, axis=-1, keepdims=True))


@pytest.fixture(scope="module")
def densities() -> Densities:
    """The density of the plane around a disc: by an implicit function, and by coal."""
    goal, circle = np.array([1.5, 0.4]), Circle(0.5)
    by_function = EuclideanDensity([UnsafeRegion(circle, Lowered(circle, 0.6))], goal)
    arm = free_body(Sphere(name="point", radius=1e-9), "plane", SQUARE)
    world = World(arm, Scene([Sphere(name="disc", radius=0.5)]))
    by_coal = NavigationDensity(
        arm,
        goal,
        [ClearanceSet(world, 0.0, 0.6)],
        TorusDistance(arm, weights=(2.0, 2.0), kappa=np.inf),
    )
    return by_function, by_coal


@given(st.floats(0.52, 2.0), st.floats(-np.pi, np.pi))
def test_density_by_an_implicit_function_and_by_coal_agree(
    densities: Densities, radius: float, direction: float
) -> None:
    by_function, by_coal = densities
    x = radius * np.array([np.cos(direction), np.sin(direction)])
    assume(np.linalg.norm(x - by_function.goal) > 1e-3)
    sample = by_coal.evaluate(x)
    assert sample.log_value == pytest.approx(by_function.log_value(x), rel=1e-6, abs=1e-6)
    for gauge in Gauge:
        expected = by_function.gradient(x, gauge)
        apart = np.linalg.norm(sample.gradient(gauge) - expected)
        assert apart <= 1e-5 * np.linalg.norm(expected)


GAP = Scene(
    [
        Box(name=name, size=(0.1, 1.0, 1.0), position=(0.0, y, 0.0))
        for name, y in (("left", 0.65), ("right", -0.65))
    ]
)


@pytest.fixture(scope="module")
def through_the_gap() -> Scenario:
    """A bar 0.68 m long, across its way, and a gap 0.3 m wide."""
    shape = Capsule(name="bar", radius=0.04, length=0.6, orientation_xyzw=ALONG_X)
    arm = free_body(shape, "plane + yaw", [(-1.2, 1.2), (-0.8, 0.8)], name="bar")
    return Scenario(
        name="gap",
        title="Turn a bar to pass a gap",
        arm=arm,
        scene=GAP,
        start=arm.configuration([-0.8, 0.0, np.pi / 2]),
        goal=arm.configuration([0.8, 0.0, np.pi / 2]),
        control=ControlParameters(form=ControlForm.REGULATION),
        simulation=SimulationParameters(dt=0.005),
    )


def run_by_velocity(scenario: Scenario, guide: str) -> Run:
    world, start, goal = scenario.world, scenario.start, scenario.goal
    controller = DensityRegulation(world, goal, path=plan_path(world, start, goal, guide).path)
    plant, p = SingleIntegrator(scenario.arm, 0.005), scenario.simulation
    done = simulate(world, controller, start, plant=plant, parameters=p)
    assert SweptCheck(world).check(done.q).verdict == SweptVerdict.CLEAR
    return done


@pytest.mark.slow
def test_a_body_passes_a_narrow_gap_only_when_turned(through_the_gap: Scenario) -> None:
    done = run_by_velocity(through_the_gap, "path")
    assert done.outcome == Outcome.REACHED
    x, _, yaw = through_the_gap.arm.angles(done.q).T
    inside = np.abs(x) < 0.02
    assert inside.any()
    assert (np.abs(np.sin(yaw[inside])) < 0.5).all()


@pytest.mark.slow
def test_without_a_path_it_stops_before_the_gap(through_the_gap: Scenario) -> None:
    done = run_by_velocity(through_the_gap, "direct")
    assert done.outcome == Outcome.STUCK
    assert (through_the_gap.arm.angles(done.q)[:, 0] < 0.0).all()


@pytest.mark.slow
def test_by_force_the_run_is_certified_and_rebuilt_from_its_file(
    through_the_gap: Scenario, tmp_path: Any
) -> None:
    done = run(through_the_gap)
    assert done.outcome == Outcome.REACHED
    assert done.certified
    done.save(tmp_path / "run.npz")
    again = Run.load(tmp_path / "run.npz")
    assert again.task.arm.description == done.task.arm.description
    assert again.certified


@pytest.fixture(scope="module")
def rigid_body() -> Arm:
    shapes = [
        Box(name="block", size=(0.2, 0.3, 0.4), position=(0.1, 0.0, -0.1)),
        Capsule(name="pin", radius=0.05, length=0.6, position=(0.0, 0.2, 0.0)),
    ]
    return free_body(shapes, "rigid body", CUBE, mass=3.0)


def test_torque_turns_a_body_through_gimbal_lock(rigid_body: Arm) -> None:
    done = run(
        Scenario(
            name="lock",
            title="Pitch over",
            arm=rigid_body,
            scene=Scene(),
            start=rigid_body.configuration(np.zeros(6)),
            goal=rigid_body.configuration([0.0, 0.3, 0.0, 0.3, np.pi, -0.2]),
            simulation=SimulationParameters(dt=0.005),
        )
    )
    assert done.outcome == Outcome.REACHED
    assert done.certified
