"""Records beside the certificate, never a pass or fail: energy, and Rantzer's condition."""

import math
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from densarm.certificates.task import REACHED_POSITION, Task
from densarm.control.controller import Gains
from densarm.density.navigation_density import LOG_MAX, Gauge, NavigationDensity
from densarm.density.rantzer import rantzer_condition
from densarm.values.arrays import Array

_ENERGY_SAMPLES = 100  # of the run at most that are looked at
_RANTZER_SAMPLES = 6
_ROUNDING = 1e-9  # part of the first energy
_SAME_TORQUE = 1e-6  # part of the largest torque


class EnergyVerdict(StrEnum):
    """Answer of the energy argument."""

    HOLDS = "holds"
    """The energy never grew between the samples that were looked at."""
    VIOLATED = "violated"
    """The energy grew, though the law says that it does not: the time step is too long for it."""
    NOT_APPLICABLE = "not applicable"
    """The run is not of the kind that the argument is about."""


@dataclass(frozen=True)
class EnergyRecord:
    """What was found of the energy; never a part of what is certified."""

    verdict: EnergyVerdict
    detail: str
    """Why, in a phrase."""
    samples: int
    """Samples at which the energy was computed."""
    largest_rise: float | None
    """Largest change from one to the next in units of the first energy; None if not computed
    or infinite."""


def record_energy(
    task: Task, density: NavigationDensity, gains: Gains, q: Array, v: Array, tau: Array
) -> EnergyRecord:
    r"""Record whether the energy of a run never grew.

    .. math::

        \ddot q = -K_p \nabla U - K_v \dot q, \quad U = 1/\rho
        \quad\Rightarrow\quad
        E = \tfrac12 \dot q^T K_p^{-1} \dot q + U, \quad
        \dot E = -\dot q^T K_p^{-1} K_v \dot q \le 0

    U is infinite on obstacles, so that no motion of finite energy reaches one. It takes a
    regulation by the plain density in the reciprocal gauge, with θ = 0 and no blend, whose torque
    nothing limited: neither the arm's limits nor the speed law. Torque is compared with the law's,
    and energy with the one before, at 100 samples at most, evenly spaced. Arrays are as in `Run`.
    """
    if reason := _unbounded(density) or ("no motion" if len(q) < 2 else ""):
        return no_energy(reason)
    divisor = task.simulation.control_divisor
    every = divisor * (1 + (len(q) - 1) // (_ENERGY_SAMPLES * divisor))
    looked_at = np.arange(0, len(q) - 1, every)  # the last torque repeats the one before
    energy, law = _energy_and_law(task, density, gains, q[looked_at], v[looked_at])
    same = np.abs(tau[looked_at] - law) <= _SAME_TORQUE * np.abs(law).max()
    shaped = int(np.count_nonzero(~same.all(axis=1)))
    if shaped:
        reason = f"limits or the speed law shaped the torque at {shaped} of {len(law)} samples"
        return EnergyRecord(EnergyVerdict.NOT_APPLICABLE, reason, len(law), None)
    with np.errstate(over="ignore"):  # from next to nothing to a contact
        rise = np.diff(energy) / (energy[0] or 1.0)
    largest = float(rise.max(initial=-1.0))
    if largest <= _ROUNDING:
        detail = f"never grew from {energy[0]:.3g} to {energy[-1]:.3g} at {len(energy)} samples"
        return EnergyRecord(EnergyVerdict.HOLDS, detail, len(energy), largest)
    at = looked_at[1 + int(rise.argmax())] * task.simulation.dt
    detail = (
        f"grew by {largest:.2g} times its first before t = {at:.3f} s, at {len(energy)} samples"
    )
    finite = largest if np.isfinite(largest) else None
    return EnergyRecord(EnergyVerdict.VIOLATED, detail, len(energy), finite)


def no_energy(reason: str) -> EnergyRecord:
    """Return the record of a run that the argument is not about."""
    return EnergyRecord(EnergyVerdict.NOT_APPLICABLE, reason, 0, None)


def _unbounded(density: NavigationDensity) -> str:
    """Return why U = 1/ρ is not the potential of a density's law, as a phrase; empty if it is."""
    parameters = density.parameters
    if parameters.gauge != Gauge.RECIPROCAL:
        return f"gauge {str(parameters.gauge)!r}, not 'reciprocal'"
    if parameters.theta > 0.0:
        return f"theta = {parameters.theta:g}, not 0: U is finite on obstacles"
    if parameters.blend_radius > 0.0:
        return f"blend_radius = {parameters.blend_radius:g}, not 0"
    return ""


def _energy_and_law(
    task: Task, density: NavigationDensity, gains: Gains, q: Array, v: Array
) -> tuple[Array, Array]:
    """Return the energy (N,) and the torque of the unlimited law (N, nv) at states."""
    arm = task.arm
    energy, law = np.empty(len(q)), np.empty_like(v)
    for k, (position, velocity) in enumerate(zip(q, v, strict=True)):
        sample = density.evaluate(position)
        attract = gains.position * sample.gradient(Gauge.RECIPROCAL)
        acceleration = attract - gains.velocity * velocity
        law[k] = arm.mass_matrix(position) @ acceleration
        law[k] += arm.nonlinear_effects(position, velocity)
        potential = math.exp(min(-sample.log_value, LOG_MAX))
        energy[k] = 0.5 * velocity @ velocity / gains.position + potential
    return energy, law


@dataclass(frozen=True)
class RantzerRecord:
    """Where Rantzer's condition held; never a pass or fail."""

    gauge: str
    """Of the density; the condition's sign depends on it."""
    samples: int = 0
    """Samples that were looked at."""
    share: float | None = None
    """Share of them at which the condition holds; None without samples."""
    smallest: float | None = None
    """Smallest value of the condition [1/rad² or 1/m²], as `RantzerCondition.margin` has it."""
    time: float | None = None
    """Where that was [s]."""


def record_rantzer(task: Task, density: NavigationDensity, q: Array) -> RantzerRecord:
    r"""Record where along a run the condition :math:`\nabla\cdot(\rho k) \ge 0` holds.

    It is the condition of the plain density, towards the goal and without sub-goals, at 6 samples
    at most, evenly spaced; samples at the goal or in contact, where ρ is infinite or zero, are
    left out. The configurations q are (N, nq).

    Source: A. Rantzer, Systems & Control Letters 42(3), 2001; [ZNV] appendix.
    """
    arm, gauge = task.arm, density.parameters.gauge
    error = np.abs(arm.difference(density.goal, q)).max(axis=1)
    away = np.flatnonzero(error > REACHED_POSITION)
    found = []
    for k in away[:: 1 + len(away) // _RANTZER_SAMPLES]:
        if np.isfinite(density.evaluate(q[k]).log_value):
            value = float(rantzer_condition(density, q[k]).margin(gauge))
            if np.isfinite(value):
                found.append((value, float(k * task.simulation.dt)))
    if not found:
        return RantzerRecord(str(gauge))
    share = float(np.mean([value >= 0.0 for value, _ in found]))
    return RantzerRecord(str(gauge), len(found), share, *min(found))
