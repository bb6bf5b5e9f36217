import coal
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from densarm.visualization.camera import FIELD_OF_VIEW, Camera, Sight

POINTS = arrays(np.float64, st.tuples(st.integers(2, 12), st.just(3)), elements=st.floats(-5, 5))


@given(POINTS)
@example(np.array([[0.0, 3.0, 0.0], [3.0, 0.0, 2.0]]))  # one behind the other
def test_every_point_is_in_the_picture(points: NDArray[np.float64]) -> None:
    camera = Camera.facing(points)
    if not np.any(np.ptp(points, axis=0) > 1e-3):
        return
    back = camera.offset / np.linalg.norm(camera.offset)
    right = np.cross([0.0, 0.0, 1.0], back)
    right /= np.linalg.norm(right)
    seen = (points - camera.target) @ np.column_stack([right, np.cross(back, right), back])
    depth = np.linalg.norm(camera.offset) - seen[:, 2]
    slope = np.tan(np.radians(FIELD_OF_VIEW / 2))
    assert np.all(depth > 0.0)
    assert np.all(np.abs(seen[:, 1]) <= slope * depth)
    assert np.all(np.abs(seen[:, 0]) <= 4 / 3 * slope * depth)


def test_planar_arm_is_seen_from_the_front() -> None:
    plane = np.array([[-2.0, -0.05, -2.0], [2.0, 0.05, 2.0], [2.0, 0.0, -2.0]])
    offset = Camera.facing(plane).offset
    assert -offset[1] > 5.0 * np.abs(offset[[0, 2]]).max()


@pytest.mark.parametrize("side", [-1.0, 1.0])
@pytest.mark.parametrize("opacity", [0.5, 1.0])
def test_camera_looks_past_a_wall(side: float, opacity: float) -> None:
    cloud = np.array([[x, y, z] for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)])
    wall, pose = coal.Box(4.0, 0.05, 4.0), pin.SE3(np.eye(3), np.array([0.5, 0.5 + side, 0.5]))
    camera = Camera.facing(cloud, [Sight(point, [(wall, pose, opacity)]) for point in cloud])
    eye = camera.target + camera.offset
    share = (pose.translation[1] - cloud[:, 1:2]) / (eye - cloud)[:, 1:2]
    crossing = (cloud + share * (eye - cloud))[:, [0, 2]]
    is_hidden = (
        (share[:, 0] > 0.0) & (share[:, 0] < 1.0) & (np.abs(crossing - 0.5) < 2.0).all(axis=1)
    )
    assert not is_hidden.any()


def test_bodies_one_behind_the_other_let_through_less() -> None:
    plate = coal.Box(1.0, 0.1, 1.0)
    places = [pin.SE3(np.eye(3), np.array([x, y, 0.0])) for x, y in ((0, 1), (0, 2), (5, 3))]
    sight = Sight(np.zeros(3), [(plate, place, 0.25) for place in places])
    assert sight.visibility(np.array([0.0, 9.0, 0.0])) == pytest.approx(0.75**2)
