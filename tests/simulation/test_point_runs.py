import numpy as np

from densarm.configuration_space import EuclideanSpace
from densarm.density.euclidean_density import EuclideanDensity
from densarm.density.gauge import Gauge
from densarm.density.implicit_function import UnsafeRegion
from densarm.density.implicit_shapes import Ball
from densarm.density.navigation_density import DensityParameters
from densarm.fields.potential_field import PotentialField
from densarm.outcome import Outcome
from densarm.simulation.point_runs import run_points
from densarm.simulation.single_integrator import SingleIntegrator

PLANE = EuclideanSpace(2)
GOAL = np.array([3.0, 0.0])


def field(theta=0.0):
    region = UnsafeRegion(Ball(1.0), Ball(2.0))
    parameters = DensityParameters(theta=theta, gauge=Gauge.LOG, blend_radius=0.2)
    return EuclideanDensity([region], GOAL, parameters)


def test_runs_stay_within_the_bound_and_reach():
    starts = np.array([[-3.0, 0.5], [0.0, 3.0], [2.0, -2.0]])
    runs = run_points(field(), SingleIntegrator(PLANE, 0.02), starts, 0.5, 60.0, 0.01)
    assert runs.count(Outcome.REACHED) == 3
    assert np.abs(runs.u).max() <= 0.5 * (1.0 + 1e-12)
    np.testing.assert_array_equal(runs.x[0], starts)
    np.testing.assert_allclose(runs.x[1:] - runs.x[:-1], 0.02 * runs.u[:-1], atol=1e-12)
    assert len(runs.time) == len(runs.x) == len(runs.u)
    np.testing.assert_array_equal(runs.u[-1], 0.0)


def test_a_run_that_ended_stays_where_it_is():
    starts = GOAL + np.array([[0.5, 0.0], [-6.0, 0.5]])
    runs = run_points(field(), SingleIntegrator(PLANE, 0.02, 1e-4), starts, 0.5, 60.0, 0.05)
    still = np.flatnonzero(np.linalg.norm(runs.x[:, 0] - GOAL, axis=1) <= 0.05)
    np.testing.assert_array_equal(runs.x[still, 0], np.tile(runs.x[still[0], 0], (len(still), 1)))


def test_entering_an_obstacle_and_the_time_limit_are_outcomes():
    blind = PotentialField([Ball(1.0)], GOAL, influence=1e-6)
    starts = np.array([[-2.0, 0.0], [2.0, 3.0]])
    runs = run_points(blind, SingleIntegrator(PLANE, 0.01), starts, 1.0, 1.5, 0.01)
    assert list(runs.outcome) == [Outcome.COLLIDED, Outcome.TIMED_OUT]


def test_the_gain_speeds_up():
    start = np.array([[-3.0, 0.5]])
    slow, fast = (
        run_points(field(), SingleIntegrator(PLANE, 0.01), start, np.inf, 120.0, 0.05, gain)
        for gain in (1.0, 3.0)
    )
    assert fast.time[-1] < slow.time[-1]
