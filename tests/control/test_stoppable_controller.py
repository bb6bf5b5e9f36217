"""Stop at any time: no contact, limits held, a straight line, and then rest."""

import numpy as np
import pytest

import densarm
from densarm.clearance import Clearance
from densarm.control.stoppable_controller import StoppableController
from densarm.simulation import PinocchioPlant

TIMES = 8  # per scenario


class Recorded:
    """Replays the torque of a run."""

    def __init__(self, run):
        self.run = run

    def torque(self, t, q, v):  # noqa: ARG002
        return self.run.tau[round(t / 0.001)]


@pytest.fixture(scope="module", params=["swing_up", "panda_table", "panda_shelf"])
def run(request):
    if request.param == "swing_up":
        return request.getfixturevalue("swing_up_run")
    return densarm.simulate(densarm.load_scenario(request.param))


def stopped(run, begin):
    """States after a stop at a sample of a run, and their torques."""
    scenario = run.scenario
    simulation = scenario.simulation
    plant = PinocchioPlant(scenario.arm, simulation.dt, simulation.integrator)
    controller = StoppableController(
        scenario.arm, Recorded(run), scenario.gains, simulation.control_period
    )
    q, v, states, torques = run.q[begin], run.v[begin], [], []
    np.testing.assert_array_equal(controller.torque(run.time[begin], q, v), run.tau[begin])
    assert not controller.is_stopping
    controller.stop()
    assert controller.is_stopping
    for k in range(700):
        tau = controller.torque(run.time[begin] + k * simulation.dt, q, v)
        states.append((q, v))
        torques.append(tau)
        q, v = plant.step(q, v, tau)
    return np.array([s[0] for s in states]), np.array([s[1] for s in states]), np.array(torques)


def test_stop_at_any_time(run):
    arm, dt = run.scenario.arm, run.scenario.simulation.dt
    clearance = Clearance(arm, run.scenario.scene)
    for begin in np.linspace(0, len(run.q) - 2, TIMES).astype(int):
        q, v, tau = stopped(run, begin)
        assert min(clearance.distances(x).min() for x in q[::20]) > 0.0
        assert (np.abs(v) <= arm.limits.velocity).all()
        assert (np.abs(np.diff(v, axis=0)) / dt <= arm.limits.acceleration * (1 + 1e-9)).all()
        assert (np.abs(tau) <= arm.limits.effort).all()
        assert np.abs(v[-1]).max() < 1e-6
        path, direction = arm.difference(q[:1], q), v[0] / max(np.linalg.norm(v[0]), 1e-9)
        off = path - np.outer(path @ direction, direction)
        assert np.abs(off).max() < 1e-3
        assert np.abs(arm.difference(q[-100], q[-1])).max() < 1e-6
