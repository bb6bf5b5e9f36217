"""Joint spaces of any joints, an obstacle in the plane, and the two-link arm between its balls."""

from collections.abc import Callable, Sequence
from functools import cache

import numpy as np
import pytest

from densarm.arms.arm import Arm
from densarm.arms.description import RobotDescription
from densarm.values.arrays import Array

NO_LIMIT = 1e15  # [m], which an arm takes for none
KINDS = {"b": "prismatic", "c": "continuous"}
LINK = """<link name="{name}"><inertial><mass value="1"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>{body}</link>"""
BALL = '<collision><geometry><sphere radius="0.1"/></geometry></collision>'
JOINT = """<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>
<axis xyz="{axis}"/><limit lower="{lower}" upper="{upper}" effort="50" velocity="1"/></joint>"""


@cache
def _joints(kinds: str, lower: tuple[float, ...], upper: tuple[float, ...]) -> Arm:
    text = LINK.format(name="link0", body=BALL)
    for k, kind in enumerate(kinds):
        text += LINK.format(name=f"link{k + 1}", body="")
        text += JOINT.format(
            name=f"joint{k + 1}",
            kind=KINDS[kind],
            parent=f"link{k}",
            child=f"link{k + 1}",
            axis="0 0 1",
            lower=lower[k] if lower else -NO_LIMIT,
            upper=upper[k] if upper else NO_LIMIT,
        )
    return Arm(RobotDescription(name="joints", urdf=f'<robot name="joints">{text}</robot>'))


@pytest.fixture(scope="session")
def joint_space() -> Callable[..., Arm]:
    """Return arms by one letter per joint, b(ounded) or c(ontinuous), and their limits, if any."""

    def make(kinds: str, lower: Sequence[float] = (), upper: Sequence[float] = ()) -> Arm:
        return _joints(kinds, tuple(lower), tuple(upper))

    return make


@pytest.fixture(scope="session")
def ball_on_slides() -> Arm:
    """A ball of 0.1 m that two slides carry in a plane, which is its joint space."""
    links = LINK.format(name="base", body="") + LINK.format(name="bridge", body="")
    joints = [("along", "base", "bridge", "1 0 0"), ("across", "bridge", "ball", "0 1 0")]
    slides = "".join(
        JOINT.format(
            name=name, kind="prismatic", parent=parent, child=child, axis=axis, lower=-1, upper=1
        )
        for name, parent, child, axis in joints
    )
    urdf = f'<robot name="slides">{links}{LINK.format(name="ball", body=BALL)}{slides}</robot>'
    return Arm(RobotDescription(name="slides", urdf=urdf))


def central_difference(
    function: Callable[[Array], float],
    q: Array,
    nv: int,
    integrate: Callable[[Array, Array], Array] = np.add,
    step: float = 1e-6,
) -> Array:
    return np.array(
        [
            (function(integrate(q, axis)) - function(integrate(q, -axis))) / (2 * step)
            for axis in step * np.eye(nv)
        ]
    )


@pytest.fixture(scope="session")
def numerical_gradient() -> Callable[..., Array]:
    """Return the gradient of a scalar function along `integrate`, by central differences."""
    return central_difference


@pytest.fixture(scope="session")
def disc() -> tuple[Callable[[Array], tuple[float, Array]], Callable[[Array], tuple[float, Array]]]:
    """h and s of the disc of radius 1 with sensing radius 2, on a squared scale."""

    def squared_radius(offset: float) -> Callable[[Array], tuple[float, Array]]:
        return lambda x: (float(x @ x - offset), 2.0 * x)

    return squared_radius(1.0), squared_radius(4.0)
