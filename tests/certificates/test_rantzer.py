"""Rantzer's condition along a run is that of the plain density, and never a verdict."""

from dataclasses import replace

import numpy as np
import pytest

import densarm
from densarm.certificates import record_rantzer
from densarm.scene import Scene, Sphere

ANGLES = np.array([[0.3, -0.2], [2.0, 0.4], [1.2, 0.9]])


@pytest.fixture(scope="module")
def free():
    """The two-link arm without obstacles, its goal hanging."""
    swing_up = densarm.load_scenario("swing_up")
    goal = swing_up.arm.configuration((0.0, 0.0))
    return replace(swing_up, scene=Scene([]), goal=goal)


def laplacian(angles):
    """Δ ln ρ = ‖∇V‖²/V² - ΔV/V for V = Π (2 - cos e_i) - 1."""
    bump, slope, curve = 2.0 - np.cos(angles), np.sin(angles), np.cos(angles)
    other = bump[::-1]
    V = np.prod(bump) - 1.0
    return np.sum((slope * other) ** 2) / V**2 - np.sum(curve * other) / V


def test_values_are_the_closed_form_of_free_space(free):
    result = record_rantzer(free, free.arm.configurations(ANGLES))
    values = np.array([laplacian(angles) for angles in ANGLES])
    assert result.samples == len(ANGLES)
    assert result.share == pytest.approx(np.mean(values >= 0.0))
    assert 0.0 < result.share < 1.0
    assert result.smallest == pytest.approx(values.min(), rel=1e-5)
    assert result.time == pytest.approx(values.argmin() * free.simulation.dt)


def test_gauge_changes_the_sign(free):
    log = replace(free.density, gauge="log", blend_radius=0.1)
    scenario = replace(free, density=log, control=replace(free.control, form="regulation"))
    q = free.arm.configurations(ANGLES)
    result = record_rantzer(scenario, q)
    assert result.gauge == "log"
    assert result.smallest > record_rantzer(free, q).smallest


def test_goal_and_contact_are_left_out(free):
    q = free.arm.configurations(np.array([[0.005, 0.0], [0.5, 0.0], [0.0, 0.0]]))
    assert record_rantzer(free, q).samples == 1
    tip = (2.0 * np.sin(0.5), 0.0, -2.0 * np.cos(0.5))
    blocked = replace(free, scene=Scene([Sphere(name="ball", radius=0.1, position=tip)]))
    result = record_rantzer(blocked, q)
    assert (result.samples, result.share, result.smallest) == (0, None, None)


def test_long_runs_are_looked_at_now_and_then(free):
    q = free.arm.configurations(np.linspace([0.1, 0.1], [1.0, 1.0], 1000))
    assert 5 <= record_rantzer(free, q).samples <= 6
