"""Baselines: the density and what it is compared with, by name, from a scenario to its drive."""

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from densarm.arms.arm import Arm
from densarm.arms.joint_space import joint_error, write_configuration
from densarm.control.controller import Gains, checked_state
from densarm.control.inverse_dynamics import InverseDynamics
from densarm.control.regulation import FieldRegulation, VelocityField
from densarm.control.speed_law import SpeedLaw
from densarm.density.unsafe_sets import SensingParameters
from densarm.planning.motion import Motion, PlanningError
from densarm.scenarios.control import ControlForm
from densarm.scenarios.run import Drive, by_density
from densarm.scenarios.scenario import Scenario
from densarm.study.control_density import ControlDensity
from densarm.study.fields import (
    BarrierField,
    BarrierFilter,
    Barriers,
    JointNavigationFunction,
    JointPotentialField,
)
from densarm.study.time_varying_density import TimeVaryingDensity
from densarm.values.arrays import Array
from densarm.values.kernels import compiled
from densarm.values.outcome import Outcome
from densarm.world.configurations import infeasibility
from densarm.world.stopping import HELD_SHARE
from densarm.world.swept_check import SweptCheck

_KAPPA = 100.0  # of the navigation function: at 10 and below it is stuck on every arm tried
_BARRIER_RATE = 5.0  # γ [1/s]


class Baseline(Protocol):
    """A way to drive a scenario's arm, whose main parameter can be scaled."""

    def __call__(self, scenario: Scenario, scale: float = 1.0) -> Drive:
        """Return what drives the arm, the main parameter at `scale` times its default.

        Raises:
            PlanningError: there is no way to the goal, or an end is infeasible.
        """
        ...


def density(scenario: Scenario, scale: float = 1.0) -> Drive:
    """Track the planning system's curve along a collision-free path by the density controller."""
    return _by_density(scenario, scale, ControlForm.TRACKING, "auto")


def density_direct(scenario: Scenario, scale: float = 1.0) -> Drive:
    """Follow the plain density of [ZNV] to the goal."""
    return _by_density(scenario, scale, ControlForm.REGULATION, "direct")


def density_moving(scenario: Scenario, scale: float = 1.0) -> Drive:
    """Follow the density of obstacles that move to the goal."""
    field = TimeVaryingDensity(
        scenario.world,
        scenario.goal,
        scenario.goal_distance,
        _scaled(scenario, scale),
        scenario.control.margin,
        scenario.gains_of(ControlForm.REGULATION),
        scenario.simulation.control_period,
    )
    return _regulated(scenario, field)


def control_density(scenario: Scenario, scale: float = 1.0) -> Drive:
    """Follow the shortest velocity along which the density's flow does not contract."""
    field = ControlDensity(
        scenario.world,
        scenario.goal,
        scenario.goal_distance,
        _scaled(scenario, scale),
        scenario.control.margin,
        scenario.gains_of(ControlForm.REGULATION),
    )
    return _regulated(scenario, field)


def potential_field(scenario: Scenario, scale: float = 1.0) -> Drive:
    """Follow Khatib's artificial potential; it repels where the density senses."""
    sensing = scenario.sensing
    return _follow(scenario, JointPotentialField, scale * sensing.distance, sensing.joint)


def navigation_function(scenario: Scenario, scale: float = 1.0) -> Drive:
    """Follow Rimon and Koditschek's navigation function."""
    return _follow(scenario, JointNavigationFunction, scale * _KAPPA)


def cbf_qp(scenario: Scenario, scale: float = 1.0) -> Drive:
    """Follow the pull of the goal, filtered by control barrier functions."""
    return _follow(scenario, BarrierFilter, scale * _BARRIER_RATE)


def plan_then_track(scenario: Scenario, scale: float = 1.0) -> Drive:
    """Track the motion of `density` by computed torque."""
    drive = density(scenario, scale)
    if drive.motion is None:
        return drive
    return replace(drive, controller=ComputedTorque(scenario.arm, drive.motion, scenario.law_gains))


BASELINES: Mapping[str, Baseline] = {
    "density": density,
    "density_direct": density_direct,
    "density_moving": density_moving,
    "control_density": control_density,
    "potential_field": potential_field,
    "navigation_function": navigation_function,
    "cbf_qp": cbf_qp,
    "plan_then_track": plan_then_track,
}
"""The baselines by name, and the density beside them."""


class MainParameter(NamedTuple):
    """What a comparison tunes of a baseline."""

    name: str
    unit: str
    default: Callable[[Scenario], float]
    """Its value at a scale of one."""


_SENSING = MainParameter("sensing distance", "m", lambda scenario: scenario.sensing.distance)

MAIN_PARAMETERS: Mapping[str, MainParameter] = {
    "density": _SENSING,
    "density_direct": _SENSING,
    "density_moving": _SENSING,
    "control_density": _SENSING,
    "potential_field": _SENSING._replace(name="influence distance"),
    "navigation_function": MainParameter("κ", "", lambda _: _KAPPA),
    "cbf_qp": MainParameter("barrier rate", "1/s", lambda _: _BARRIER_RATE),
    "plan_then_track": _SENSING,
}
"""What `scale` scales."""

DENSITIES = ("density", "density_direct", "density_moving", "control_density")
"""The baselines that are forms of the density."""


class ComputedTorque:
    r"""The classical tracking controller, which knows of no obstacle.

    .. math::

        \tau = H + M \big( \ddot q_d - K_p e - K_v \dot e \big), \qquad e = q \ominus q_d

    It has the gains, limits and motion of `DensityTracking`, whose baseline it is.

    Args:
        arm: the arm.
        motion: q_d(t) and its derivatives.
        gains: K_p and K_v.

    Attributes:
        motion: as given.
        goal: where it ends (nq,).
        tracking_error: largest |e| of a joint at the last call, zero before the first [rad or m].

    Source: B. Siciliano et al., Robotics: Modelling, Planning and Control, 2009, section 8.5.
    """

    def __init__(self, arm: Arm, motion: Motion, gains: Gains) -> None:
        self.motion = motion
        self.goal: Array = arm.configurations(motion.position[-1])
        self.tracking_error: float = 0.0
        self._arm = arm
        self._gains = gains
        self._error = np.zeros(arm.nv)
        self._dynamics = InverseDynamics(arm, HELD_SHARE * arm.limits.acceleration)
        self.torque(0.0, self.goal, np.zeros(arm.nv))  # kernels are loaded before a control loop
        self.tracking_error = 0.0

    def torque(self, t: float, q: ArrayLike, v: ArrayLike) -> Array:
        """Act as `Controller.torque`."""
        q, v = checked_state(self._arm, q, v)
        point = self.motion.sample(t, lead=0.5 * self.motion.period)
        self.tracking_error = _write_error(point.position, q, self._arm.joint_index, self._error)
        self._dynamics.update(math.nan, q, v)
        brake = point.acceleration - self._gains.velocity * (v - point.velocity)
        return self._dynamics.torque(brake, -self._gains.position * self._error)

    def describe_stall(self, q: Array) -> str:  # noqa: ARG002
        """Return, as a phrase, why the arm rests short of the goal."""
        return self.motion.detail


@compiled
def _write_error(wanted: Array, q: Array, joint_index: NDArray[np.int64], out: Array) -> float:
    """Write q ⊖ q_d (nv,) [rad or m] from positions (nv,); return its largest entry.

    In one kernel, so that no baseline's step is slower than the density's by NumPy's calls alone.
    """
    goal = np.empty_like(q)
    write_configuration(wanted, joint_index, goal)
    joint_error(goal, q, joint_index, out)
    return float(np.abs(out).max())


def _scaled(scenario: Scenario, scale: float) -> SensingParameters:
    return replace(scenario.sensing, distance=scale * scenario.sensing.distance)


def _by_density(scenario: Scenario, scale: float, form: ControlForm, guide: str) -> Drive:
    control = replace(scenario.control, form=form, guide=guide)
    chosen = replace(scenario, control=control, sensing=_scaled(scenario, scale))
    # Not in a world of its own, in which nothing would move.
    return by_density(chosen, world=scenario.world, replans=False)


def _follow(scenario: Scenario, field: type[BarrierField], *parameters: float) -> Drive:
    """Return what follows a field; each gets the same distances, margin and pull."""
    barriers = Barriers(scenario.world, scenario.control.margin)
    distance, rate = scenario.goal_distance, scenario.gains_of(ControlForm.REGULATION).rate
    return _regulated(scenario, field(barriers, scenario.goal, distance, rate, *parameters))


def _regulated(scenario: Scenario, field: VelocityField) -> Drive:
    """Return what follows a field between feasible ends, under the scenario's speed law."""
    world, margin = scenario.world, scenario.control.margin
    ends = {"start": scenario.start, "goal": scenario.goal}
    if fault := infeasibility(SweptCheck(world, margin), ends):
        raise PlanningError(Outcome.INFEASIBLE, fault)
    law = SpeedLaw(world, margin, scenario.speed)
    gains, period = scenario.gains_of(ControlForm.REGULATION), scenario.simulation.control_period
    return Drive(FieldRegulation(scenario.arm, field, law, gains, period))
