"""Compiled forward kinematics agrees with Pinocchio's."""

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st

from densarm.arm import Arm, load_arm
from densarm.proof.link_placements import joint_table, pose_row, write_joint_poses

BRANCHING = Path(__file__).parents[1] / "data" / "branching.urdf"
BASE = pin.SE3(pin.rpy.rpyToMatrix(0.3, -0.7, 2.0), np.array([0.4, -0.2, 0.9]))
POSITIONS = st.tuples(*[st.floats(-4.0, 4.0)] * 7)
ARMS = {
    "panda": lambda: load_arm("panda"),
    "branching, placed": lambda: load_arm(BRANCHING, base_placement=BASE),
}


@pytest.fixture(scope="module", params=ARMS)
def arm(request) -> Arm:
    return ARMS[request.param]()


@given(angles=POSITIONS, step=POSITIONS, share=st.floats(0.0, 1.0))
def test_agrees_with_pinocchio(arm, angles, step, share):
    """On revolute, continuous and prismatic joints, about any axis, in a chain and in a tree."""
    angles, step = (np.array(values)[: arm.nv] for values in (angles, step))
    pin.forwardKinematics(arm.model, arm.data, arm.configuration(angles + share * step))
    poses = np.empty((arm.model.njoints, 12))
    write_joint_poses(*joint_table(arm.model), angles, step, share, poses)
    expected = [pose_row(placement) for placement in arm.data.oMi]
    np.testing.assert_allclose(poses, expected, atol=1e-13)
