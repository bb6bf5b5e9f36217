"""What every scenario of the catalogue keeps to."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from click.testing import CliRunner

from densarm.arms.catalogue import scenario_paths
from densarm.certificates.phases import body_poses
from densarm.cli.list_known import list_known
from densarm.scenarios.control import ControlForm
from densarm.scenarios.scenario import Scenario, load_scenario
from densarm.scene.point_cloud import PointCloud
from densarm.scene.scene import Scene
from densarm.simulation.run import Run
from densarm.values.outcome import Outcome
from densarm.world.near_pairs import smallest_distances
from densarm.world.swept_check import SweptCheck
from densarm.world.world import World

pytestmark = pytest.mark.slow

loaded = cache(load_scenario)


@cache
def listed() -> dict[str, list[str]]:
    lines = CliRunner().invoke(list_known, standalone_mode=False).output.splitlines()
    return {cells[0]: cells[1:] for line in lines if (cells := line.split())}


@pytest.fixture(params=scenario_paths())
def scenario(request: pytest.FixtureRequest) -> Scenario:
    return loaded(request.param)


def test_the_tasks_that_people_are_told_of_are_known() -> None:
    known = {"three_link_gate", "ur5_bin", "xarm7_posts", "kinova_posts", "z1_window"}
    panda = {"panda_table", "panda_shelf", "panda_holding_bar"}
    assert known | panda | {"so100_desk", "swing_up"} <= set(scenario_paths())


def test_scenario_has_a_title_obstacles_and_default_control(scenario: Scenario) -> None:
    assert scenario.title != scenario.name
    assert len(scenario.scene) > 0
    follows = bool(scenario.goal_follows)
    assert scenario.control.form == (ControlForm.REGULATION if follows else ControlForm.TRACKING)
    assert scenario.control.guide == ("direct" if "swing_up" in scenario.name else "auto")


def test_start_and_goal_are_clear_and_the_straight_segment_is_not(scenario: Scenario) -> None:
    arm = scenario.arm
    check = SweptCheck(scenario.world, scenario.control.margin)
    for q in (scenario.start, scenario.goal):
        assert check.configuration_is_clear(q)
        angles = arm.angles(q)
        assert ((angles >= arm.limits.lower) & (angles <= arm.limits.upper)).all()
    is_straight = check.segment_is_clear(scenario.start, scenario.goal)
    assert scenario.world.fastest_obstacle > 0.0 or scenario.steps or not is_straight


def test_it_is_listed_with_its_robot_joints_and_pairs(scenario: Scenario) -> None:
    """Links in pieces, which take long to cut, count as their hulls: they have more pairs."""
    arm = scenario.arm
    own = len(arm.collision_model.collisionPairs)
    others = scenario.world.n_pairs - own
    name, joints, self_pairs, with_obstacles = listed()[scenario.name]
    assert [name, joints, with_obstacles] == [arm.name, str(arm.nv), str(others)]
    in_pieces = any("." in item.name for item in arm.collision_model.geometryObjects)
    assert int(self_pairs) < own if in_pieces else int(self_pairs) == own


@pytest.mark.parametrize("name", scenario_paths())
def test_a_real_arm_would_accept_its_torques(
    catalogue_run: Callable[[str], Run], name: str
) -> None:
    """Without gravity they change by 1 N·m per ms at most, from what holds the arm at first."""
    if loaded(name).world.fastest_obstacle > 0.0:
        pytest.skip("evades what moves")
    done = catalogue_run(name)
    for part in done.phases or (done,):
        arm = part.task.arm
        held = np.array([arm.nonlinear_effects(q, np.zeros(arm.nv)) for q in part.q])
        free = np.vstack([np.zeros(arm.nv), part.tau - held])
        assert np.abs(np.diff(free, axis=0)).max() <= 1e3 * done.task.simulation.dt + 1e-6


def test_kinova_goes_the_short_way_round(catalogue_run: Callable[[str], Run]) -> None:
    scenario = loaded("kinova_posts")
    arm = scenario.arm
    step = arm.difference(scenario.start, scenario.goal)
    assert abs(arm.angles(scenario.start)[0] + step[0]) > 3.15
    done = catalogue_run("kinova_posts")
    assert (done.outcome, done.certified) == (Outcome.REACHED, True), done.detail


def test_a_shelf_that_cameras_saw_is_left(catalogue_run: Callable[[str], Run]) -> None:
    done = catalogue_run("panda_shelf_cloud")
    assert (done.outcome, done.certified) == (Outcome.REACHED, True), done.detail
    # The shelf itself, of which the cloud saw what faces the cameras, is not touched either.
    shelf = World(done.task.arm, loaded("panda_shelf").scene)
    assert smallest_distances(shelf, done.q[::10]).min() > 0.0
    # Points in its way, and the same run is none that was proved.
    places = [done.task.arm.pose(q).position for q in done.q[::100]]
    cloud = PointCloud(name="way", points=places, radius=0.01)
    other = replace(done.task, scene=Scene([*done.task.scene, cloud]))
    assert not replace(done, task=other).certified


def test_a_part_is_carried_out_of_a_bin(catalogue_run: Callable[[str], Run]) -> None:
    done = catalogue_run("ur5_bin")
    assert (done.outcome, done.certified) == (Outcome.REACHED, True), done.detail


@pytest.mark.parametrize(
    ("name", "into", "half", "bodies"),
    [
        ("panda_pick_place", "bottom", (0.2, 0.05, 0.07), ("can_1", "can_2", "can_3")),
        ("ur5_bin_pick", "tray_bottom", (0.15, 0.1, 0.03), ("part_1", "part_2")),
        ("so101_desk_sort", "desk", (0.25, 0.35, 0.03), ("cork_1", "cork_2", "cork_3")),
    ],
)
def test_what_is_picked_is_put_where_it_belongs(
    catalogue_run: Callable[[str], Run],
    name: str,
    into: str,
    half: tuple[float, ...],
    bodies: tuple[str, ...],
) -> None:
    done = catalogue_run(name)
    assert (done.outcome, done.certified) == (Outcome.REACHED, True), done.detail
    last = done.phases[-1]
    where = {key: pose for key, (_, pose) in body_poses(last.task, last.q[-1]).items()}
    for body in bodies:
        assert (np.abs(where[into].actInv(where[body].translation)) <= half).all()


def test_the_second_grasp_in_the_corner_of_a_bin(catalogue_run: Callable[[str], Run]) -> None:
    remark = catalogue_run("ur5_bin_pick").remark
    assert "passed over ways to goal 1: the line of 'cup' by (0, 0, -0.2) m is blocked" in remark
    assert "wrist_3_link_0 and bin_right overlap by" in remark
