"""Torques of many states are those of each."""

import numpy as np
import pytest

from densarm.arm import load_arm
from densarm.joint_torques import JointTorques


@pytest.mark.parametrize("name", ["two_link", "panda"])
@pytest.mark.parametrize("shape", [(), (1,), (5,), (2, 3)])
def test_equation_of_motion(name, shape):
    arm, rng = load_arm(name), np.random.default_rng(1)
    angles, v, a = (rng.uniform(-1.0, 1.0, (*shape, arm.nv)) for _ in range(3))
    torque = JointTorques(arm)(arm.configurations(angles), v, a)
    assert torque.shape == v.shape
    for index in np.ndindex(*shape):
        q = arm.configuration(angles[index])
        expected = arm.mass_matrix(q) @ a[index] + arm.nonlinear_effects(q, v[index])
        np.testing.assert_allclose(torque[index], expected, rtol=1e-9, atol=1e-9)


def test_one_joint():
    arm = load_arm("two_link", locked_joints={"elbow": 0.0})
    q = np.tile(arm.configuration([0.3]), (4, 1))
    torque = JointTorques(arm)(q, np.zeros((4, 1)), np.ones((4, 1)))
    assert torque.shape == (4, 1)
    assert np.ptp(torque) <= 1e-12
