"""A run among obstacles that move: they touch where they are, and the proof knows of them."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import ArrayLike

from densarm.arms.arm import Arm, load_arm
from densarm.certificates.task import SimulationParameters
from densarm.control.regulation import DensityRegulation
from densarm.control.tracking import DensityTracking
from densarm.planning.plan import plan_motion
from densarm.scene.motion import BackAndForth, ConstantVelocity, ObstacleMotion, Waypoints
from densarm.scene.obstacles import Sphere
from densarm.scene.scene import Scene
from densarm.simulation.run import Run
from densarm.simulation.simulate import simulate
from densarm.values.arrays import Array
from densarm.values.outcome import Outcome
from densarm.world.stopping import StoppingTrajectory
from densarm.world.world import World

RADIUS = 0.1


@pytest.fixture(scope="module")
def arm() -> Arm:
    return load_arm("two_link")


def ball(x: float, z: float, motion: ObstacleMotion | None) -> Scene:
    return Scene([Sphere(name="ball", radius=RADIUS, position=(x, 0.0, z), motion=motion)])


def swing(arm: Arm, scene: Scene) -> Run:
    """A swing from hanging, planned in the scene as it begins."""
    world, start = World(arm, scene), arm.configuration([0.0, 0.0])
    motion = plan_motion(world, start, arm.configuration([0.8, 0.3]))
    return simulate(world, DensityTracking(world, motion), start)


@pytest.fixture(scope="module")
def beside(arm: Arm) -> Run:
    """A run that a ball goes along with, out of reach."""
    return swing(arm, ball(-1.5, -1.0, BackAndForth(position=(-1.4, 0, -0.5), period=0.7)))


def test_a_run_beside_what_moves_is_certified(beside: Run, tmp_path: Path) -> None:
    assert beside.outcome == Outcome.REACHED
    assert beside.certified
    assert "until at rest, obstacles moving on" in beside.certificate.checks[-1].detail
    beside.save(tmp_path / "run.npz")
    again = Run.load(tmp_path / "run.npz")
    assert again.task.scene == beside.task.scene
    assert again.certificate == beside.certificate


def test_clearance_is_that_of_the_moved_obstacle(arm: Arm, beside: Run) -> None:
    (item,) = beside.task.scene
    for k in range(0, len(beside.time), 100):
        pose = item.pose_at(k * 0.001)
        there = Sphere(name="ball", radius=RADIUS, position=pose.translation)
        smallest = World(arm, Scene([there])).distances(beside.q[k]).min()
        assert beside.clearance[k] == pytest.approx(smallest, abs=1e-9)


def test_runs_in_one_world_are_alike(arm: Arm, beside: Run) -> None:
    world = World(arm, beside.task.scene)
    world.set_time(3.0)
    motion = plan_motion(World(arm, beside.task.scene), beside.q[0], arm.configuration([0.8, 0.3]))
    for _ in range(2):
        again = simulate(world, DensityTracking(world, motion), beside.q[0])
        np.testing.assert_array_equal(again.clearance, beside.clearance)


class Hold:
    """Torque that carries the arm's weight, and nothing else."""

    def __init__(self, arm: Arm) -> None:
        self.arm = arm

    def torque(self, t: float, q: ArrayLike, v: ArrayLike) -> Array:  # noqa: ARG002
        return self.arm.nonlinear_effects(q, v)


def test_what_comes_to_a_resting_arm_touches_it(arm: Arm) -> None:
    """From 0.9 m away at 1 m/s, onto a link that hangs."""
    world = World(arm, ball(0.9, -0.5, ConstantVelocity(linear=(-1.0, 0.0, 0.0))))
    rest = arm.configuration([0.0, 0.0])
    apart = world.distances(rest).min()
    run = simulate(world, Hold(arm), rest)
    assert run.outcome == Outcome.COLLIDED
    assert run.time[-1] == pytest.approx(apart, abs=1.001e-3)
    assert run.clearance[-1] <= 0.0 < run.clearance[-2]
    assert run.certificate.checks[0].detail.startswith("contact at t = 0.7")


def test_what_passes_between_two_samples_is_seen(arm: Arm) -> None:
    """It goes through a link and is gone, clear of it at both samples."""
    world, rest = World(arm, Scene()), arm.configuration([0.0, 0.0])
    parameters = SimulationParameters(dt=0.01, time_limit=0.2)
    run = simulate(world, Hold(arm), rest, parameters=parameters)
    for times in ((0.101, 0.109), (0.104, 0.106)):
        crossing = Waypoints(times=times, positions=((0, -0.09, -0.3), (0, 0.09, -0.3)))
        bullet = Scene([Sphere(name="bullet", radius=0.01, motion=crossing)])
        passed, around = replace(run, task=replace(run.task, scene=bullet)), World(arm, bullet)
        for k, time in enumerate(run.time):
            around.set_time(time)
            assert around.distances(run.q[k]).min() > 0.0
        check = passed.certificate.checks[0]
        assert not check.holds
        assert check.detail.startswith("contact at t = 0.100 s")


def test_stopping_is_proved_among_what_moves(arm: Arm, beside: Run) -> None:
    """The motion itself is clear of what crosses behind it, where it could not have stopped."""
    k = int(np.abs(beside.v).sum(axis=1).argmax()) // 2  # on it, the arm speeds up
    q, v, data = beside.q[k : k + 1], beside.v[k : k + 1], arm.model.createData()
    duration = float(StoppingTrajectory(arm).durations(q, v)[0])
    pin.framesForwardKinematics(arm.model, data, arm.integrate(q[0], 0.5 * duration * v[0]))
    tip = data.oMf[arm.end_effector_frame].translation
    rest = beside.time[k] + duration
    times = (rest - 0.02, rest - 0.005)
    crossing = Waypoints(times=times, positions=(tip - (0, 0.5, 0), tip))
    scene = Scene([Sphere(name="late", radius=0.02, motion=crossing)])
    checks = replace(beside, task=replace(beside.task, scene=scene)).certificate.checks
    parts = {check.name: check.holds for check in checks}
    assert parts["swept"]
    assert parts["replay"]
    assert not parts["stopping"]


@pytest.mark.parametrize("plain", [False, True])
def test_regulation_goes_on_where_obstacles_move(arm: Arm, plain: bool) -> None:
    away = ConstantVelocity(linear=(0.2, 0.0, 0.3))
    world = World(arm, ball(1.6, 0.0, away))
    controller = DensityRegulation(world, arm.configuration([0.8, 0.3]), plain=plain)
    run = simulate(world, controller, arm.configuration([0.0, 0.0]))
    assert run.outcome == Outcome.REACHED
    assert run.certified
