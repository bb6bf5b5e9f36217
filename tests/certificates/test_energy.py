"""The energy of a regulated run falls, and where it cannot be asked the reason is told."""

from dataclasses import replace

import numpy as np
import pytest

import densarm
from densarm.arm import Arm
from densarm.certificates import EnergyVerdict, record_energy
from densarm.certificates.plain_density import plain_density
from densarm.control.gains import Gains
from densarm.density.gauge import Gauge
from densarm.scene import Scene, Sphere
from densarm.simulation.plant import PinocchioPlant

START = (0.05, -0.03)
NEAR = Sphere(name="near", radius=0.1, position=(0.25, 0.0, -1.9))


def regulation(swing_up, obstacles=(), **simulation):
    """A soft motion to hanging of an arm whose acceleration has no limit to speak of."""
    arm = Arm(replace(swing_up.arm.description, acceleration=(1e4, 1e4)))
    return replace(
        swing_up,
        arm=arm,
        scene=Scene(obstacles),
        start=arm.configuration(START),
        goal=arm.configuration((0.0, 0.0)),
        control=replace(swing_up.control, form="regulation", guide="direct"),
        gains=Gains(position=25.0, velocity=10.0),
        simulation=replace(swing_up.simulation, **simulation),
    )


def record(run):
    return record_energy(run.scenario, run.q, run.v, run.tau)


@pytest.fixture(scope="module")
def swing_up():
    return densarm.load_scenario("swing_up")


@pytest.fixture(scope="module")
def free_run(swing_up):
    return densarm.simulate(regulation(swing_up, time_limit=0.5))


def unlimited_run(scenario, steps):
    """States and torques under the law itself, with neither speed law nor guard."""
    arm, gains, p = scenario.arm, scenario.gains, scenario.simulation
    density, plant = plain_density(scenario), PinocchioPlant(arm, p.dt, p.integrator)
    q, v, states = scenario.start, np.zeros(arm.nv), []
    for _ in range(steps):
        gradient = density.evaluate(q).gradient(Gauge.RECIPROCAL)
        acceleration = gains.position * gradient - gains.velocity * v
        tau = arm.mass_matrix(q) @ acceleration + arm.nonlinear_effects(q, v)
        states.append((q, v, tau))
        q, v = plant.step(q, v, tau)
    return [np.array(column) for column in zip(*states, strict=True)]


def test_energy_falls_from_its_closed_form_in_free_space(free_run):
    """There 1/ρ = V = κ (Π (1 + (1 - cos e_i)/κ) - 1), κ = 1."""
    result = record(free_run)
    first = np.prod(2.0 - np.cos(START)) - 1.0
    assert result.verdict == EnergyVerdict.HOLDS
    assert f"from {first:.3g} to" in result.detail
    assert 50 <= result.samples <= 100
    assert result.largest_rise <= 0.0


def test_energy_falls_beside_an_obstacle(swing_up):
    near = regulation(swing_up, [NEAR])
    run = unlimited_run(near, 300)
    free = unlimited_run(regulation(swing_up), 1)
    assert not np.allclose(run[2][0], free[2][0])  # the obstacle is sensed
    assert record_energy(near, *run).verdict == EnergyVerdict.HOLDS


def test_a_step_too_long_for_the_gain_makes_energy_grow(swing_up):
    """v⁺ ≈ (1 - K_v Δt) v = -1.6 v."""
    scenario = regulation(swing_up, dt=0.26, time_limit=0.78)
    result = record(densarm.simulate(scenario))
    assert result.verdict == EnergyVerdict.VIOLATED
    assert result.largest_rise > 0.01


def test_a_torque_that_is_not_the_laws_is_told(free_run):
    tau = free_run.tau.copy()
    tau[:300, 1] += 1e-3
    result = record(replace(free_run, tau=tau))
    assert result.verdict == EnergyVerdict.NOT_APPLICABLE
    assert "shaped the torque" in result.detail


@pytest.mark.parametrize(
    ("table", "changes", "reason"),
    [
        ("control", {"form": "tracking"}, "'tracking'"),
        ("control", {"guide": "path"}, "sub-goals"),
        ("density", {"gauge": "log", "blend_radius": 0.1}, "gauge 'log'"),
        ("density", {"theta": 1e-3}, "theta"),
        ("density", {"blend_radius": 0.1}, "blend_radius"),
    ],
)
def test_other_runs_are_not_asked(free_run, table, changes, reason):
    scenario = free_run.scenario
    scenario = replace(scenario, **{table: replace(getattr(scenario, table), **changes)})
    result = record(replace(free_run, scenario=scenario))
    assert (result.verdict, result.samples) == (EnergyVerdict.NOT_APPLICABLE, 0)
    assert reason in result.detail


def test_a_fast_run_is_limited(swing_up):
    arm = swing_up.arm
    scenario = replace(regulation(swing_up), arm=arm, gains=Gains())
    scenario = replace(scenario, start=arm.configuration((0.6, 0.0)))
    result = record(densarm.simulate(scenario))
    assert result.verdict == EnergyVerdict.NOT_APPLICABLE
    assert "limits or the speed law" in result.detail


def test_an_arm_that_never_moved(free_run):
    rows = {name: getattr(free_run, name)[:1] for name in ("q", "v", "tau")}
    assert record(replace(free_run, **rows)).detail == "no motion"


def test_a_rise_beyond_the_doubles_is_no_number(free_run):
    """What is recorded can be written as JSON, however wild the run."""
    arm, gains = free_run.scenario.arm, free_run.scenario.gains
    q = np.tile(free_run.scenario.goal, (3, 1))
    v = np.array([[1e-160, 0.0], [1e100, 0.0], [0.0, 0.0]])
    tau = np.array(
        [
            arm.nonlinear_effects(q[k], v[k]) - gains.velocity * arm.mass_matrix(q[k]) @ v[k]
            for k in range(3)
        ]
    )
    result = record_energy(free_run.scenario, q, v, tau)
    assert (result.verdict, result.largest_rise) == (EnergyVerdict.VIOLATED, None)
