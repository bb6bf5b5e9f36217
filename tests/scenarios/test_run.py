"""Runs of scenarios: outcomes that say why, the same bits for the same scenario and seed."""

import hashlib
import re
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from densarm.certificates.records import EnergyVerdict
from densarm.certificates.task import Task
from densarm.control.tracking import DensityTracking
from densarm.density.navigation_density import Gauge
from densarm.errors import InvalidValueError, UnknownNameError
from densarm.planning.guide import GuidePath, NoPath
from densarm.planning.motion import PlanningError
from densarm.planning.plan import plan_motion
from densarm.scenarios.control import ControlForm, ControlParameters
from densarm.scenarios.run import Drive, by_density, records, run, run_by
from densarm.scenarios.scenario import Scenario, load_scenario
from densarm.scene.obstacles import Box, Sphere
from densarm.scene.scene import Scene
from densarm.simulation.plants import PinocchioPlant
from densarm.simulation.run import Run
from densarm.simulation.simulate import simulate_task
from densarm.values.arrays import Array
from densarm.values.outcome import Outcome
from densarm.world.world import World


def formed(scenario: Scenario, form: str, **changes: Any) -> Scenario:
    return replace(scenario, control=replace(scenario.control, form=ControlForm(form), **changes))


def digest(run: Run) -> str:
    arrays = (run.time, run.q, run.v, run.tau, run.clearance)
    return hashlib.sha256(b"".join(array.tobytes() for array in arrays)).hexdigest()


def test_reached(swing_up_run: Run) -> None:
    assert swing_up_run.outcome == Outcome.REACHED
    assert swing_up_run.detail == ""
    assert swing_up_run.goal_error <= 0.01
    np.testing.assert_array_equal(swing_up_run.time, 0.001 * np.arange(len(swing_up_run.q)))
    np.testing.assert_array_equal(swing_up_run.tau[-1], swing_up_run.tau[-2])
    assert swing_up_run.tracking_error is not None
    assert swing_up_run.tracking_error <= 0.005
    assert 0.0 < swing_up_run.plan_time < swing_up_run.preparation_time


def test_recorded_clearance_is_that_of_the_samples(swing_up_run: Run) -> None:
    world = World(swing_up_run.task.arm, swing_up_run.task.scene)
    for k in range(0, len(swing_up_run.q), 97):
        assert world.distances(swing_up_run.q[k]).min() == swing_up_run.clearance[k]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["swing_up", "three_link_swing_up"])
@pytest.mark.parametrize("form", ["tracking", "velocity"])
def test_the_density_alone_swings_an_arm_up_from_its_critical_point(name: str, form: str) -> None:
    done = run(formed(load_scenario(name), form))
    assert done.outcome == Outcome.REACHED
    assert done.certified
    assert done.plan_time == 0.0 < done.preparation_time
    assert done.remark.startswith("left a critical point of the density at joint positions (0, 0")
    angles = np.unwrap(done.task.arm.angles(done.q), axis=0)
    np.testing.assert_allclose(angles[-1], np.pi * np.eye(len(angles[0]))[0], atol=0.01)


@pytest.mark.parametrize("form", ["regulation", "plain"])
def test_regulation_leaves_the_critical_point(swing_up: Scenario, form: str) -> None:
    scenario = formed(replace(swing_up, scene=Scene()), form)
    done = run(scenario, guide="direct")
    assert done.outcome == Outcome.REACHED
    assert done.remark.startswith("left a critical point of the density at joint positions (0, 0)")


def test_a_remark_is_kept(swing_up_run: Run, tmp_path: Path) -> None:
    replace(swing_up_run, remark="left it").save(tmp_path / "run.npz")
    assert Run.load(tmp_path / "run.npz").remark == "left it"


@pytest.mark.parametrize("form", ["tracking", pytest.param("regulation", marks=pytest.mark.slow)])
def test_stuck_names_what_blocks(swing_up: Scenario, form: str) -> None:
    start = swing_up.arm.configuration((0.01, 0.01))
    done = run(formed(replace(swing_up, start=start), form), guide="direct")
    assert done.outcome == Outcome.STUCK
    assert done.detail.startswith("maximum of the density")
    assert "lower_link_0 and right" in done.detail
    assert (done.clearance > 0.0).all()
    checks = {check.name: check.holds for check in done.certificate.checks}
    assert [name for name, holds in checks.items() if not holds] == ["goal"]


@pytest.mark.slow
@pytest.mark.parametrize("gauge", [Gauge.DENSITY, Gauge.LOG])
def test_regulation_in_the_other_gauges_reaches_by_the_blend(
    swing_up: Scenario, gauge: Gauge
) -> None:
    scenario = replace(
        formed(swing_up, "regulation"),
        density=replace(swing_up.density, gauge=gauge, blend_radius=0.05),
        simulation=replace(swing_up.simulation, control_divisor=5),
    )
    done = run(scenario)
    assert done.outcome == Outcome.REACHED
    assert done.certified


def test_timed_out(swing_up: Scenario) -> None:
    hurried = replace(swing_up, simulation=replace(swing_up.simulation, time_limit=0.5))
    done = run(formed(hurried, "regulation"))
    assert done.outcome == Outcome.TIMED_OUT
    assert done.time[-1] == pytest.approx(0.5)
    assert done.detail == "after 0.5 s"


def test_a_motion_longer_than_the_time_limit_is_not_begun(swing_up: Scenario) -> None:
    hurried = replace(swing_up, simulation=replace(swing_up.simulation, time_limit=0.5))
    done = run(hurried)
    assert done.outcome == Outcome.TIMED_OUT
    assert len(done.time) == 1
    assert re.search(r"the motion takes 1\.\d+ s, more than time_limit = 0\.5 s", done.detail)


@pytest.mark.parametrize("distance", [1e-9, 1e-5, 4e-4])
def test_almost_at_the_goal(swing_up: Scenario, distance: float) -> None:
    goal = swing_up.arm.integrate(swing_up.start, np.array([distance, 0.0]))
    done = run(replace(swing_up, goal=goal))
    assert done.outcome == Outcome.REACHED
    assert done.certified


def test_goal_at_the_start_is_reached_at_once(swing_up: Scenario) -> None:
    done = run(replace(swing_up, goal=swing_up.start))
    assert done.outcome == Outcome.REACHED
    assert done.time[-1] < 0.2
    assert done.certified


@pytest.mark.parametrize("form", ControlForm)
def test_no_path(fenced_in: Scenario, form: str) -> None:
    done = run(formed(fenced_in, form))
    assert done.outcome == Outcome.NO_PATH
    assert "1 searches by RRT-Connect of 50 iterations each found no path" in done.detail
    assert len(done.q) == 1
    assert done.plan_time > 0.0 == done.preparation_time


@pytest.mark.parametrize("form", ControlForm)
@pytest.mark.parametrize("guide", ["path", "direct"])
def test_infeasible_start_and_goal_name_pairs_depths_joints_and_limits(
    form: str, guide: str
) -> None:
    panda = load_scenario("panda_table")
    crate = Box(name="crate", size=(0.2, 0.2, 0.2), position=(0.3, 0.0, 0.5))
    ball = Sphere(name="ball", radius=0.1, position=(0.0, 0.0, 0.3))
    start = panda.arm.postures["ready"]
    goal = np.array([*panda.goal[:3], 0.5, *panda.goal[4:]])
    scenario = replace(panda, scene=Scene([crate, ball]), start=start, goal=goal)
    done = run(formed(scenario, form), guide)
    assert done.outcome == Outcome.INFEASIBLE
    assert "start: panda_" in done.detail
    assert " and ball overlap by " in done.detail
    assert " mm" in done.detail
    assert "goal: joint 'panda_joint4' at 0.5 is outside [-3.0718, -0.0698]" in done.detail
    assert done.plan_time == done.preparation_time == 0.0
    assert len(done.q) == 1
    assert not done.certified


def test_inside_the_margin_is_infeasible(swing_up: Scenario) -> None:
    done = run(formed(swing_up, "tracking", margin=1.3))
    assert done.outcome == Outcome.INFEASIBLE
    assert "mm apart" in done.detail


def test_an_arm_too_weak_is_infeasible(swing_up: Scenario) -> None:
    weak = replace(swing_up, timing=replace(swing_up.timing, torque_share=0.01))
    done = run(weak)
    assert done.outcome == Outcome.INFEASIBLE
    assert "torque limits" in done.detail


def test_a_posture_that_cannot_be_held_is_infeasible(swing_up: Scenario) -> None:
    description = swing_up.arm.description
    weak = type(swing_up.arm)(
        replace(description, urdf=description.urdf.replace('effort="60"', 'effort="15"'))
    )
    level = weak.configuration([np.pi / 2, 0.0])
    done = run(replace(swing_up, arm=weak, scene=Scene(), goal=level))
    assert done.outcome == Outcome.INFEASIBLE
    assert done.detail.startswith("goal: joint 'shoulder' needs 19.62 N·m to hold the arm")
    assert done.detail.endswith("and has 15")
    upright = run(replace(swing_up, arm=weak, scene=Scene()))
    assert upright.outcome == Outcome.INFEASIBLE
    assert "no motion along the planned path" in upright.detail
    assert "joint 'shoulder' needs" in upright.detail


# Other ways to drive an arm.


def test_contact_ends_the_record_with_a_verdict(swing_up: Scenario) -> None:
    """A controller that sees no obstacle is stopped at the first sample in contact."""

    def blind(scenario: Scenario) -> Drive:
        empty = World(scenario.arm, Scene())
        motion = plan_motion(empty, scenario.start, scenario.goal)
        return Drive(DensityTracking(empty, motion), motion=motion)

    done = run_by(swing_up, blind)
    assert done.outcome == Outcome.COLLIDED
    assert done.detail.startswith("lower_link_0 and right at t = ")
    assert (done.clearance[:-1] > 0.0).all()
    assert done.clearance[-1] <= 0.0
    assert not done.certified
    np.testing.assert_array_equal(done.tau[-1], done.tau[-2])


@pytest.mark.parametrize("outcome", [Outcome.NO_PATH, Outcome.STUCK, Outcome.INFEASIBLE])
def test_a_way_that_finds_none_is_an_outcome(swing_up: Scenario, outcome: Outcome) -> None:
    def none(_: Scenario) -> Drive:
        raise PlanningError(outcome, "a wall is in the way")

    done = run_by(swing_up, none)
    assert (done.outcome, done.detail) == (outcome, "a wall is in the way")
    assert len(done.q) == 1
    assert (done.plan_time > 0.0) == (outcome == Outcome.NO_PATH)


def test_what_drives_along_a_path_plans_again_where_asked_to(swing_up: Scenario) -> None:
    drive = by_density(swing_up)
    assert drive.motion is not None
    assert drive.plan_time == drive.motion.plan_time > 0.0
    assert hasattr(drive.controller, "replanned_at")
    assert not hasattr(by_density(swing_up, replans=False).controller, "replanned_at")


@pytest.mark.parametrize("form", [ControlForm.REGULATION, ControlForm.PLAIN])
def test_the_other_forms_have_no_motion(swing_up: Scenario, form: str) -> None:
    drive = by_density(formed(swing_up, form))
    assert drive.motion is None
    assert drive.plan_time > 0.0


def test_feedback_keeps_its_own_alpha(swing_up: Scenario) -> None:
    """The larger α is of the planning system alone."""
    hurried = replace(swing_up, simulation=replace(swing_up.simulation, time_limit=0.1))
    runs = [
        run(formed(hurried, "regulation", guide="path", planning_alpha=alpha))
        for alpha in (1.0, 10.0)
    ]
    assert digest(runs[0]) == digest(runs[1])


@pytest.mark.parametrize("form", ControlForm)
def test_a_guide_of_ones_own_is_asked_once_with_the_seed(swing_up: Scenario, form: str) -> None:
    class Own:
        def __init__(self, answer: Callable[[Array, Array], Any]) -> None:
            self.answer, self.seeds = answer, list[int]()

        def plan(self, start: Array, goal: Array, seed: int) -> Any:
            self.seeds.append(seed)
            return self.answer(start, goal)

    near = replace(swing_up, goal=swing_up.arm.configuration((0.3, 0.2)))
    scenario = replace(near, simulation=replace(near.simulation, control_divisor=5))
    guide = Own(lambda start, goal: GuidePath(np.stack([start, goal]), is_clear=True))
    done = run(formed(scenario, form), guide, seed=7)
    assert done.outcome == Outcome.REACHED, done.detail
    assert guide.seeds == [7]
    guide = Own(lambda *_: NoPath("the moon is in the way"))
    done = run(formed(scenario, form), guide)
    assert (done.outcome, done.detail) == (Outcome.NO_PATH, "the moon is in the way")
    assert guide.seeds == [0]


# What is recorded, and told.


def test_task_of_a_run_tells_guide_and_seed(swing_up: Scenario) -> None:
    done = run(swing_up, guide="direct", seed=3)
    scenario = Scenario.of_task(done.task)
    assert (scenario.seed, scenario.control.guide) == (3, "direct")
    assert done.task.to_json()["seed"] == 3


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"guide": "astar"}, "^guide = 'astar': must be one of auto, density, direct, path"),
        ({"seed": -1}, "^seed = -1"),
        ({"seed": 0.5}, "^seed = 0.5"),
    ],
)
def test_arguments_are_checked(swing_up: Scenario, arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(InvalidValueError, match=message):
        run(swing_up, **arguments)


def test_a_scenario_may_be_given_by_its_name(swing_up_run: Run) -> None:
    scenario = swing_up_run.task.name
    assert digest(run(scenario)) == digest(run(load_scenario(scenario)))
    with pytest.raises(UnknownNameError, match=r"did you mean 'swing_up'"):
        run("swingup")


def test_progress_is_told(swing_up: Scenario) -> None:
    told = list[str]()
    run(swing_up, guide="direct", on_progress=told.append)
    assert told[0] == "planning"
    assert any(phrase.startswith("running") for phrase in told)


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"form": "tracking"}, "control form 'tracking'"),
        ({"form": "regulation", "guide": "path"}, "guide 'path', whose sub-goals"),
        ({"form": "regulation", "guide": "direct"}, "no motion"),
        ({"form": "plain", "guide": "direct"}, "control form 'plain'"),
    ],
)
def test_records_are_of_the_plain_density_and_energy_of_regulation_alone(
    swing_up: Scenario, changes: dict[str, Any], reason: str
) -> None:
    scenario = formed(swing_up, **changes)
    task, world = scenario.task, scenario.world
    energy, rantzer = records(Run.at_rest(task, world, Outcome.NO_PATH, "no way"))
    assert (energy.verdict, energy.samples) == (EnergyVerdict.NOT_APPLICABLE, 0)
    assert reason in energy.detail
    assert (rantzer.gauge, rantzer.samples) == ("reciprocal", 1)


# The same bits.

SCRIPT = """
import hashlib
from densarm.scenarios.run import run
done = run("panda_shelf", seed=1)
arrays = (done.time, done.q, done.v, done.tau, done.clearance)
print(hashlib.sha256(b"".join(array.tobytes() for array in arrays)).hexdigest())
"""


@pytest.mark.slow
def test_same_scenario_and_seed_give_the_same_bits() -> None:
    scenario = load_scenario("panda_shelf")
    first, second = (digest(run(scenario, seed=1)) for _ in range(2))
    elsewhere = subprocess.run(
        [sys.executable, "-c", SCRIPT], capture_output=True, text=True, check=True
    )
    assert first == second == elsewhere.stdout.strip()


@pytest.mark.slow
def test_another_seed_is_another_run(swing_up: Scenario, swing_up_run: Run) -> None:
    assert digest(run(swing_up)) == digest(swing_up_run)
    assert digest(run(swing_up, seed=5)) != digest(swing_up_run)


def test_a_run_rebuilt_from_json_is_the_same(swing_up_run: Run) -> None:
    rebuilt = Scenario.of_task(Task.from_json(swing_up_run.task.to_json()))
    assert digest(run(rebuilt)) == digest(swing_up_run)


# An arm that is pushed off its plan: stopped, and planned for again from where it rests.


class PushedPlant(PinocchioPlant):
    """Adds a push to the torque for a fifth of a second."""

    steps = 0

    def step(self, q: Array, v: Array, u: Array) -> tuple[Array, Array]:
        time = self.steps * self.dt
        self.steps += 1
        push = np.array([40.0, -20.0])  # N·m
        return super().step(q, v, u + push * (0.5 <= time < 0.7))


@pytest.mark.slow
def test_an_arm_pushed_off_its_plan_reaches_the_goal(swing_up: Scenario, tmp_path: Path) -> None:
    swing_up = replace(swing_up, control=ControlParameters(guide="path"))
    drive = by_density(swing_up)
    plant = PushedPlant(swing_up.arm)
    done = simulate_task(swing_up.task, swing_up.world, drive.controller, plant)
    assert done.outcome == Outcome.REACHED
    assert (done.clearance > 0.0).all()
    assert len(done.replanned_at) == 1
    assert 0.5 < done.replanned_at[0] < done.time[-1]
    at_rest = np.abs(done.v[round(done.replanned_at[0] / 0.001)])
    assert (at_rest <= 1e-3).all()
    assert done.tracking_error == pytest.approx(0.2, abs=0.02)  # then it was stopped
    done.save(tmp_path / "run.npz")
    assert Run.load(tmp_path / "run.npz").replanned_at == done.replanned_at


def test_an_arm_that_nothing_pushes_keeps_its_plan(swing_up_run: Run) -> None:
    assert swing_up_run.replanned_at == ()
