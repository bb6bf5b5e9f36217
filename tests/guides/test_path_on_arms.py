"""PathGuide with the swept bound, on real links."""

import numpy as np
import pytest

from densarm.arm import load_arm
from densarm.clearance import Clearance
from densarm.guides import GuidePath, PathGuide
from densarm.proof.swept_bound import SweptBound
from densarm.scene import Box, Scene, Sphere

TWO_LINK = (
    "two_link",
    Scene([Sphere(name=f"ball_{x}", radius=0.2, position=(x, 0.0, -0.5)) for x in (-1.5, 1.5)]),
    [0.0, 0.0],
    [np.pi, 0.0],
)
PANDA = (
    "panda",
    Scene([Box(name="post", size=(0.1, 0.1, 1.2), position=(0.5, 0.0, 0.6))]),
    [-0.8, 0.3, 0.0, -1.8, 0.0, 2.1, 0.8],
    [0.8, 0.3, 0.0, -1.8, 0.0, 2.1, 0.8],
)


@pytest.mark.parametrize(("name", "scene", "start", "goal"), [TWO_LINK, PANDA])
def test_the_path_around_an_obstacle_is_clear_and_repeats(name, scene, start, goal, samples_of):
    arm = load_arm(name)
    clearance = Clearance(arm, scene)
    ends = arm.configuration(start), arm.configuration(goal)
    path = PathGuide(arm, SweptBound(clearance)).plan(*ends, seed=0)
    assert isinstance(path, GuidePath)
    assert len(path.waypoints) > 2
    np.testing.assert_array_equal(path.waypoints[[0, -1]], ends)
    assert min(clearance.distances(q).min() for q in samples_of(arm, path.waypoints)) > 0.0
    again = PathGuide(arm, SweptBound(Clearance(arm, scene))).plan(*ends, seed=0)
    np.testing.assert_array_equal(again.waypoints, path.waypoints)
