"""JaxArm: kinematics and dynamics of a chain of revolute joints, and its capsules, in JAX."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pinocchio as pin
from jax import Array

from densarm.arms.arm import Arm


class JaxArm:
    """The numbers of Pinocchio's model, in functions that JAX compiles and differentiates.

    Args:
        arm: a chain of revolute joints, its shapes capsules.
    """

    def __init__(self, arm: Arm) -> None:
        model = arm.model
        self.n = model.nv
        joints = range(1, model.njoints)
        self._turn = np.array([model.jointPlacements[j].rotation for j in joints])
        self._offset = np.array([model.jointPlacements[j].translation for j in joints])
        self._axis = np.array([np.ravel(model.joints[j].createData().S)[3:] for j in joints])
        self._cross = np.array([pin.skew(axis) for axis in self._axis])
        self._mass = np.array([model.inertias[j].mass for j in joints])
        self._center = np.array([model.inertias[j].lever for j in joints])
        self._inertia = np.array([model.inertias[j].inertia for j in joints])
        self._gravity = model.gravity.linear
        items = [item for item in arm.collision_model.geometryObjects if item.parentJoint > 0]
        self._parent = np.array([item.parentJoint - 1 for item in items])
        along = np.array([item.placement.rotation[:, 2] for item in items])
        half = np.array([[item.geometry.halfLength] for item in items])
        middle = np.array([item.placement.translation for item in items])
        self._tail, self._spine = middle - half * along, 2.0 * half * along
        self._radius = np.array([item.geometry.radius for item in items])
        # Compiled each by itself, as cbfpy calls them once one by one; inlined in what is compiled.
        self.sphere_distances = jax.jit(self._sphere_distances)
        """From q, centers (S, 3) and radii (S,) to the distances of spheres x capsules [m]."""
        self.bias = jax.jit(self._bias)
        """From q and v to Coriolis, centrifugal and gravity torques (n,) [N·m]."""
        self.mass_matrix = jax.jit(self._mass_matrix)
        """From q to M (n, n)."""

    def _sphere_distances(self, q: Array, centers: Array, radii: Array) -> Array:
        rotations, origins = self._placements(q)
        turn, origin = rotations[self._parent], origins[self._parent]
        tail = origin + jnp.einsum("kij,kj->ki", turn, self._tail)
        spine = jnp.einsum("kij,kj->ki", turn, self._spine)
        away = centers[:, None, :] - tail
        length = np.sum(self._spine**2, axis=1)
        share = jnp.clip(jnp.sum(away * spine, axis=2) / length, 0.0, 1.0)
        gap = jnp.linalg.norm(away - share[:, :, None] * spine, axis=2)
        return (gap - self._radius - radii[:, None]).ravel()

    def _bias(self, q: Array, v: Array) -> Array:
        """Return the torques of Newton's and Euler's equations, all links at once."""
        links = self._links(q)
        spin = jnp.cumsum(links.axis * v[:, None], axis=0)
        before = jnp.concatenate([jnp.zeros((1, 3)), spin[:-1]])
        turning = jnp.cumsum(jnp.cross(before, links.axis * v[:, None]), axis=0)
        turning_before = jnp.concatenate([jnp.zeros((1, 3)), turning[:-1]])
        step = jnp.diff(links.origin, axis=0, prepend=jnp.zeros((1, 3)))
        pull = jnp.cross(turning_before, step) + jnp.cross(before, jnp.cross(before, step))
        arm = links.center - links.origin
        at_center = jnp.cumsum(pull, axis=0) - self._gravity
        at_center += jnp.cross(turning, arm) + jnp.cross(spin, jnp.cross(spin, arm))
        force = self._mass[:, None] * at_center
        turned = jnp.einsum("iab,ib->ia", links.inertia, spin)
        moment = jnp.einsum("iab,ib->ia", links.inertia, turning) + jnp.cross(spin, turned)
        return jnp.einsum("ija,ia->j", links.linear, force) + jnp.einsum(
            "ija,ia->j", links.angular, moment
        )

    def _mass_matrix(self, q: Array) -> Array:
        links = self._links(q)
        linear = jnp.einsum("i,ija,ika->jk", self._mass, links.linear, links.linear)
        turned = jnp.einsum("iab,ikb->ika", links.inertia, links.angular)
        return linear + jnp.einsum("ija,ika->jk", links.angular, turned)

    def _links(self, q: Array) -> "_Links":
        rotation, origin = self._placements(q)
        axis = jnp.einsum("iab,ib->ia", rotation, self._axis)
        center = origin + jnp.einsum("iab,ib->ia", rotation, self._center)
        inertia = jnp.einsum("iab,ibc,idc->iad", rotation, self._inertia, rotation)
        moves = np.tril(np.ones((self.n, self.n)))[:, :, None]
        angular = moves * axis[None]
        linear = moves * jnp.cross(axis[None], center[:, None] - origin[None])
        return _Links(origin, axis, center, inertia, linear, angular)

    def _placements(self, q: Array) -> tuple[Array, Array]:
        """Return each joint's rotation (n, 3, 3) and origin (n, 3) in the world."""
        sine, versine = jnp.sin(q)[:, None, None], 1.0 - jnp.cos(q)[:, None, None]
        local = np.eye(3) + sine * self._cross + versine * (self._cross @ self._cross)
        turns = self._turn @ local
        rotation, origin = jnp.eye(3), jnp.zeros(3)
        rotations, origins = [], []
        for offset, turn in zip(self._offset, turns, strict=True):
            origin = origin + rotation @ offset
            rotation = rotation @ turn
            rotations.append(rotation)
            origins.append(origin)
        return jnp.stack(rotations), jnp.stack(origins)


class _Links(NamedTuple):
    """Links and their Jacobians, in the world."""

    origin: Array
    axis: Array
    center: Array
    inertia: Array
    linear: Array
    """Of each center of mass by each joint (n, n, 3)."""
    angular: Array
