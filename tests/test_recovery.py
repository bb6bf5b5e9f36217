"""An arm that is pushed off its plan: stopped, and planned for again from where it rests."""

import numpy as np

import densarm
from densarm.simulation.plant import PinocchioPlant
from densarm.trajectory import Trajectory


class PushedPlant(PinocchioPlant):
    """Adds a push to the torque for a fifth of a second."""

    steps = 0

    def step(self, q, v, u):
        time = self.steps * self.dt
        self.steps += 1
        push = np.array([40.0, -20.0])  # N·m
        return super().step(q, v, u + push * (0.5 <= time < 0.7))


def test_an_arm_pushed_off_its_plan_reaches_the_goal(monkeypatch, tmp_path):
    monkeypatch.setattr("densarm.closed_loop.PinocchioPlant", PushedPlant)
    run = densarm.simulate(densarm.load_scenario("swing_up"))
    assert run.outcome == densarm.Outcome.REACHED
    assert (run.clearance > 0.0).all()
    assert len(run.replanned_at) == 1
    assert 0.5 < run.replanned_at[0] < run.time[-1]
    at_rest = np.abs(run.v[round(run.replanned_at[0] / 0.001)])
    assert (at_rest <= 1e-3).all()
    assert run.tracking_error is None
    run.save(tmp_path / "run.npz")
    assert Trajectory.load(tmp_path / "run.npz").replanned_at == run.replanned_at


def test_an_arm_that_nothing_pushes_keeps_its_plan(swing_up_run):
    assert swing_up_run.replanned_at == ()
