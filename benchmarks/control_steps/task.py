"""ControlTask: what every control step is given alike."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pinocchio as pin

from densarm.arms.arm import Arm, load_arm
from densarm.planning.motion import Motion
from densarm.scene.obstacles import Sphere
from densarm.scene.scene import Scene
from densarm.study.step import swing, world_among_spheres
from densarm.values.arrays import Array
from densarm.world.world import World

OFF_MOTION = 1e-3  # of the states in every joint [rad]
MARGIN = 0.005  # distance that the peers keep [m]
_ENDS = 100  # states
_REACH, _HEIGHT = 0.6, 1.0  # half the side and height of the box of scattered spheres [m]
_RADIUS = 0.05  # of scattered spheres [m]
_NEAREST = 0.02  # distance from a scattered sphere to the arm, at least [m]


@dataclass(frozen=True)
class ControlTask:
    """An arm of seven revolute joints that follows a swing among spheres, a step each millisecond.

    The states are near the swing and in its order; every step gets the same ones.
    """

    arm: Arm
    world: World
    motion: Motion

    @property
    def spheres(self) -> list[Sphere]:
        return [body for body in self.world.scene if isinstance(body, Sphere)]

    @property
    def period(self) -> float:
        """Time between states [s]."""
        return self.motion.period

    @cached_property
    def q(self) -> Array:
        """Configurations (N, 7) [rad]."""
        return self.motion.position + OFF_MOTION

    @property
    def visited(self) -> range:
        """Indices of the states to visit: all but the ends, where the swing is at joint limits."""
        return range(_ENDS, len(self.q) - _ENDS)

    @property
    def v(self) -> Array:
        """Velocities (N, 7) [rad/s]."""
        return self.motion.velocity

    @cached_property
    def wanted(self) -> Array:
        """Positions one period after each state (N, 7) [rad]: what a velocity is commanded for."""
        position = self.motion.position
        return np.vstack([position[1:], position[-1:]])

    @cached_property
    def acceleration(self) -> Array:
        """Accelerations of the motion at each state (N, 7) [rad/s²]."""
        times = self.period * np.arange(len(self.q))
        return np.array([self.motion.sample(t).acceleration for t in times])

    def poses(self) -> list[pin.SE3]:
        """Return the end effector's poses at `wanted`."""
        model, data = self.arm.model, self.arm.model.createData()
        frame = self.arm.end_effector_frame
        poses = []
        for q in self.wanted:
            pin.framesForwardKinematics(model, data, q)
            poses.append(data.oMf[frame].copy())
        return poses


def panda_task(shapes: str, n_spheres: int, scene: str) -> ControlTask:
    """Return the task of Panda, every moving shape of it paired with every sphere.

    Args:
        shapes: "hull" or "capsule".
        n_spheres: number of spheres.
        scene: "close", the spheres of `densarm bench step`, out of many those that the arm passes
            closest; or "scattered", anywhere in reach where the arm does not come.
    """
    arm = load_arm("panda", shapes=shapes)
    motion = swing(arm)
    if scene == "scattered":
        return ControlTask(arm, _among_scattered(arm, motion, n_spheres), motion)
    moving = sum(item.parentJoint > 0 for item in arm.collision_model.geometryObjects)
    return ControlTask(arm, world_among_spheres(arm, motion, n_spheres * moving), motion)


def _among_scattered(arm: Arm, motion: Motion, count: int) -> World:
    arm.collision_model.removeAllCollisionPairs()
    random = np.random.default_rng(0)
    lowest, highest = (-_REACH, -_REACH, 0.0), (_REACH, _REACH, _HEIGHT)
    passed = arm.configurations(motion.position[:: len(motion.position) // 10])
    spheres: list[Sphere] = []
    while len(spheres) < count:
        position = tuple(random.uniform(lowest, highest).tolist())
        sphere = Sphere(name=f"sphere_{len(spheres)}", radius=_RADIUS, position=position)
        alone = World(arm, Scene([sphere]))
        if min(alone.distances(q).min() for q in passed) >= _NEAREST:
            spheres.append(sphere)
    return World(arm, Scene(spheres))
