"""Passive safety: the arm rests before what moves can reach it, and the certificate proves it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from densarm.arms.arm import Arm, load_arm
from densarm.certificates.certificate import Check
from densarm.certificates.task import SimulationParameters
from densarm.control.evasion import Evasion
from densarm.control.passive import PassiveTracking
from densarm.control.tracking import DensityTracking
from densarm.errors import InvalidValueError
from densarm.planning.motion import Motion
from densarm.planning.plan import plan_motion
from densarm.scenarios.control import ControlForm, ControlParameters
from densarm.scenarios.run import run as run_scenario
from densarm.scenarios.scenario import Scenario
from densarm.scene.motion import ConstantVelocity
from densarm.scene.obstacles import Sphere
from densarm.scene.scene import Scene
from densarm.simulation.plants import PinocchioPlant
from densarm.simulation.run import Run
from densarm.simulation.simulate import simulate
from densarm.study.moving import draw_trial
from densarm.values.outcome import Outcome
from densarm.world.world import World

AWAY = (0.0, 50.0, 0.0)
CROSSING = (1.5, -2.5, -1.0), (0.0, 1.5, 0.0)  # through the plane of the arm, beside it
REST = 0.01  # [rad/s]


class Blind(Evasion):
    """Sees nothing that moves."""

    def is_needed(self) -> bool:
        return False


@pytest.fixture(scope="module")
def arm() -> Arm:
    return load_arm("two_link")


@pytest.fixture(scope="module")
def motion(arm: Arm) -> Motion:
    """A swing from hanging, among nothing."""
    world = World(arm, Scene())
    return plan_motion(world, arm.configuration([0.0, 0.0]), arm.configuration([1.2, 0.3]))


def ball(at: tuple[float, ...], velocity: tuple[float, ...] | None) -> Scene:
    moves = None if velocity is None else ConstantVelocity(linear=velocity)
    return Scene([Sphere(name="ball", radius=0.1, position=at, motion=moves)])


def swing(arm: Arm, motion: Motion, scene: Scene, speed: float | None) -> Run:
    """Run with passive safety, or blind where no speed is declared."""
    world, start = World(arm, scene), arm.configuration([0.0, 0.0])
    if speed is None:
        return simulate(world, DensityTracking(world, motion, evasion=Blind), start)
    parameters = SimulationParameters(time_limit=20.0)
    return simulate(world, PassiveTracking(world, motion, speed), start, parameters=parameters)


def passive(run: Run, **changes: object) -> Check:
    """Return the check of a run, or of its task with other claims."""
    changed = replace(run, task=replace(run.task, **changes))  # type: ignore[arg-type]
    check = changed.certificate.checks[-1]
    assert check.name == "passive"
    return check


@pytest.fixture(scope="module")
def crossed(arm: Arm, motion: Motion) -> Run:
    """A run that a ball crosses at the declared speed, so that the arm waits."""
    return swing(arm, motion, ball(*CROSSING), 1.5)


@pytest.mark.parametrize("position", [AWAY, (1.5, 0.0, -1.0)])
def test_without_what_moves_it_is_tracking(
    arm: Arm, motion: Motion, position: tuple[float, ...]
) -> None:
    scene = ball(position, None)
    run, plain = swing(arm, motion, scene, 2.0), swing(arm, motion, scene, None)
    np.testing.assert_array_equal(run.q, plain.q)
    np.testing.assert_array_equal(run.tau, plain.tau)
    assert passive(run).holds is None
    assert run.certificate.checks[:-1] == plain.certificate.checks
    assert run.certified == plain.certified


@pytest.mark.slow
def test_it_waits_for_what_crosses_and_is_certified(
    crossed: Run, motion: Motion, tmp_path: Path
) -> None:
    assert crossed.outcome == Outcome.REACHED
    assert crossed.certified
    assert crossed.time[-1] > motion.duration + 0.5
    check = passive(crossed)
    assert check.holds
    assert check.detail.startswith("at rest before what moves by up to 1.5 m/s can reach it")
    assert check.margin is not None
    assert check.margin > 0.0
    crossed.save(tmp_path / "run.npz")
    again = Run.load(tmp_path / "run.npz")
    assert again.task.passive_speed == 1.5
    assert again.certificate == crossed.certificate


@pytest.mark.slow
def test_the_inequality_holds_at_samples_that_are_in_motion(crossed: Run, arm: Arm) -> None:
    """By accelerations alone, which is the least that stopping takes."""
    world, checked = World(arm, crossed.task.scene), 0
    for k in range(0, len(crossed.q), 10):
        speed = np.abs(crossed.v[k])
        if speed.max() > REST:
            world.set_time(float(crossed.time[k]))
            least = float((speed / arm.limits.acceleration).max())
            need = 1.5 * least + world.lipschitz @ (0.5 * least * speed)
            distance = world.distances(crossed.q[k])
            assert (distance > need)[world.has_motion].all()
            checked += 1
    assert checked > 20


@pytest.mark.slow
@pytest.mark.parametrize(
    ("speed", "why"),
    [
        (1.0, "an obstacle may have 1.5 m/s, and 1 m/s are declared"),
        (20.0, "could reach the moving arm"),
    ],
)
def test_another_declared_speed_fails(crossed: Run, speed: float, why: str) -> None:
    check = passive(crossed, passive_speed=speed)
    assert check.holds is False
    assert why in check.detail


@pytest.mark.slow
def test_an_obstacle_that_is_nearer_fails(crossed: Run) -> None:
    assert passive(crossed, scene=ball((1.5, -1.5, -1.0), CROSSING[1])).holds is False


@pytest.mark.slow
def test_an_arm_without_the_mode_fails(arm: Arm, motion: Motion) -> None:
    run = swing(arm, motion, ball((1.5, -1.0, -1.0), CROSSING[1]), None)
    assert passive(run, passive_speed=1.5).holds is False


def test_what_comes_to_the_arm_touches_it_at_rest(arm: Arm, motion: Motion) -> None:
    run = swing(arm, motion, ball((2.0, 0.0, -1.0), (-0.8, 0.0, 0.0)), 0.8)
    assert run.outcome == Outcome.COLLIDED
    assert np.abs(run.v[-2:]).max() <= REST
    assert passive(run).holds
    assert not run.certified  # as there is a contact


def test_it_brakes_straight_for_what_appears_and_returns(arm: Arm, motion: Motion) -> None:
    """Nearer than a pause of the clock allows; then gone again, and touched nothing."""
    world = World(arm, ball(AWAY, None))
    controller, plant = PassiveTracking(world, motion, 2.0), PinocchioPlant(arm, 0.001)
    q, v = arm.configuration([0.0, 0.0]), np.zeros(arm.nv)
    rested, middle = False, round(500 * motion.duration)
    for k in range(round(1000 * motion.duration) + 3000):
        if k == middle:
            assert np.abs(v).max() > 10 * REST
            world.move_obstacle("ball", (0.0, 0.4, -1.0))
        if k == middle + 1500:
            world.move_obstacle("ball", AWAY)
        q, v = plant.step(q, v, controller.torque(0.001 * k, q, v))
        if middle + 800 <= k < middle + 1500:
            assert np.abs(v).max() < REST
            rested = True
    assert rested
    assert np.abs(arm.difference(controller.goal, q)).max() < REST


def test_after_a_gap_in_time_it_begins_from_rest(arm: Arm, motion: Motion) -> None:
    world = World(arm, ball((1.5, -1.0, -1.0), (0.0, 0.1, 0.0)))
    controller = PassiveTracking(world, motion, 5.0)
    q, v = arm.configuration([0.0, 0.0]), np.zeros(arm.nv)
    np.testing.assert_array_equal(controller.reference, motion.position[0])
    for t in (0.0, 0.5, 0.501, 0.502):
        tau = controller.torque(t, q, v)
        np.testing.assert_allclose(tau, arm.nonlinear_effects(q, v), atol=1e-6)
    assert controller.is_moving


@pytest.mark.slow
def test_in_a_scenario_and_its_record(swing_up: Scenario) -> None:
    control = ControlParameters(passive_speed=0.5)
    there = Sphere(
        name="passing",
        radius=0.1,
        position=(1.0, -6.0, 0.0),
        motion=ConstantVelocity(linear=(0.0, 0.4, 0.0)),
    )
    scenario = replace(swing_up, control=control, scene=Scene([*swing_up.scene, there]))
    run = run_scenario(scenario)
    assert passive(run).holds
    assert Scenario.of_task(run.task).control == control


def test_a_speed_that_is_none_or_has_no_use(arm: Arm, motion: Motion) -> None:
    with pytest.raises(InvalidValueError, match=r"^speed = 0"):
        PassiveTracking(World(arm, Scene()), motion, 0.0)
    with pytest.raises(InvalidValueError, match=r"^passive_speed = -1"):
        ControlParameters(passive_speed=-1.0)
    with pytest.raises(InvalidValueError, match=r"form 'tracking', not 'regulation'"):
        ControlParameters(passive_speed=1.0, form=ControlForm.REGULATION)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_a_panda_among_balls(seed: int) -> None:
    panda = load_arm("panda", shapes="capsule")
    trial = draw_trial(panda, 2, 0.9, seed)
    world = World(panda, trial.scene)
    start = panda.configurations(trial.motion.position[0])
    parameters = SimulationParameters(time_limit=6.0)
    run = simulate(world, PassiveTracking(world, trial.motion, 1.0), start, parameters=parameters)
    assert passive(run).holds
    assert run.outcome == Outcome.REACHED or np.abs(run.v[-2:]).max() <= REST
