"""Records beside a certificate: energy that falls, and Rantzer's condition; never a verdict."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from densarm.arms.arm import Arm
from densarm.certificates.records import (
    EnergyRecord,
    EnergyVerdict,
    RantzerRecord,
    record_energy,
    record_rantzer,
)
from densarm.control.controller import Gains
from densarm.density.navigation_density import (
    Gauge,
    NavigationDensity,
    density_towards,
)
from densarm.scenarios.control import ControlForm
from densarm.scenarios.run import run
from densarm.scenarios.scenario import Scenario
from densarm.scene.obstacles import Obstacle, Sphere
from densarm.scene.scene import Scene
from densarm.simulation.plants import PinocchioPlant
from densarm.simulation.run import Run
from densarm.values.arrays import Array

START = (0.05, -0.03)
NEAR = Sphere(name="near", radius=0.1, position=(0.25, 0.0, -1.9))
SOFT = Gains(position=25.0, velocity=10.0)


def regulation(swing_up: Scenario, *obstacles: Obstacle, **simulation: Any) -> Scenario:
    """A soft motion to hanging of an arm without limits of acceleration and rates to speak of."""
    arm = Arm(replace(swing_up.arm.description, acceleration=(1e4, 1e4), torque_rate=np.inf))
    return replace(
        swing_up,
        arm=arm,
        scene=Scene(obstacles),
        start=arm.configuration(START),
        goal=arm.configuration((0.0, 0.0)),
        control=replace(swing_up.control, form=ControlForm.REGULATION, guide="direct"),
        gains=SOFT,
        simulation=replace(swing_up.simulation, **simulation),
    )


def density_of(scenario: Scenario, **changes: Any) -> NavigationDensity:
    parameters = replace(scenario.density, **changes)
    return density_towards(scenario.world, scenario.goal, parameters=parameters)


def energy_of(run: Run, gains: Gains = SOFT, **changes: Any) -> EnergyRecord:
    density = density_of(Scenario.of_task(run.task), **changes)
    return record_energy(run.task, density, gains, run.q, run.v, run.tau)


@pytest.fixture(scope="module")
def free_run(swing_up: Scenario) -> Run:
    return run(regulation(swing_up, time_limit=0.2))


def unlimited_run(scenario: Scenario, steps: int) -> tuple[Array, Array, Array]:
    """States and torques under the law itself, with neither speed law nor backup filter."""
    arm, gains, p = scenario.arm, scenario.law_gains, scenario.simulation
    density, plant = density_of(scenario), PinocchioPlant(arm, p.dt, p.integrator)
    q, v, states = scenario.start, np.zeros(arm.nv), []
    for _ in range(steps):
        gradient = density.evaluate(q).gradient(Gauge.RECIPROCAL)
        acceleration = gains.position * gradient - gains.velocity * v
        tau = arm.mass_matrix(q) @ acceleration + arm.nonlinear_effects(q, v)
        states.append((q, v, tau))
        q, v = plant.step(q, v, tau)
    columns = [np.array(column) for column in zip(*states, strict=True)]
    return columns[0], columns[1], columns[2]


def test_energy_falls_from_its_closed_form_in_free_space(free_run: Run) -> None:
    """There 1/ρ = V = κ (Π (1 + (1 - cos e_i)/κ) - 1), κ = 1."""
    result = energy_of(free_run)
    first = np.prod(2.0 - np.cos(START)) - 1.0
    assert result.verdict == EnergyVerdict.HOLDS
    assert f"from {first:.3g} to" in result.detail
    assert 50 <= result.samples <= 100
    assert result.largest_rise is not None
    assert result.largest_rise <= 0.0


def test_energy_falls_beside_an_obstacle(swing_up: Scenario) -> None:
    near = regulation(swing_up, NEAR)
    states = unlimited_run(near, 300)
    free = unlimited_run(regulation(swing_up), 1)
    assert not np.allclose(states[2][0], free[2][0])  # the obstacle is sensed
    result = record_energy(near.task, density_of(near), near.law_gains, *states)
    assert result.verdict == EnergyVerdict.HOLDS


def test_a_step_too_long_for_the_gain_makes_energy_grow(swing_up: Scenario) -> None:
    """v⁺ ≈ (1 - K_v Δt) v = -1.6 v."""
    result = energy_of(run(regulation(swing_up, dt=0.26, time_limit=0.78)))
    assert result.verdict == EnergyVerdict.VIOLATED
    assert result.largest_rise is not None
    assert result.largest_rise > 0.01


def test_a_torque_that_is_not_the_laws_is_told(free_run: Run) -> None:
    tau = free_run.tau.copy()
    tau[:100, 1] += 1e-3
    result = energy_of(replace(free_run, tau=tau))
    assert result.verdict == EnergyVerdict.NOT_APPLICABLE
    assert "shaped the torque" in result.detail


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"gauge": Gauge.LOG, "blend_radius": 0.1}, "gauge 'log'"),
        ({"theta": 1e-3}, "theta"),
        ({"blend_radius": 0.1}, "blend_radius"),
    ],
)
def test_other_densities_are_not_asked(free_run: Run, changes: dict[str, Any], reason: str) -> None:
    result = energy_of(free_run, **changes)
    assert (result.verdict, result.samples) == (EnergyVerdict.NOT_APPLICABLE, 0)
    assert reason in result.detail


def test_a_fast_run_is_limited(swing_up: Scenario) -> None:
    arm = swing_up.arm
    scenario = replace(regulation(swing_up), arm=arm, gains=Gains())
    scenario = replace(scenario, start=arm.configuration((0.6, 0.0)))
    result = energy_of(run(scenario), Gains())
    assert result.verdict == EnergyVerdict.NOT_APPLICABLE
    assert "limits or the speed law" in result.detail


def test_an_arm_that_never_moved(free_run: Run) -> None:
    rows: Any = {name: getattr(free_run, name)[:1] for name in ("q", "v", "tau")}
    assert energy_of(replace(free_run, **rows)).detail == "no motion"


def test_a_rise_beyond_the_doubles_is_no_number(free_run: Run) -> None:
    """What is recorded can be written as JSON, however wild the run."""
    task = free_run.task
    arm, scenario = task.arm, Scenario.of_task(task)
    q = np.tile(scenario.goal, (3, 1))
    v = np.array([[1e-160, 0.0], [1e100, 0.0], [0.0, 0.0]])
    tau = np.array(
        [
            arm.nonlinear_effects(q[k], v[k]) - SOFT.velocity * arm.mass_matrix(q[k]) @ v[k]
            for k in range(3)
        ]
    )
    result = record_energy(task, density_of(scenario), SOFT, q, v, tau)
    assert (result.verdict, result.largest_rise) == (EnergyVerdict.VIOLATED, None)


# Rantzer's condition.

ANGLES = np.array([[0.3, -0.2], [2.0, 0.4], [1.2, 0.9]])


@pytest.fixture(scope="module")
def free(swing_up: Scenario) -> Scenario:
    """The two-link arm without obstacles, its goal hanging."""
    return replace(swing_up, scene=Scene(), goal=swing_up.arm.configuration((0.0, 0.0)))


def rantzer_of(scenario: Scenario, q: Array, **changes: Any) -> RantzerRecord:
    return record_rantzer(scenario.task, density_of(scenario, **changes), q)


def laplacian(angles: Array) -> float:
    """Δ ln ρ = ‖∇V‖²/V² - ΔV/V for V = Π (2 - cos e_i) - 1."""
    bump, slope, curve = 2.0 - np.cos(angles), np.sin(angles), np.cos(angles)
    other = bump[::-1]
    V = np.prod(bump) - 1.0
    return float(np.sum((slope * other) ** 2) / V**2 - np.sum(curve * other) / V)


def test_values_are_the_closed_form_of_free_space(free: Scenario) -> None:
    result = rantzer_of(free, free.arm.configurations(ANGLES))
    values = np.array([laplacian(angles) for angles in ANGLES])
    assert result.samples == len(ANGLES)
    assert result.share == pytest.approx(np.mean(values >= 0.0))
    assert result.share is not None
    assert 0.0 < result.share < 1.0
    assert result.smallest == pytest.approx(values.min(), rel=1e-5)
    assert result.time == pytest.approx(values.argmin() * free.simulation.dt)


def test_gauge_changes_the_sign(free: Scenario) -> None:
    q = free.arm.configurations(ANGLES)
    log = rantzer_of(free, q, gauge=Gauge.LOG, blend_radius=0.1)
    reciprocal = rantzer_of(free, q)
    assert log.gauge == "log"
    assert log.smallest is not None
    assert reciprocal.smallest is not None
    assert log.smallest > reciprocal.smallest


def test_goal_and_contact_are_left_out(free: Scenario) -> None:
    q = free.arm.configurations(np.array([[0.005, 0.0], [0.5, 0.0], [0.0, 0.0]]))
    assert rantzer_of(free, q).samples == 1
    tip = (2.0 * np.sin(0.5), 0.0, -2.0 * np.cos(0.5))
    blocked = replace(free, scene=Scene([Sphere(name="ball", radius=0.1, position=tip)]))
    result = rantzer_of(blocked, q)
    assert (result.samples, result.share, result.smallest) == (0, None, None)


def test_long_runs_are_looked_at_now_and_then(free: Scenario) -> None:
    q = free.arm.configurations(np.linspace([0.1, 0.1], [1.0, 1.0], 1000))
    assert 5 <= rantzer_of(free, q).samples <= 6
