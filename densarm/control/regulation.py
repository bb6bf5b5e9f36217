"""Regulation: controllers that follow a planning system q̇ = k(q) to the goal, without a clock."""

import math
from collections.abc import Callable, Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from densarm.arms.arm import Arm
from densarm.arms.dynamics import Kinematics
from densarm.arms.pose import Pose
from densarm.control.controller import Gains, ToldByGoal, checked_state
from densarm.control.disturbance_observer import FREE_INERTIA, ActuationParameters
from densarm.control.evasion import Evasion
from densarm.control.inverse_dynamics import (
    INERTIA_FLOOR,
    LARGEST_LAG,
    TORQUE,
    InverseDynamics,
)
from densarm.control.moving_goal import MovingGoal
from densarm.control.sensing import require_smooth_goal
from densarm.control.speed_law import SpeedLaw, SpeedParameters
from densarm.control.stopping import BackupFilter
from densarm.density.goal_distance import GoalDistance, InertiaDistance, TorusDistance
from densarm.density.navigation_density import DensityParameters
from densarm.density.pose_distance import PoseDistance
from densarm.density.sub_goals import GuidedDensity, GuidePath, SubGoals
from densarm.density.unsafe_sets import SensingParameters, UnsafeSet
from densarm.errors import InvalidValueError
from densarm.planning.path_margins import inside_limits
from densarm.values.arrays import Array
from densarm.values.checks import finite_vector
from densarm.world.active_pairs import ActivePairs, DistanceBounds
from densarm.world.configurations import infeasibility
from densarm.world.stopping import HELD_SHARE
from densarm.world.swept_check import SweptCheck
from densarm.world.world import World

_LEAVING_SPEED = 0.1  # [rad/s] at a critical point of ρ that is no maximum
_NEAR = 1e-3  # [rad], below which a sub-goal's pull fades


class VelocityField(Protocol):
    """A planning system q̇ = k(q) on the joint space of an arm, before its speed is limited."""

    @property
    def distances(self) -> DistanceBounds:
        """Distances of all pairs, at the configuration that was evaluated last."""
        ...

    def velocity(self, q: Array, metric: Array | None) -> tuple[Array, float]:
        """Return k (nv,) [rad/s or m/s] at q (nq,), and the length of the way left [rad].

        k is zero where it leads nowhere. Gradients are taken in the inverse of a positive definite
        metric (nv, nv); None for the identity.
        """
        ...


class FieldRegulation(ToldByGoal):
    r"""Regulate to the goal along a velocity field, without a reference in time.

    .. math:: \tau = H + M K_v (k(q) - \dot q) - \hat d

    With the field of the density, k = (K_p/K_v) ∇ρ at the speed of the speed law, this is [ZNV]
    eq. 17 with a constant q_d, its attraction scaled before its damping. d̂ is added to it: what the
    model does not explain, by a `DisturbanceObserver`, whose model has M + D. Else a joint whose
    rotor has several times its inertia would swing, and circle the next sub-goal; D is bounded as
    in `robust_torque`, and zero in a joint whose torque has no rate limit, an ideal one. Where
    the arm could no longer stop in the free space ahead, it stops along a straight line. With
    `inertia_at`, a configuration (nq,) whose largest inertia is the unit of the metric M, gradients
    are taken in that, so that the torque itself points along them.

    Source: [ZNV] eq. 17.
    """

    def __init__(
        self,
        arm: Arm,
        field: VelocityField,
        speed_law: SpeedLaw,
        gains: Gains = Gains(),
        period: float = 0.001,
        inertia_at: Array | None = None,
        actuation: ActuationParameters = ActuationParameters(),
        evasion: Evasion | None = None,
    ) -> None:
        self._arm, self._evasion = arm, evasion
        self._is_evading = False
        self._field = field
        self._speed_law = speed_law
        self._gain = gains.velocity
        self._at_rest = np.zeros(arm.nv)
        self._scale = 0.0
        if inertia_at is not None:
            self._scale = 1.0 / float(arm.mass_matrix(inertia_at).diagonal().max())
        checked_state(arm, arm.configuration(np.zeros(arm.nv)), np.zeros(arm.nv))  # loads a kernel
        if arm.links_without_mass:
            return
        limit = HELD_SHARE * arm.limits.acceleration
        self._kinematics = Kinematics(arm)
        self._dynamics = InverseDynamics(arm, limit, self._kinematics, period, actuation)
        late, self._floor = period + actuation.delay, np.zeros(arm.nv)
        has_rotor = np.isfinite(arm.limits.torque_rate)
        self._most_floor = has_rotor * max(LARGEST_LAG / (gains.velocity * late) - 1.0, 0.0)
        self._filter = BackupFilter(arm, speed_law, gains, period)
        self._dynamics.load()

    def torque(self, t: float, q: ArrayLike, v: ArrayLike) -> Array:
        """Act as `Controller.torque`.

        Raises:
            RobotDescriptionError: the arm has links without a mass.
        """
        self._arm.require_masses("torque")
        q, v = checked_state(self._arm, q, v)
        self._update(t, q, v)
        v = self._dynamics.velocity
        metric = self._scale * self._dynamics.mass_matrix() if self._scale > 0.0 else None
        velocity = self._limited(q, metric)
        if self._evasion is not None and self._evasion.is_needed():
            evading, self._is_evading = self._evasion.velocity(q, v, velocity)
            if self._is_evading:
                self._evasion.send_torque(self._dynamics, evading)
                tau = np.array(self._dynamics.rows[TORQUE])
                a = self._filter.acceleration(q, v, tau + self._dynamics.disturbance)
                self._dynamics.expect(self._floor * a)
                return tau
        wanted = self._dynamics.torque(-self._gain * v, self._gain * velocity)
        tau = self._filter.torque(t, self._dynamics, q, v, wanted, self._field.distances)
        self._dynamics.expect(self._floor * self._filter.last)
        return tau

    def _update(self, t: float, q: Array, v: Array) -> None:
        """Update the dynamics, whose observer alone takes M for that of the arm and D.

        What D would take of accelerations it is told to expect, so that an arm without rotors
        moves as it would without D.
        """
        dynamics, floor, diagonal = self._dynamics, self._floor, slice(None, None, self._arm.nv + 1)
        free = np.maximum(dynamics.rows[FREE_INERTIA] - floor, 0.0)  # as it was at the last call
        np.minimum(dynamics.rows[INERTIA_FLOOR], self._most_floor * free, out=floor)
        self._kinematics.update(q)
        mass = self._kinematics.mass_matrix.flat
        own = mass[diagonal]
        mass[diagonal] = own + floor
        dynamics.update(t, q, v)
        mass[diagonal] = own

    @property
    def is_evading(self) -> bool:
        """Whether an obstacle moves, and the arm gave way at the last call."""
        return self._is_evading and self._evasion is not None and self._evasion.sees_motion

    @property
    def dynamics(self) -> InverseDynamics:
        """What is known of disturbance and torques."""
        return self._dynamics

    def velocity(self, t: float, q: ArrayLike, v: ArrayLike) -> Array:
        """Return the planning system k(q) itself, as `VelocityController.velocity`."""
        return self._limited(checked_state(self._arm, q, v)[0], None)

    def _limited(self, q: Array, metric: Array | None) -> Array:
        velocity, way_left = self._field.velocity(q, metric)
        velocity = self._speed_law.limit(q, velocity, self._field.distances, way_left)
        with_goal = self._goal_velocity()
        if not with_goal.any():
            return velocity
        return self._speed_law.limit(q, velocity + with_goal, self._field.distances, math.inf)

    def _goal_velocity(self) -> Array:
        """Return the velocity (nv,) that goes with the goal, from where the field was evaluated."""
        return self._at_rest


class DensityRegulation(FieldRegulation):
    r"""Regulate to a goal by the density, obstacles acting wherever the arm is.

    .. math::

        \tau = H + M K_v (k(q) - \dot q) - \hat d, \qquad k(q) = \min\{1, s / \|p\|\} \, p, \qquad
        p = \frac{K_p}{K_v} \frac{\ell}{\|q \ominus q_{sub}\|} \, \nabla\rho(q)

    s is the speed law. A sub-goal q_sub pulls as from the end of the way ℓ that is left to the
    goal: else the speed would jump whenever the next sub-goal comes in sight. Towards the goal
    itself the factor is one.

    In its plain form the torque points along ∇ρ itself, u = ∇ρ + d(q, q̇): the arm follows M⁻¹∇ρ,
    the gradient in the metric of its inertia, and d cancels the nonlinearities and damps. With V in
    that metric too both lead straight from sub-goal to sub-goal, and differ where obstacles are
    sensed.

    Where obstacles move the arm gives way to them, as `Evasion` says, k(q) being the velocity that
    is wanted.

    Where the goal is a pose, V is a `PoseDistance`, ∇ρ is taken in its metric, and ℓ is the length
    of its step: the arm is led to no configuration, and where the pose is out of reach as near to
    it as the density leads.

    Args:
        world: the arm among obstacles.
        goal: configuration (nq,), or a pose.
        path: sub-goals to a configuration, as `plan_path` finds them; None for the goal alone.
        plain: whether in the plain form.
        margin: safety margin m of the pairs [m].
        gains: K_p and K_v.
        period: time between two calls [s].
        goal_distance: V of configurations; by default `TorusDistance`, `InertiaDistance` if plain.
        unsafe_sets: what else must not be entered, beside pairs of bodies and joint limits.
        density: α, θ, gauge and blend, and the weights of a `TorusDistance`.
        sensing: sensing distances.
        speed: parameters of the speed law.
        actuation: how late torque is, and how far the model is trusted.
        evasion: makes what gives way to obstacles that move, as the class `Evasion`.

    Attributes:
        goal: as given (nq,), or where it has moved to; or the pose.

    Raises:
        InvalidValueError: a goal that touches something or is outside limits, a density that is
            singular or flat at the goal, or a path, the plain form or a blend towards a pose.
        UnknownNameError: a pose of an unknown frame.

    Source: [ZNV] eq. 11, 17 and section V-C, the speed law in place of the saturation of eq. 14.
    """

    def __init__(
        self,
        world: World,
        goal: ArrayLike | Pose,
        *,
        path: GuidePath | None = None,
        plain: bool = False,
        margin: float = 0.0,
        gains: Gains = Gains(),
        period: float = 0.001,
        goal_distance: GoalDistance | None = None,
        unsafe_sets: Sequence[UnsafeSet] = (),
        density: DensityParameters = DensityParameters(),
        sensing: SensingParameters = SensingParameters(),
        speed: SpeedParameters = SpeedParameters(),
        actuation: ActuationParameters = ActuationParameters(),
        evasion: Callable[[World, ActivePairs, float], Evasion] = Evasion,
    ) -> None:
        require_smooth_goal(density, may_blend=True)
        arm = world.arm
        self._check = SweptCheck(world, margin)
        self._sensing = sensing
        self._joint_space_alone = {"plain": plain, "density.blend_radius": density.blend_radius}
        self.goal: Any = self._checked(goal)
        if path is not None and isinstance(goal, Pose):
            raise InvalidValueError("path", "sub-goals", "None where the goal is a pose")
        path = path or self._to_alone(self.goal)
        if goal_distance is None:
            weighted = TorusDistance(arm, density.weights)
            goal_distance = InertiaDistance(arm, self.goal) if plain else weighted
        self._goal_distance = goal_distance
        self._pose_distance: PoseDistance | None = None
        goals, led_by = SubGoals(self._check, path, sensing), self._distance_to(self.goal)
        self._guided = GuidedDensity(self._check, goals, led_by, density, tuple(unsafe_sets))
        self._density_field = _DensityField(self._guided, gains.rate)
        self._moving_goal, self._goal_moves = MovingGoal(arm, self.goal), np.zeros(0)
        inertia_at = path.waypoints[-1] if plain else None
        law = SpeedLaw(world, margin, speed)
        gives_way = None
        if not arm.links_without_mass:
            gives_way = evasion(world, self._guided.pairs, margin)
        super().__init__(
            arm, self._density_field, law, gains, period, inertia_at, actuation, gives_way
        )

    def set_goal(self, goal: ArrayLike | Pose, velocity: ArrayLike | None = None) -> None:
        r"""Lead to another goal from the next call on, without sub-goals.

        Where the goal moves, its velocity is added to the planning system, and the speed law
        limits the sum: :math:`k + \dot q_{goal}` follows it without a lag. That of a pose is a
        twist, which is followed by the velocity that `PoseDistance.following` has for it.

        Args:
            goal: configuration (nq,), or pose, that it has at the next call.
            velocity: at which it goes on from there (nv,) [rad/s or m/s], or of a pose (6,), linear
                [m/s] and angular [rad/s], both in the world; for 0.1 s, after which it rests unless
                it was set again. None to estimate it from the goal that was set before, as
                `MovingGoal` does.

        Raises:
            InvalidValueError: as for the class, or a velocity of another length or not finite; the
                old goal is kept then.
            UnknownNameError: as for the class.
        """
        checked = self._checked(goal)
        size = 6 if isinstance(checked, Pose) else self._arm.nv
        told = None if velocity is None else finite_vector("velocity", velocity, size)
        density, led_by = self._guided.density, self._distance_to(checked)
        if led_by is not density.goal_distance or not isinstance(checked, Pose):
            self._guided.lead_along(SubGoals(self._check, self._to_alone(checked), self._sensing))
            density.goal_distance = led_by
        self.goal = checked
        self._moving_goal.set(checked, told)

    def torque(self, t: float, q: ArrayLike, v: ArrayLike) -> Array:
        """Act as `Controller.torque`."""
        self._move_goal(t)
        return super().torque(t, q, v)

    def velocity(self, t: float, q: ArrayLike, v: ArrayLike) -> Array:
        """Act as `VelocityController.velocity`."""
        self._move_goal(t)
        return super().velocity(t, q, v)

    def _move_goal(self, t: float) -> None:
        """Put a goal that moves where it is at a time [s]."""
        goal, self._goal_moves = self._moving_goal.at(t)
        if goal is self.goal:
            return
        self.goal = goal
        if isinstance(goal, Pose):
            self._distance_to(goal)
        else:
            self._guided.move_goal(goal)

    def _goal_velocity(self) -> Array:
        led_by = self._guided.density.goal_distance
        if not self._goal_moves.any():
            return self._at_rest
        if isinstance(led_by, PoseDistance):
            return led_by.following(self._goal_moves)
        return self._goal_moves

    @property
    def remark(self) -> str:
        """Which critical points of ρ the arm left, and how; empty where it met none."""
        return self._density_field.remark

    def describe_stall(self, q: Array) -> str:
        """Return, as a phrase, why the density leads nowhere from q (nq,), and what blocks it."""
        return self._guided.describe_stall(q)

    def _to_alone(self, goal: Array | Pose) -> GuidePath:
        """Return the way to a goal alone; that to a pose is the field's to lay."""
        if isinstance(goal, Pose):
            limits = self._check.arm.limits
            goal = self._check.arm.configuration(np.clip(0.0, limits.lower, limits.upper))
        return GuidePath(np.tile(inside_limits(self._check, goal), (2, 1)), is_clear=False)

    def _distance_to(self, goal: Array | Pose) -> GoalDistance:
        """Return V of a goal, the one of all poses pointed at it."""
        if not isinstance(goal, Pose):
            return self._goal_distance
        if self._pose_distance is None:
            self._pose_distance = PoseDistance(self._check.arm, goal)
        self._pose_distance.set_pose(goal)
        return self._pose_distance

    def _checked(self, goal: ArrayLike | Pose) -> Any:
        if isinstance(goal, Pose):
            for name, given in self._joint_space_alone.items():
                if given:
                    raise InvalidValueError(name, given, "left out where the goal is a pose")
            return goal
        q = self._check.arm.check_configuration("goal", goal)
        if fault := infeasibility(self._check, {"goal": q}):
            raise InvalidValueError("goal", q, f"one that can be held, and clear ({fault})")
        return q


class _DensityField:
    """The gradient of the guided density, pulling from the end of the way: a `VelocityField`."""

    def __init__(self, guided: GuidedDensity, rate: float) -> None:
        self._guided, self._rate = guided, rate
        self._gradient = np.zeros(guided.world.arm.nv)
        self.remark = ""

    @property
    def distances(self) -> DistanceBounds:
        return self._guided.pairs

    def velocity(self, q: Array, metric: Array | None) -> tuple[Array, float]:
        """Act as `VelocityField.velocity`, and move on along the sub-goals."""
        guided = self._guided
        guided.update(q)
        if isinstance(to_pose := guided.density.goal_distance, PoseDistance):
            metric = to_pose.metric
            guided.move_goal(guided.world.arm.integrate(q, to_pose.step()))
        to_sub_goal, beyond = guided.way_left(q)
        if guided.is_critical():
            return self._leaving(q), to_sub_goal + beyond
        guided.write_gradient(q, self._gradient)
        pull = 1.0 + beyond / max(to_sub_goal, _NEAR)
        velocity = self._rate * pull * self._gradient
        if metric is not None:
            velocity = np.asarray(np.linalg.solve(metric, velocity), dtype=np.float64)
        return velocity, to_sub_goal + beyond

    def _leaving(self, q: Array) -> Array:
        """Return a velocity (nv,) away from a critical point q (nq,); zero where none leads away.

        Once it is left, ∇ρ leads on.
        """
        direction = self._guided.unstable_direction(q)
        if direction is None:
            return np.zeros_like(self._gradient)
        self.remark = self._guided.describe_departure(q, direction)
        return _LEAVING_SPEED * direction
