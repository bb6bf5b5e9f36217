"""Torques of many states are those of each; what holding takes, by the joint nearest its limit."""

import numpy as np
import pytest

from densarm.arms.arm import load_arm
from densarm.arms.dynamics import JointTorques, holding_ratios, holding_torque


@pytest.mark.parametrize("name", ["two_link", "panda"])
@pytest.mark.parametrize("shape", [(), (1,), (5,), (2, 3)])
def test_equation_of_motion(name: str, shape: tuple[int, ...]) -> None:
    arm, rng = load_arm(name), np.random.default_rng(1)
    angles, v, a = (rng.uniform(-1.0, 1.0, (*shape, arm.nv)) for _ in range(3))
    torque = JointTorques(arm)(arm.configurations(angles), v, a)
    assert torque.shape == v.shape
    for index in np.ndindex(*shape):
        q = arm.configuration(angles[index])
        expected = arm.mass_matrix(q) @ a[index] + arm.nonlinear_effects(q, v[index])
        np.testing.assert_allclose(torque[index], expected, rtol=1e-9, atol=1e-9)


def test_one_joint() -> None:
    arm = load_arm("two_link", locked_joints={"elbow": 0.0})
    q = np.tile(arm.configuration([0.3]), (4, 1))
    torque = JointTorques(arm)(q, np.zeros((4, 1)), np.ones((4, 1)))
    assert torque.shape == (4, 1)
    assert np.ptp(torque) <= 1e-12


def test_a_stretched_arm() -> None:
    """Two uniform rods of 1 m and 1 kg, held out level."""
    arm = load_arm("two_link")
    q = arm.configuration([np.pi / 2, 0.0])
    torque = 9.81 * np.array([0.5 + 1.5, 0.5])
    np.testing.assert_allclose(holding_ratios(arm, q), torque / arm.limits.effort, rtol=1e-3)
    phrase = holding_torque(arm, q)
    assert phrase.startswith("joint 'shoulder' needs 19.62 N·m to hold the arm")
    assert phrase.endswith("(1.571, 0), and has 60")


def test_hanging_it_needs_nothing() -> None:
    arm = load_arm("two_link")
    assert holding_ratios(arm, arm.postures["hanging"]) == pytest.approx([0.0, 0.0], abs=1e-9)
