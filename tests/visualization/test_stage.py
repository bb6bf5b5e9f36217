from dataclasses import replace

import numpy as np
import pytest

from densarm.arm import load_arm
from densarm.scene import HalfSpace, Scene
from densarm.visualization.stage import Stage


@pytest.fixture(scope="module")
def stage(swing):
    return Stage(swing)


def test_frames_are_samples_with_the_closest_and_the_last(stage, swing):
    k = int(swing.clearance.argmin())
    rows = np.searchsorted(swing.time, stage.time)
    assert {0, k, len(swing.time) - 1} <= set(rows.tolist())
    np.testing.assert_array_equal(swing.q[rows], stage.q)
    np.testing.assert_array_equal(swing.time[rows], stage.time)
    assert stage.closest.distance.min() == pytest.approx(swing.clearance.min())


def test_path_follows_the_end_effector_in_the_colours_of_the_clearance(stage, two_link):
    angles = two_link.angles(stage.q)
    ends = np.column_stack(
        [
            np.sin(angles[:, 0]) + np.sin(angles.sum(axis=1)),
            np.zeros(len(angles)),
            -np.cos(angles[:, 0]) - np.cos(angles.sum(axis=1)),
        ]
    )
    away = np.linalg.norm(stage.path.vertices[:, np.newaxis] - ends, axis=2)
    assert away.min(axis=1).max() < 2.0 * stage.line_radius
    expected = stage.scale.colors(stage.closest.distance)[away.argmin(axis=1)]
    assert np.abs(stage.path.colors - expected).max() < 0.15


def test_arm_at_rest_has_no_path_and_may_have_no_pairs(resting):
    stage = Stage(resting)
    assert stage.path is None
    assert len(stage.time) == 1
    assert stage.obstacles == stage.sensing == ()


def test_motion_without_pairs_has_a_path(swing):
    alone = replace(swing.scenario, scene=Scene())
    run = replace(swing, scenario=alone, clearance=np.full(len(swing.time), np.inf))
    assert np.isfinite(Stage(run).path.colors).all()


def test_sensing_region_is_wider_than_its_obstacle_by_the_sensing_distance(stage):
    for obstacle, region in zip(stage.obstacles, stage.sensing, strict=True):
        assert region.name == obstacle.name
        wider = np.ptp(region.mesh.vertices, axis=0) - np.ptp(obstacle.mesh.vertices, axis=0)
        np.testing.assert_allclose(wider, 2.0 * stage.sensing_distance, atol=5e-3)


def test_floor_lies_below_and_around(stage):
    poses = stage.joint_poses(stage.q[0])
    corners = np.vstack([body.corners(poses) for body in stage.robot])
    low, high = corners.min(axis=0), corners.max(axis=0)
    points = stage.floor.reshape(-1, 3)
    assert np.all(points[:, 2] <= low[2])
    assert np.all(points.min(axis=0)[:2] < low[:2])
    assert np.all(points.max(axis=0)[:2] > high[:2])


def test_camera_does_not_step_back_for_a_half_space(resting):
    floor = Scene([HalfSpace(name="floor", offset=-5.0)])
    cameras = [
        Stage(replace(resting, scenario=replace(resting.scenario, scene=scene))).camera
        for scene in (Scene(), floor)
    ]
    np.testing.assert_array_equal(cameras[0].offset, cameras[1].offset)
    np.testing.assert_array_equal(cameras[0].target, cameras[1].target)


def test_end_effector_may_share_its_name_with_a_joint(resting):
    arm = load_arm("z1")
    scenario = replace(
        resting.scenario, arm=arm, start=arm.postures["ready"], goal=arm.postures["ready"]
    )
    row = np.zeros((1, arm.nv))
    run = replace(resting, scenario=scenario, q=arm.postures["ready"][np.newaxis], v=row, tau=row)
    assert Stage(run).path is None
