"""FixedStepLoop: plant and controller stepped together at a fixed rate."""

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum, auto
from typing import Generic

import numpy as np

from densarm.arrays import Array
from densarm.configuration_space import ConfigurationSpace
from densarm.errors import InvalidValueError
from densarm.simulation.plant import C_contra, Integrator, Plant
from densarm.validation import one_of, positive, positive_integer

REACHED_POSITION = 0.01
"""Largest position error of a joint at the goal [rad or m]."""
REACHED_VELOCITY = 0.01
"""Largest velocity of a joint at the goal [rad/s or m/s]."""

_HELD_SHARE = 0.5  # the loop ends well inside the bounds above
_STALL_MOTION = 0.01  # [rad or m] within the stall time
_PROGRESS_INTERVAL = 200  # steps


@dataclass(frozen=True)
class SimulationParameters:
    """Parameters of the fixed-step loop.

    Raises:
        InvalidValueError: a value out of its range.
    """

    dt: float = 0.001
    """Time step of the plant [s]."""
    integrator: Integrator = Integrator.SEMI_IMPLICIT_EULER
    """How the dynamics are stepped."""
    control_divisor: int = 1
    """Plant steps per controller call; its input is held between."""
    time_limit: float = 60.0
    """Simulated time after which the run ends [s]."""
    hold_time: float = 0.1
    """Time that the goal must be held [s]."""
    stall_time: float = 1.0
    """Time within which an arm away from the goal moves by 0.01 rad, or counts as stuck [s]."""

    def __post_init__(self) -> None:
        for name in ("dt", "time_limit", "hold_time", "stall_time"):
            positive(name, getattr(self, name))
        positive_integer("control_divisor", self.control_divisor)
        integrator = Integrator(one_of("integrator", self.integrator, list(Integrator)))
        object.__setattr__(self, "integrator", integrator)
        if not 1.0 <= self.time_limit / self.dt <= 1e7:
            allowed = f"between 1 and 1e7 steps of dt = {self.dt}"
            raise InvalidValueError("time_limit", self.time_limit, allowed)

    @property
    def control_period(self) -> float:
        """Time between two calls of the controller [s]."""
        return self.dt * self.control_divisor


class LoopEnd(Enum):
    """Why the loop ended."""

    REACHED = auto()
    STALLED = auto()
    TIMED_OUT = auto()


@dataclass(frozen=True)
class Recording:
    """Every state of a run, first and last included."""

    time: Array
    """k dt (N,) [s]."""
    q: Array
    """Configurations (N, nq)."""
    v: Array
    """Velocities (N, nv) [rad/s or m/s]."""
    u: Array
    """Input of the plant held from each sample to the next (N, nv); the last row repeats."""
    end: LoopEnd


class FixedStepLoop(Generic[C_contra]):
    """Runs a controller on a plant until the goal is held, the motion stalls, or time is up.

    Args:
        space: where the motion takes place: the arm, or Rⁿ.
        plant: what is driven.
        parameters: time step and limits of time.

    Raises:
        InvalidValueError: a plant with another time step.
    """

    def __init__(
        self, space: ConfigurationSpace, plant: Plant[C_contra], parameters: SimulationParameters
    ) -> None:
        if plant.dt != parameters.dt:
            raise InvalidValueError("dt of the plant", plant.dt, f"the loop's, {parameters.dt}")
        self._space = space
        self._plant = plant
        self._parameters = parameters

    def run(
        self,
        controller: C_contra,
        start: Array,
        goal: Array,
        not_before: float = 0.0,
        on_progress: Callable[[float], None] = lambda _: None,
    ) -> Recording:
        """Return the run from rest at the start.

        Args:
            controller: called every `control_divisor` steps.
            start: configuration (nq,).
            goal: configuration (nq,).
            not_before: time [s] until which standing still is no stall.
            on_progress: told the simulated time [s] now and then.
        """
        p, q, v = self._parameters, start, np.zeros(self._space.nv)
        held, end = 0, LoopEnd.TIMED_OUT
        rest, rested_since = q, 0
        states, inputs = [(q, v)], []
        for k in range(round(p.time_limit / p.dt)):
            if k % p.control_divisor == 0:
                u = self._plant.control(controller, k * p.dt, q, v)
            q, v = self._plant.step(q, v, u)
            states.append((q, v))
            inputs.append(u)
            held = held + 1 if self._is_at_goal(q, v, goal) else 0
            if k * p.dt <= not_before or self._error(q, rest) > _STALL_MOTION:
                rest, rested_since = q, k
            if held * p.dt >= p.hold_time:
                end = LoopEnd.REACHED
                break
            if (k - rested_since) * p.dt >= p.stall_time:
                end = LoopEnd.STALLED
                break
            if k % _PROGRESS_INTERVAL == 0:
                on_progress(k * p.dt)
        inputs.append(inputs[-1])
        return Recording(
            time=p.dt * np.arange(len(states), dtype=np.float64),
            q=np.array([state[0] for state in states]),
            v=np.array([state[1] for state in states]),
            u=np.array(inputs),
            end=end,
        )

    def _is_at_goal(self, q: Array, v: Array, goal: Array) -> bool:
        if np.abs(v).max() > _HELD_SHARE * REACHED_VELOCITY:
            return False
        return self._error(goal, q) <= _HELD_SHARE * REACHED_POSITION

    def _error(self, q_a: Array, q_b: Array) -> float:
        """Return the largest difference of a joint [rad or m]."""
        return float(np.abs(self._space.difference(q_a, q_b)).max())
