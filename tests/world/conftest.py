"""Arms that the tests of the world share, each loaded once."""

from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from densarm.arms.arm import Arm, load_arm
from densarm.arms.description import RobotDescription
from densarm.arms.free_body import free_body
from densarm.scene.mesh import Mesh
from densarm.scene.obstacles import Box, Obstacle, Sphere
from densarm.scene.scene import Attachment, Scene
from densarm.values.arrays import Array
from densarm.world.world import World

DATA = Path(__file__).parents[1] / "data"
BASE = pin.SE3(pin.rpy.rpyToMatrix(0.3, -0.7, 2.0), np.array([0.4, -0.2, 0.9]))
STICK = Attachment(Box(name="stick", size=(0.5, 0.02, 0.02), position=(0, 0, 0.1)), "panda_hand")
ARMS: dict[str, Callable[[], Arm]] = {
    "two_link": lambda: load_arm("two_link"),
    "panda": lambda: load_arm("panda"),
    "panda capsules": lambda: load_arm("panda", shapes="capsule", torque_rate=np.inf),
    "panda with a stick": lambda: load_arm("panda").holding(STICK),
    "branching": lambda: load_arm(DATA / "branching.urdf"),
    "branching, placed": lambda: load_arm(DATA / "branching.urdf", base_placement=BASE),
    "gantry": lambda: load_arm(DATA / "gantry.urdf"),
}
INERTIAL = (
    '<inertial><mass value="1"/>'
    '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
)


@pytest.fixture(scope="session")
def arm_named() -> Callable[[str], Arm]:
    """Return arms by the names of `ARMS`."""
    return cache(lambda name: ARMS[name]())


@pytest.fixture(scope="session")
def two_link(arm_named: Callable[[str], Arm]) -> Arm:
    return arm_named("two_link")


@pytest.fixture(scope="session")
def single_link() -> Callable[..., Arm]:
    """Return a maker of arms of one joint, by the shape that it moves."""

    def make(shape: str, axis: str = "0 1 0", kind: str = "revolute", origin: str = "0 0 0") -> Arm:
        urdf = f"""<robot name="single"><link name="base"/><link name="link">
          {INERTIAL}<collision><origin xyz="{origin}"/><geometry>{shape}</geometry></collision>
          </link><joint name="joint" type="{kind}"><parent link="base"/><child link="link"/>
          <axis xyz="{axis}"/><limit lower="-9" upper="9" effort="1" velocity="1"/>
          </joint></robot>"""
        return Arm(RobotDescription(name="single", urdf=urdf))

    return make


def positions_within_limits(arm: Arm, parts: Array) -> Array:
    low = np.where(arm.continuous, -np.pi, arm.limits.lower)
    high = np.where(arm.continuous, np.pi, arm.limits.upper)
    return np.asarray(low + parts[..., : arm.nv] * (high - low))


@pytest.fixture(scope="session")
def within_limits() -> Callable[[Arm, Array], Array]:
    """Return joint positions (..., nv) from their shares (..., nv or more) of an arm's ranges."""
    return positions_within_limits


@pytest.fixture(scope="session")
def nearest_to_links() -> Callable[[Array, Array], Array]:
    """Return distances (N,) [m] of a point from the centre lines of the two-link arm's links.

    Their arguments are joint positions (N, 2) [rad] and the point (3,) [m].
    """

    def nearest(angles: Array, point: Array) -> Array:
        start, distances = np.zeros((len(angles), 3)), []
        for absolute in np.cumsum(angles, axis=1).T:
            along = np.column_stack([np.sin(absolute), 0 * absolute, -np.cos(absolute)])
            offset = np.clip(((point - start) * along).sum(axis=1), 0.0, 1.0)  # links of 1 m
            distances.append(np.linalg.norm(point - start - offset[:, None] * along, axis=1))
            start = start + along
        return np.asarray(np.min(distances, axis=0))

    return nearest


@pytest.fixture(scope="session")
def free_among() -> Callable[[Obstacle, Obstacle], World]:
    """Return a world of a body that moves freely, by x y z yaw pitch roll, and an obstacle."""
    grain = free_body(Sphere(name="grain", radius=1e-6), "rigid body", [(-9.0, 9.0)] * 3)

    def make(body: Obstacle, obstacle: Obstacle) -> World:
        return World(grain.holding(Attachment(body, "body")), Scene([obstacle]))

    return make


@pytest.fixture(scope="session")
def random_mesh() -> Callable[[str, np.random.Generator], Mesh]:
    """Return a maker of convex meshes from fat to thin as a sheet of paper."""

    def make(name: str, random: np.random.Generator) -> Mesh:
        corners = random.normal(size=(random.integers(4, 60), 3))
        return Mesh(name=name, pieces=[corners * 10.0 ** random.uniform(-3, 0, 3)])

    return make
