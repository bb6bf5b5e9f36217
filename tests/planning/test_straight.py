"""Straight lines of a frame: near enough to the line, proved clear, and refused in one line."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import densarm
from densarm.arms.line import Segment
from densarm.errors import DensarmError, InvalidValueError, UnknownNameError
from densarm.planning.motion import PlanningError
from densarm.planning.smoothing import STRAIGHT
from densarm.values.outcome import Outcome

TCP = "panda_hand_tcp"
PANDA = densarm.load_arm("panda")
TABLE = densarm.Box(name="table", size=[0.8, 1.4, 0.04], position=[0.6, 0.0, 0.1])
WORLD = densarm.World(PANDA, densarm.Scene([TABLE]))
READY = PANDA.postures["ready"]
POSE = PANDA.pose(READY, TCP)


def refusal(line: densarm.Line) -> str:
    with pytest.raises(PlanningError) as caught:
        densarm.plan_motion(WORLD, READY, line)
    assert caught.value.outcome == Outcome.NO_PATH
    assert "\n" not in str(caught.value)
    return caught.value.detail


@pytest.mark.slow
@settings(max_examples=10)
@given(st.tuples(*[st.floats(-0.2, 0.2)] * 3).filter(lambda by: np.linalg.norm(by) > 0.01))
def test_motion_keeps_to_the_line(by: tuple[float, float, float]) -> None:
    line = densarm.Line(TCP, by=by)
    segment = line.segment(PANDA, READY)
    try:
        motion = densarm.plan_motion(WORLD, READY, line)
    except PlanningError:
        return
    far, turned = segment.off(PANDA, PANDA.configurations(motion.position))
    assert far.max() <= STRAIGHT[0] + 1e-5
    assert turned.max() <= STRAIGHT[1] + 1e-4
    end = PANDA.pose(PANDA.configurations(motion.position[-1]), TCP)
    assert end.position == pytest.approx(np.add(POSE.position, by), abs=1e-5)
    way = [PANDA.pose(PANDA.configurations(row), TCP).position for row in motion.position]
    along = [(np.subtract(b, a) @ np.array(by)) for a, b in pairwise(way)]
    assert min(along) >= -1e-9


@pytest.mark.slow
def test_run_is_certified_and_within_a_millimetre() -> None:
    line = densarm.Line(TCP, densarm.Pose(TCP, [0.45, 0.15, 0.4], [0.98, 0.2, 0.0, 0.0]))
    segment = line.segment(PANDA, READY)
    motion = densarm.plan_motion(WORLD, READY, line)
    run = densarm.simulate(WORLD, densarm.DensityTracking(WORLD, motion), READY)
    assert (run.outcome, run.certified) == (Outcome.REACHED, True), run.detail
    assert segment.off(PANDA, run.q)[0].max() <= 1e-3
    assert motion.path is not None
    assert motion.path.found_by == "a straight line"


def test_ends_in_the_world_and_along_the_frame() -> None:
    down = densarm.Line(TCP, along=(0.0, 0.0, 0.1)).segment(PANDA, READY)
    same = densarm.Line(TCP, by=(0.0, 0.0, -0.1)).segment(PANDA, READY)
    there = densarm.Line(TCP, np.add(POSE.position, (0.0, 0.0, -0.1))).segment(PANDA, READY)
    for segment in (down, same, there, Segment.from_json(down.to_json())):
        assert segment.end.isApprox(down.end, 1e-9)
        assert segment.length == pytest.approx(0.1)
    assert down.placement(0.25).translation == pytest.approx(
        POSE.position - np.array([0, 0, 0.025])
    )


def test_how_far_a_frame_is_off_a_line() -> None:
    turned = POSE.moved(np.array([0.0, 0.2, 0.0, 0.0, 0.0, 0.3]))
    for end, turn in ((turned, 0.05), (POSE.moved(np.array([0.0, 0.2, 0, 0, 0, 0])), 0.2)):
        segment = Segment("panda_hand_tcp", POSE.placement, end.placement)
        aside = POSE.moved(np.array([0.003, 0.1, 0.004, 0.0, 0.0, 0.2]))  # half the way along
        (q,) = WORLD.inverse_kinematics(aside, count=1, near=READY)
        far, off = segment.off(PANDA, np.array([READY, q]))
        assert far == pytest.approx([0.0, 0.005], abs=1e-6)
        assert off == pytest.approx([0.0, turn], abs=1e-6)


def test_line_that_cannot_be_followed_says_how_far_and_why() -> None:
    far = refusal(densarm.Line(TCP, [1.3, 0.0, 0.3]))
    assert "the line ends at a pose of 'panda_hand_tcp'" in far
    assert "is out of reach: the nearest found is 0.354 m off" in far
    blocked = refusal(densarm.Line(TCP, by=(0.0, 0.0, -0.45)))
    assert "is blocked after 358 mm: panda_rightfinger_3 and table overlap by" in blocked


def test_line_that_ends_at_a_joint_limit_names_the_joint() -> None:
    told = refusal(densarm.Line(TCP, by=(-0.24, -0.09, -0.57)))
    assert "270 of 625 mm, where panda_joint4 is at its limit: begin it in another posture" in told


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ({}, r"line = \[\]: must be told by one of to, by and along"),
        ({"by": (0, 0, 1), "along": (0, 0, 1)}, r"line = \['by', 'along'\]: must be told by one"),
        ({"by": (0, 1)}, r"by = \(0, 1\): must be of shape \(3,\)"),
        ({"to": densarm.Pose("panda_hand", [0, 0, 1])}, "to.frame = 'panda_hand': must be the"),
        ({"to": densarm.Pose(TCP, [0, 0, 1], [1, 0, 0, 0], "z")}, "to.free = 'z': must be none"),
    ],
)
def test_what_is_no_line(arguments: dict[str, object], told: str) -> None:
    with pytest.raises(InvalidValueError, match=told):
        densarm.Line(TCP, **arguments)  # type: ignore[arg-type]


def test_unknown_frame_and_no_length() -> None:
    with pytest.raises(UnknownNameError, match="did you mean 'panda_hand_tcp'"):
        densarm.plan_motion(WORLD, READY, densarm.Line("panda_tcp", by=(0, 0, 0.1)))
    with pytest.raises(DensarmError, match=r"must be at least 0\.1 mm"):
        densarm.plan_motion(WORLD, READY, densarm.Line(TCP, by=(0, 0, 0.0)))
