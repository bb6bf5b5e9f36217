"""CbfpyStep: a torque filter by control barrier functions, by cbfpy."""

import jax
import jax.numpy as jnp
import numpy as np
from cbfpy import CBF, CBFConfig

from control_steps.jax_arm import JaxArm
from control_steps.task import MARGIN, ControlTask
from densarm.control.controller import Gains
from densarm.values.arrays import Array

_RATE = 10.0  # of both class-K functions, as in the examples of OSCBF [1/s]
_TOLERANCE = {"elastiqp": 1e-6, "qpax": 1e-3}  # as cbfpy's examples and defaults have them


class CbfpyStep:
    """Computed torque, filtered by `CBF.safety_filter`; the whole command compiled as one.

    Args:
        task: what is to be done; its shapes are capsules.
        backend: "elastiqp", which cbfpy advises on CPUs, or "qpax", its default.
    """

    def __init__(self, task: ControlTask, backend: str) -> None:
        self._task = task
        arm, gains = JaxArm(task.arm), Gains()
        config = _Config(task, arm, backend)
        filtered = CBF.from_config(config)

        def command(q: jax.Array, v: jax.Array, wanted: jax.Array) -> jax.Array:
            feedback = gains.position * (wanted[0] - q) + gains.velocity * (wanted[1] - v)
            torque = arm.mass_matrix(q) @ (wanted[2] + feedback) + arm.bias(q, v)
            return filtered.safety_filter(jnp.concatenate([q, v]), torque)

        def measure(q: jax.Array) -> tuple[jax.Array, jax.Array]:
            return config.distances(q), jax.jacfwd(config.distances)(q)

        self._command, self._measure = jax.jit(command), jax.jit(measure)
        motion = task.motion
        self._wanted = np.stack([motion.position, motion.velocity, task.acceleration], axis=1)
        self.name = f"cbfpy, {backend}"
        self.set_up = (
            "computed torque, then CBF.safety_filter: every pair and joint limit a barrier of"
            " relative degree 2, torque limits, compiled as one, float64, one thread; dynamics and"
            " capsule distances in closed form in JAX, as cbfpy brings no arm; the command is a"
            " torque"
        )

    def measure(self, k: int) -> object:
        return jax.block_until_ready(self._measure(self._task.q[k]))

    def command(self, k: int) -> Array:
        return np.asarray(self._command(self._task.q[k], self._task.v[k], self._wanted[k]))

    def distances(self, k: int) -> Array:
        return np.asarray(self._measure(self._task.q[k])[0])


class _Config(CBFConfig):
    def __init__(self, task: ControlTask, arm: JaxArm, backend: str) -> None:
        self._arm, self._n = arm, arm.n
        self._centers = np.array([sphere.position for sphere in task.spheres])
        self._radii = np.array([sphere.radius for sphere in task.spheres])
        limits = task.arm.limits
        self._lower, self._upper = limits.lower, limits.upper
        super().__init__(
            n=2 * arm.n,
            m=arm.n,
            u_min=-limits.effort,
            u_max=limits.effort,
            backend=backend,
            solver_tol=_TOLERANCE[backend],
        )

    def distances(self, q: jax.Array) -> jax.Array:
        return self._arm.sphere_distances(q, self._centers, self._radii)

    def f(self, z: jax.Array) -> jax.Array:
        q, v = z[: self._n], z[self._n :]
        free = jnp.linalg.solve(self._arm.mass_matrix(q), -self._arm.bias(q, v))
        # No barrier depends on v, so that no derivative of these accelerations is ever needed.
        return jnp.concatenate([v, jax.lax.stop_gradient(free)])

    def g(self, z: jax.Array) -> jax.Array:
        inverse = jnp.linalg.inv(self._arm.mass_matrix(z[: self._n]))
        return jnp.concatenate([jnp.zeros_like(inverse), inverse])

    def h_2(self, z: jax.Array) -> jax.Array:
        q = z[: self._n]
        return jnp.concatenate([self.distances(q) - MARGIN, q - self._lower, self._upper - q])

    def alpha(self, h: jax.Array) -> jax.Array:
        return _RATE * h

    def alpha_2(self, h_2: jax.Array) -> jax.Array:
        return _RATE * h_2
