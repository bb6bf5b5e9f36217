"""Every method: reaches in an easy scene without contact, and says why where it does not."""

from dataclasses import replace

import numpy as np
import pytest

from densarm.clearance import Clearance
from densarm.closed_loop import run_closed_loop
from densarm.outcome import Outcome
from densarm.scenario import load_scenario
from densarm.scene import Scene, Sphere
from densarm.study.methods import METHODS

FIELDS = ["density_direct", "potential_field", "navigation_function", "cbf_qp"]


@pytest.fixture(scope="module")
def swing_up():
    return load_scenario("swing_up")


@pytest.fixture(scope="module")
def panda():
    """Panda lifts its hand past a small ball, which lies off the straight way."""
    scenario = load_scenario("panda_table")
    ready = scenario.arm.postures["ready"]
    ball = Sphere(name="ball", radius=0.04, position=[0.45, 0.25, 0.75])
    return replace(scenario, scene=Scene([ball]), start=ready, goal=ready + 0.3)


@pytest.mark.parametrize("name", METHODS)
@pytest.mark.parametrize("scene", ["two_link", "panda"])
def test_reaches_in_an_easy_scene(swing_up, panda, scene, name):
    angles = swing_up.arm.configuration
    easy = replace(swing_up, start=angles([0.3, 0.4]), goal=angles([0.6, -1.2]))
    scenario = {"two_link": easy, "panda": panda}[scene]
    run = run_closed_loop(scenario, METHODS[name])
    assert run.outcome == Outcome.REACHED, run.detail
    assert run.clearance.min() > 0.0
    limits = scenario.arm.limits
    assert (np.abs(run.v) <= limits.velocity).all()
    assert (np.abs(run.tau) <= limits.effort).all()


@pytest.mark.parametrize("name", FIELDS)
def test_says_where_it_rests(swing_up, name):
    """The start of the swing-up is a critical point of every V on circles."""
    run = run_closed_loop(swing_up, METHODS[name])
    assert run.outcome == Outcome.STUCK
    assert "at joint positions" in run.detail


@pytest.mark.parametrize("name", FIELDS)
def test_a_field_stops_before_what_it_cannot_pass(swing_up, name):
    scenario = replace(swing_up, start=swing_up.arm.configuration([0.2, 0.0]))
    run = run_closed_loop(scenario, METHODS[name])
    assert run.outcome == Outcome.STUCK
    assert run.clearance.min() > 0.0
    assert "lower_link_0 and right" in run.detail


def test_plan_then_track_has_the_reference_of_density(swing_up):
    clearance = Clearance(swing_up.arm, swing_up.scene)
    drives = [METHODS[name](swing_up, clearance) for name in ("density", "plan_then_track")]
    first, second = (drive.reference.position for drive in drives)
    np.testing.assert_array_equal(first, second)
    assert type(drives[0].controller) is not type(drives[1].controller)
