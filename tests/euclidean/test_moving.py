import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from densarm.density.navigation_density import DensityParameters, Gauge
from densarm.errors import InvalidValueError
from densarm.euclidean.density import EuclideanDensity
from densarm.euclidean.implicit import Placed, UnsafeRegion
from densarm.euclidean.moving import EllipticMotion, MovingDensity, MovingRegion
from densarm.euclidean.shapes import Ball

REGION = UnsafeRegion(Ball(0.5), Ball(1.2))
PARAMETERS = DensityParameters(gauge=Gauge.LOG, blend_radius=0.1)
MOTIONS = [
    EllipticMotion((1.0, -2.0), (3.0, 4.0), 0.1),
    EllipticMotion((0.5, 0.0), (2.0, 1.0), -0.7, 0.2),
]
times = st.floats(0.0, 20.0)


@pytest.mark.parametrize("motion", MOTIONS)
@given(time=times)
def test_velocity_is_the_derivative_of_the_position(motion: EllipticMotion, time: float) -> None:
    step = 1e-5
    numerical = (motion.position(time + step) - motion.position(time - step)) / (2.0 * step)
    np.testing.assert_allclose(motion.velocity(time), numerical, atol=1e-8)


@given(time=times)
def test_is_the_standing_density_plus_the_velocity_of_the_target(time: float) -> None:
    obstacle, target = MOTIONS
    field = MovingDensity([MovingRegion(REGION, obstacle)], target, PARAMETERS, gain=2.0)
    centre = obstacle.position(time)
    standing = EuclideanDensity(
        [UnsafeRegion(Placed(REGION.h, centre), Placed(REGION.s, centre))],
        target.position(time),
        PARAMETERS,
    )
    x = centre + np.array([[0.8, 0.3], [-1.0, 0.0], [3.0, 3.0]])
    expected = 2.0 * standing.direction(x) + target.velocity(time)
    snapshot = field.at(time)
    np.testing.assert_allclose(snapshot.direction(x), expected, rtol=1e-12, atol=1e-12)
    np.testing.assert_array_equal(snapshot.height(x), standing.height(x))
    np.testing.assert_array_equal(snapshot.goal, target.position(time))


@given(st.floats(0.0, 2.0 * np.pi), st.floats(0.0, 50.0))
def test_close_to_an_obstacle_the_gap_widens_however_fast_it_comes(
    bearing: float, speed: float
) -> None:
    through_origin = EllipticMotion((-1.0, 0.0), (1.0, 1.0), speed)  # upwards, at t = 0
    target = EllipticMotion((2.0, 0.0), (1.0, 1.0), 0.2)
    field = MovingDensity([MovingRegion(REGION, through_origin)], target, PARAMETERS)
    x = 0.501 * np.array([np.cos(bearing), np.sin(bearing)])
    velocity = through_origin.velocity(0.0)
    rate = REGION.h.gradient(x) @ (field.at(0.0).direction(x) - velocity)
    assert rate > 0.0


def test_impossible_values_are_refused() -> None:
    target = MOTIONS[0]
    with pytest.raises(InvalidValueError, match="gauge"):
        MovingDensity([], target, DensityParameters(gauge=Gauge.DENSITY))
    with pytest.raises(InvalidValueError, match="gain"):
        MovingDensity([], target, PARAMETERS, gain=0.0)
    with pytest.raises(InvalidValueError, match="semi_axes"):
        EllipticMotion((0.0, 0.0), (1.0, 0.0), 1.0)
    with pytest.raises(InvalidValueError, match="rate"):
        EllipticMotion((0.0, 0.0), (1.0, 1.0), np.nan)
