"""Holding torque: what the joints need to hold an arm still."""

import numpy as np
import pinocchio as pin

from densarm.arm import Arm
from densarm.arrays import Array


def holding_ratios(arm: Arm, q: Array) -> Array:
    """Return the torque that holds the arm at q (nq,), in units of the limits (nv,)."""
    return np.asarray(np.abs(_torque(arm, q)) / arm.limits.effort)


def holding_torque(arm: Arm, q: Array) -> str:
    """Return, as a phrase, what holding the arm at q (nq,) asks of the joint nearest its limit."""
    joint = int(holding_ratios(arm, q).argmax())
    where = ", ".join(f"{angle:.4g}" for angle in arm.angles(q))
    slides = "P" in arm.model.joints[joint + 1].shortname().removeprefix("JointModel")[:1]
    unit = "N" if slides else "N·m"
    return (
        f"joint {arm.joint_names[joint]!r} needs {abs(_torque(arm, q)[joint]):.4g} {unit} to hold "
        f"the arm at joint positions ({where}), and has {arm.limits.effort[joint]:.4g}"
    )


def _torque(arm: Arm, q: Array) -> Array:
    return np.array(pin.computeGeneralizedGravity(arm.model, arm.data, q))
