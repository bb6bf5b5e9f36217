import numpy as np
import pytest

from densarm.arms.joint_space import EuclideanSpace
from densarm.density.navigation_density import DensityParameters, Gauge
from densarm.euclidean.density import EuclideanDensity
from densarm.euclidean.fields import PotentialField
from densarm.euclidean.implicit import UnsafeRegion
from densarm.euclidean.moving import EllipticMotion, MovingDensity, MovingRegion
from densarm.euclidean.runs import run_points
from densarm.euclidean.shapes import Ball
from densarm.simulation.plants import SingleIntegrator
from densarm.values.outcome import Outcome

PLANE = EuclideanSpace(2)
GOAL = np.array([3.0, 0.0])
PARAMETERS = DensityParameters(gauge=Gauge.LOG, blend_radius=0.1)
TARGET = EllipticMotion((0.0, 0.0), (1.0, 0.6), 0.3)
STARTS = np.array([[-3.0, 0.5], [0.0, 3.0], [2.0, -2.0]])


def standing(_: float) -> EuclideanDensity:
    """A disc before the goal, at any time."""
    region = UnsafeRegion(Ball(1.0), Ball(2.0))
    parameters = DensityParameters(gauge=Gauge.LOG, blend_radius=0.2)
    return EuclideanDensity([region], GOAL, parameters)


def test_runs_stay_within_the_bound_and_reach() -> None:
    starts = np.array([[-3.0, 0.5], [0.0, 3.0], [2.0, -2.0]])
    runs = run_points(standing, SingleIntegrator(PLANE, 0.02), starts, 0.5, 60.0, 0.01)
    assert runs.count(Outcome.REACHED) == 3
    assert np.abs(runs.u).max() <= 0.5 * (1.0 + 1e-12)
    np.testing.assert_array_equal(runs.x[0], starts)
    np.testing.assert_allclose(runs.x[1:] - runs.x[:-1], 0.02 * runs.u[:-1], atol=1e-12)
    assert len(runs.time) == len(runs.x) == len(runs.u)
    np.testing.assert_array_equal(runs.u[-1], 0.0)


def test_a_run_that_ended_stays_where_it_is() -> None:
    starts = GOAL + np.array([[0.5, 0.0], [-6.0, 0.5]])
    runs = run_points(standing, SingleIntegrator(PLANE, 0.02, 1e-4), starts, 0.5, 60.0, 0.05)
    still = np.flatnonzero(np.linalg.norm(runs.x[:, 0] - GOAL, axis=1) <= 0.05)
    np.testing.assert_array_equal(runs.x[still, 0], np.tile(runs.x[still[0], 0], (len(still), 1)))


def test_entering_an_obstacle_and_the_time_limit_are_outcomes() -> None:
    blind = PotentialField([Ball(1.0)], GOAL, influence=1e-6)
    starts = np.array([[-2.0, 0.0], [2.0, 3.0]])
    runs = run_points(lambda _: blind, SingleIntegrator(PLANE, 0.01), starts, 1.0, 1.5, 0.01)
    assert list(runs.outcome) == [Outcome.COLLIDED, Outcome.TIMED_OUT]


def test_the_gain_speeds_up() -> None:
    start = np.array([[-3.0, 0.5]])
    slow, fast = (
        run_points(standing, SingleIntegrator(PLANE, 0.01), start, np.inf, 120.0, 0.05, gain)
        for gain in (1.0, 3.0)
    )
    assert fast.time[-1] < slow.time[-1]


def swept(speed: float) -> MovingRegion:
    """A disc that comes from the left through the starts, along a long ellipse without a width."""
    motion = EllipticMotion((-5.0, 0.0), (50.0, 1e-9), speed / 50.0, -0.5 * np.pi)
    return MovingRegion(UnsafeRegion(Ball(0.5), Ball(1.2)), motion)


def test_follows_the_target_with_an_error_of_the_order_of_the_step() -> None:
    field = MovingDensity([], TARGET, PARAMETERS, gain=2.0)
    coarse, fine = (
        run_points(field.at, SingleIntegrator(PLANE, dt), STARTS, 1.0, 12.0) for dt in (0.04, 0.02)
    )
    assert fine.error[-1].max() < 1e-3
    np.testing.assert_allclose(coarse.error[-1], 2.0 * fine.error[-1], rtol=0.05)
    assert not fine.entered.any()
    assert (fine.smallest_h == np.inf).all()


def test_runs_are_what_the_plant_does_within_the_bound() -> None:
    field = MovingDensity([swept(0.5)], TARGET, PARAMETERS)
    runs = run_points(field.at, SingleIntegrator(PLANE, 0.05), STARTS, 0.7, 3.0)
    np.testing.assert_array_equal(runs.x[0], STARTS)
    np.testing.assert_allclose(runs.x[1:] - runs.x[:-1], 0.05 * runs.u[:-1], atol=1e-12)
    assert np.abs(runs.u).max() <= 0.7 * (1.0 + 1e-12)
    np.testing.assert_array_equal(runs.u[-1], 0.0)
    assert len(runs.time) == len(runs.x) == 61
    goal = np.array([TARGET.position(time) for time in runs.time])
    distance = np.linalg.norm(runs.x - goal[:, np.newaxis], axis=-1)
    np.testing.assert_allclose(runs.error, distance, rtol=1e-12)


@pytest.mark.parametrize(("speed", "entered"), [(0.9, False), (20.0, True)])
def test_a_point_in_the_way_is_entered_by_what_is_faster_alone(speed: float, entered: bool) -> None:
    start = np.array([[-2.0, 0.0]])
    target = EllipticMotion((3.0, 3.0), (1.0, 1.0), 0.0)
    field = MovingDensity([swept(speed)], target, PARAMETERS)
    runs = run_points(field.at, SingleIntegrator(PLANE, 0.01), start, 1.0, 4.0)
    assert runs.entered.tolist() == [entered]
    assert (runs.smallest_h.min() <= 0.0) == entered
    if entered:
        met = np.flatnonzero(runs.smallest_h[:, 0] <= 0.0)[0]
        assert (runs.x[met:] == runs.x[met]).all()
        np.testing.assert_array_equal(runs.u[met:], 0.0)
