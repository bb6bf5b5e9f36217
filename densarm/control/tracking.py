"""DensityTracking: the density inverse-dynamics controller along a motion."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from densarm.arms.dynamics import Kinematics
from densarm.control.controller import Gains, checked_state
from densarm.control.inverse_dynamics import (
    ATTRACT,
    BRAKE,
    TORQUE,
    InverseDynamics,
    limited_torque,
)
from densarm.density.goal_distance import GoalDistance, TorusDistance, torus_distance
from densarm.density.navigation_density import (
    DensityParameters,
    Gauge,
    NavigationDensity,
    write_gauge_gradient,
)
from densarm.density.unsafe_sets import (
    ClearanceSet,
    JointLimitSet,
    SensingParameters,
    UnsafeSet,
)
from densarm.errors import InvalidValueError
from densarm.planning.motion import Motion, write_sample
from densarm.values.arrays import Array
from densarm.values.kernels import compiled
from densarm.world.active_pairs import ActivePairs
from densarm.world.near_pairs import least_distances
from densarm.world.stopping import HELD_SHARE
from densarm.world.world import DISTANCE_TOLERANCE, World

_INTERVAL = 0.02  # [s] of the motion between computed distances
_SMALLEST = 1e-6  # [m or rad], sensing distance where the motion leaves no distance to sense in


class DensityTracking:
    r"""Track q_d(t), obstacles acting at the true configuration.

    .. math::

        \tau = H + M \big( \ddot q_d + K_p \nabla(-1/\rho) - K_v \dot e \big), \qquad
        e = q \ominus q_d, \quad \rho = \Psi(q) / V(e)

    [ZNV] has ∇ρ(e), singular at e = 0; this feedback tends to -K_p e there, and obstacles act at q,
    where they are. Where limits need it the attraction is scaled down, then all. Every sensing
    distance is below what the motion keeps from the unsafe set, so that Ψ = 1 on it and obstacles
    act only on an arm that was pushed off it; those that move, of which the motion knows nothing,
    act from the largest sensing distance on. The torque is taken to be held for the motion's
    period: q̈_d is its mean over that time.

    `velocity` tracks it with a plant that is told velocities, which needs no masses:

    .. math::

        u = \bar{\dot q}_d + \frac{K_p}{K_v} \nabla(-1/\rho)

    with the mean of q̇_d over a period, inside the limits of velocity and acceleration.

    Args:
        world: the arm among obstacles.
        motion: q_d(t), as `plan_motion` makes it.
        gains: K_p and K_v.
        goal_distance: V; None for a `TorusDistance`.
        unsafe_sets: what else must not be entered, beside pairs of bodies and joint limits.
        density: α, θ and gauge; tracking lives at e = 0, where nothing may be singular or flat.
        sensing: largest sensing distances, and their share of the distance kept on the way.

    Attributes:
        motion: as given.
        goal: where it ends (nq,).
        tracking_error: largest |e| of a joint at the last call, zero before the first [rad or m].

    Raises:
        InvalidValueError: a density that is singular, flat or blended at e = 0.

    Source: [ZNV] eq. 17, with what docs/departures.md tells.
    """

    def __init__(
        self,
        world: World,
        motion: Motion,
        *,
        gains: Gains = Gains(),
        goal_distance: GoalDistance | None = None,
        unsafe_sets: Sequence[UnsafeSet] = (),
        density: DensityParameters = DensityParameters(),
        sensing: SensingParameters = SensingParameters(),
    ) -> None:
        require_smooth_goal(density, may_blend=False)
        arm = world.arm
        self.motion = motion
        self.goal: Array = arm.configurations(motion.position[-1])
        self.tracking_error: float = 0.0
        self._arm = arm
        self._kinematics = Kinematics(arm)
        distance = goal_distance or TorusDistance(arm)
        unsafe = [*_sensed_off(world, motion, sensing, self._kinematics), *unsafe_sets]
        self._density = NavigationDensity(arm, self.goal, unsafe, distance, density)
        self._gains = gains
        self._arrays: tuple[Any, ...] | None = None
        if arm.links_without_mass:
            self.velocity(0.0, self.goal, np.zeros(arm.nv))
            return
        limit = HELD_SHARE * arm.limits.acceleration
        self._dynamics = InverseDynamics(arm, limit, self._kinematics)
        if isinstance(distance, TorusDistance):  # V by one kernel with all the rest, for its speed
            numbers = 0.0, 0.0, motion.period, distance.kappa, gains.position, gains.velocity
            sample = np.zeros((5, arm.nv))
            sample[_WEIGHTS] = distance.weights
            self._arrays = (
                np.array(numbers),
                self._dynamics.rows,
                sample,
                motion.knots,
                arm.joint_index,
                self._density.log_psi_gradient,
                *self._dynamics.terms,
            )
        self.torque(0.0, self.goal, np.zeros(arm.nv))  # kernels are loaded before a control loop
        self.tracking_error = 0.0

    def torque(self, t: float, q: ArrayLike, v: ArrayLike) -> Array:
        """Act as `Controller.torque`.

        Raises:
            RobotDescriptionError: the arm has links without a mass.
        """
        self._arm.require_masses("torque")
        q, v = checked_state(self._arm, q, v)
        self._kinematics.update(q)
        if self._arrays is None:
            return self._torque_by_any_distance(t, q, v)
        numbers, rows = self._arrays[:2]
        self._density.update_psi(q)
        self._dynamics.update(q, v)
        numbers[0], numbers[1] = t, self._density.log_psi
        self.tracking_error = _tracking_torque(q, v, *self._arrays)
        return np.array(rows[TORQUE])

    def velocity(self, t: float, q: ArrayLike, v: ArrayLike) -> Array:
        """Act as `VelocityController.velocity`, v being the velocity commanded last."""
        q, v = checked_state(self._arm, q, v)
        self._kinematics.update(q)
        motion, limits = self.motion, self._arm.limits
        now, then = motion.sample(t), motion.sample(t + motion.period)
        follow = (then.position - now.position) / motion.period
        wanted = follow + self._gains.rate * self._attraction(q, now.position)
        change = motion.period * HELD_SHARE * limits.acceleration
        reached = np.clip(wanted, v - change, v + change)
        return np.asarray(np.clip(reached, -limits.velocity, limits.velocity))

    def describe_stall(self, q: Array) -> str:
        """Return, as a phrase, why the arm rests short of the goal."""
        return self.motion.detail

    @property
    def remark(self) -> str:
        """As `Motion.remark`."""
        return self.motion.remark

    def _torque_by_any_distance(self, t: float, q: Array, v: Array) -> Array:
        motion, gains = self.motion, self._gains
        point = motion.sample(t, lead=0.5 * motion.period)
        attract = self._attraction(q, point.position)
        self._dynamics.update(q, v)
        brake = point.acceleration - gains.velocity * (v - point.velocity)
        return self._dynamics.torque(brake, gains.position * attract)

    def _attraction(self, q: Array, wanted: Array) -> Array:
        """Return ∇ρ (nv,) at q (nq,) towards joint positions (nv,), and keep the error."""
        density, attract = self._density, np.empty(self._arm.nv)
        density.set_goal(self._arm.configurations(wanted))
        density.update(q)
        density.write_gradient(density.parameters.gauge, attract)
        self.tracking_error = float(np.abs(density.error(q)).max())
        return attract


def require_smooth_goal(
    density: DensityParameters, *, may_blend: bool, form: str = "tracking"
) -> None:
    """Refuse a density whose gradient is singular or flat at the goal, or a blend not to be read.

    The form of control is for the error.

    Raises:
        InvalidValueError: such a density.
    """
    is_smooth = density.gauge == Gauge.RECIPROCAL and density.alpha == 1.0
    reason = (
        f"in gauge {str(density.gauge)!r} with alpha = {density.alpha:g}, whose gradient is "
        "singular or flat at the goal (or use gauge 'reciprocal', alpha = 1)"
    )
    if not may_blend and density.blend_radius > 0.0:
        allowed = "0 in tracking, which lives at e = 0, where a blend leaves nothing of obstacles"
        raise InvalidValueError("density.blend_radius", density.blend_radius, allowed)
    if not is_smooth and not may_blend:
        raise InvalidValueError("control.form", form, f"'regulation' or 'plain' {reason}")
    if not is_smooth and density.blend_radius == 0.0:
        raise InvalidValueError("density.blend_radius", 0.0, f"above 0 {reason}")


def _sensed_off(
    world: World, motion: Motion, sensing: SensingParameters, kinematics: Kinematics
) -> tuple[UnsafeSet, UnsafeSet]:
    """Return pairs and joint limits, sensed nowhere on a motion but where the arm is off it."""
    arm = world.arm
    every = max(1, round(_INTERVAL / motion.period))
    angles = np.vstack([motion.position[::every], motion.position[-1:]])
    configurations = arm.configurations(angles)
    held = motion.margin + DISTANCE_TOLERANCE
    limit = held + sensing.distance / sensing.path_share  # beyond which all are sensed alike
    least = least_distances(world, configurations, limit) - held
    angles = arm.angles(configurations)
    inside = np.minimum(angles - arm.limits.lower, arm.limits.upper - angles).min(axis=0)
    pair_sensing = np.clip(sensing.path_share * least, _SMALLEST, sensing.distance)
    joint_sensing = np.clip(sensing.path_share * inside, _SMALLEST, sensing.joint)
    pairs = ActivePairs(world, kinematics)
    return (
        ClearanceSet(world, motion.margin, pair_sensing, pairs, sensing.distance),
        JointLimitSet(arm, joint_sensing),
    )


_POSITION, _VELOCITY, _ACCELERATION, _ERROR, _WEIGHTS = 0, 1, 2, 3, 4  # rows of a sample


@compiled
def _tracking_torque(
    q: Array,
    v: Array,
    numbers: Array,
    rows: Array,
    sample: Array,
    knots: Array,
    joint_index: NDArray[np.int64],
    log_psi_gradient: Array,
    mass: Array,
    nonlinear: Array,
) -> float:
    """Write the torque of `DensityTracking` as `limited_torque` does; return the tracking error.

    It is one kernel, of few arguments, since every call and every argument has its cost.
    """
    u, log_psi = numbers[0] / numbers[2], numbers[1]
    write_sample(u, u + 0.5, numbers[2], knots, sample)
    error, attract, largest = sample[_ERROR], rows[ATTRACT], 0.0
    for i in range(v.shape[0]):
        k, wanted = joint_index[0, i], sample[_POSITION, i]
        off = q[k] - wanted
        if joint_index[1, i]:
            c, s = math.cos(wanted), math.sin(wanted)
            off = math.atan2(q[k + 1] * c - q[k] * s, q[k] * c + q[k + 1] * s)
        if abs(off) > largest:
            largest = abs(off)
        error[i] = off
        rows[BRAKE, i] = sample[_ACCELERATION, i] - numbers[5] * (v[i] - sample[_VELOCITY, i])
    distance = torus_distance(error, joint_index, sample[_WEIGHTS], numbers[3])
    # In the reciprocal gauge with α = 1, as `require_smooth_goal` has it.
    write_gauge_gradient(log_psi_gradient, distance, error, 1.0, log_psi, 0.0, -1.0, attract)
    for i in range(v.shape[0]):
        attract[i] *= numbers[4]
    limited_torque(mass, nonlinear, rows)
    return largest
