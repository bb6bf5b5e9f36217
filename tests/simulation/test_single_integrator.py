from pathlib import Path

import numpy as np
import pytest

from densarm.arm import load_arm
from densarm.configuration_space import EuclideanSpace
from densarm.errors import InvalidValueError
from densarm.simulation.single_integrator import NoiseScaling, SingleIntegrator

PLANE = EuclideanSpace(2)
BRANCHING = Path(__file__).parents[1] / "data" / "branching.urdf"


def test_moves_by_the_control():
    x, v = SingleIntegrator(PLANE, 0.1).step(np.ones(2), np.zeros(2), np.array([1.0, -2.0]))
    np.testing.assert_allclose(x, [1.1, 0.8])
    np.testing.assert_array_equal(v, [1.0, -2.0])


@pytest.mark.parametrize(
    ("scaling", "variance"), [(NoiseScaling.HELD, 4e-6), (NoiseScaling.WHITE, 4e-4)]
)
def test_variance_of_a_step_follows_the_scaling(scaling, variance):
    plant = SingleIntegrator(PLANE, 0.01, 0.04, scaling)
    zero = np.zeros((100_000, 2))
    x, _ = plant.step(zero, zero, zero)
    assert x.var() == pytest.approx(variance, rel=0.02)
    assert abs(x.mean()) < 0.02 * np.sqrt(variance)


def test_same_seed_same_noise():
    zero = np.zeros(3)
    plants = [SingleIntegrator(EuclideanSpace(3), 0.1, 1.0, seed=seed) for seed in (5, 5, 6)]
    runs = [plant.step(zero, zero, zero)[0] for plant in plants]
    np.testing.assert_array_equal(runs[0], runs[1])
    assert (runs[0] != runs[2]).all()


def test_moves_an_arm_within_its_joint_space():
    arm = load_arm(BRANCHING)  # with a continuous joint
    plant = SingleIntegrator(arm, 0.1)
    q, u = arm.configuration(np.full(arm.nv, 0.3)), np.linspace(-1.0, 1.0, arm.nv)
    start, turned = q, np.zeros(arm.nv)
    for _ in range(50):
        q, v = plant.step(q, turned, u)
    arm.check_configuration("q", q)
    np.testing.assert_array_equal(v, u)
    np.testing.assert_allclose(arm.difference(arm.integrate(start, 5.0 * u), q), 0.0, atol=1e-12)


def test_values_out_of_range_are_refused():
    with pytest.raises(InvalidValueError, match="dt"):
        SingleIntegrator(PLANE, 0.0)
    with pytest.raises(InvalidValueError, match="scaling"):
        SingleIntegrator(PLANE, 0.1, 1.0, "pink")
    with pytest.raises(InvalidValueError, match="noise"):
        SingleIntegrator(PLANE, 0.1, -1.0)
