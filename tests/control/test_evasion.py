"""Evasion: rows that hold where they can, balls that miss, and scenes that stand."""

from collections.abc import Callable
from pathlib import Path

import daqp
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog

import densarm
from densarm.arms.arm import Arm, load_arm
from densarm.control.disturbance_observer import AHEAD_VELOCITY, DISTURBANCE
from densarm.control.evasion import EVADING_GAIN, Evasion, EvasionParameters
from densarm.control.inverse_dynamics import TORQUE, InverseDynamics
from densarm.control.regulation import DensityRegulation
from densarm.control.tracking import DensityTracking
from densarm.density.inverse_bump import log_inverse_bump
from densarm.errors import InvalidValueError
from densarm.planning.motion import Motion
from densarm.scene.motion import ConstantVelocity
from densarm.scene.obstacles import Sphere
from densarm.scene.scene import Scene
from densarm.simulation.plants import PinocchioPlant
from densarm.simulation.run import Run
from densarm.simulation.simulate import simulate
from densarm.study.moving import draw_trial
from densarm.values.arrays import Array
from densarm.values.outcome import Outcome
from densarm.world.active_pairs import ActivePairs
from densarm.world.stopping import HELD_SHARE
from densarm.world.world import World

PLAIN = EvasionParameters(horizon=0.0)


class Blind(Evasion):
    """Sees nothing that moves."""

    def is_needed(self) -> bool:
        return False


class Unasked(Evasion):
    """Is not to be asked for a velocity."""

    def velocity(self, q: Array, v: Array, nominal: Array) -> tuple[Array, bool]:  # noqa: ARG002
        raise AssertionError


@pytest.fixture(scope="module")
def with_ball(panda: Arm) -> World:
    """The Panda beside a ball, from far away."""
    return World(panda, Scene([Sphere(name="ball", radius=0.08, position=(0.0, 0.0, 5.0))]))


@settings(max_examples=60, deadline=None)
@given(
    at=st.tuples(*[st.floats(-0.9, 0.9)] * 3),
    velocity=st.tuples(*[st.floats(-1.0, 1.0)] * 3),
    nominal=st.tuples(*[st.floats(-0.3, 0.3)] * 7),
)
def test_rows_of_the_density_hold_unless_no_velocity_in_reach_keeps_them(
    with_ball: World, at: Array, velocity: Array, nominal: Array
) -> None:
    world, arm = with_ball, with_ball.arm
    q = arm.postures["ready"]
    world.move_obstacle("ball", (0.0, 0.0, 5.0))
    evasion = Evasion(world, pairs := ActivePairs(world), 0.0, PLAIN)
    world.move_obstacle("ball", at, velocity=velocity)
    assert evasion.is_needed()
    pairs.update(q)
    sample = world.clearance(q)
    assume(sample.distance.min() > 0.02)
    found, _ = evasion.velocity(q, np.zeros(arm.nv), np.array(nominal))
    most = 0.9 * arm.limits.acceleration / EVADING_GAIN
    assert (np.abs(found) <= most + 1e-9).all()
    slopes, bounds = [], []
    for k, names in enumerate(world.pairs):
        h = sample.distance[k] - PLAIN.margin - PLAIN.reaction * max(-sample.rate[k], 0.0)
        if "ball" in names and 1e-3 < h < 0.98 * PLAIN.distance:  # beyond, its slope is zero
            slope = log_inverse_bump(h, PLAIN.distance, 0.0)[1]
            slopes.append(sample.gradient[k])
            bounds.append(-PLAIN.decay / slope - sample.rate[k])
    lack = np.array(bounds) - np.array(slopes).reshape(-1, arm.nv) @ found
    if (lack > 2e-3).any():  # rows are soft
        limits = list(zip(-most, most, strict=True))
        assert not linprog(
            np.zeros(arm.nv), -np.array(slopes), -np.array(bounds), bounds=limits
        ).success


class Wakeful(Evasion):
    """Has every pair of what moves awake, however far."""

    def velocity(self, q: Array, v: Array, nominal: Array) -> tuple[Array, bool]:
        self._pairs.set_reach(np.where(self._is_moving, np.inf, self._pairs.reach))
        self._pairs.update(q)
        return super().velocity(q, v, nominal)


@pytest.fixture(scope="module")
def sleeping_and_awake(with_ball: World) -> list[tuple[ActivePairs, Evasion]]:
    """Pairs that sleep as they may, and some that do not, each with what evades by them."""
    both = []
    for kind in (Evasion, Wakeful):
        with_ball.move_obstacle("ball", (0.0, 0.0, 5.0))
        pairs = ActivePairs(with_ball)
        both.append((pairs, kind(with_ball, pairs, 0.0)))
        pairs.set_reach(0.0)
    return both


@settings(max_examples=40, deadline=None)
@given(
    way=st.tuples(*[st.floats(-1.0, 1.0)] * 3).filter(lambda way: np.linalg.norm(way) > 0.1),
    off=st.floats(0.15, 0.6),
    speed=st.floats(0.0, 2.0),
    pushed=st.tuples(*[st.floats(-1.0, 1.0)] * 7),
)
def test_a_pair_that_sleeps_would_ask_for_nothing(
    with_ball: World,
    sleeping_and_awake: list[tuple[ActivePairs, Evasion]],
    way: Array,
    off: float,
    speed: float,
    pushed: Array,
) -> None:
    """A ball that comes at the hand, from near and far."""
    q, v, found = with_ball.arm.postures["ready"], np.array(pushed), []
    way = np.array(way) / np.linalg.norm(way)
    with_ball.move_obstacle("ball", (0.31, 0.0, 0.52) + off * way, velocity=-speed * way)
    for pairs, evasion in sleeping_and_awake:
        assert evasion.is_needed()
        for _ in range(17):  # so that misses are looked for at each of the times ahead
            pairs.update(q)
            wanted, _ = evasion.velocity(q, v, v)
        found.append(wanted)
    np.testing.assert_allclose(found[0], found[1], atol=1e-9)


@settings(max_examples=20, deadline=None)
@given(
    way=st.tuples(*[st.floats(-1.0, 1.0)] * 3).filter(lambda way: np.linalg.norm(way) > 0.1),
    gap=st.floats(1e-4, 3e-3),
)
def test_an_arm_that_evades_keeps_a_millimetre_off_what_stands(
    panda: Arm, way: Array, gap: float
) -> None:
    """It is to be driven into a ball that stands by the hand, and backs off where it is nearer."""
    q, v = panda.postures["ready"], np.zeros(panda.nv)
    at = np.array([0.31, 0.0, 0.52]) + 0.25 * np.array(way) / np.linalg.norm(way)
    point = World(panda, Scene([Sphere(name="point", radius=0.01, position=at)]))
    far = [d for d, pair in zip(point.distances(q), point.pairs, strict=True) if "point" in pair]
    assume((size := 0.01 + min(far) - gap) > 0.0)
    stands = Sphere(name="stands", radius=size, position=at)
    world = World(panda, Scene([stands, Sphere(name="comes", radius=0.08, position=(0, 0, 9.0))]))
    evasion = Evasion(world, pairs := ActivePairs(world), 0.0)
    world.move_obstacle("comes", (0.0, 0.0, 5.0), velocity=(0.0, 0.0, -1.0))
    assert evasion.is_needed()
    sample = world.clearance(q)
    nearest = int(sample.distance.argmin())
    slope = sample.gradient[nearest]
    assert sample.distance[nearest] == pytest.approx(gap, abs=1e-6)
    for _ in range(2):  # since the first call tells how far pairs are to be awake
        pairs.update(q)
        found, _ = evasion.velocity(q, v, -0.05 * slope / np.linalg.norm(slope))
    fastest = float(np.abs(slope) @ (0.9 * panda.limits.acceleration / EVADING_GAIN))
    assert slope @ found >= min(10.0 * (1e-3 - gap), fastest) - 1e-6


@pytest.fixture(scope="module")
def crossing_runs() -> dict[type[Evasion], Run]:
    """A ball of 1 m/s that would hit the moving Panda, with and without what evades it."""
    trial = draw_trial(load_arm("panda", shapes="capsule"), 1, 1.0, 1)
    start = trial.arm.configurations(trial.motion.position[0])
    runs = {}
    for evasion in (Evasion, Blind):
        world = World(trial.arm, trial.scene)
        controller = DensityTracking(world, trial.motion, evasion=evasion)
        runs[evasion] = simulate(world, controller, start)
    return runs


@pytest.mark.slow
def test_a_ball_that_crosses_is_evaded_and_the_run_is_proved(
    crossing_runs: dict[type[Evasion], Run],
) -> None:
    run = crossing_runs[Evasion]
    assert (run.outcome, run.detail) == (Outcome.REACHED, "")
    assert run.clearance.min() > 0.005
    assert run.certified


@pytest.mark.slow
def test_the_same_ball_hits_an_arm_that_does_not_see_it(
    crossing_runs: dict[type[Evasion], Run],
) -> None:
    assert crossing_runs[Blind].outcome == Outcome.COLLIDED


@pytest.mark.slow
@pytest.mark.parametrize(
    ("scenario", "clearance"), [("panda_crossing", 0.012), ("panda_shared_table", 0.045)]
)
def test_scenarios_among_what_moves_are_certified(
    catalogue_run: Callable[[str], Run], scenario: str, clearance: float
) -> None:
    run = catalogue_run(scenario)
    assert (run.outcome, run.detail, run.replanned_at) == (Outcome.REACHED, "", ())
    assert run.clearance.min() > clearance
    assert run.certified


@pytest.mark.slow
@pytest.mark.parametrize("keeps", [True, False])
def test_accelerations_keep_their_limits_where_the_rate_of_torques_binds(
    keeps: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A torque that changes along the straight way to the one that is wanted does not."""
    trial = draw_trial(load_arm("panda", shapes="capsule"), 4, 1.0, 8)
    arm, world = trial.arm, World(trial.arm, trial.scene)
    if not keeps:

        def straight(
            _: Evasion, dynamics: InverseDynamics, wanted: Array, ahead: Array | None = None
        ) -> None:
            ahead = np.zeros(arm.nv) if ahead is None else ahead
            a = EVADING_GAIN * (wanted - dynamics.rows[AHEAD_VELOCITY]) + ahead
            most = HELD_SHARE * arm.limits.acceleration
            held = dynamics.mass_matrix() @ np.clip(a, -most, most) + dynamics.arrays[1]
            effort = arm.limits.effort
            dynamics.send(np.clip(held - dynamics.rows[DISTURBANCE], -effort, effort))

        monkeypatch.setattr(Evasion, "send_torque", straight)
    controller, plant = DensityTracking(world, trial.motion), PinocchioPlant(arm, 0.001)
    q, v, torques = arm.configurations(trial.motion.position[0]), np.zeros(arm.nv), list[Array]()
    fastest = 0.0
    for k in range(600):
        world.set_time(0.001 * k)
        tau = controller.torque(0.001 * k, q, v)
        torques.append(tau - arm.nonlinear_effects(q, np.zeros(arm.nv)))
        q, after = plant.step(q, v, tau)
        fastest = max(fastest, float((np.abs(after - v) / arm.limits.acceleration).max() / 0.001))
        v = after
    assert (fastest <= 1.0) == keeps
    assert np.abs(np.diff(torques, axis=0)).max() <= 1.0 + 1e-9


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 10**6), moved=st.floats(0.0, 2.0))
def test_the_torque_that_is_sent_has_the_nearest_accelerations_that_limits_and_rates_allow(
    with_ball: World, seed: int, moved: float
) -> None:
    """Joint 2 near its torque limit, or a torque sent before that was for something else."""
    arm, random = with_ball.arm, np.random.default_rng(seed)
    evasion = Evasion(with_ball, ActivePairs(with_ball), 0.0, PLAIN)
    dynamics = InverseDynamics(arm, np.full(arm.nv, np.inf))
    q = arm.configurations(random.uniform(arm.limits.lower, arm.limits.upper))
    v = 0.3 * random.uniform(-1.0, 1.0, arm.nv) * arm.limits.velocity
    dynamics.update(0.0, q, v)
    gravity = arm.nonlinear_effects(q, np.zeros(arm.nv))
    before = gravity + moved * random.uniform(-1.0, 1.0, arm.nv)
    before = dynamics.send(np.clip(before, -arm.limits.effort, arm.limits.effort))
    dynamics.update(0.001, q, v)
    wanted, most = v + random.uniform(-0.5, 0.5, arm.nv), HELD_SHARE * arm.limits.acceleration
    evasion.send_torque(dynamics, wanted)
    tau, mass = dynamics.rows[TORQUE], arm.mass_matrix(q)
    step = 0.001 * arm.limits.torque_rate
    low = np.maximum(-arm.limits.effort, before - step)
    high = np.minimum(arm.limits.effort, before + step)
    assert ((low - 1e-9 <= tau) & (tau <= high + 1e-9)).all()
    offset = arm.nonlinear_effects(q, v) - dynamics.disturbance
    share = np.linalg.solve(mass, tau - offset) / most
    aim = np.clip(EVADING_GAIN * (wanted - dynamics.velocity) / most, -1.0, 1.0)
    upper, lower = (
        np.append(np.ones(arm.nv), high - offset),
        np.append(-np.ones(arm.nv), low - offset),
    )
    best, _, flag, _ = daqp.solve(np.eye(arm.nv), -aim, mass * most, upper, lower)
    assume(flag > 0)  # some torque keeps all limits of acceleration
    np.testing.assert_allclose(share, best, atol=0.02)


@pytest.mark.slow
def test_what_comes_into_the_way_and_stays_is_planned_around(tmp_path: Path) -> None:
    file = tmp_path / "stays.toml"
    file.write_text(
        """
        [robot]
        name = "panda"

        [task]
        start = [0.418, 0.214, 0.207, -1.868, -0.05, 2.077, 1.43]
        goal = [-0.395, 0.287, -0.167, -1.248, 0.047, 1.532, 0.232]

        [[obstacles]]
        type = "sphere"
        name = "ball"
        radius = 0.1

        [obstacles.motion]
        type = "waypoints"
        times = [0.0, 0.6]
        positions = [[1.3, 0.05, 0.45], [0.6, 0.0, 0.45]]
        """
    )
    run = densarm.run(file)
    assert run.outcome == Outcome.REACHED
    assert len(run.replanned_at) == 1
    assert run.replanned_at[0] > 0.6
    assert run.clearance.min() > 0.02


@pytest.mark.slow
def test_regulation_evades_a_ball_that_would_hit_it() -> None:
    trial = draw_trial(load_arm("panda", shapes="capsule"), 1, 1.0, 2)
    start, goal = trial.arm.configurations(trial.motion.position[[0, -1]])
    runs = []
    for evasion in (Blind, Evasion):
        world = World(trial.arm, trial.scene)
        controller = DensityRegulation(world, goal, evasion=evasion)
        runs.append(simulate(world, controller, start))
    blind, seeing = runs
    assert blind.outcome == Outcome.COLLIDED
    assert (seeing.outcome, seeing.detail) == (Outcome.REACHED, "")
    assert seeing.clearance.min() > 0.0
    assert (np.abs(seeing.tau) <= trial.arm.limits.effort).all()


@pytest.mark.slow
def test_evading_stays_inside_the_limits(crossing_runs: dict[type[Evasion], Run]) -> None:
    run, limits = crossing_runs[Evasion], crossing_runs[Evasion].task.arm.limits
    assert (np.abs(run.tau) <= limits.effort).all()
    assert (np.abs(run.v) <= 1.02 * limits.velocity).all()
    gravity = np.array(
        [run.task.arm.nonlinear_effects(q, 0.0 * v) for q, v in zip(run.q, run.v, strict=True)]
    )
    change = np.abs(np.diff(run.tau - gravity, axis=0))
    assert (change <= 1e-3 * limits.torque_rate + 1e-9).all()


def test_nothing_is_asked_where_nothing_moves(panda: Arm, panda_swing: Motion) -> None:
    scene = Scene([Sphere(name="ball", radius=0.08, position=(0.9, 0.0, 0.9))])
    torques = []
    for evasion in (Unasked, Evasion):
        tracking = DensityTracking(World(panda, scene), panda_swing, evasion=evasion)
        q, v = panda.configurations(panda_swing.position[0] + 0.01), np.zeros(panda.nv)
        torques.append([tracking.torque(0.001 * k, q, v) for k in range(20)])
    np.testing.assert_array_equal(torques[0], torques[1])


def test_an_arm_at_rest_is_left_alone_by_what_passes_far_away(
    panda: Arm, panda_swing: Motion
) -> None:
    away = ConstantVelocity(linear=(0.0, 0.0, 1.0))
    far = Sphere(name="ball", radius=0.08, position=(3.0, 0.0, 0.0), motion=away)
    q, v = panda.configurations(panda_swing.position[0]), np.zeros(panda.nv)
    moving, without = (
        DensityTracking(World(panda, Scene(obstacles)), panda_swing) for obstacles in ([far], [])
    )
    assert np.allclose(moving.torque(0.0, q, v), without.torque(0.0, q, v), atol=1e-9)


@pytest.mark.parametrize("key", ["distance", "decay", "margin", "reaction", "horizon", "miss"])
def test_a_negative_parameter_is_refused(key: str) -> None:
    with pytest.raises(InvalidValueError, match=key):
        EvasionParameters(**{key: -1.0})
