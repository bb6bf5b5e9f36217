import numpy as np
import pytest
from scipy.integrate import solve_ivp

from densarm.density.navigation_density import DensityParameters, Gauge
from densarm.errors import InvalidValueError
from densarm.euclidean.density import EuclideanDensity
from densarm.euclidean.implicit import UnsafeRegion
from densarm.euclidean.integral_curves import CurveParameters, integral_curves
from densarm.euclidean.shapes import Ball, CShape, Egg
from densarm.values.arrays import Array
from densarm.values.outcome import Outcome

GOAL = np.array([4.0, -3.0])
REGION = UnsafeRegion(Ball(2.0), Ball(3.0))


def disc(theta: float = 0.0, gauge: Gauge = Gauge.LOG) -> EuclideanDensity:
    return EuclideanDensity([REGION], GOAL, DensityParameters(theta=theta, gauge=gauge))


def random_starts(count: int = 100) -> Array:
    points = np.random.default_rng(0).uniform(-8.0, 8.0, (2 * count, 2))
    return points[REGION.h(points) > 0.0][:count]


@pytest.mark.parametrize("gauge", list(Gauge))
def test_every_start_reaches_in_every_gauge(gauge: Gauge) -> None:
    curves = integral_curves(disc(gauge=gauge), random_starts())
    assert curves.count(Outcome.REACHED) == 100
    assert curves.smallest_h.min() > 0.0
    assert (np.linalg.norm(curves.end - GOAL, axis=1) <= 1e-3).all()
    # Around the disc it is longer than straight, by less than half its circumference.
    straight = np.linalg.norm(random_starts() - GOAL, axis=1)
    assert (curves.length >= straight - 2e-3).all()
    assert (curves.length <= straight + 3.0 * np.pi).all()


def test_agrees_with_a_general_integrator() -> None:
    start = np.array([-4.0, 1.0])
    field = disc()

    def slope(_: float, x: Array) -> Array:
        k = field.direction(x)
        return k / np.linalg.norm(k)

    (path,) = integral_curves(field, start[np.newaxis], record=True).paths
    arc = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1)))
    exact = solve_ivp(slope, (0.0, 9.0), start, "BDF", rtol=1e-9, atol=1e-9, dense_output=True)
    for at in (1.0, 3.0, 6.0, 8.5):
        point = [np.interp(at, arc, path[:, i]) for i in range(2)]
        np.testing.assert_allclose(point, exact.sol(at), atol=5e-3)


def test_a_shift_leaks_into_the_unsafe_set() -> None:
    near = 2.0005 * np.array([[np.cos(a), np.sin(a)] for a in np.linspace(1.6, 3.4, 20)])
    assert integral_curves(disc(0.0), near).count(Outcome.REACHED) == 20
    assert integral_curves(disc(0.1), near).count(Outcome.COLLIDED) == 20


def test_starts_in_the_unsafe_set_are_infeasible_and_the_goal_is_reached_at_once() -> None:
    curves = integral_curves(disc(), np.array([[0.0, 0.0], GOAL]), record=True)
    assert list(curves.outcome) == [Outcome.INFEASIBLE, Outcome.REACHED]
    np.testing.assert_array_equal(curves.length, 0.0)
    assert [len(path) for path in curves.paths] == [1, 1]


def test_the_measure_zero_set_gets_stuck_at_the_saddle() -> None:
    away = -GOAL / 5.0
    curves = integral_curves(disc(), np.outer([2.1, 6.0], away))
    assert list(curves.outcome) == [Outcome.STUCK] * 2
    np.testing.assert_allclose(curves.end[0], curves.end[1], atol=1e-5)


def test_a_cavity_that_is_not_sensed_around_holds_its_starts() -> None:
    shape = CShape(2.2, 0.4, 0.0, 2.0)
    field = EuclideanDensity([UnsafeRegion(shape, Egg(1.0, 1.0, 1.1, 2.5))], [-9.0, 1.0])
    curves = integral_curves(field, np.array([[-1.0, 0.3], [-0.5, -0.5]]))
    assert list(curves.outcome) == [Outcome.STUCK] * 2


def test_limits_of_length_and_steps_are_outcomes(monkeypatch: pytest.MonkeyPatch) -> None:
    starts = np.array([[-6.0, 0.0]])
    short = integral_curves(disc(), starts, CurveParameters(longest_curve=1.0))
    monkeypatch.setattr("densarm.euclidean.integral_curves._MOST_STEPS", 2)
    brief = integral_curves(disc(), starts)
    assert short.outcome[0] == brief.outcome[0] == Outcome.TIMED_OUT


def test_paths_run_from_start_to_end() -> None:
    starts = random_starts(5)
    curves = integral_curves(disc(), starts, record=True)
    for start, end, length, path in zip(
        starts, curves.end, curves.length, curves.paths, strict=True
    ):
        np.testing.assert_array_equal(path[[0, -1]], [start, end])
        chords = np.linalg.norm(np.diff(path, axis=0), axis=1)
        assert chords.sum() == pytest.approx(length)
        assert chords.max() <= 0.25 * 1.05


def test_parameters_out_of_range_are_refused() -> None:
    with pytest.raises(InvalidValueError, match="tolerance"):
        CurveParameters(tolerance=0.0)
    with pytest.raises(InvalidValueError, match="longest_curve"):
        CurveParameters(longest_curve=0.0)
