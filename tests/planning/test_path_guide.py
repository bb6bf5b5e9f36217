"""PathGuide: every edge proved clear, and the same bits for the same seed."""

import signal
import subprocess
import sys
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from densarm.arms.arm import Arm, load_arm
from densarm.arms.joints import POSITION_TOLERANCE
from densarm.errors import InvalidValueError
from densarm.planning.guide import FreeSpace, GuidePath, NoPath, PlanningParameters
from densarm.planning.path_guide import PathGuide
from densarm.scene.obstacles import Box, Sphere
from densarm.scene.scene import Scene
from densarm.values.arrays import Array
from densarm.world.separating_planes import SeparatingPlanes
from densarm.world.world import World

Discs = Callable[..., Any]

coordinate = st.floats(-2.9, 2.9)
disc = st.tuples(coordinate, coordinate, st.floats(0.1, 1.2))


def path_of(answer: GuidePath | NoPath) -> Array:
    assert isinstance(answer, GuidePath)
    assert answer.is_clear
    return answer.waypoints


@pytest.mark.slow
@settings(max_examples=100, deadline=None)
@given(
    discs=st.lists(disc, max_size=6),
    start=st.tuples(coordinate, coordinate),
    goal=st.tuples(coordinate, coordinate),
    seed=st.integers(0, 2**32),
)
def test_every_edge_of_a_path_is_clear(
    arm: Arm,
    make_discs: Discs,
    samples_of: Callable[[Arm, Array], Array],
    discs: list[tuple[float, float, float]],
    start: tuple[float, float],
    goal: tuple[float, float],
    seed: int,
) -> None:
    world = make_discs(arm, *discs)
    q_start, q_goal = arm.configuration(start), arm.configuration(goal)
    answer = PathGuide(arm, world, PlanningParameters(iterations=200, searches=2)).plan(
        q_start, q_goal, seed
    )
    if isinstance(answer, NoPath):
        assert not world.segment_is_clear(q_start, q_goal)
        return
    np.testing.assert_array_equal(answer.waypoints[[0, -1]], [q_start, q_goal])
    samples = samples_of(arm, answer.waypoints)
    assert world.gap(samples).min() > -1e-9
    angles = arm.angles(samples)
    assert (angles >= arm.limits.lower).all()
    assert (angles <= arm.limits.upper).all()


@pytest.fixture
def wall(arm: Arm, make_discs: Discs) -> Any:
    """Discs that block the straight segment from (-1.5, 0) to (1.5, 0)."""
    return make_discs(arm, (0.0, 0.0, 0.6), (0.0, 1.0, 0.6), (0.3, -0.9, 0.4))


def ends(arm: Arm) -> tuple[Array, Array]:
    return arm.configuration([-1.5, 0.0]), arm.configuration([1.5, 0.0])


def test_a_clear_straight_segment_is_the_path(arm: Arm, make_discs: Discs) -> None:
    start, goal = ends(arm)
    world = make_discs(arm)
    path = path_of(PathGuide(arm, world).plan(start, goal, seed=0))
    np.testing.assert_array_equal(path, [start, goal])
    assert world.segments == 1


def test_same_seed_same_bits_whatever_ran_before(arm: Arm, wall: Any) -> None:
    guide = PathGuide(arm, wall)
    first = {seed: path_of(guide.plan(*ends(arm), seed)) for seed in (0, 1, 2)}
    again = {seed: path_of(guide.plan(*ends(arm), seed)) for seed in (2, 0, 1)}
    for seed, waypoints in first.items():
        np.testing.assert_array_equal(again[seed], waypoints)
    assert not np.array_equal(first[0], first[1])


@pytest.mark.parametrize("second", ["continuous", "prismatic"])
def test_continuous_joints_go_the_short_way(
    second: str,
    make_arm: Callable[..., Arm],
    make_discs: Discs,
    samples_of: Callable[[Arm, Array], Array],
) -> None:
    arm = make_arm("continuous", second)
    start, goal = arm.configuration([2.6, 0.0]), arm.configuration([-2.6, 0.0])
    world = make_discs(arm, (np.pi, 0.0, 0.2))
    path = path_of(PathGuide(arm, world).plan(start, goal, seed=0))
    assert len(path) > 2
    length = np.linalg.norm(arm.difference(path[:-1], path[1:]), axis=1).sum()
    assert 2 * np.pi - 5.2 < length < 1.5
    assert (np.abs(arm.angles(samples_of(arm, path))[:, 0]) > 2.5).all()


def test_bounded_revolute_joints_do_not_wrap(
    make_arm: Callable[..., Arm], make_discs: Discs
) -> None:
    arm = make_arm("revolute", "revolute")
    start, goal = arm.configuration([2.9, 0.0]), arm.configuration([-2.9, 0.0])
    path = path_of(PathGuide(arm, make_discs(arm, (0.0, 0.0, 0.5))).plan(start, goal, 0))
    assert np.linalg.norm(np.diff(path, axis=0), axis=1).sum() > 5.8


def test_an_enclosed_goal_has_no_path(
    arm: Arm, make_discs: Discs, enclosure: list[tuple[float, float, float]]
) -> None:
    parameters = PlanningParameters(iterations=100, searches=2)
    guide = PathGuide(arm, make_discs(arm, *enclosure), parameters)
    answer = guide.plan(arm.configuration([-2.0, 0.0]), arm.configuration([0.0, 0.0]), 0)
    assert isinstance(answer, NoPath)
    assert "2 searches" in answer.reason
    assert "100 iterations" in answer.reason


class Watched:
    """A world that remembers the edges of trees that it was asked for."""

    def __init__(self, world: FreeSpace) -> None:
        self._world = world
        self._asked: list[Array] = []

    def configuration_is_clear(self, q: Array) -> bool:
        return self._world.configuration_is_clear(q)

    def segment_is_clear(self, q_a: Array, q_b: Array) -> bool:
        return self._world.segment_is_clear(q_a, q_b)

    def polyline_is_clear(self, angles: Array) -> bool:
        if len(angles) == 2:
            self._asked.append(angles)
        return self._world.polyline_is_clear(angles)

    @property
    def ends(self) -> Array:
        """Joint positions (N, 2, nv)."""
        return np.array(self._asked)

    @property
    def lengths(self) -> Array:
        return np.asarray(np.linalg.norm(self.ends[:, 1] - self.ends[:, 0], axis=1))


def test_later_searches_add_longer_edges(
    arm: Arm, make_discs: Discs, enclosure: list[tuple[float, float, float]]
) -> None:
    watched = Watched(make_discs(arm, *enclosure))
    parameters = PlanningParameters(iterations=100, searches=2, extension=0.3)
    ends = arm.configuration([-2.0, 0.0]), arm.configuration([0.0, 0.0])
    PathGuide(arm, watched, parameters).plan(*ends, 0)
    lengths = watched.lengths
    later = np.flatnonzero(lengths > 0.31)
    assert lengths.max() <= 0.6 + 1e-9
    assert (lengths[: later[0]] <= 0.3 + 1e-9).all()
    assert later[0] > 50


def test_the_first_samples_are_near_both_ends(
    make_arm: Callable[..., Arm], make_discs: Discs, enclosure: list[tuple[float, float, float]]
) -> None:
    arm = make_arm("revolute", "revolute")
    watched = Watched(make_discs(arm, *enclosure))
    parameters = PlanningParameters(100, near_share=0.1, near_distance=0.4, searches=1)
    ends = arm.configuration([-2.0, 0.0]), arm.configuration([0.0, 0.0])
    PathGuide(arm, watched, parameters).plan(*ends, 0)
    middle, half = np.array([-1.0, 0.0]), np.array([1.0, 0.0])
    beyond = np.abs(watched.ends - middle) - half
    far = np.flatnonzero(beyond.max(axis=(1, 2)) > 0.4 + 1e-9)
    assert far[0] >= 10
    assert beyond[: far[0]].max() > 0.3


def test_continuous_joints_are_near_across_the_seam(
    make_arm: Callable[..., Arm], make_discs: Discs
) -> None:
    """From 2.9 to -2.9 the short way, where a disc is passed by the second joint."""
    arm = make_arm("continuous", "revolute")
    watched = Watched(make_discs(arm, (np.pi, 0.0, 0.2)))
    start, goal = arm.configuration([2.9, 0.0]), arm.configuration([-2.9, 0.0])
    parameters = PlanningParameters(16, near_share=1.0, near_distance=0.4, searches=1)
    assert isinstance(PathGuide(arm, watched, parameters).plan(start, goal, 0), GuidePath)
    off_seam = np.abs(np.mod(watched.ends[..., 0], 2.0 * np.pi) - np.pi)
    assert 0.25 < off_seam.max() <= np.pi - 2.9 + 0.4 + 1e-9


def test_near_a_whole_turn_is_anywhere(make_arm: Callable[..., Arm], make_discs: Discs) -> None:
    """A wall at the seam leaves the long way."""
    arm = make_arm("continuous", "revolute")
    world = make_discs(arm, *[(np.pi, y, 0.4) for y in np.arange(-3.0, 3.1, 0.5)])
    start, goal = arm.configuration([2.5, 0.0]), arm.configuration([-2.5, 0.0])
    for distance, answer in ((0.4, NoPath), (3.0, GuidePath)):
        parameters = PlanningParameters(16, 1.0, near_distance=distance, searches=1)
        assert isinstance(PathGuide(arm, world, parameters).plan(start, goal, 0), answer)


def test_what_is_not_found_soon_near_both_ends_is_searched_everywhere(
    make_arm: Callable[..., Arm], make_discs: Discs
) -> None:
    """The way round the wall is not near: all of few samples find none, nor do many for long."""
    arm = make_arm("revolute", "revolute")
    wall = make_discs(arm, (0.0, 0.0, 0.6), (0.0, 1.0, 0.6), (0.3, -0.9, 0.4))
    few, many = (PlanningParameters(n, 1.0, near_distance=0.5, searches=1) for n in (16, 500))
    assert isinstance(PathGuide(arm, wall, few).plan(*ends(arm), 0), NoPath)
    assert wall.segments < 100
    assert isinstance(PathGuide(arm, wall, many).plan(*ends(arm), 0), GuidePath)


def test_an_end_in_contact_is_named(arm: Arm, wall: Any) -> None:
    free, blocked = arm.configuration([-1.5, 0.0]), arm.configuration([0.0, 0.0])
    guide = PathGuide(arm, wall)
    assert guide.plan(blocked, free, 0) == NoPath("the start is not clear of contact")
    assert guide.plan(free, blocked, 0) == NoPath("the goal is not clear of contact")


def test_an_end_outside_limits_is_named(make_arm: Callable[..., Arm], make_discs: Discs) -> None:
    arm = make_arm("prismatic", "continuous")
    guide = PathGuide(arm, make_discs(arm))
    answer = guide.plan(arm.configuration([0.0, 0.0]), arm.configuration([3.1, 0.0]), 0)
    assert answer == NoPath("the goal is outside the position limits of first")


def test_an_end_may_exceed_limits_by_the_tolerance(
    make_arm: Callable[..., Arm], make_discs: Discs
) -> None:
    arm = make_arm("revolute", "revolute")
    over = arm.limits.upper[1] + 0.9 * POSITION_TOLERANCE
    wall = make_discs(arm, (0.0, 0.0, 0.6))
    start, goal = arm.configuration([-1.5, over]), arm.configuration([1.5, -over])
    path = path_of(PathGuide(arm, wall).plan(start, goal, 0))
    np.testing.assert_array_equal(path[[0, -1]], [start, goal])


def test_ends_on_the_limits_and_on_the_seam_are_allowed(
    make_arm: Callable[..., Arm], make_discs: Discs
) -> None:
    arm = make_arm("prismatic", "continuous")
    world = make_discs(arm, (0.0, np.pi, 1.0))
    start, goal = arm.configuration([-3.0, np.pi]), arm.configuration([3.0, -np.pi])
    assert isinstance(PathGuide(arm, world).plan(start, goal, 0), GuidePath)


def test_a_joint_without_an_interval_is_refused(
    make_arm: Callable[..., Arm], make_discs: Discs
) -> None:
    arm = make_arm("prismatic", "continuous", bound=1.7e308)
    with pytest.raises(InvalidValueError, match=r"joint 'first'.*lock the joint"):
        PathGuide(arm, make_discs(arm))


@pytest.mark.parametrize(
    "field", ["iterations", "near_distance", "searches", "extension", "shortcuts"]
)
def test_parameters_are_positive(field: str) -> None:
    with pytest.raises(InvalidValueError, match=field):
        PlanningParameters(**{field: 0})


@pytest.mark.parametrize("share", [-0.1, 1.1, np.nan])
def test_a_share_outside_its_interval_is_refused(share: float) -> None:
    with pytest.raises(InvalidValueError, match=r"near_share.*\[0, 1\]"):
        PlanningParameters(near_share=share)


@pytest.mark.parametrize("answers", [1, 3, 5, 10])
def test_an_interrupt_ends_the_plan_and_the_next_one_is_whole(
    answers: int, arm: Arm, wall: Any
) -> None:
    expected = path_of(PathGuide(arm, wall).plan(*ends(arm), 0))
    wall.segments = 0

    class Interrupted:
        configuration_is_clear = staticmethod(wall.configuration_is_clear)

        def segment_is_clear(self, q_a: Array, q_b: Array) -> bool:
            if wall.segments == answers:
                signal.raise_signal(signal.SIGINT)
            return bool(wall.segment_is_clear(q_a, q_b))

        def polyline_is_clear(self, angles: Array) -> bool:
            points = arm.configurations(angles)
            return all(self.segment_is_clear(a, b) for a, b in pairwise(points))

    with pytest.raises(KeyboardInterrupt):
        PathGuide(arm, Interrupted()).plan(*ends(arm), 0)
    assert wall.segments == answers
    np.testing.assert_array_equal(path_of(PathGuide(arm, wall).plan(*ends(arm), 0)), expected)


PROGRAM = """
import sys
sys.path.insert(0, {folder!r})
from conftest import DiscWorld, _two_joint_arm
import numpy as np
from densarm.planning.guide import NoPath
from densarm.planning.guide import PlanningParameters
from densarm.planning.path_guide import PathGuide
arm = _two_joint_arm(("continuous", "prismatic"), 3.0)
world = DiscWorld(arm, np.array([[0.0, 0.0]]), np.array([0.8]))
q = arm.configuration
path = PathGuide(arm, world).plan(q([-1.5, 0.0]), q([1.5, 0.0]), 7)
world.centers, world.radii = np.array([[x, 1.5] for x in range(-4, 4)]), np.full(8, 0.8)
parameters = PlanningParameters(iterations=50, searches=1)
assert isinstance(PathGuide(arm, world, parameters).plan(q([0, 0]), q([0, 2.9]), 7), NoPath)
print(path.waypoints.tobytes().hex())
"""


@pytest.mark.slow
def test_a_new_process_gives_the_same_bits_and_says_nothing() -> None:
    program = PROGRAM.format(folder=str(Path(__file__).parent))
    runs = [
        subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
        for _ in range(2)
    ]
    assert [run.stderr for run in runs] == ["", ""]
    assert runs[0].stdout == runs[1].stdout
    assert len(runs[0].stdout.splitlines()) == 1


@pytest.mark.slow
def test_importing_the_guide_leaves_ompl_alone() -> None:
    program = "import sys, densarm.planning.path_guide; print('ompl' in sys.modules)"
    run = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    assert run.stdout.strip() == "False"


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


@pytest.mark.slow
@pytest.mark.parametrize(("name", "scene", "start", "goal"), [TWO_LINK, PANDA])
def test_the_path_around_an_obstacle_is_clear_and_repeats(
    name: str,
    scene: Scene,
    start: tuple[float, float],
    goal: tuple[float, float],
    samples_of: Callable[[Arm, Array], Array],
) -> None:
    arm = load_arm(name)
    world = World(arm, scene)
    ends = arm.configuration(start), arm.configuration(goal)
    path = path_of(PathGuide(arm, SeparatingPlanes(world)).plan(*ends, seed=0))
    assert len(path) > 2
    np.testing.assert_array_equal(path[[0, -1]], ends)
    assert min(world.distances(q).min() for q in samples_of(arm, path)) > 0.0
    again = PathGuide(arm, SeparatingPlanes(World(arm, scene))).plan(*ends, seed=0)
    np.testing.assert_array_equal(path_of(again), path)
