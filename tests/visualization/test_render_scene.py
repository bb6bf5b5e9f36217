from dataclasses import replace

import numpy as np
import pytest

from densarm.arms.arm import Arm, load_arm
from densarm.scene.obstacles import HalfSpace
from densarm.scene.scene import Scene
from densarm.simulation.run import Run
from densarm.values.outcome import Outcome
from densarm.visualization.bodies import sensing_bodies
from densarm.visualization.render_scene import RenderScene, SummaryLine, closest_line
from densarm.world.world import NearestPair, World


@pytest.fixture(scope="module")
def scene(swing: Run) -> RenderScene:
    return RenderScene(swing)


def test_frames_are_samples_with_the_closest_and_the_last(scene: RenderScene, swing: Run) -> None:
    k = int(swing.clearance.argmin())
    rows = np.searchsorted(swing.time, scene.time)
    assert {0, k, len(swing.time) - 1} <= set(rows.tolist())
    np.testing.assert_array_equal(swing.q[rows], scene.q)
    np.testing.assert_array_equal(swing.time[rows], scene.time)
    assert scene.clearance.min() == pytest.approx(swing.clearance.min())


def test_path_follows_the_end_effector_in_the_colours_of_the_clearance(
    scene: RenderScene, two_link: Arm
) -> None:
    angles = two_link.angles(scene.q)
    ends = np.column_stack(
        [
            np.sin(angles[:, 0]) + np.sin(angles.sum(axis=1)),
            np.zeros(len(angles)),
            -np.cos(angles[:, 0]) - np.cos(angles.sum(axis=1)),
        ]
    )
    assert scene.path is not None
    away = np.linalg.norm(scene.path.vertices[:, np.newaxis] - ends, axis=2)
    assert away.min(axis=1).max() < 2.0 * scene.line_radius
    expected = scene.scale.colors(scene.clearance)[away.argmin(axis=1)]
    assert np.abs(scene.path.colors - expected).max() < 0.15


def test_arm_at_rest_has_no_path_and_may_have_no_pairs(resting: Run) -> None:
    scene = RenderScene(resting)
    assert scene.path is None
    assert len(scene.time) == 1
    assert scene.obstacles == ()
    assert scene.closest == []
    assert scene.closest_line == {}


def test_motion_without_pairs_has_a_path(swing: Run) -> None:
    alone = replace(swing.task, scene=Scene())
    run = replace(swing, task=alone, clearance=np.full(len(swing.time), np.inf))
    path = RenderScene(run).path
    assert path is not None
    assert path.colors is not None
    assert np.isfinite(path.colors).all()


def test_sensing_region_is_wider_than_its_obstacle_by_the_sensing_distance(
    scene: RenderScene,
) -> None:
    sensing = sensing_bodies(scene.solids, scene.sensing_distance)
    for obstacle, region in zip(scene.solids, sensing, strict=True):
        assert region.name == obstacle.name
        wider = np.ptp(region.mesh.vertices, axis=0) - np.ptp(obstacle.mesh.vertices, axis=0)
        np.testing.assert_allclose(wider, 2.0 * scene.sensing_distance, atol=5e-3)


def test_floor_lies_below_and_around(scene: RenderScene) -> None:
    poses = scene.joint_poses(scene.q[0])
    corners = np.vstack([body.corners(poses) for body in scene.robot])
    low, high = corners.min(axis=0), corners.max(axis=0)
    points = scene.floor.reshape(-1, 3)
    assert np.all(points[:, 2] <= low[2])
    assert np.all(points.min(axis=0)[:2] < low[:2])
    assert np.all(points.max(axis=0)[:2] > high[:2])


def test_camera_does_not_step_back_for_a_half_space(resting: Run) -> None:
    floor = Scene([HalfSpace(name="floor", offset=-5.0)])
    cameras = [
        RenderScene(replace(resting, task=replace(resting.task, scene=obstacles))).camera
        for obstacles in (Scene(), floor)
    ]
    np.testing.assert_array_equal(cameras[0].offset, cameras[1].offset)
    np.testing.assert_array_equal(cameras[0].target, cameras[1].target)


def test_half_space_below_is_the_floor_and_others_have_a_grid(resting: Run) -> None:
    wall = HalfSpace(name="wall", normal=(0.0, 1.0, 0.0), offset=-3.0)
    for around in (
        [HalfSpace(name="floor", offset=-2.5)],
        [HalfSpace(name="floor", offset=-2.5), wall],
    ):
        task = replace(resting.task, scene=Scene(around))
        scene = RenderScene(replace(resting, task=task))
        assert scene.ground == -2.5
        planes = [scene.floor[..., 2] + 2.5, scene.floor[..., 1] + 3.0][: len(around)]
        on_one = np.min(np.abs(planes), axis=0)
        assert on_one.max() < 2e-3
        assert all((np.abs(plane).max(axis=1) < 2e-3).sum() > 4 for plane in planes)


@pytest.mark.slow
def test_camera_sees_the_hand_past_the_arm(resting: Run) -> None:
    arm = load_arm("xarm7")
    q = arm.configuration([0.011, 0.740, 0.406, 1.217, 0.197, -0.879, -0.331])
    task = replace(resting.task, arm=arm, start=q, goal=q)
    row = np.zeros((1, arm.nv))
    scene = RenderScene(replace(resting, task=task, q=q[np.newaxis], v=row, tau=row))
    (sight,) = scene.watched
    assert sight.visibility(scene.camera.target + scene.camera.offset) == 1.0


@pytest.mark.slow
def test_end_effector_may_share_its_name_with_a_joint(resting: Run) -> None:
    arm = load_arm("z1", shapes="capsule")
    ready = arm.postures["ready"]
    task = replace(resting.task, arm=arm, start=ready, goal=ready)
    row = np.zeros((1, arm.nv))
    run = replace(resting, task=task, q=ready[np.newaxis], v=row, tau=row)
    assert RenderScene(run).path is None


def test_without_a_goal_the_motion_alone_is_seen(aimless: Run) -> None:
    scene = RenderScene(aimless)
    assert np.isfinite(scene.camera.offset).all()
    assert scene.path is not None


@pytest.fixture(scope="module")
def closest(swing: Run) -> list[NearestPair]:
    world = World(swing.task.arm, swing.task.scene)
    return [pair for q in swing.q[::40] if (pair := world.nearest(q))]


def test_points_are_as_far_apart_as_the_distance(closest: list[NearestPair], swing: Run) -> None:
    distance = [pair.distance for pair in closest]
    np.testing.assert_allclose(distance, swing.clearance[::40])
    apart = [np.linalg.norm(pair.points[1] - pair.points[0]) for pair in closest]
    np.testing.assert_allclose(apart, np.abs(distance), atol=1e-6)
    assert {pair.names[1] for pair in closest} == {"ball", "cylinder"}


def test_line_leads_from_one_point_to_the_other(closest: list[NearestPair]) -> None:
    line = closest_line(closest, 0.01)
    points = np.array([pair.points for pair in closest])
    _, rods = line["line"]
    np.testing.assert_allclose(rods[:, :3, 3], points[:, 0])
    np.testing.assert_allclose(rods[:, :3, 2] + rods[:, :3, 3], points[:, 1], atol=1e-9)
    ball, transforms = line["second"]
    np.testing.assert_allclose(transforms[:, :3, 3], points[:, 1])
    assert np.linalg.norm(transforms[0, :3, 0] * ball.vertices.max()) == pytest.approx(
        0.02, rel=0.1
    )


def test_points_that_coincide_have_a_line() -> None:
    touching = NearestPair(0.0, np.zeros((2, 3)), ("a", "b"))
    rod = closest_line([touching], 0.01)["line"][1][0]
    assert np.isfinite(rod).all()
    assert np.linalg.norm(rod[:3, 2]) < 1e-5


def test_reached_and_certified(swing_up_run: Run) -> None:
    summary = SummaryLine.of(swing_up_run)
    assert summary.words[0] == ("reached", True)
    assert summary.words[-1] == ("certified", True)
    assert summary.detail == f"Led by {swing_up_run.led_by}; {swing_up_run.remark}"
    assert summary.title == swing_up_run.task.title


@pytest.mark.parametrize(
    ("clearance", "expected"),
    [(0.00316227, "3.16 mm"), (1.25, "1250 mm"), (-0.001, "-1 mm"), (np.inf, "infinite")],
)
def test_failed_run(resting: Run, clearance: float, expected: str) -> None:
    run = replace(resting, clearance=np.array([clearance]), outcome=Outcome.NO_PATH)
    summary = SummaryLine.of(run)
    assert summary.words[0] == ("no path", False)
    assert summary.words[1:3] == (("0.000 s", None), (f"smallest clearance {expected}", None))
    assert summary.detail == f"{Outcome.NO_PATH.description} late"


@pytest.mark.slow
def test_what_phases_carry_is_drawn_where_it_is(carried_can: Run) -> None:
    scene = RenderScene(carried_can)
    assert {body.name for body in scene.obstacles} == {"table", "can"}
    assert scene.obstacle_poses.keys() == {"can"}
    heights = np.array([pose.translation[2] for pose in scene.obstacle_poses["can"]])
    assert heights[[0, -1]] == pytest.approx([0.18, 0.18], abs=1e-3)
    assert heights.max() == pytest.approx(0.28, abs=1e-3)
    fingers = scene.q[:, 7:]
    assert np.ptp(fingers[:, 0]) == pytest.approx(0.0064, abs=1e-4)
    assert scene.clearance.min() == pytest.approx(carried_can.clearance.min())
