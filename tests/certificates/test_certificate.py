"""Every part of a certificate fails the run that it is there to refuse, and that part alone."""

import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from densarm.certificates.certificate import REPLAY_TOLERANCE, Check, certify, replay_errors
from densarm.certificates.task import Input, SimulationParameters, Task
from densarm.control.regulation import DensityRegulation
from densarm.control.speed_law import SpeedParameters
from densarm.planning.plan import plan_path
from densarm.scenarios.scenario import Scenario
from densarm.scene.obstacles import Sphere
from densarm.scene.scene import Scene
from densarm.simulation.plants import SingleIntegrator
from densarm.simulation.run import Run
from densarm.simulation.simulate import simulate

PARTS = ["swept", "start", "goal", "limits", "replay", "stopping"]


def failing(run: Run) -> set[str]:
    """Return the parts that fail, of what is claimed of the run itself, not of its tube."""
    certificate = replace(run, tube=None).certificate
    assert [check.name for check in certificate.checks] == PARTS
    names = {check.name for check in certificate.checks if not check.holds}
    assert certificate.certified == (not names)
    return names


def tube_check(run: Run) -> Check:
    """Return the check of the tube; nothing is certified within it unless that holds."""
    certificate = run.certificate
    assert [check.name for check in certificate.checks] == [*PARTS, "tube"]
    check = certificate.checks[-1]
    assert bool(certificate.within) == (certificate.certified and check.holds is True)
    return check


def tampered(run: Run, name: str, row: int, column: int, change: float) -> Run:
    array = getattr(run, name).copy()
    array[row, column] += change
    return replace(run, **{name: array})


def moved(run: Run, **angles: tuple[float, float]) -> Task:
    """Return a run's task with another start or goal, given in joint angles."""
    ends: Any = {key: run.task.arm.configuration(value) for key, value in angles.items()}
    return replace(run.task, **ends)


def test_an_honest_run(swing_up_run: Run) -> None:
    assert failing(swing_up_run) == set()
    assert swing_up_run.certified


def failing_if(run: Run, **claims: Any) -> set[str]:
    """Return the failing parts where the record claims another plant; replay never passes."""
    certificate = replace(run, task=replace(run.task, **claims)).certificate
    replayed = next(check for check in certificate.checks if check.name == "replay")
    assert replayed.holds is None
    assert "does not apply" in replayed.detail
    return {check.name for check in certificate.checks if check.holds is False}


def test_a_run_is_certified_within_its_tube(swing_up_run: Run) -> None:
    check = tube_check(swing_up_run)
    assert check.holds
    assert swing_up_run.certificate.within.startswith("clear within ±0.00")
    assert check.margin is not None
    assert check.margin > 0.5  # of the tube


def test_a_tube_that_is_too_wide_is_refused(swing_up_run: Run) -> None:
    assert swing_up_run.tube is not None
    for tube in (20.0 * swing_up_run.tube, np.array([1e-3, 0.0]), np.array([np.nan, 1e-3])):
        wide = replace(swing_up_run, tube=tube)
        assert tube_check(wide).holds is False
        assert not wide.certified


def test_what_left_its_tube_is_certified_without_it(swing_up_run: Run) -> None:
    assert swing_up_run.tube is not None
    narrow = replace(swing_up_run, tube=0.02 * swing_up_run.tube)
    assert tube_check(narrow).holds is None
    assert "which the run left" in tube_check(narrow).detail
    assert narrow.certified


def test_replay_does_not_apply_to_another_plant_and_all_else_does(swing_up_run: Run) -> None:
    assert failing_if(swing_up_run, plant="mujoco") == set()
    assert failing_if(swing_up_run, disturbances={"payload": 1.0}) == set()
    moved_goal = moved(swing_up_run, goal=(3.13, 0.02))
    assert failing_if(replace(swing_up_run, task=moved_goal), plant="mujoco") == {"goal"}
    heavy = replace(swing_up_run, task=replace(swing_up_run.task, disturbances={"payload": 1.0}))
    assert "not of the disturbed plant" in heavy.certificate.checks[5].detail


def test_noise_of_sensors_leaves_the_plant_to_be_replayed(swing_up_run: Run) -> None:
    noisy = replace(swing_up_run.task, disturbances={"encoder_noise": 1e-4, "seed": 1})
    assert failing(replace(swing_up_run, task=noisy)) == set()
    wrong = tampered(replace(swing_up_run, task=noisy), "tau", 100, 0, 1.0)
    assert failing(wrong) == {"replay"}


def test_start_moved(swing_up_run: Run) -> None:
    task = moved(swing_up_run, start=(1e-6, 0.0))
    assert failing(replace(swing_up_run, task=task)) == {"start"}


def test_start_in_motion(swing_up_run: Run) -> None:
    cut: Any = {name: getattr(swing_up_run, name)[500:] for name in ("q", "v", "tau", "clearance")}
    time = swing_up_run.time[: len(cut["q"])]
    task = replace(swing_up_run.task, start=cut["q"][0])
    assert failing(replace(swing_up_run, task=task, time=time, **cut)) == {"start"}


@pytest.mark.parametrize("factor", [1.001, 0.5])
def test_another_time_grid(swing_up_run: Run, factor: float) -> None:
    assert failing(replace(swing_up_run, time=factor * swing_up_run.time)) == {"start"}


def test_goal_missed(swing_up_run: Run) -> None:
    task = moved(swing_up_run, goal=(3.13, 0.02))
    assert failing(replace(swing_up_run, task=task)) == {"goal"}


def test_ends_in_motion(swing_up_run: Run) -> None:
    cut: Any = {name: getattr(swing_up_run, name)[:1000] for name in ("time", "q", "v", "tau")}
    task = replace(swing_up_run.task, goal=cut["q"][-1])
    assert failing(replace(swing_up_run, task=task, **cut)) == {"goal"}


def weakened(run: Run, **limits: str) -> Run:
    """The run judged for an arm of other limits."""
    arm = run.task.arm
    description = arm.description
    for old, new in limits.items():
        assert old in description.urdf
        description = replace(description, urdf=description.urdf.replace(old, new))
    return replace(run, task=replace(run.task, arm=type(arm)(description)))


def test_torque_beyond_its_limit(swing_up_run: Run) -> None:
    peak = np.abs(swing_up_run.tau[:, 0]).max()
    assert failing(weakened(swing_up_run, **{'effort="60"': f'effort="{peak * 0.999}"'})) == {
        "limits"
    }


def test_velocity_beyond_its_limit(swing_up_run: Run) -> None:
    peak = np.abs(swing_up_run.v).max()
    assert failing(weakened(swing_up_run, **{'velocity="6"': f'velocity="{peak * 0.999}"'})) == {
        "limits"
    }


@pytest.mark.parametrize("name", ["v", "tau"])
def test_replay_sees_a_change_of_a_millionth(swing_up_run: Run, name: str) -> None:
    change = {"v": 1e-8, "tau": 1e-4}[name]  # tau acts through dt/M
    assert failing(tampered(swing_up_run, name, 700, 0, change)) == {"replay"}


def test_replay_sees_a_change_of_position(swing_up_run: Run) -> None:
    arm, q = swing_up_run.task.arm, swing_up_run.q.copy()
    q[700] = arm.integrate(q[700], np.array([1e-8, 0.0]))
    assert failing(replace(swing_up_run, q=q)) == {"replay"}


def test_not_a_number_is_never_certified(swing_up_run: Run) -> None:
    for name in ("q", "v", "tau"):
        assert failing(tampered(swing_up_run, name, 700, 0, np.nan))


def test_replay_error_is_the_rounding_of_an_honest_run(swing_up_run: Run) -> None:
    run = swing_up_run
    errors = replay_errors(run.task, run.q, run.v, run.tau)
    assert errors.shape == (len(run.q) - 1,)
    assert errors.max() <= 1e-12


def test_obstacle_between_two_samples(swing_up_run: Run) -> None:
    """A pinhead inside the links' sweep, which they clear at every sample that was taken."""
    run, arm = swing_up_run, swing_up_run.task.arm
    ends = np.array([0, len(run.q) - 1])
    few: Any = {name: getattr(run, name)[ends] for name in ("q", "v", "tau")}
    task = replace(
        run.task,
        goal=arm.configuration((2.0, 0.0)),
        scene=Scene([Sphere(name="pinhead", radius=1e-3, position=(1.6, 0.0, -1.0))]),
    )
    few["q"] = arm.configurations(np.array([[0.0, 0.0], [2.0, 0.0]]))
    certificate = certify(task, run.time[:2], **few)
    checks = dict(zip(PARTS, certificate.checks, strict=True))
    assert not checks["swept"].holds
    assert "lower_link_0-pinhead" in checks["swept"].detail
    assert not checks["replay"].holds


def test_obstacle_on_the_way(swing_up_run: Run) -> None:
    run, arm = swing_up_run, swing_up_run.task.arm
    absolute = np.cumsum(arm.angles(run.q[len(run.q) // 2]))
    tip = (np.sin(absolute).sum(), 0.0, -np.cos(absolute).sum())
    blocked = Scene([*run.task.scene, Sphere(name="late", radius=0.01, position=tip)])
    task = replace(run.task, scene=blocked)
    assert failing(replace(run, task=task)) == {"swept", "stopping"}


def test_teleport(swing_up_run: Run) -> None:
    """Leave out the middle of the motion, where the obstacles are."""
    run = swing_up_run
    kept = np.r_[0:300, len(run.q) - 300 : len(run.q)]
    cut: Any = {name: getattr(run, name)[kept] for name in ("q", "v", "tau", "clearance")}
    names = failing(replace(run, time=run.time[: len(kept)], **cut))
    assert "replay" in names


def test_without_a_goal_it_is_told_and_not_certified(swing_up_run: Run) -> None:
    run = replace(swing_up_run, task=replace(swing_up_run.task, goal=None))
    assert failing(run) == {"goal"}
    goal = run.certificate.checks[PARTS.index("goal")]
    assert (goal.detail, goal.margin) == ("no goal was given", None)
    assert goal.time == pytest.approx(run.time[-1])


def test_margins_are_to_spare_and_negative_where_it_fails(swing_up_run: Run) -> None:
    margins = {check.name: check.margin for check in swing_up_run.certificate.checks}
    assert all(margin is not None and margin > 0.0 for margin in margins.values())
    swept, smallest = margins["swept"], float(swing_up_run.clearance.min())
    assert swept is not None
    assert smallest <= swept < smallest + 0.02
    peak = np.abs(swing_up_run.tau[:, 0]).max()
    weak = weakened(swing_up_run, **{'effort="60"': f'effort="{peak * 0.5}"'})
    limits = weak.certificate.checks[PARTS.index("limits")]
    assert limits.margin == pytest.approx(-1.0)
    assert "torque 200% (shoulder" in limits.detail


# Runs of a plant that is told velocities.


@pytest.fixture(scope="module")
def velocity_run(swing_up: Scenario) -> Run:
    """Slow enough that its first step is within the acceleration limits."""
    world, start, goal = swing_up.world, swing_up.start, swing_up.goal
    path = plan_path(world, start, goal).path
    slow = SpeedParameters(braking_share=0.05, velocity_share=0.05)
    return simulate(
        world,
        DensityRegulation(world, goal, path=path, speed=slow),
        start,
        plant=SingleIntegrator(swing_up.arm, 0.05),
        parameters=SimulationParameters(dt=0.05),
    )


def test_a_run_by_velocity_can_be_certified(velocity_run: Run) -> None:
    assert velocity_run.task.input == Input.VELOCITY
    assert failing(velocity_run) == set()
    np.testing.assert_array_equal(velocity_run.tau, 0.0)


@pytest.mark.parametrize("name", ["q", "v"])
def test_replay_of_a_run_by_velocity_checks_the_kinematics(velocity_run: Run, name: str) -> None:
    arm, row = velocity_run.task.arm, 200
    if name == "v":
        changed = tampered(velocity_run, "v", row, 0, 1e-6)
    else:
        q = velocity_run.q.copy()
        q[row] = arm.integrate(q[row], np.array([0.0, 1e-8]))
        changed = replace(velocity_run, q=q)
    assert failing(changed) == {"replay"}
    errors = replay_errors(changed.task, changed.q, changed.v, changed.tau)
    assert set(np.flatnonzero(errors > REPLAY_TOLERANCE)) <= {row - 1, row}


def test_a_run_by_velocity_is_none_by_torque(velocity_run: Run) -> None:
    task = replace(velocity_run.task, input=Input.TORQUE)
    assert "replay" in failing(replace(velocity_run, task=task))


def without_masses(run: Run, **changes: Any) -> Run:
    """The run judged for an arm that is the same but for the masses of its links."""
    description = run.task.arm.description
    text = re.sub(r"(?s)<inertial>.*?</inertial>", "", description.urdf)
    assert text != description.urdf
    arm = type(run.task.arm)(replace(description, urdf=text))
    assert arm.links_without_mass
    return replace(run, task=replace(run.task, arm=arm, **changes))


def test_a_run_by_velocity_of_an_arm_without_masses(velocity_run: Run) -> None:
    run = without_masses(velocity_run)
    assert failing(run) == set()
    details = {check.name: check.detail for check in run.certificate.checks}
    assert details["limits"].endswith("torque limits do not apply")
    assert details["stopping"].endswith("by acceleration limits alone")
    limits = velocity_run.certificate.checks[PARTS.index("limits")]
    assert limits.detail.endswith("torque limits do not apply")
    stopping = velocity_run.certificate.checks[PARTS.index("stopping")]
    assert "acceleration limits" not in stopping.detail


def test_what_fails_without_masses_too(velocity_run: Run) -> None:
    assert failing(without_masses(tampered(velocity_run, "v", 5, 0, 1.0))) >= {"limits", "replay"}
    run, arm = without_masses(velocity_run), velocity_run.task.arm
    absolute = np.cumsum(arm.angles(run.q[len(run.q) // 2]))
    tip = (np.sin(absolute).sum(), 0.0, -np.cos(absolute).sum())
    blocked = Scene([*run.task.scene, Sphere(name="late", radius=0.01, position=tip)])
    assert failing(replace(run, task=replace(run.task, scene=blocked))) == {"swept", "stopping"}


def test_torque_proves_nothing_without_masses(velocity_run: Run, swing_up_run: Run) -> None:
    for run in (swing_up_run, velocity_run):
        judged = without_masses(run, input=Input.TORQUE)
        assert failing(judged) == {"replay"}
        replay = judged.certificate.checks[PARTS.index("replay")]
        assert replay.detail.endswith("no mass of upper_link, lower_link")
