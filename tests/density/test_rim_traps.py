import numpy as np
import pytest

import densarm
from densarm.density import TorusDistance
from densarm.density.enclosing_ellipsoid import Ellipsoid
from densarm.density.rim_traps import rim, rim_traps
from densarm.errors import InvalidValueError

ARM = densarm.load_arm("two_link")
SUM = TorusDistance(ARM, ARM.configuration([1.5, 0.0]), kappa=np.inf)


def ellipse(first: float, second: float) -> Ellipsoid:
    return Ellipsoid(np.zeros(2), np.diag([first**2, second**2]))


def test_rim_is_on_the_ellipse():
    body = Ellipsoid(np.array([1.0, 2.0]), np.array([[1.0, 0.6], [0.6, 0.5]]))
    np.testing.assert_allclose(body.level(rim(body, 50)), 1.0)


def test_a_circle_before_the_goal_has_no_trap():
    assert rim_traps(ARM, ellipse(0.5, 0.5), SUM).shape == (0, 2)


def test_a_wall_before_the_goal_has_one_where_it_faces_away_from_the_goal():
    (trap,) = rim_traps(ARM, ellipse(0.1, 2.0), SUM)
    np.testing.assert_allclose(trap, [-0.1, 0.0], atol=1e-2)


def test_weights_that_flatten_the_level_sets_of_the_goal_distance_free_a_wall():
    tilt = np.array([[np.cos(0.4), -np.sin(0.4)], [np.sin(0.4), np.cos(0.4)]])
    wall = Ellipsoid(np.zeros(2), (tilt * np.array([0.04, 2.0])) @ tilt.T)
    weighted = TorusDistance(ARM, SUM.goal, [8.0, 1.0], np.inf)
    assert len(rim_traps(ARM, wall, SUM)) == 1
    assert len(rim_traps(ARM, wall, weighted)) == 0


def test_refuses_other_than_two_joints():
    with pytest.raises(InvalidValueError, match="number of joints = 7"):
        rim_traps(densarm.load_arm("panda"), ellipse(1.0, 1.0), SUM)
