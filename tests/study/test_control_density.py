"""The control density program: its rows, its divergence, and the flow of its feedback."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from densarm.arms.arm import Arm, load_arm
from densarm.density.goal_distance import TorusDistance
from densarm.density.unsafe_sets import SensingParameters
from densarm.scene.obstacles import Sphere
from densarm.scene.scene import Scene
from densarm.study.control_density import ControlDensity
from densarm.values.arrays import Array
from densarm.world.configurations import clear_configurations
from densarm.world.world import World

NEAR = 1e-4  # [rad]
BALLS = {"panda": (0.5, 0.1, 0.4), "two_link": (1.5, 0.0, -0.5)}

shares = st.lists(st.floats(0.05, 0.95), min_size=7, max_size=7)


Case = tuple[World, ControlDensity]


@pytest.fixture(params=BALLS, scope="module")
def case(request: pytest.FixtureRequest) -> Case:
    arm = load_arm(request.param, shapes="capsule" if request.param == "panda" else "hull")
    ball = Sphere(name="ball", radius=0.2, position=BALLS[request.param])
    goal, sensing = arm.configuration(np.full(arm.nv, -0.4)), SensingParameters(distance=0.3)
    world = World(arm, Scene([ball]))
    return world, ControlDensity(world, goal, TorusDistance(arm), sensing)


def clear(world: World, share: list[float]) -> Array:
    limits, nv = world.arm.limits, world.arm.nv
    lower, upper = np.maximum(limits.lower, -np.pi), np.minimum(limits.upper, np.pi)
    q: Array = world.arm.configuration(lower + np.array(share[:nv]) * (upper - lower))
    assume(world.distances(q).min() > 0.02)
    return q


def log_slope(arm: Arm, program: ControlDensity, q: Array) -> Array:
    """Return ∇ ln ρ by central differences of ln ρ."""
    values = []
    for e in 1e-6 * np.eye(arm.nv):
        ahead, behind = (program.density.evaluate(arm.integrate(q, x)) for x in (e, -e))
        values.append((ahead.log_value - behind.log_value) / 2e-6)
    return np.array(values)


@settings(max_examples=40)
@given(share=shares)
def test_the_solution_keeps_every_row(case: Case, share: list[float]) -> None:
    (world, program), arm = case, case[0].arm
    q = clear(world, share)
    u, _ = program.velocity(q, None)
    assert abs(program.divergence) <= program.bound * (1.0 + 1e-4)
    assert log_slope(arm, program, q) @ u >= program.bound * (1.0 - 1e-3)
    assert log_slope(arm, program, q) @ u + program.divergence >= -1e-3 * program.bound


@pytest.mark.parametrize("seed", range(3))
def test_the_flow_does_not_contract_where_the_divergence_is_slack(case: Case, seed: int) -> None:
    """∇·(ρu)/ρ by central differences of the feedback itself, and the divergence it was made of."""
    (world, program), arm, shown = case, case[0].arm, 0
    for q in clear_configurations(world, 20, seed, 0.02):
        u, told = program.velocity(q, None)[0], program.divergence
        if abs(told) > 0.9 * program.bound:
            continue
        divergence = 0.0
        for e in np.eye(arm.nv):
            ahead, behind = (
                program.velocity(arm.integrate(q, x), None)[0] for x in (NEAR * e, -NEAR * e)
            )
            divergence += float((ahead - behind) @ e) / (2.0 * NEAR)
        slack = 0.05 * program.bound
        if np.abs(divergence - told) > slack:  # where nearest bodies change, ∇L jumps
            continue
        shown += 1
        assert log_slope(arm, program, q) @ u + divergence >= 0.0
    assert shown >= 12


def test_in_free_space_it_is_the_pull_of_the_goal() -> None:
    arm = load_arm("two_link")
    goal = arm.configuration([0.5, 0.5])
    distance = TorusDistance(arm, kappa=np.inf)
    free = ControlDensity(World(arm, Scene()), goal, distance, SensingParameters())
    e = np.array([0.01, -0.02])
    u, way_left = free.velocity(arm.integrate(goal, e), None)
    np.testing.assert_allclose(u, -10.0 * e, rtol=1e-3)
    assert way_left == pytest.approx(np.linalg.norm(e))
    assert not free.velocity(goal, None)[0].any()
