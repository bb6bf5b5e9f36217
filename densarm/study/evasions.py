"""Other laws by which an arm gives way to what moves, in the servo and the bounds of `Evasion`."""

import os
import warnings
from functools import lru_cache
from typing import Any

import numpy as np

from densarm.control.evasion import Evasion
from densarm.simulation.mujoco_plant import MujocoPlant
from densarm.values.arrays import Array
from densarm.world.active_pairs import ActivePairs
from densarm.world.distance_view import add_pair_gradients, pair_rates
from densarm.world.world import Pairs, World

RATE, REACH, MARGIN = 3.0, 0.5, 0.02
"""ξ [1/s], reach [m] and m [m] of the damper QP, and of the peers."""

_STOP_DISTANCE = 0.3  # [m]
_PERIOD = 0.001  # [s]
_SAME = 1e-3  # [rad/s or m/s] by which a velocity that gives way to nothing may differ


class DamperEvasion(Evasion):
    """The velocity-damper QP: ∇d_k · q̇ + n_k · w_k ≥ -ξ (d_k - m) for pairs within reach.

    ξ = 3 /s, m = 20 mm and a reach of 0.5 m are the best of five settings that were tried; servo,
    bounds and nominal velocity are those of `Evasion`.

    Source: B. Faverjon, P. Tournassoud, A Local Based Approach for Path Planning of Manipulators
        with a High Number of Degrees of Freedom, ICRA 1987.
    """

    def _write_rows(self, v: Array, angles: Array) -> None:  # noqa: ARG002
        near, distance, slopes, rate = self._near()
        rows = np.column_stack([slopes, -RATE * (distance - MARGIN) - rate])
        moves, standing = self._is_moving[near], len(self._rows) - self._world.n_pairs
        for block, begin, chosen in ((0, 0, rows[moves]), (-1, standing, rows[~moves])):
            self._rows[begin : begin + len(chosen)] = chosen
            self._count[block] = len(chosen)

    def _near(self) -> tuple[Pairs, Array, Array, Array]:
        """Return pairs within reach, their distances, gradients (P, nv) and ∂d_k/∂t."""
        pairs, world = self._pairs, self._world
        pairs.set_reach(np.maximum(pairs.reach, REACH))
        near = np.flatnonzero((pairs.state != 0) & (pairs.rows[:, 0] < REACH))
        rows, slopes = np.ascontiguousarray(pairs.rows[near]), np.zeros((len(near), self._arm.nv))
        add_pair_gradients(rows, pairs.kinematics.jacobian, world.sign[near], slopes)
        return near, rows[:, 0], slopes, pair_rates(rows, world.twist[near])


class StopAndGo(Evasion):
    """Stops while anything that moves is near, and goes on when it is not."""

    def velocity(self, q: Array, v: Array, nominal: Array) -> tuple[Array, bool]:
        """Act as `Evasion.velocity`."""
        self._pairs.set_reach(np.maximum(self._pairs.reach, REACH))
        moving = self._is_moving & (self._pairs.state != 0)
        near = bool((self._pairs.rows[moving, 0] < _STOP_DISTANCE).any())
        return super().velocity(q, v, 0.0 * nominal if near else nominal)[0], near

    def _write_rows(self, v: Array, angles: Array) -> None:
        """Write none."""


class MinkEvasion(Evasion):
    r"""mink's `solve_ik`, towards where q̇_nom leads in a period, with its collision limit.

    Its gain is set so that the limit is ∇d_k · q̇ ≥ -ξ (d_k - m), with the damper QP's numbers; by
    default it acts in the last step before a contact. It knows nothing of velocities of obstacles.
    """

    def __init__(self, world: World, pairs: ActivePairs, margin: float) -> None:
        super().__init__(world, pairs, margin)
        import mink

        self._mink, self._first = mink, world.arm.collision_model.ngeoms
        self._model = model = MujocoPlant(world, _PERIOD).model
        model.geom_contype[:] = model.geom_conaffinity[:] = 1
        self._configuration = mink.Configuration(model)
        self._posture = mink.PostureTask(model, cost=1.0)
        geoms = [model.geom(f"shape {k}").id for k in range(world.geometry_model.ngeoms)]
        speed = dict(zip(world.arm.joint_names, self._limits[2].tolist(), strict=True))
        self._limits_of_mink = [
            mink.ConfigurationLimit(model),
            mink.VelocityLimit(model, speed),
            mink.CollisionAvoidanceLimit(
                model,
                [([geoms[a]], [geoms[b]]) for a, b in world.pair_shapes.tolist()],
                gain=RATE * _PERIOD**2,
                minimum_distance_from_collisions=MARGIN,
                collision_detection_distance=REACH,
            ),
        ]

    def velocity(self, q: Array, v: Array, nominal: Array) -> tuple[Array, bool]:
        """Act as `Evasion.velocity`."""
        shapes, angles = self._world.geometry_model.geometryObjects, self._arm.angles(q)
        for k in range(self._first, len(shapes)):
            self._model.body(f"shape {k}").pos[:] = shapes[k].placement.translation
        self._configuration.update(angles)
        self._posture.set_target(angles + _PERIOD * nominal)
        try:
            found = self._mink.solve_ik(
                self._configuration,
                [self._posture],
                _PERIOD,
                solver="daqp",
                limits=self._limits_of_mink,
            )
        except self._mink.NoSolutionFound:
            found = 0.0 * nominal
        gives_way = bool(np.abs(found - nominal).max() > _SAME)
        return super().velocity(q, v, found)[0], gives_way

    def _write_rows(self, v: Array, angles: Array) -> None:
        """Write none."""


class CbfpyEvasion(DamperEvasion):
    """cbfpy's safety filter of velocities: a barrier for every pair, with the damper QP's numbers.

    Distances, their gradients and rates are densarm's, of pairs within reach; cbfpy has no arms.
    """

    def __init__(self, world: World, pairs: ActivePairs, margin: float) -> None:
        super().__init__(world, pairs, margin)
        speed = self._limits[2]
        self._filter = _cbfpy_filter(world.n_pairs, tuple(speed.tolist()))
        self._state = np.zeros(len(speed) + 1)
        self._table = np.zeros((world.n_pairs, len(speed) + 1))
        self._distance = np.zeros(world.n_pairs)

    def velocity(self, q: Array, v: Array, nominal: Array) -> tuple[Array, bool]:
        """Act as `Evasion.velocity`."""
        near, distance, slopes, rate = self._near()
        self._table[:], self._distance[:] = 0.0, REACH
        self._table[near, :-1], self._table[near, -1] = slopes, rate
        self._distance[near] = distance
        found = self._filter(self._state, nominal, self._distance - MARGIN, self._table)
        gives_way = bool(np.abs(found - nominal).max() > _SAME)
        return Evasion.velocity(self, q, v, np.asarray(found, np.float64))[0], gives_way

    def _write_rows(self, v: Array, angles: Array) -> None:
        """Write none."""


@lru_cache(maxsize=4)  # it is compiled for seconds
def _cbfpy_filter(pairs: int, speed: tuple[float, ...]) -> Any:
    """Return the filter of velocities up to a speed, given z = 0, h (K,) and ∂h/∂z (K, nv + 1).

    The state z is the joints' way and the time from now on.
    """
    os.environ.setdefault("XLA_FLAGS", "--xla_cpu_multi_thread_eigen=false")
    import jax
    import jax.numpy as jnp

    jax.config.update("jax_enable_x64", True)
    with warnings.catch_warnings():  # of variables that only a faster step would need
        warnings.simplefilter("ignore")
        from cbfpy import CBF, CBFConfig

    n = len(speed)

    class Barriers(CBFConfig):
        def f(self, *_: Any) -> Any:
            return jnp.zeros(n + 1).at[n].set(1.0)

        def g(self, *_: Any) -> Any:
            return jnp.eye(n + 1, n)

        def h_1(self, z: Any, h: Any, slopes: Any) -> Any:
            return h + slopes @ z

        def alpha(self, h: Any, *_: Any) -> Any:
            return RATE * h

    limits = {"u_min": -np.array(speed), "u_max": np.array(speed)}
    given = np.ones(pairs), np.ones((pairs, n + 1))
    options = {"backend": "elastiqp", "solver_tol": 1e-6, "init_args": given}
    return CBF.from_config(Barriers(n + 1, n, **limits, **options)).safety_filter
