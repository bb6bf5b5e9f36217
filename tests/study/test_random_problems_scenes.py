"""Random scenes: in proportion to the arm, from a seed alone, with ends in front and behind."""

from functools import cache

import numpy as np
import pytest

from densarm.arms.arm import load_arm
from densarm.scene.obstacles import Box, Sphere, obstacle_pose
from densarm.study.random_problems import OBSTACLES, Region, SceneKind, Workspace, wall


@cache
def workspace(name: str) -> Workspace:
    return Workspace(load_arm(name))


def test_reach_is_that_of_two_links_of_a_metre() -> None:
    assert 1.98 < workspace("two_link").reach <= 2.0
    np.testing.assert_array_equal(workspace("two_link").centre, np.zeros(3))


@pytest.mark.parametrize("kind", OBSTACLES.values(), ids=OBSTACLES)
@pytest.mark.parametrize("name", ["two_link", "panda"])
def test_a_seed_is_one_scene_and_another_another(kind: SceneKind, name: str) -> None:
    first, again, other = (kind(workspace(name), np.random.default_rng(s)) for s in (1, 1, 2))
    assert first.scene == again.scene
    assert first.scene != other.scene


@pytest.mark.parametrize("kind", OBSTACLES.values(), ids=OBSTACLES)
def test_obstacles_of_a_planar_arm_are_in_its_plane(kind: SceneKind) -> None:
    """Else they would be in nobody's way."""
    for seed in range(5):
        scene = kind(workspace("two_link"), np.random.default_rng(seed)).scene
        for body in scene:
            assert isinstance(body, Sphere | Box)
            off = abs(body.position[1])
            size = body.radius if isinstance(body, Sphere) else max(body.size)
            assert off < size


def test_solid_fills_its_region() -> None:
    forward = np.array([0.6, 0.8, 0.0])
    region = Region(
        np.array([1.0, 2.0, 3.0]), forward, np.array([0.1, -0.2, -0.3]), np.array([0.5, 0.4, 0.0])
    )
    box = region.solid("solid")
    assert isinstance(box, Box)
    pose, random = obstacle_pose(box), np.random.default_rng(0)
    for corner in 0.5 * random.choice([-1.0, 1.0], (8, 3)):
        assert region.contains(pose.act(0.999 * corner * np.array(box.size)))
        assert not region.contains(pose.act(1.001 * corner * np.array(box.size)))


def test_a_wall_is_between_its_ends_and_leaves_a_gap_in_the_middle() -> None:
    found = wall(workspace("panda"), np.random.default_rng(3))
    ends = [region for region in found.ends if region is not None]
    before, behind = sorted(ends, key=lambda region: region.high[0])
    right, left, below, above = (body for body in found.scene if isinstance(body, Box))
    thickness = min(right.size)
    assert before.high[0] < behind.low[0]
    side = before.axes[1]
    gap = np.dot(side, left.position) - 0.5 * left.size[1]
    gap -= np.dot(side, right.position) + 0.5 * right.size[1]
    assert 0.4 <= gap / workspace("panda").reach <= 0.6
    assert thickness < behind.low[0] - before.high[0]
    assert below.position[2] < above.position[2]
