"""Every part of a certificate fails the run that it is there to refuse, and that part alone."""

from dataclasses import replace

import numpy as np
import pytest

from densarm.certificates import certify, replay_errors
from densarm.scene import Scene, Sphere

PARTS = ["swept", "start", "goal", "limits", "replay", "stopping"]


def failing(run):
    certificate = run.verify()
    assert [check.name for check in certificate.checks] == PARTS
    names = {check.name for check in certificate.checks if not check.holds}
    assert certificate.certified == (not names)
    return names


def tampered(run, name, row, column, change):
    array = getattr(run, name).copy()
    array[row, column] += change
    return replace(run, **{name: array})


def moved(run, **angles):
    """Return a run's scenario with another start or goal, given in joint angles."""
    ends = {key: run.scenario.arm.configuration(value) for key, value in angles.items()}
    return replace(run.scenario, **ends)


def test_an_honest_run(swing_up_run):
    assert failing(swing_up_run) == set()
    assert swing_up_run.certified


def test_start_moved(swing_up_run):
    scenario = moved(swing_up_run, start=(1e-6, 0.0))
    assert failing(replace(swing_up_run, scenario=scenario)) == {"start"}


def test_start_in_motion(swing_up_run):
    cut = {name: getattr(swing_up_run, name)[500:] for name in ("q", "v", "tau", "clearance")}
    time = swing_up_run.time[: len(cut["q"])]
    scenario = replace(swing_up_run.scenario, start=cut["q"][0])
    assert failing(replace(swing_up_run, scenario=scenario, time=time, **cut)) == {"start"}


@pytest.mark.parametrize("factor", [1.001, 0.5])
def test_another_time_grid(swing_up_run, factor):
    assert failing(replace(swing_up_run, time=factor * swing_up_run.time)) == {"start"}


def test_goal_missed(swing_up_run):
    scenario = moved(swing_up_run, goal=(3.13, 0.02))
    assert failing(replace(swing_up_run, scenario=scenario)) == {"goal"}


def test_ends_in_motion(swing_up_run):
    cut = {name: getattr(swing_up_run, name)[:1000] for name in ("time", "q", "v", "tau")}
    scenario = replace(swing_up_run.scenario, goal=cut["q"][-1])
    assert failing(replace(swing_up_run, scenario=scenario, **cut)) == {"goal"}


def weakened(run, **limits):
    """The run judged for an arm of other limits."""
    arm = run.scenario.arm
    description = arm.description
    for old, new in limits.items():
        assert old in description.urdf
        description = replace(description, urdf=description.urdf.replace(old, new))
    return replace(run, scenario=replace(run.scenario, arm=type(arm)(description)))


def test_torque_beyond_its_limit(swing_up_run):
    peak = np.abs(swing_up_run.tau[:, 0]).max()
    assert failing(weakened(swing_up_run, **{'effort="60"': f'effort="{peak * 0.999}"'})) == {
        "limits"
    }


def test_velocity_beyond_its_limit(swing_up_run):
    peak = np.abs(swing_up_run.v).max()
    assert failing(weakened(swing_up_run, **{'velocity="6"': f'velocity="{peak * 0.999}"'})) == {
        "limits"
    }


@pytest.mark.parametrize("name", ["v", "tau"])
def test_replay_sees_a_change_of_a_millionth(swing_up_run, name):
    change = {"v": 1e-8, "tau": 1e-4}[name]  # tau acts through dt/M
    assert failing(tampered(swing_up_run, name, 700, 0, change)) == {"replay"}


def test_replay_sees_a_change_of_position(swing_up_run):
    arm, q = swing_up_run.scenario.arm, swing_up_run.q.copy()
    q[700] = arm.integrate(q[700], np.array([1e-8, 0.0]))
    assert failing(replace(swing_up_run, q=q)) == {"replay"}


def test_not_a_number_is_never_certified(swing_up_run):
    for name in ("q", "v", "tau"):
        assert failing(tampered(swing_up_run, name, 700, 0, np.nan))


def test_replay_error_is_the_rounding_of_an_honest_run(swing_up_run):
    run = swing_up_run
    simulation = run.scenario.simulation
    arm = run.scenario.arm
    errors = replay_errors(arm, simulation.dt, simulation.integrator, run.q, run.v, run.tau)
    assert errors.shape == (len(run.q) - 1,)
    assert errors.max() <= 1e-12


def test_obstacle_between_two_samples(swing_up_run):
    """A pinhead inside the links' sweep, which they clear at every sample that was taken."""
    run, arm = swing_up_run, swing_up_run.scenario.arm
    ends = np.array([0, len(run.q) - 1])
    few = {name: getattr(run, name)[ends] for name in ("q", "v", "tau")}
    scenario = replace(
        run.scenario,
        goal=arm.configuration((2.0, 0.0)),
        scene=Scene([Sphere(name="pinhead", radius=1e-3, position=(1.6, 0.0, -1.0))]),
    )
    few["q"] = np.stack([scenario.start, scenario.goal])
    certificate = certify(scenario, run.time[:2], **few)
    checks = dict(zip(PARTS, certificate.checks, strict=True))
    assert not checks["swept"].holds
    assert "lower_link_0-pinhead" in checks["swept"].detail
    assert not checks["replay"].holds


def test_obstacle_on_the_way(swing_up_run):
    run, arm = swing_up_run, swing_up_run.scenario.arm
    absolute = np.cumsum(arm.angles(run.q[len(run.q) // 2]))
    tip = (np.sin(absolute).sum(), 0.0, -np.cos(absolute).sum())
    blocked = Scene([*run.scenario.scene, Sphere(name="late", radius=0.01, position=tip)])
    scenario = replace(run.scenario, scene=blocked)
    assert failing(replace(run, scenario=scenario)) == {"swept", "stopping"}


def test_teleport(swing_up_run):
    """Leave out the middle of the motion, where the obstacles are."""
    run = swing_up_run
    kept = np.r_[0:300, len(run.q) - 300 : len(run.q)]
    cut = {name: getattr(run, name)[kept] for name in ("q", "v", "tau", "clearance")}
    names = failing(replace(run, time=run.time[: len(kept)], **cut))
    assert "replay" in names
