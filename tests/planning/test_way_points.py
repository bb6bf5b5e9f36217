"""Way points: passed one after another, without a stop, and clear of what is between them."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

import densarm
from densarm.arms.free_body import free_body
from densarm.errors import InvalidValueError
from densarm.planning.motion import Motion, PlanningError
from densarm.planning.plan import plan_motion
from densarm.scene.obstacles import Sphere
from densarm.scene.scene import Scene
from densarm.world.swept_check import SweptCheck, SweptVerdict
from densarm.world.world import World

coordinate = st.floats(-1.2, 1.2)
place = st.tuples(coordinate, coordinate)


@pytest.fixture(scope="module")
def plane() -> World:
    """Return a disc in a square, and another one in the middle of it."""
    arm = free_body(Sphere(name="disc", radius=0.1), "plane", [(-1.2, 1.2)] * 2)
    return World(arm, Scene([Sphere(name="middle", radius=0.2)]))


def passed(motion: Motion, arm: densarm.Arm) -> list[tuple[int, float]]:
    """Return the first knot within the blend of each way point after the last, and how far off."""
    found, row = list[tuple[int, float]](), 0
    assert motion.way_points is not None
    for q in motion.way_points.q:
        off = np.abs(arm.difference(q, arm.configurations(motion.position[row:]))).max(axis=1)
        within = off <= motion.way_points.blend
        assert within.any(), (off.min(), row)
        row += int(within.argmax())
        found.append((row, float(off.min())))
    return found


@pytest.mark.slow
@settings(max_examples=20)
@given(places=st.lists(place, min_size=4, max_size=5), blend=st.sampled_from([0.01, 0.05, 0.2]))
@example(places=[(0.0, 1.0), (0.0, 1.1875), (1.0, 1.0)], blend=0.01)  # near a position limit
def test_all_are_passed_in_their_order_and_nothing_is_touched(
    plane: World, places: list[tuple[float, float]], blend: float
) -> None:
    points = [np.array(x) * max(1.0, 0.4 / max(np.hypot(*x), 0.1)) for x in places]
    points = [x for x in points if np.linalg.norm(x) > 0.35 and np.abs(x).max() <= 1.2]
    if len(points) < 3:
        return
    start, *through, goal = points
    motion = plan_motion(plane, start, goal, through=through, blend=blend)
    for _, off in passed(motion, plane.arm):
        assert off <= 0.9 * blend
    np.testing.assert_allclose(motion.position[-1], goal, atol=0.003)
    q = plane.arm.configurations(motion.position)
    assert SweptCheck(plane).check(q).verdict == SweptVerdict.CLEAR


def test_it_does_not_stop_and_is_quicker_than_stopping(plane: World) -> None:
    start, corner, goal = np.array([[-1.0, -0.8], [1.0, -0.8], [1.0, 0.8]])
    motion = plan_motion(plane, start, goal, through=[corner])
    ((row, _),) = passed(motion, plane.arm)
    assert np.linalg.norm(motion.velocity[row]) > 0.2
    stops = plan_motion(plane, start, corner).duration + plan_motion(plane, corner, goal).duration
    assert motion.duration < 0.95 * stops
    wider = plan_motion(plane, start, goal, through=[corner], blend=0.3)
    assert wider.duration < motion.duration


def test_there_and_back_and_where_it_is_already(plane: World) -> None:
    a, b = np.array([-1.0, 0.8]), np.array([1.0, 0.8])
    motion = plan_motion(plane, a, a, through=[a, b, a, b], blend=0.02)
    rows = [row for row, _ in passed(motion, plane.arm)]
    assert rows[0] == 0
    assert (np.diff(rows) > 0).all()
    assert plan_motion(plane, a, a, through=a).duration == pytest.approx(0.001)


def test_at_a_position_limit(plane: World) -> None:
    start, corner, goal = np.array([[-1.0, 0.0], [0.0, 1.2], [1.0, 0.0]])
    motion = plan_motion(plane, start, goal, through=[corner], blend=0.01)
    assert passed(motion, plane.arm)[0][1] <= 0.009
    assert motion.position[:, 1].max() <= 1.2


def test_of_a_pose_and_over_the_back_of_a_joint() -> None:
    arm = densarm.load_arm("two_link")
    world = World(arm, Scene([]))
    frame = arm.end_effector
    above = densarm.Pose(frame, arm.pose(arm.configuration([3.0, 0.4]), frame).position)
    start, goal = (arm.configuration(x) for x in ([2.4, 0.0], [-2.4, 0.3]))
    motion = plan_motion(world, start, goal, through=[above])
    assert motion.way_points is not None
    reached = arm.pose(motion.way_points.q[0], frame).position
    assert reached == pytest.approx(above.position, abs=1e-4)
    passed(motion, arm)
    assert motion.duration < 2.0


def test_what_cannot_be_passed_is_told(plane: World) -> None:
    start, goal, middle = np.array([[-1.0, 0.0], [1.0, 0.0], [0.0, 0.1]])
    with pytest.raises(PlanningError, match=r"to way point 2: goal: .* overlap by"):
        plan_motion(plane, start, goal, through=[[0.0, 1.0], middle])
    with pytest.raises(InvalidValueError, match="way point 2"):
        plan_motion(plane, start, goal, through=[[0.0, 1.0], [0.0]])
    with pytest.raises(InvalidValueError, match=r"blend = 0.001: must be at least 0.01"):
        plan_motion(plane, start, goal, through=[[0.0, 1.0]], blend=0.001)
    with pytest.raises(InvalidValueError, match="guide = 'the density alone'"):
        plan_motion(plane, start, goal, "direct", through=[[0.0, 1.0]])
    with pytest.raises(InvalidValueError, match=r"through = .*: must be left out where the goal"):
        plan_motion(plane, start, densarm.Line("disc", by=[0.1, 0.0, 0.0]), through=[start])


def test_the_same_seed_the_same_bits(plane: World) -> None:
    start, goal = np.array([[-1.0, -0.8], [1.0, 0.8]])
    one, other = (plan_motion(plane, start, goal, through=[-0.8, 0.9], seed=3) for _ in range(2))
    np.testing.assert_array_equal(one.position, other.position)
