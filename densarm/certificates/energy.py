"""Energy: whether the energy of a regulated run never grew."""

import math
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from densarm.arrays import Array
from densarm.certificates.plain_density import plain_density
from densarm.density import Gauge
from densarm.density.navigation_density import LOG_MAX
from densarm.scenario import ControlForm, GuideKind, Scenario

_SAMPLES = 100  # of the run at most that are looked at
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


def record_energy(scenario: Scenario, q: Array, v: Array, tau: Array) -> EnergyRecord:
    r"""Record whether the energy of a run never grew.

    .. math::

        \ddot q = -K_p \nabla U - K_v \dot q, \quad U = 1/\rho
        \quad\Rightarrow\quad
        E = \tfrac12 \dot q^T K_p^{-1} \dot q + U, \quad
        \dot E = -\dot q^T K_p^{-1} K_v \dot q \le 0

    U is infinite on obstacles, so that no motion of finite energy reaches one. It takes a
    regulation by the plain density in the reciprocal gauge, with θ = 0 and no blend, whose torque
    nothing limited: neither the arm's limits nor the speed law. Torque is compared with the law's,
    and energy with the one before, at 100 samples at most, evenly spaced.

    Args:
        scenario: arm, scene, goal and parameters.
        q: configurations (N, nq).
        v: velocities (N, nv) [rad/s or m/s].
        tau: torque held from each sample to the next (N, nv) [N·m or N].
    """
    reason = _other_kind(scenario) or ("no motion" if len(q) < 2 else "")
    if reason:
        return EnergyRecord(EnergyVerdict.NOT_APPLICABLE, reason, 0, None)
    divisor = scenario.simulation.control_divisor
    every = divisor * (1 + (len(q) - 1) // (_SAMPLES * divisor))
    looked_at = np.arange(0, len(q) - 1, every)  # the last torque repeats the one before
    energy, law = _energy_and_law(scenario, q[looked_at], v[looked_at])
    same = np.abs(tau[looked_at] - law) <= _SAME_TORQUE * np.abs(law).max()
    shaped = int(np.count_nonzero(~same.all(axis=1)))
    if shaped:
        reason = f"limits or the speed law shaped the torque at {shaped} of {len(law)} samples"
        return EnergyRecord(EnergyVerdict.NOT_APPLICABLE, reason, len(law), None)
    return _judged(energy, np.asarray(looked_at * scenario.simulation.dt, dtype=np.float64))


def _judged(energy: Array, time: Array) -> EnergyRecord:
    with np.errstate(over="ignore"):  # from next to nothing to a contact
        rise = np.diff(energy) / (energy[0] or 1.0)
    largest = float(rise.max(initial=-1.0))
    if largest <= _ROUNDING:
        detail = f"never grew from {energy[0]:.3g} to {energy[-1]:.3g} at {len(energy)} samples"
        return EnergyRecord(EnergyVerdict.HOLDS, detail, len(energy), largest)
    at = time[1 + int(rise.argmax())]
    detail = (
        f"grew by {largest:.2g} times its first before t = {at:.3f} s, at {len(energy)} samples"
    )
    finite = largest if np.isfinite(largest) else None
    return EnergyRecord(EnergyVerdict.VIOLATED, detail, len(energy), finite)


def _other_kind(scenario: Scenario) -> str:
    """Return why the argument is not about a scenario, as a phrase; empty if it is."""
    control, density = scenario.control, scenario.density
    if control.form != ControlForm.REGULATION:
        return f"control form {str(control.form)!r}, not 'regulation'"
    if control.guide != GuideKind.DIRECT:
        return f"guide {str(control.guide)!r}, whose sub-goals change U, not 'direct'"
    if density.gauge != Gauge.RECIPROCAL:
        return f"gauge {str(density.gauge)!r}, not 'reciprocal'"
    if density.theta > 0.0:
        return f"theta = {density.theta:g}, not 0: U is finite on obstacles"
    if density.blend_radius > 0.0:
        return f"blend_radius = {density.blend_radius:g}, not 0"
    return ""


def _energy_and_law(scenario: Scenario, q: Array, v: Array) -> tuple[Array, Array]:
    """Return the energy (N,) and the torque of the unlimited law (N, nv) at states."""
    arm, gains, density = scenario.arm, scenario.gains, plain_density(scenario)
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
