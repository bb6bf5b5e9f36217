"""Holding torque: the joint that is nearest to its limit, in words."""

import numpy as np
import pytest

from densarm.arm import load_arm
from densarm.holding_torque import holding_ratios, holding_torque


def test_a_stretched_arm():
    """Two uniform rods of 1 m and 1 kg, held out level."""
    arm = load_arm("two_link")
    q = arm.configuration([np.pi / 2, 0.0])
    torque = 9.81 * np.array([0.5 + 1.5, 0.5])
    np.testing.assert_allclose(holding_ratios(arm, q), torque / arm.limits.effort, rtol=1e-3)
    phrase = holding_torque(arm, q)
    assert phrase.startswith("joint 'shoulder' needs 19.62 N·m to hold the arm")
    assert phrase.endswith("(1.571, 0), and has 60")


def test_hanging_it_needs_nothing():
    arm = load_arm("two_link")
    assert holding_ratios(arm, arm.postures["hanging"]) == pytest.approx([0.0, 0.0], abs=1e-9)
