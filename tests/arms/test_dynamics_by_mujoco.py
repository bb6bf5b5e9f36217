"""M(q) and H(q, v) against MuJoCo, an engine that shares no code with Pinocchio."""

import xml.etree.ElementTree as ElementTree
from typing import Any

import numpy as np
import pytest

from densarm.arms.arm import Arm, load_arm
from densarm.values.arrays import Array

mujoco = pytest.importorskip("mujoco")


def in_mujoco(arm: Arm) -> tuple[Any, Any]:
    """The arm's URDF without its geometry, as MuJoCo reads it."""
    root = ElementTree.fromstring(arm.description.urdf)
    for link in root.iter("link"):
        for item in [*link.findall("visual"), *link.findall("collision")]:
            link.remove(item)
    extension = ElementTree.SubElement(root, "mujoco")
    ElementTree.SubElement(extension, "compiler", fusestatic="false")
    model = mujoco.MjModel.from_xml_string(ElementTree.tostring(root, encoding="unicode"))
    return model, mujoco.MjData(model)


def mass_matrix_and_bias(
    model: Any, data: Any, arm: Arm, angles: Array, v: Array
) -> tuple[Array, Array]:
    columns = [model.joint(name).dofadr[0] for name in arm.joint_names]
    data.qpos[:] = data.qvel[:] = 0.0
    for name, position in arm.description.locked_joints.items():
        data.joint(name).qpos[0] = position
    for name, position, velocity in zip(arm.joint_names, angles, v, strict=True):
        data.joint(name).qpos[0], data.joint(name).qvel[0] = position, velocity
    mujoco.mj_forward(model, data)
    full = np.zeros((model.nv, model.nv))
    for row, unit in zip(full, np.eye(model.nv), strict=True):
        mujoco.mj_mulM(model, data, row, unit)
    return full[np.ix_(columns, columns)], data.qfrc_bias[columns]


@pytest.mark.parametrize("name", ["two_link", "panda"])
def test_mass_matrix_and_nonlinear_effects(name: str) -> None:
    arm = load_arm(name)
    model, data = in_mujoco(arm)
    random = np.random.default_rng(0)
    for _ in range(100):
        angles, v = random.uniform(-2.0, 2.0, (2, arm.nv))
        q = arm.configuration(angles)
        mass, bias = mass_matrix_and_bias(model, data, arm, angles, v)
        np.testing.assert_allclose(arm.mass_matrix(q), mass, rtol=0, atol=1e-10)
        np.testing.assert_allclose(arm.nonlinear_effects(q, v), bias, rtol=0, atol=1e-10)
