"""simulate: outcomes that say why, the same bits for the same scenario and seed."""

import hashlib
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

import densarm
from densarm.closed_loop import simulate
from densarm.errors import InvalidValueError
from densarm.motion_plan import plan_motion
from densarm.outcome import Outcome
from densarm.scenario import GuideKind, load_scenario
from densarm.scene import Box, Scene, Sphere


@pytest.fixture(scope="module")
def swing_up():
    return load_scenario("swing_up")


@pytest.fixture(scope="module")
def panda():
    return load_scenario("panda_table")


def digest(run):
    arrays = (run.time, run.q, run.v, run.tau, run.clearance)
    return hashlib.sha256(b"".join(array.tobytes() for array in arrays)).hexdigest()


def test_reached(swing_up_run):
    assert swing_up_run.outcome == Outcome.REACHED
    assert swing_up_run.detail == ""
    assert swing_up_run.goal_error <= 0.01
    np.testing.assert_array_equal(swing_up_run.time, 0.001 * np.arange(len(swing_up_run.q)))
    np.testing.assert_array_equal(swing_up_run.tau[-1], swing_up_run.tau[-2])
    assert swing_up_run.tracking_error <= 0.005


def test_recorded_clearance_is_that_of_the_samples(swing_up_run):
    scenario = swing_up_run.scenario
    clearance = densarm.Clearance(scenario.arm, scenario.scene)
    for k in range(0, len(swing_up_run.q), 97):
        assert clearance.distances(swing_up_run.q[k]).min() == swing_up_run.clearance[k]


@pytest.mark.parametrize("form", ["tracking", "regulation", "plain"])
def test_direct_from_the_start_of_swing_up_is_stuck_at_a_critical_point(swing_up, form):
    scenario = replace(swing_up, control=replace(swing_up.control, form=form))
    run = simulate(scenario, guide="direct")
    assert run.outcome == Outcome.STUCK
    assert run.detail.startswith("saddle of the density at joint positions (0, 0)")
    assert run.plan_time == 0.0 < run.preparation_time
    assert not run.certified


@pytest.mark.parametrize("form", ["tracking", "regulation"])
def test_stuck_names_what_blocks(swing_up, form):
    scenario = replace(
        swing_up,
        start=swing_up.arm.configuration((0.01, 0.01)),
        control=replace(swing_up.control, form=form),
    )
    run = simulate(scenario, guide="direct")
    assert run.outcome == Outcome.STUCK
    assert run.detail.startswith("maximum of the density")
    assert "lower_link_0 and right" in run.detail
    assert (run.clearance > 0.0).all()
    checks = {check.name: check.holds for check in run.verify().checks}
    assert [name for name, holds in checks.items() if not holds] == ["goal"]


@pytest.mark.parametrize("gauge", ["density", "log"])
def test_regulation_in_the_other_gauges_reaches_by_the_blend(swing_up, gauge):
    scenario = replace(
        swing_up,
        control=replace(swing_up.control, form="regulation"),
        density=replace(swing_up.density, gauge=gauge, blend_radius=0.05),
        simulation=replace(swing_up.simulation, control_divisor=5),
    )
    run = simulate(scenario)
    assert run.outcome == Outcome.REACHED
    assert run.certified


def test_timed_out(swing_up):
    hurried = replace(swing_up, simulation=replace(swing_up.simulation, time_limit=0.5))
    run = simulate(hurried)
    assert run.outcome == Outcome.TIMED_OUT
    assert run.time[-1] == pytest.approx(0.5)
    assert "0.5 s" in run.detail


def test_goal_at_the_start_is_reached_at_once(swing_up):
    run = simulate(replace(swing_up, goal=swing_up.start))
    assert run.outcome == Outcome.REACHED
    assert run.time[-1] < 0.2
    assert run.certified


def test_no_path(fenced_in):
    run = simulate(fenced_in)
    assert run.outcome in (Outcome.NO_PATH, Outcome.INFEASIBLE)
    assert len(run.q) == 1


def test_infeasible_start_and_goal_name_pairs_depths_joints_and_limits(panda):
    crate = Box(name="crate", size=(0.2, 0.2, 0.2), position=(0.3, 0.0, 0.5))
    ball = Sphere(name="ball", radius=0.1, position=(0.0, 0.0, 0.3))
    start = panda.arm.postures["ready"]
    goal = [*panda.goal[:3], 0.5, *panda.goal[4:]]
    run = simulate(replace(panda, scene=Scene([crate, ball]), start=start, goal=goal))
    assert run.outcome == Outcome.INFEASIBLE
    assert "start: panda_" in run.detail
    assert " and ball overlap by " in run.detail
    assert " mm" in run.detail
    assert "goal: joint 'panda_joint4' at 0.5 is outside [-3.072, -0.0698]" in run.detail
    assert run.plan_time == run.preparation_time == 0.0
    assert len(run.q) == 1
    assert not run.certified


def test_inside_the_margin_is_infeasible(swing_up):
    control = replace(swing_up.control, margin=1.3)
    run = simulate(replace(swing_up, control=control))
    assert run.outcome == Outcome.INFEASIBLE
    assert "mm apart" in run.detail


def test_an_arm_too_weak_is_infeasible(swing_up):
    weak = replace(swing_up, timing=replace(swing_up.timing, torque_share=0.01))
    run = simulate(weak)
    assert run.outcome == Outcome.INFEASIBLE
    assert "torque limits" in run.detail


def test_a_posture_that_cannot_be_held_is_infeasible(swing_up):
    description = swing_up.arm.description
    weak = type(swing_up.arm)(
        replace(description, urdf=description.urdf.replace('effort="60"', 'effort="15"'))
    )
    level = weak.configuration([np.pi / 2, 0.0])
    run = simulate(replace(swing_up, arm=weak, scene=Scene(), goal=level))
    assert run.outcome == Outcome.INFEASIBLE
    assert run.detail.startswith("goal: joint 'shoulder' needs 19.62 N·m to hold the arm")
    assert run.detail.endswith("and has 15")
    upright = simulate(replace(swing_up, arm=weak, scene=Scene()))
    assert upright.outcome == Outcome.INFEASIBLE
    assert "no motion along the planned path" in upright.detail
    assert "joint 'shoulder' needs" in upright.detail


def test_contact_ends_the_record_with_a_verdict(swing_up, monkeypatch):
    """A controller that sees no obstacle is stopped at the first sample in contact."""
    blind = plan_motion(
        replace(swing_up, scene=Scene()),
        densarm.Clearance(swing_up.arm, Scene()),
        GuideKind.PATH,
    )
    monkeypatch.setattr("densarm.closed_loop.plan_motion", lambda *_: blind)
    run = simulate(swing_up)
    assert run.outcome == Outcome.COLLIDED
    assert run.detail.startswith("lower_link_0 and right at t = ")
    assert (run.clearance[:-1] > 0.0).all()
    assert run.clearance[-1] <= 0.0
    assert not run.certified
    np.testing.assert_array_equal(run.tau[-1], run.tau[-2])


def test_scenario_of_a_run_tells_guide_and_seed(swing_up):
    run = simulate(swing_up, guide="direct", seed=3)
    assert run.scenario.seed == 3
    assert run.scenario.control.guide == GuideKind.DIRECT
    assert run.scenario.to_json()["seed"] == 3


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"guide": "astar"}, "^guide = 'astar': must be one of direct, path"),
        ({"seed": -1}, "^seed = -1"),
        ({"seed": 0.5}, "^seed = 0.5"),
    ],
)
def test_arguments_are_checked(swing_up, arguments, message):
    with pytest.raises(InvalidValueError, match=message):
        simulate(swing_up, **arguments)


def test_progress_is_told(swing_up):
    told = []
    simulate(swing_up, guide="direct", on_progress=told.append)
    assert told[0] == "planning"
    assert any(phrase.startswith("running") for phrase in told)


SCRIPT = """
import hashlib, densarm
run = densarm.simulate(densarm.load_scenario("panda_shelf"), seed=1)
arrays = (run.time, run.q, run.v, run.tau, run.clearance)
print(hashlib.sha256(b"".join(array.tobytes() for array in arrays)).hexdigest())
"""


def test_same_scenario_and_seed_give_the_same_bits(swing_up, swing_up_run):
    scenario = load_scenario("panda_shelf")
    first, second = (digest(simulate(scenario, seed=1)) for _ in range(2))
    elsewhere = subprocess.run(
        [sys.executable, "-c", SCRIPT], capture_output=True, text=True, check=True
    )
    assert first == second == elsewhere.stdout.strip()
    assert digest(simulate(swing_up)) == digest(swing_up_run)


def test_another_seed_is_another_run(swing_up, swing_up_run):
    assert digest(simulate(swing_up, seed=5)) != digest(swing_up_run)


def test_a_run_rebuilt_from_json_is_the_same(swing_up, swing_up_run):
    rebuilt = type(swing_up).from_json(swing_up_run.scenario.to_json())
    assert digest(simulate(rebuilt)) == digest(swing_up_run)
