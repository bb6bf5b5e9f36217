"""Conditions: what a comparison does to an arm without telling its controllers."""

from dataclasses import dataclass, replace

import numpy as np
import pinocchio as pin

from densarm.errors import DensarmError
from densarm.scenarios.scenario import Scenario
from densarm.scene.obstacles import Sphere
from densarm.scene.scene import Scene
from densarm.simulation.disturbances import Disturbances
from densarm.simulation.plants import PinocchioPlant
from densarm.values.arrays import Array
from densarm.values.checks import non_negative
from densarm.world.configurations import infeasibility
from densarm.world.swept_check import SweptCheck
from densarm.world.world import World

PUSH_TIME = 0.3
"""When the arm is pushed [s]."""

PASSING_TIME = 0.8
"""When the ball is where the straight motion from start to goal has its middle [s]."""

BALL = "moving ball"
"""Name of the obstacle that moves."""

_RADIUS = 0.08  # of the ball [m]
_DIRECTIONS = 100  # from which the ball may come
_CLEARANCE = 0.005  # of the ball where it begins, beyond the margin from start and goal [m]


@dataclass(frozen=True)
class Condition:
    """A disturbance of every run, or of none; zero for each that there is not.

    Raises:
        InvalidValueError: a negative number, or one that is not finite.
    """

    push: float = 0.0
    """Added once to, or taken from, the velocity of every joint [rad/s or m/s]."""
    payload: float = 0.0
    """A point mass at the end effector of the plant [kg]."""
    moving: float = 0.0
    """Speed of a ball of 80 mm radius that crosses the arm's way [m/s]. Planners see it where it is
    at first; it goes through other obstacles."""

    def __post_init__(self) -> None:
        for name in ("push", "payload", "moving"):
            non_negative(name, getattr(self, name))

    @property
    def name(self) -> str:
        """Return what is done, with its size."""
        units = {"push": "rad/s", "payload": "kg", "moving": "m/s"}
        told = [f"{k} {getattr(self, k):g} {unit}" for k, unit in units.items() if getattr(self, k)]
        return ", ".join(told) or "undisturbed"

    def applied(self, scenario: Scenario, seed: tuple[int, int]) -> "tuple[Scenario, Disturbed]":
        """Return the scenario, the ball among its obstacles, and the plant.

        Args:
            scenario: what is run; the plant moves the ball in the world of the returned one.
            seed: of the signs of the push and the direction of the ball.

        Raises:
            DensarmError: from no direction drawn the ball begins clear of start and goal.
        """
        random = np.random.default_rng(seed)
        signs = random.choice([-1.0, 1.0], scenario.arm.nv)
        if not self.moving:
            return scenario, Disturbed(self, scenario, self.push * signs)
        arm, margin = scenario.arm, scenario.control.margin + _CLEARANCE
        middle = arm.integrate(scenario.start, 0.5 * arm.difference(scenario.start, scenario.goal))
        pin.framesForwardKinematics(arm.model, arm.data, middle)
        centre = arm.data.oMf[arm.end_effector_frame].translation + arm.origin
        ends = {"start": scenario.start, "goal": scenario.goal}
        for direction in random.standard_normal((_DIRECTIONS, 3)):
            velocity = self.moving * direction / np.linalg.norm(direction)
            begin = centre - PASSING_TIME * velocity
            ball = Sphere(name=BALL, radius=_RADIUS, position=tuple(begin))
            if not infeasibility(SweptCheck(World(arm, Scene([ball])), margin), ends):
                scene = Scene([*scenario.scene, ball], scenario.scene.attachments)
                beside = replace(scenario, scene=scene)
                return beside, Disturbed(self, beside, self.push * signs, begin, velocity)
        raise DensarmError(f"moving = {self.moving:g}: the ball begins too near to start and goal")


class Disturbed:
    """A `Plant` that is pushed, carries a mass or stands in a world that moves.

    Args:
        condition: its payload.
        scenario: the arm, its time step, and the world whose ball is moved.
        push: added to the velocity (nv,) [rad/s or m/s] at `PUSH_TIME`.
        begin: where the ball is at first (3,) [m]; None without one.
        velocity: of the ball (3,) [m/s].
    """

    def __init__(
        self,
        condition: Condition,
        scenario: Scenario,
        push: Array,
        begin: Array | None = None,
        velocity: Array | None = None,
    ) -> None:
        simulation, heavier = scenario.simulation, Disturbances(payload=condition.payload)
        self._plant = PinocchioPlant(scenario.arm, simulation.dt, simulation.integrator, heavier)
        self.dt = simulation.dt
        self._world, self._push, self._begin, self._velocity = scenario.world, push, begin, velocity
        self._steps = 0

    def step(self, q: Array, v: Array, u: Array) -> tuple[Array, Array]:
        """Act as `Plant.step`, and move the ball."""
        if self._steps == round(PUSH_TIME / self.dt):
            v = v + self._push
        q, v = self._plant.step(q, v, u)
        self._steps += 1
        if self._begin is not None and self._velocity is not None:
            time = self._steps * self.dt
            self._world.move_obstacle(BALL, self._begin + time * self._velocity)
        return q, v
