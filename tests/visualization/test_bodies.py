"""What is drawn of obstacles and of what the arm holds."""

import coal
import numpy as np
import pinocchio as pin
import pytest

from densarm.arms.arm import Arm, load_arm
from densarm.scene.mesh import Mesh
from densarm.scene.obstacles import HalfSpace, Sphere
from densarm.scene.point_cloud import PointCloud
from densarm.scene.scene import Attachment, Scene
from densarm.visualization.bodies import (
    WORLD,
    arm_bodies,
    half_space_bodies,
    obstacle_bodies,
    sensing_bodies,
    spoken_names,
)

TETRAHEDRON = ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


def test_half_space_is_a_board_below_its_surface_next_to_what_is_seen() -> None:
    wall = HalfSpace(name="wall", normal=(2.0, 0.0, 0.0), offset=-0.3, position=(1.0, 5.0, 5.0))
    scene, middle = Scene([wall]), np.array([2.0, 3.0, 1.0])
    (board,) = half_space_bodies(scene, middle, 4.0)
    corners = board.mesh.vertices @ board.placement.rotation.T + board.placement.translation
    low, high = corners.min(axis=0), corners.max(axis=0)
    assert high[0] == pytest.approx(0.7)
    np.testing.assert_allclose((low + high)[1:] / 2.0, middle[1:])
    np.testing.assert_allclose((high - low)[1:], 4.0)
    assert obstacle_bodies(scene) == ()


def test_each_piece_of_a_mesh_is_drawn() -> None:
    pieces = obstacle_bodies(Scene([Mesh(name="mug", pieces=(TETRAHEDRON, TETRAHEDRON))]))
    assert [piece.name for piece in pieces] == ["mug.0", "mug.1"]
    assert all(piece.joint == WORLD for piece in pieces)


def test_held_body_moves_with_its_link(two_link: Arm) -> None:
    ball = Sphere(name="ball", radius=0.1, position=(0.0, 0.0, -0.5))
    arm = two_link.holding(Attachment(ball, "lower_link"))
    (held,) = [body for body in arm_bodies(arm) if body.name == "ball"]
    assert arm.model.names[held.joint] == "elbow"
    assert isinstance(held.shape, coal.Sphere)
    pin.forwardKinematics(arm.model, arm.data, arm.configuration([np.pi / 2, 0.0]))
    middle = held.corners(list(arm.data.oMi)).mean(axis=0)
    np.testing.assert_allclose(middle, [1.5, 0.0, 0.0], atol=1e-9)


@pytest.mark.parametrize(
    ("robot", "name", "spoken"),
    [
        ("kinova", "j2s6s200_link_4_0", "link 4"),
        ("panda", "panda_link5_0", "link 5"),
        ("panda", "panda_leftfinger_3", "left finger"),
        ("ur5", "wrist_1_link_0", "wrist 1"),
        ("ur5", "forearm_link_0.3", "forearm"),
        ("xarm7", "link_base_0", "base"),
        ("z1", "gripperMover_0.1", "gripper mover"),
        ("z1", "link04_0", "link 4"),
        ("xarm7", "link4_0.2", "link 4"),
        ("two_link", "upper_link_0", "upper link"),
        ("two_link", "left_ball", "left ball"),
    ],
)
def test_names_are_those_that_a_person_would_say(robot: str, name: str, spoken: str) -> None:
    assert spoken_names(load_arm(robot), [name]) == {name: spoken}


def test_held_bodies_keep_their_names() -> None:
    bar = Sphere(name="bar_0", radius=0.01)
    arm = load_arm("panda").holding(Attachment(bar, link="panda_hand"))
    assert spoken_names(arm, ["bar_0", "panda_hand_0"]) == {
        "bar_0": "bar 0",
        "panda_hand_0": "hand",
    }


def test_a_cloud_is_drawn_by_its_points() -> None:
    points = np.array([[0.0, 0.0, 0.0], [1.0, 2.0, 3.0]])
    cloud = PointCloud(name="cloud", points=points, radius=0.1, position=(1.0, 0.0, 0.0))
    (body,) = obstacle_bodies(Scene([cloud]))
    assert body.mesh.vertices.shape == (12, 3)
    assert body.mesh.faces.shape == (16, 3)
    np.testing.assert_allclose(body.mesh.vertices[6:].mean(axis=0), points[1], atol=1e-12)
    np.testing.assert_array_equal(body.placement.translation, [1.0, 0.0, 0.0])
    a, b, c = (body.mesh.vertices[body.mesh.faces[:8, k]] for k in range(3))
    assert (np.einsum("ij,ij->i", np.cross(b - a, c - a), a) > 0.0).all()  # from outside
    assert sensing_bodies((body,), 0.1) == ()
