"""How obstacles move: without jumps, no faster than they say, as files and records have it."""

import json
import math
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st

from densarm.errors import DensarmError
from densarm.scene.motion import BackAndForth, ConstantVelocity, ObstacleMotion, Waypoints
from densarm.scene.obstacles import Box, Capsule, HalfSpace, Obstacle, Sphere
from densarm.scene.scene import Attachment, Scene, parse_obstacle
from densarm.values.arrays import Array

NUMBER = st.floats(-1.0, 1.0)
POINT = st.tuples(NUMBER, NUMBER, NUMBER)
QUATERNION = (
    st.tuples(NUMBER, NUMBER, NUMBER, NUMBER)
    .filter(lambda x: math.hypot(*x) > 0.1)
    .map(lambda x: tuple((np.array(x) / math.hypot(*x)).tolist()))
)
TIME = st.floats(-1.0, 6.0)


@st.composite
def waypoints(draw: st.DrawFn) -> Waypoints:
    times = np.cumsum(draw(st.lists(st.floats(0.1, 1.0), min_size=2, max_size=4)))
    rows = len(times)
    return Waypoints(
        times=times.tolist(),
        positions=draw(st.lists(POINT, min_size=rows, max_size=rows)),
        orientations_xyzw=draw(st.lists(QUATERNION, min_size=rows, max_size=rows)),
        of_point=draw(POINT),
    )


MOTION: st.SearchStrategy[ObstacleMotion] = st.one_of(
    st.builds(ConstantVelocity, linear=POINT, angular=POINT),
    st.builds(
        BackAndForth,
        position=POINT,
        orientation_xyzw=QUATERNION,
        period=st.floats(0.5, 3.0),
        smooth=st.booleans(),
    ),
    waypoints(),
)
BODY: st.SearchStrategy[Obstacle] = MOTION.map(
    lambda motion: Box(name="it", size=(0.2, 0.4, 0.6), motion=motion)
)


def corners(obstacle: Obstacle, time: float) -> Array:
    pose = obstacle.pose_at(time)
    points = np.array(obstacle.convex_shapes()[0].points())
    return np.asarray(points @ pose.rotation.T + pose.translation)


@given(body=BODY, begin=TIME, span=st.floats(1e-6, 2.0))
def test_no_point_goes_faster_than_the_bound(body: Obstacle, begin: float, span: float) -> None:
    way = np.linalg.norm(corners(body, begin + span) - corners(body, begin), axis=1).max()
    assert way <= span * body.speed_bound(begin, begin + span) + 1e-12


@given(body=BODY, time=TIME)
def test_velocity_is_the_change_of_the_pose(body: Obstacle, time: float) -> None:
    step, velocity, pose = 1e-6, body.velocity_at(time), body.pose_at(time)
    after = body.pose_at(time + step)
    turn = pin.log3(after.rotation @ pose.rotation.T)
    change = np.concatenate([after.translation - pose.translation, turn]) / step
    # Unless a way point, or a turn, lies between.
    if np.allclose(body.velocity_at(time + step), velocity, atol=1e-3):
        np.testing.assert_allclose(velocity, change, atol=1e-3)


@given(body=BODY)
def test_a_scene_of_moving_obstacles_is_read_as_it_is_written(body: Obstacle) -> None:
    scene = Scene([body])
    assert Scene.from_json(json.loads(json.dumps(scene.to_json()))) == scene
    own = body.pose_at(0.0)
    np.testing.assert_allclose(own.translation, body.position, atol=1e-9)


def test_back_and_forth_is_at_its_ends_when_it_should_be() -> None:
    for smooth in (True, False):
        motion = BackAndForth(position=(1, 0, 0), period=2.0, smooth=smooth)
        ball = Sphere(name="ball", radius=0.1, position=(0, 0, 1), motion=motion)
        for time, x in ((0.0, 0.0), (0.5, 0.5), (1.0, 1.0), (1.5, 0.5), (2.0, 0.0), (5.0, 1.0)):
            there = (x, 0.0, 1.0 - x)
            np.testing.assert_allclose(ball.pose_at(time).translation, there, atol=1e-12)


def test_a_chain_stays_joined() -> None:
    """A forearm that turns about an elbow that moves, and the upper arm that holds it."""
    times, elbow = (1.0, 2.0), ((0, 0, 1), (0.1, 0.2, 1.1))
    turned = ((0, 0, 0, 1), (math.sqrt(0.5), 0, 0, math.sqrt(0.5)))
    upper, lower = (
        Capsule(
            name=name,
            radius=0.05,
            length=0.3,
            motion=Waypoints(
                times=times, positions=elbow, orientations_xyzw=turns, of_point=(0, 0, end)
            ),
        )
        for name, turns, end in (("upper", turned, 0.15), ("lower", turned[::-1], -0.15))
    )
    for time in np.linspace(0.0, 3.0, 20):
        ends = [
            body.pose_at(time).act(np.array([0, 0, z]))
            for body, z in ((upper, 0.15), (lower, -0.15))
        ]
        np.testing.assert_allclose(ends[0], ends[1], atol=1e-12)


def test_a_body_that_stands() -> None:
    ball = Sphere(name="ball", radius=0.1, position=(1, 2, 3))
    np.testing.assert_array_equal(ball.pose_at(5.0).translation, (1, 2, 3))
    assert ball.speed_bound(0.0, 9.0) == 0.0
    assert not ball.velocity_at(1.0).any()


WAY: dict[str, Any] = {"type": "waypoints", "times": [0, 1], "positions": [[0, 0, 1], [0, 1, 1]]}


@pytest.mark.parametrize(
    ("motion", "message"),
    [
        ({}, "unknown type of obstacle a.motion 'None'"),
        (3, "obstacle a.motion = 3: must be a table"),
        ({"type": "constant_velocity"}, "motion.linear = None: must be given"),
        ({"type": "constant_velocity", "linear": [0, 0, math.nan]}, "motion.linear = .*finite"),
        (
            {"type": "constant_velocity", "linear": [200, 0, 0]},
            r"a.motion \[m/s\] = 200.0: must be",
        ),
        ({"type": "constant_velocity", "speed": 1}, "unknown key of obstacle a.motion .*'speed'"),
        (WAY | {"times": [1, 0]}, r"motion.times = \(1.0, 0.0\): must be two or more .* increase"),
        (WAY | {"times": [0, math.inf]}, "motion.times = .*finite"),
        (WAY | {"times": [0]}, "motion.times"),
        (WAY | {"times": 1}, "motion.times"),
        (WAY | {"times": [0, 1, 2]}, "motion.positions = 2: must be as many as times, 3"),
        (WAY | {"positions": 1}, "motion.positions"),
        (WAY | {"positions": [[0, 0, 1], [0, 1]]}, r"motion.positions\[1\] = .*shape"),
        (WAY | {"positions": [[0, 0, 1], [0, 0, 2e6]]}, r"positions\[1\].*less than 1000 km"),
        (WAY | {"positions": [[0, 0, 1], [0, 0, 1e3]]}, r"a.motion \[m/s\] = 999.0: must be at"),
        (WAY | {"orientations_xyzw": [[0, 0, 0, 1]] * 3}, "motion.orientations_xyzw = 3"),
        (WAY | {"orientations_xyzw": [[0, 0, 0, 1], [0, 0, 0, 2]]}, "unit quaternion"),
        (WAY | {"orientations_xyzw": [[1, 0, 0, 0]] * 2}, "a.orientation_xyzw = .*left out, or"),
        (WAY | {"positions": [[1, 0, 1], [1, 1, 1]]}, r"a.position = .*left out, or \[1.0, 0.0"),
        ({"type": "back_and_forth", "position": [0, 0, 1], "period": 0}, "motion.period = 0"),
        ({"type": "back_and_forth", "position": [9, 0, 1], "period": 1e-3}, "at most 100"),
        (
            {"type": "back_and_forth", "position": [0, 0, 1], "period": 1, "smooth": 3},
            "motion.smooth = 3: must be true or false",
        ),
    ],
)
def test_motions_that_are_refused(motion: Any, message: str) -> None:
    pose = {"position": [0, 0, 1], "orientation_xyzw": [0, 1, 0, 0]}
    table = {"type": "sphere", "name": "a", "radius": 0.1, **pose, "motion": motion}
    with pytest.raises(DensarmError, match=message) as error:
        parse_obstacle(table)
    assert "\n" not in str(error.value)


def test_what_has_no_end_may_rise_but_not_turn() -> None:
    rises = ConstantVelocity(linear=(0, 0, 0.1))
    assert HalfSpace(name="floor", motion=rises).speed_bound(0, 1) == pytest.approx(0.1)
    with pytest.raises(DensarmError, match=r"floor.motion = .*: must be one that does not turn"):
        HalfSpace(name="floor", motion=ConstantVelocity(linear=(0, 0, 0), angular=(1, 0, 0)))


def test_sizes_are_checked_of_what_turns_too() -> None:
    turns = ConstantVelocity(linear=(0, 0, 0), angular=(0, 0, 1))
    with pytest.raises(DensarmError, match=r"box\.size"):
        Box(name="box", size=(0.1, -0.1, 0.1), motion=turns)


def test_what_a_link_holds_has_no_motion_of_its_own() -> None:
    ball = Sphere(name="ball", radius=0.1, motion=ConstantVelocity(linear=(0, 0, 1)))
    with pytest.raises(DensarmError, match="none: its link moves it"):
        Attachment(ball, "hand")
