import numpy as np
import pytest

from densarm.configuration_space import EuclideanSpace
from densarm.density.gauge import Gauge
from densarm.density.implicit_function import UnsafeRegion
from densarm.density.implicit_shapes import Ball
from densarm.density.navigation_density import DensityParameters
from densarm.fields.motion import EllipticMotion, UniformMotion
from densarm.fields.moving_density import MovingDensity, MovingRegion
from densarm.simulation.single_integrator import SingleIntegrator
from densarm.simulation.tracking_runs import track_points

PLANE = EuclideanSpace(2)
PARAMETERS = DensityParameters(gauge=Gauge.LOG, blend_radius=0.1)
TARGET = EllipticMotion((0.0, 0.0), (1.0, 0.6), 0.3)
STARTS = np.array([[-3.0, 0.5], [0.0, 3.0], [2.0, -2.0]])


def swept(speed):
    """A disc that comes from the left through the starts."""
    motion = UniformMotion((-5.0, 0.0), (speed, 0.0))
    return MovingRegion(UnsafeRegion(Ball(0.5), Ball(1.2)), motion)


def test_follows_the_target_with_an_error_of_the_order_of_the_step():
    field = MovingDensity([], TARGET, PARAMETERS, gain=2.0)
    coarse, fine = (
        track_points(field, SingleIntegrator(PLANE, dt), STARTS, 1.0, 12.0) for dt in (0.04, 0.02)
    )
    assert fine.error[-1].max() < 1e-3
    np.testing.assert_allclose(coarse.error[-1], 2.0 * fine.error[-1], rtol=0.05)
    assert not fine.entered.any()
    assert (fine.smallest_h == np.inf).all()


def test_runs_are_what_the_plant_does_within_the_bound():
    runs = track_points(
        MovingDensity([swept(0.5)], TARGET, PARAMETERS),
        SingleIntegrator(PLANE, 0.05),
        STARTS,
        0.7,
        3.0,
    )
    np.testing.assert_array_equal(runs.x[0], STARTS)
    np.testing.assert_allclose(runs.x[1:] - runs.x[:-1], 0.05 * runs.u[:-1], atol=1e-12)
    assert np.abs(runs.u).max() <= 0.7 * (1.0 + 1e-12)
    np.testing.assert_array_equal(runs.u[-1], 0.0)
    assert len(runs.time) == len(runs.x) == 61
    goal = np.array([TARGET.position(time) for time in runs.time])
    distance = np.linalg.norm(runs.x - goal[:, np.newaxis], axis=-1)
    np.testing.assert_allclose(runs.error, distance, rtol=1e-12)


@pytest.mark.parametrize(("speed", "entered"), [(0.9, False), (20.0, True)])
def test_a_point_in_the_way_is_entered_by_what_is_faster_alone(speed, entered):
    start = np.array([[-2.0, 0.0]])
    runs = track_points(
        MovingDensity([swept(speed)], UniformMotion((4.0, 3.0), (0.0, 0.0)), PARAMETERS),
        SingleIntegrator(PLANE, 0.01),
        start,
        1.0,
        4.0,
    )
    assert runs.entered.tolist() == [entered]
    assert (runs.smallest_h.min() <= 0.0) == entered
    if entered:
        met = np.flatnonzero(runs.smallest_h[:, 0] <= 0.0)[0]
        assert (runs.x[met:] == runs.x[met]).all()
        np.testing.assert_array_equal(runs.u[met:], 0.0)
