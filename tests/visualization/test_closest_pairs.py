import numpy as np
import pytest

from densarm.clearance import Clearance
from densarm.scene import Scene
from densarm.visualization.closest_line import closest_line
from densarm.visualization.closest_pairs import ClosestPairs


@pytest.fixture(scope="module")
def closest(swing):
    clearance = Clearance(swing.scenario.arm, swing.scenario.scene)
    return ClosestPairs.along(clearance, swing.q[::40])


def test_points_are_as_far_apart_as_the_distance(closest, swing):
    np.testing.assert_allclose(closest.distance, swing.clearance[::40])
    apart = np.linalg.norm(closest.points[:, 1] - closest.points[:, 0], axis=1)
    np.testing.assert_allclose(apart, np.abs(closest.distance), atol=1e-6)
    assert {pair[1] for pair in closest.names} == {"ball", "cylinder"}


def test_line_leads_from_one_point_to_the_other(closest):
    line = closest_line(closest, 0.01)
    _, rods = line["line"]
    np.testing.assert_allclose(rods[:, :3, 3], closest.points[:, 0])
    np.testing.assert_allclose(rods[:, :3, 2] + rods[:, :3, 3], closest.points[:, 1], atol=1e-9)
    ball, transforms = line["second"]
    np.testing.assert_allclose(transforms[:, :3, 3], closest.points[:, 1])
    assert np.linalg.norm(transforms[0, :3, 0] * ball.vertices.max()) == pytest.approx(
        0.02, rel=0.1
    )


def test_points_that_coincide_have_a_line():
    points = np.zeros((1, 2, 3))
    rod = closest_line(ClosestPairs(np.zeros(1), points, (("a", "b"),)), 0.01)["line"][1][0]
    assert np.isfinite(rod).all()
    assert np.linalg.norm(rod[:3, 2]) < 1e-5


def test_without_pairs_there_is_nothing(two_link, resting):
    nothing = ClosestPairs.along(Clearance(two_link, Scene()), resting.q)
    assert len(nothing.distance) == len(nothing.points) == len(nothing.names) == 0
    assert closest_line(nothing, 0.01) == {}
