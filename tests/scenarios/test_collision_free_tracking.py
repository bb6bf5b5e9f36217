"""Collision-free tracking: every scenario under every controller form, and the same check blind.

The certificate must fail once the obstacles are taken out of what plans and steers, or it would
not be the density that keeps the arm off them.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from itertools import product

import numpy as np
import pytest

from densarm.scenarios.control import ControlForm
from densarm.scenarios.run import run
from densarm.scenarios.scenario import Scenario, load_scenario
from densarm.scene.scene import Scene
from densarm.simulation.run import Run
from densarm.values.outcome import Outcome

pytestmark = pytest.mark.slow

SCENARIOS = ["swing_up", "panda_table", "panda_shelf"]
TRACKING_ERROR = 0.005  # [rad]
REGULATIONS = (ControlForm.REGULATION, ControlForm.PLAIN)

# The feedback at full rate is the one of the scenario files; slower rates are as certified and
# simulate faster.
DIVISOR = dict.fromkeys(ControlForm, 1) | dict.fromkeys(REGULATIONS, 5)
CASES = list(product(SCENARIOS, ControlForm))
JERK_TIME = 0.025  # [s], 1 / K_v


def configured(name: str, form: ControlForm) -> Scenario:
    scenario = load_scenario(name)
    # The plain form's V has no weights, without which the density alone is stuck in swing_up.
    guide = "auto" if form == ControlForm.PLAIN else scenario.control.guide
    return replace(
        scenario,
        control=replace(scenario.control, form=form, guide=guide),
        simulation=replace(scenario.simulation, control_divisor=DIVISOR[form]),
    )


@pytest.fixture(scope="module")
def run_of(catalogue_run: Callable[[str], Run]) -> Callable[[str, ControlForm], Run]:
    @cache
    def ran(name: str, form: ControlForm) -> Run:
        is_as_it_stands = form == ControlForm.TRACKING
        return catalogue_run(name) if is_as_it_stands else run(configured(name, form))

    return ran


@pytest.mark.parametrize(("name", "form"), CASES)
def test_reaches_and_is_certified(
    run_of: Callable[[str, ControlForm], Run], name: str, form: ControlForm
) -> None:
    done = run_of(name, form)
    assert done.outcome == Outcome.REACHED, done.detail
    assert [check for check in done.certificate.checks if not check.holds] == []


@pytest.mark.parametrize(("name", "form"), list(product(SCENARIOS, REGULATIONS)))
def test_regulation_neither_jolts_nor_chatters(
    run_of: Callable[[str, ControlForm], Run], name: str, form: ControlForm
) -> None:
    done = run_of(name, form)
    task = done.task
    dt, limit = task.simulation.dt, task.arm.limits.acceleration
    a = np.diff(done.v, axis=0) / dt / limit
    step = task.simulation.control_period / JERK_TIME
    assert np.abs(np.diff(a, axis=0)).max() < step + 0.05
    # While a torque is held, accelerations drift: what it asked for is their mean.
    held = task.simulation.control_divisor
    mean = np.diff(done.v[::held], axis=0) / (held * dt) / limit
    changes = sum((np.diff(np.sign(x[np.abs(x) > 0.01])) != 0).sum() for x in mean.T)
    assert changes / done.time[-1] < 20.0


@pytest.mark.parametrize("name", SCENARIOS)
def test_tracks_its_motion(run_of: Callable[[str, ControlForm], Run], name: str) -> None:
    error = run_of(name, ControlForm.TRACKING).tracking_error
    assert error is not None
    assert error <= TRACKING_ERROR


@pytest.mark.parametrize("form", REGULATIONS)
def test_other_forms_have_no_motion_to_track(
    run_of: Callable[[str, ControlForm], Run], form: ControlForm
) -> None:
    assert run_of("swing_up", form).tracking_error is None


@pytest.mark.parametrize(("name", "form"), CASES)
def test_without_obstacles_in_the_density_it_is_not(name: str, form: ControlForm) -> None:
    scenario = configured(name, form)
    blind = run(replace(scenario, scene=Scene()))
    assert blind.outcome == Outcome.REACHED
    assert blind.certified
    judged = replace(blind, task=scenario.task).certificate
    failing = {check.name: check.detail for check in judged.checks if not check.holds}
    assert set(failing) - {"tube"} == {"swept", "stopping"}
    assert failing["swept"].startswith("contact")
