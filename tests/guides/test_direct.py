"""DirectGuide."""

import numpy as np

from densarm.guides import DirectGuide


def test_the_goal_is_the_only_sub_goal():
    start, goal = np.array([0.0, 1.0]), np.array([2.0, -1.0])
    path = DirectGuide().plan(start, goal, seed=3)
    np.testing.assert_array_equal(path.waypoints, [start, goal])
