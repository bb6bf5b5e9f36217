from collections.abc import Callable
from dataclasses import replace
from typing import Any

import meshcat
import numpy as np
import pinocchio as pin
import pytest

from densarm.arms.arm import Arm
from densarm.arms.description import RobotDescription
from densarm.arms.pose import Pose
from densarm.scene.motion import BackAndForth
from densarm.scene.obstacles import Capsule, Sphere
from densarm.scene.scene import Scene
from densarm.simulation.run import Run
from densarm.values.arrays import Array
from densarm.visualization.meshcat_drawing import draw
from densarm.visualization.picture import Picture
from densarm.visualization.render_scene import RenderScene

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
    """Keeps the commands that it is sent."""

    def __init__(self) -> None:
        self.commands: list[dict[str, Any]] = []

    def send(self, command: Any) -> None:
        self.commands.append(command.lower())

    def of_type(self, kind: str) -> dict[str, dict[str, Any]]:
        return {c["path"]: c for c in self.commands if c["type"] == kind}

    def place(self, path: str) -> Array:
        return np.reshape(self.of_type("set_transform")[path]["matrix"], (4, 4)).T


def drawn(scene: RenderScene) -> Window:
    window = Window()
    draw(scene, meshcat.Visualizer(window=window))
    return window


@pytest.fixture(scope="module")
def scene(swing: Run) -> RenderScene:
    return RenderScene(swing)


@pytest.fixture(scope="module")
def window(scene: RenderScene) -> Window:
    return drawn(scene)


def test_links_without_visuals_show_their_collision_shapes(record: Callable[..., Run]) -> None:
    arm = Arm(RobotDescription(name="bare", urdf=NO_VISUALS))
    objects = drawn(RenderScene(record(arm, np.zeros((2, 1)), 1.0, Scene()))).of_type("set_object")
    assert sorted(path for path in objects if "/robot/" in path) == [
        "/meshcat/robot/turn/arm_0",
        "/meshcat/robot/universe/base_0",
    ]


def test_goal_shares_the_meshes_of_the_robot(window: Window) -> None:
    objects = {path: c["object"] for path, c in window.of_type("set_object").items()}
    goal = {path: item for path, item in objects.items() if "/goal/" in path}
    assert goal
    for path, item in goal.items():
        other = objects[path.replace("/goal/", "/robot/")]
        assert item["object"]["geometry"] == other["object"]["geometry"]
        assert item["materials"][0]["transparent"]


def test_without_a_goal_there_is_no_ghost(aimless: Run) -> None:
    objects = drawn(RenderScene(aimless)).of_type("set_object")
    assert any("/robot/" in path for path in objects)
    assert not any("/goal/" in path for path in objects)


def test_obstacles_and_their_sensing_regions_stand_where_the_scene_says(
    window: Window, swing: Run
) -> None:
    for obstacle in swing.task.scene:
        for group in ("obstacles", "sensing"):
            place = window.place(f"/meshcat/{group}/{obstacle.name}")
            np.testing.assert_allclose(place[:3, 3], obstacle.position)


def test_arm_starts_at_the_first_frame_and_the_ghost_is_at_the_goal(
    window: Window, swing: Run, two_link: Arm
) -> None:
    goal = swing.task.goal
    assert goal is not None
    for group, q in (("robot", swing.q[0]), ("goal", goal)):
        (shoulder, _) = two_link.angles(q)
        elbow = window.place(f"/meshcat/{group}/elbow")[:3, 3]
        np.testing.assert_allclose(elbow, [np.sin(shoulder), 0, -np.cos(shoulder)], atol=1e-9)


def test_animation_has_the_pose_of_every_joint_at_every_frame(
    window: Window, scene: RenderScene, two_link: Arm
) -> None:
    (command,) = (c for c in window.commands if c["type"] == "set_animation")
    clips = {c["path"]: c["clip"]["tracks"] for c in command["animations"]}
    position, quaternion = clips["/meshcat/robot/elbow"]
    assert [key["time"] for key in position["keys"]] == scene.time.tolist()
    angles = two_link.angles(scene.q)
    places = np.array([key["value"] for key in position["keys"]])
    np.testing.assert_allclose(places[:, 0], np.sin(angles[:, 0]), atol=1e-9)
    turns = [pin.Quaternion(np.array(key["value"])).matrix() for key in quaternion["keys"]]
    expected = [scene.joint_poses(q)[2].rotation for q in scene.q]
    np.testing.assert_allclose(turns, expected, atol=1e-9)


def test_obstacles_move_along(two_link: Arm, record: Callable[..., Run]) -> None:
    motion = BackAndForth(position=(1.5, 0, 1), orientation_xyzw=(1, 0, 0, 0), period=3.0)
    ball = Sphere(name="ball", radius=0.3, position=(1.5, 0.0, -0.5))
    bar = Capsule(name="bar", radius=0.1, length=0.5, position=(-1.5, 0.0, -0.5), motion=motion)
    run = record(two_link, np.zeros((50, 2)), 2.0, Scene([ball, bar]))
    shown = RenderScene(run)
    commands = drawn(shown).commands
    (command,) = (c for c in commands if c["type"] == "set_animation")
    clips = {c["path"]: c["clip"]["tracks"] for c in command["animations"]}
    assert "/meshcat/obstacles/ball" not in clips
    for group in ("obstacles", "sensing"):
        position, quaternion = clips[f"/meshcat/{group}/bar"]
        for k, time in enumerate(shown.time):
            pose = bar.pose_at(time)
            np.testing.assert_allclose(position["keys"][k]["value"], pose.translation, atol=1e-9)
            turn = pin.Quaternion(np.array(quaternion["keys"][k]["value"])).matrix()
            np.testing.assert_allclose(turn, pose.rotation, atol=1e-9)
    pictures = [Picture(shown, 320, 180).frame(k) for k in (0, len(shown.time) - 1)]
    below = [np.asarray(image, dtype=int)[40:-40] for image in pictures]
    assert (np.abs(below[0] - below[1]).max(axis=2) > 8).sum() > 200


def test_poses_that_are_goals_have_axes_or_a_ball(swing: Run) -> None:
    whole = Pose("link2", [0.1, 0.0, 0.5], [0.0, 1.0, 0.0, 0.0])
    goals = [whole.to_json(), Pose("link2", [0.3, 0.0, 0.5]).to_json(), [0.0, 0.0]]
    task = replace(swing.task, settings={**swing.task.settings, "goals": goals})
    window = drawn(RenderScene(replace(swing, task=task)))
    drawings = window.of_type("set_object")
    (axes,) = [path for path in drawings if path.endswith("goal/pose_0")]
    np.testing.assert_allclose(window.place(axes), whole.placement.homogeneous, atol=1e-12)
    assert drawings[axes]["object"]["object"]["type"] == "LineSegments"
    (ball,) = [path for path in drawings if path.endswith("goal/pose_1")]
    np.testing.assert_allclose(window.place(ball)[:3, 3], [0.3, 0.0, 0.5])
    assert not any(path.endswith("pose_2") for path in drawings)
