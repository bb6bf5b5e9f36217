"""Compiled forward kinematics agrees with Pinocchio's."""

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st

from densarm.arm import Arm, load_arm
from densarm.proof.link_placements import joint_chain, write_placements

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
    rotation, translation = (np.empty((arm.model.njoints, *shape)) for shape in ((3, 3), (3,)))
    write_placements(joint_chain(arm.model), angles, step, share, rotation, translation)
    for joint, expected in enumerate(arm.data.oMi):
        np.testing.assert_allclose(rotation[joint], expected.rotation, atol=1e-13)
        np.testing.assert_allclose(translation[joint], expected.translation, atol=1e-13)
