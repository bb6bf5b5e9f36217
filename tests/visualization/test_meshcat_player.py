from collections.abc import Iterator
from typing import Any

import meshcat
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st

from densarm.arm import Arm, load_arm
from densarm.attachment import Attachment
from densarm.rigid_body import free_body
from densarm.robot_description import RobotDescription
from densarm.scene import HalfSpace, Mesh, Scene, Sphere
from densarm.visualization.meshcat_player import MeshcatPlayer

NO_VISUALS = """
<robot name="bare">
  <link name="base"><collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision></link>
  <link name="arm">
    <inertial>
      <mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>
    </inertial>
    <collision>
      <origin xyz="0 0 0.5"/><geometry><cylinder radius="0.1" length="0.6"/></geometry>
    </collision>
  </link>
  <joint name="turn" type="revolute">
    <parent link="base"/><child link="arm"/><axis xyz="1 0 0"/>
    <limit lower="-1" upper="1" effort="1" velocity="1"/>
  </joint>
</robot>
"""


class Window:
    """Keeps the commands that a player sends."""

    def __init__(self) -> None:
        self.commands: list[dict[str, Any]] = []

    def send(self, command: Any) -> None:
        self.commands.append(command.lower())

    def drawn(self) -> dict[str, dict[str, Any]]:
        return {c["path"]: c["object"] for c in self.commands if c["type"] == "set_object"}

    def placed(self) -> dict[str, np.ndarray]:
        moves = [c for c in self.commands if c["type"] == "set_transform"]
        return {c["path"]: np.reshape(c["matrix"], (4, 4)).T for c in moves}


def player_of(arm: Arm, scene: Scene) -> tuple[MeshcatPlayer, Window]:
    window = Window()
    return MeshcatPlayer(arm, scene, meshcat.Visualizer(window=window)), window


@pytest.fixture(scope="module")
def two_link() -> Iterator[Arm]:
    return load_arm("two_link")


def test_links_without_visuals_show_their_collision_shapes() -> None:
    arm = Arm(RobotDescription(name="bare", urdf=NO_VISUALS))
    _, window = player_of(arm, Scene())
    robot = [path for path in window.drawn() if "/robot/" in path]
    assert sorted(robot) == [
        "/meshcat/robot/turn/arm_0",
        "/meshcat/robot/universe/base_0",
    ]


def test_goal_shares_the_meshes_of_the_robot(two_link: Arm) -> None:
    player, window = player_of(two_link, Scene())
    player.draw_goal(two_link.configuration([1.0, 1.0]))
    drawn = window.drawn()
    goal = {
        path.replace("/goal/", "/robot/"): item for path, item in drawn.items() if "goal" in path
    }
    assert goal
    for path, item in goal.items():
        assert item["object"]["geometry"] == drawn[path]["object"]["geometry"]
        assert item["materials"][0]["transparent"]


def test_obstacles_stand_where_the_scene_says(two_link: Arm) -> None:
    scene = Scene([Sphere(name="ball", radius=0.1, position=(1.0, 2.0, 3.0))])
    _, window = player_of(two_link, scene)
    assert "/meshcat/obstacles/ball" in window.drawn()
    np.testing.assert_allclose(window.placed()["/meshcat/obstacles/ball"][:3, 3], [1.0, 2.0, 3.0])


def test_half_space_is_a_board_below_its_surface(two_link: Arm) -> None:
    wall = HalfSpace(name="wall", normal=(2.0, 0.0, 0.0), offset=-0.3, position=(1.0, 5.0, 5.0))
    _, window = player_of(two_link, Scene([wall]))
    pose = window.placed()["/meshcat/obstacles/wall"]
    board = window.drawn()["/meshcat/obstacles/wall"]["geometries"][0]
    thickness = board["depth"]
    assert board["width"] == board["height"] > 100 * thickness
    np.testing.assert_allclose(pose[:3, 2], [1.0, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(pose[:3, 3], [0.7 - 0.5 * thickness, 0.0, 0.0], atol=1e-12)


def test_camera_does_not_step_back_for_a_half_space(two_link: Arm) -> None:
    views = []
    for scene in (Scene(), Scene([HalfSpace(name="floor", offset=-1.9)])):
        player, window = player_of(two_link, scene)
        player.place_camera(two_link.configuration([0.0, 0.0])[np.newaxis])
        views.append([c for c in window.commands if "Cameras" in c["path"]])
    assert views[0] == views[1]


def test_each_piece_of_a_mesh_is_drawn(two_link: Arm) -> None:
    piece = ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    _, window = player_of(two_link, Scene([Mesh(name="mug", pieces=(piece, piece))]))
    assert {"/meshcat/obstacles/mug.0", "/meshcat/obstacles/mug.1"} <= set(window.drawn())


def test_held_body_moves_with_its_link(two_link: Arm) -> None:
    ball = Sphere(name="ball", radius=0.1, position=(0.0, 0.0, -0.5))
    player, window = player_of(two_link.holding(Attachment(ball, "lower_link")), Scene())
    player.draw_goal(two_link.configuration([1.0, 1.0]))
    assert {"/meshcat/robot/elbow/ball", "/meshcat/goal/elbow/ball"} <= set(window.drawn())
    np.testing.assert_allclose(window.placed()["/meshcat/robot/elbow/ball"][:3, 3], ball.position)


def test_display_places_the_joints(two_link: Arm) -> None:
    player, window = player_of(two_link, Scene())
    player.display(two_link.configuration([np.pi / 2, 0.0]))
    np.testing.assert_allclose(
        window.placed()["/meshcat/robot/elbow"][:3, 3], [1.0, 0.0, 0.0], atol=1e-12
    )


@given(
    seconds=st.floats(0.01, 3.0),
    samples=st.integers(2, 300),
    rate=st.floats(1.0, 60.0),
    start=st.floats(0.0, 5.0),
)
def test_key_frames_are_samples(
    two_link: Arm, seconds: float, samples: int, rate: float, start: float
) -> None:
    player, _ = player_of(two_link, Scene())
    time = start + np.linspace(0.0, seconds, samples)
    angle = np.linspace(0.0, 2.0, samples)
    q = np.array([two_link.configuration([a, -a]) for a in angle])
    (shoulder, elbow) = player.animation(time, q, rate).clips.values()
    keys = np.array(elbow.tracks["position"].frames)
    assert keys[0] == 0.0
    assert keys[-1] == pytest.approx(seconds)
    assert np.all(np.diff(keys) > 0.0)
    assert len(keys) <= seconds * rate + 2
    assert shoulder.tracks["quaternion"].frames == elbow.tracks["quaternion"].frames
    expected = np.interp(keys, time - start, angle)
    position = np.array(elbow.tracks["position"].values)
    np.testing.assert_allclose(position[:, 0], np.sin(expected), atol=1e-9)
    rotation = [pin.Quaternion(np.array(x)).matrix() for x in elbow.tracks["quaternion"].values]
    np.testing.assert_allclose(rotation, np.broadcast_to(np.eye(3), (len(keys), 3, 3)), atol=1e-9)


def test_path_follows_the_end_effector(two_link: Arm) -> None:
    player, window = player_of(two_link, Scene())
    q = np.array([two_link.configuration([a, 0.0]) for a in np.linspace(0.0, np.pi, 500)])
    player.draw_path(q)
    curve = np.array(window.drawn()["/meshcat/path"]["geometries"][0]["path"]["points"])
    np.testing.assert_allclose(np.linalg.norm(curve, axis=1), 2.0, atol=1e-4)
    np.testing.assert_allclose(curve[[0, -1]], [[0, 0, -2], [0, 0, 2]], atol=1e-9)


def test_path_of_a_body_without_extent_is_drawn() -> None:
    point = free_body(Sphere(name="point", radius=1e-9), "plane", [(-1.0, 1.0)] * 2)
    player, window = player_of(point, Scene())
    player.draw_path(np.linspace([-0.5, 0.0], [0.5, 0.0], 50))
    points = window.drawn()["/meshcat/path"]["geometries"][0]["path"]["points"]
    np.testing.assert_allclose(np.array(points)[[0, -1]], [[-0.5, 0, 0], [0.5, 0, 0]], atol=1e-9)


def test_arm_at_rest_has_no_path(two_link: Arm) -> None:
    player, window = player_of(two_link, Scene())
    player.draw_path(np.tile(two_link.configuration([0.2, 0.1]), (50, 1)))
    assert "/meshcat/path" not in window.drawn()
