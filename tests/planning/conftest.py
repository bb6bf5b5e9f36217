"""Discs in the joint space of two-joint arms, the two-link arm, and a disc in the plane."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import pytest

from densarm.arms.arm import Arm
from densarm.arms.description import RobotDescription
from densarm.arms.free_body import free_body
from densarm.scenarios.scenario import Scenario
from densarm.scene.obstacles import Box, Obstacle, Sphere
from densarm.scene.scene import Scene
from densarm.values.arrays import Array
from densarm.world.swept_check import SweptCheck
from densarm.world.world import World

BOUND = 3.0  # [m]

JOINT = """<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>
<axis xyz="{axis}"/>{limit}</joint>"""

LINK = """<link name="{name}"><inertial><mass value="1"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><geometry><sphere radius="0.1"/></geometry></collision></link>"""


def _two_joint_arm(kinds: tuple[str, str], bound: float) -> Arm:
    limit = f'<limit lower="{-bound}" upper="{bound}" effort="1" velocity="1"/>'
    body = "".join(LINK.format(name=name) for name in "abc")
    for kind, name, parent, child in zip(kinds, ("first", "second"), "ab", "bc", strict=True):
        body += JOINT.format(
            name=name,
            kind=kind,
            parent=parent,
            child=child,
            axis="1 0 0" if parent == "a" else "0 1 0",
            limit="" if kind == "continuous" else limit,
        )
    return Arm(RobotDescription(name="two_joints", urdf=f'<robot name="two_joints">{body}</robot>'))


@dataclass
class DiscWorld:
    """Discs in the space of two joints, periodic where they turn; exact, counting its answers."""

    arm: Arm
    centers: Array
    """(D, 2)."""
    radii: Array
    """(D,)."""
    segments: int = 0
    configurations: int = 0

    def gap(self, q: Array) -> Array:
        """Return the least gap to a disc of configurations (..., nq)."""
        offset = self.arm.angles(q)[..., None, :] - self.centers
        turns = self.arm.continuous
        offset[..., turns] = (offset[..., turns] + np.pi) % (2 * np.pi) - np.pi
        gaps = np.linalg.norm(offset, axis=-1) - self.radii
        return np.asarray(np.min(gaps, axis=-1, initial=np.inf))

    def configuration_is_clear(self, q: Array) -> bool:
        """Return whether q is outside every disc."""
        self.configurations += 1
        return bool(self.gap(q) > 0.0)

    def segment_is_clear(self, q_a: Array, q_b: Array) -> bool:
        """Return whether a segment misses every disc and its copies."""
        self.segments += 1
        start, step = self.arm.angles(q_a), self.arm.difference(q_a, q_b)
        turns = np.array([-1, 0, 1]) * 2 * np.pi
        shifts = np.stack(np.meshgrid(*[turns * turning for turning in self.arm.continuous]), -1)
        to_center = (self.centers[:, None] + shifts.reshape(-1, 2)) - start
        along = np.clip(to_center @ step / max(step @ step, 1e-300), 0.0, 1.0)
        gap = np.linalg.norm(to_center - along[..., None] * step, axis=-1) - self.radii[:, None]
        # Where an end touches a disc, a rounding decides: no otherwise than for the end alone.
        return bool(np.all(gap > 0.0) and self.gap(q_a) > 0.0 and self.gap(q_b) > 0.0)

    def polyline_is_clear(self, angles: Array) -> bool:
        """Return whether every segment is clear."""
        points = self.arm.configurations(angles)
        return all(self.segment_is_clear(a, b) for a, b in pairwise(points))


@pytest.fixture(scope="session")
def make_arm() -> Callable[..., Arm]:
    """Return a maker of two-joint arms."""

    def make(first: str, second: str, bound: float = BOUND) -> Arm:
        return _two_joint_arm((first, second), bound)

    return make


@pytest.fixture(
    scope="session",
    params=[("prismatic", "prismatic"), ("continuous", "continuous"), ("continuous", "prismatic")],
    ids="-".join,
)
def arm(request: pytest.FixtureRequest) -> Arm:
    """Return an arm of each mix of bounded and continuous joints."""
    return _two_joint_arm(request.param, BOUND)


@pytest.fixture(scope="session")
def make_discs() -> Callable[..., DiscWorld]:
    """Return a maker of disc worlds, each disc (x, y, radius)."""

    def make(arm: Arm, *discs: tuple[float, float, float]) -> DiscWorld:
        table = np.array(discs, dtype=float).reshape(-1, 3)
        return DiscWorld(arm, table[:, :2], table[:, 2])

    return make


@pytest.fixture(scope="session")
def enclosure() -> list[tuple[float, float, float]]:
    """Return overlapping discs on a ring of radius 1 around the origin."""
    angles = np.linspace(0.0, 2 * np.pi, 24, endpoint=False)
    return [(float(np.cos(a)), float(np.sin(a)), 0.2) for a in angles]


@pytest.fixture(scope="session")
def samples_of() -> Callable[[Arm, Array], Array]:
    """Return a function that samples the segments between waypoints densely."""

    def sample(arm: Arm, waypoints: Array) -> Array:
        fractions = np.linspace(0.0, 1.0, 501)[:, None]
        edges = [fractions * arm.difference(a, b) for a, b in pairwise(waypoints)]
        return np.concatenate(
            [arm.integrate(*edge) for edge in zip(waypoints[:-1], edges, strict=True)]
        )

    return sample


@pytest.fixture(scope="session")
def check(swing_up: Scenario) -> SweptCheck:
    """Return what proves motions of the two-link arm between the balls of swing_up."""
    return SweptCheck(swing_up.world)


@pytest.fixture(scope="session")
def curve(check: SweptCheck) -> Array:
    """Return a polyline with corners, over the back of a continuous joint."""
    corners = np.array([[2.8, 0.0], [3.4, 0.9], [4.0, 0.6], [3.6, -0.4]])
    return check.arm.configurations(corners)


@pytest.fixture
def among() -> Callable[..., tuple[World, Array, Array]]:
    """Return a maker of a disc's world in the plane, and of two ends there."""

    def make(
        obstacles: list[Obstacle], start: Sequence[float], goal: Sequence[float]
    ) -> tuple[World, Array, Array]:
        arm = free_body(Sphere(name="disc", radius=0.1), "plane", [(-1.2, 1.2)] * 2)
        return World(arm, Scene(obstacles)), np.array(start), np.array(goal)

    return make


@pytest.fixture
def cap() -> list[Obstacle]:
    """Open to the right: what is inside and what is behind hide from each other."""
    return [
        Box(name="back", size=(0.1, 1.0, 0.3)),
        Box(name="upper", size=(0.5, 0.1, 0.3), position=(0.2, 0.45, 0.0)),
        Box(name="lower", size=(0.5, 0.1, 0.3), position=(0.2, -0.45, 0.0)),
    ]
