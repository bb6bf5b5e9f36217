"""Rantzer's condition: in closed form, and as the divergence of the flow that it is about."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from densarm.arms.arm import Arm
from densarm.arms.joint_space import EuclideanSpace
from densarm.density.goal_distance import EuclideanDistance, TorusDistance
from densarm.density.navigation_density import DensityParameters, Gauge, NavigationDensity
from densarm.density.rantzer import RantzerCondition, rantzer_condition
from densarm.density.unsafe_sets import ImplicitSet
from densarm.values.arrays import Array

PlaneFunction = Callable[[Array], tuple[float, Array]]


def condition(density: NavigationDensity, x: Array) -> RantzerCondition:
    return rantzer_condition(density, x)


@given(st.integers(1, 6), st.sampled_from([0.1, 0.6, 1.1, 2.1]), st.floats(0.3, 3.0))
def test_free_space_has_its_closed_form(n: int, alpha: float, radius: float) -> None:
    """L = -α ln r²: ΔL = -2α(n - 2)/r², ‖∇L‖² = 4α²/r²."""
    density = NavigationDensity(
        EuclideanSpace(n), np.zeros(n), [], EuclideanDistance(), DensityParameters(alpha=alpha)
    )
    record = condition(density, np.full(n, radius / np.sqrt(n)))
    assert record.laplacian == pytest.approx(-2.0 * alpha * (n - 2) / radius**2, abs=1e-4)
    assert record.squared_gradient == pytest.approx(4.0 * alpha**2 / radius**2, rel=1e-12)
    if n != 2:
        assert record.sign(Gauge.DENSITY) == np.sign(alpha - (n - 2) / 4)
        assert record.sign(Gauge.LOG) == np.sign(alpha - (n - 2) / 2)
        assert record.sign(Gauge.RECIPROCAL) == np.sign(2 - n)


def test_margin_is_the_divergence_of_the_flow_over_its_factor(
    disc: tuple[PlaneFunction, PlaneFunction],
) -> None:
    goal, x, step = np.array([3.0, 0.0]), np.array([-1.5, 0.2]), 1e-5
    unsafe = [ImplicitSet(*disc)]
    density = NavigationDensity(EuclideanSpace(2), goal, unsafe, EuclideanDistance())
    record, value = condition(density, x), density.evaluate(x).value
    factors = {Gauge.DENSITY: value**2, Gauge.LOG: value, Gauge.RECIPROCAL: 1.0}
    for gauge, factor in factors.items():

        def flow(y: Array, gauge: Gauge = gauge) -> Array:
            sample = density.evaluate(y)
            return sample.value * sample.gradient(gauge)

        divergence = sum(
            (flow(x + axis)[i] - flow(x - axis)[i]) / (2 * step)
            for i, axis in enumerate(step * np.eye(2))
        )
        assert record.margin(gauge) == pytest.approx(divergence / factor, rel=1e-5)


def test_continuous_joints_are_differenced_along_the_circle(
    joint_space: Callable[[str], Arm],
) -> None:
    """V = 1 - cos e: L'' = 1/(1 - cos e) for α = 1."""
    arm = joint_space("c")
    goal = arm.configuration([0.0])
    density = NavigationDensity(arm, goal, [], TorusDistance(arm, kappa=np.inf))
    record = rantzer_condition(density, arm.configuration([2.5]))
    assert record.laplacian == pytest.approx(1.0 / (1.0 - np.cos(2.5)), rel=1e-6)
