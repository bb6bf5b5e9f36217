"""Units of joint positions, for the labels of plots."""

from densarm.arm import Arm


def joint_unit(arm: Arm, joint: int) -> str:
    """Return the unit of a joint's position: "m" where it slides, else "rad"."""
    kind = arm.model.joints[joint + 1].shortname().removeprefix("JointModel")
    return "m" if kind.startswith("P") else "rad"
