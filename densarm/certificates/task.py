"""Task: what a run is about, and is judged by."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from enum import StrEnum
from pathlib import Path
from typing import Any

import coal
import numpy as np

from densarm.arms.arm import Arm
from densarm.arms.description import RobotDescription
from densarm.density.navigation_density import DensityParameters
from densarm.density.unsafe_sets import SensingParameters
from densarm.errors import DensarmError, InvalidValueError, RobotDescriptionError
from densarm.scene.mesh import Mesh
from densarm.scene.obstacles import geometry_objects
from densarm.scene.scene import Scene
from densarm.values.arrays import Array
from densarm.values.checks import (
    finite_vector,
    non_negative,
    one_of,
    positive,
    positive_integer,
)
from densarm.values.documented import documented
from densarm.values.tables import parse_table

REACHED_POSITION = 0.01
"""Largest position error of a joint at the goal [rad or m]."""

REACHED_VELOCITY = 0.01
"""Largest velocity of a joint at the goal [rad/s or m/s]."""

PLANTS = ("pinocchio", "mujoco")
"""Names of plants: the arm's model, or one of one's own; and what MuJoCo makes of an arm."""

ROBOT = "robot"
"""Stands for a plant in the record of what a real arm did."""

_LARGE = 10.0  # longest side of a mesh that is worth a remark [m]

FORMAT = 2
"""Version of the JSON form."""


class Integrator(StrEnum):
    """How a plant advances by one step."""

    SEMI_IMPLICIT_EULER = "semi_implicit_euler"
    """v⁺ = v + a Δt, then q⁺ = q ⊕ v⁺ Δt."""
    RK4 = "rk4"
    """The classical Runge-Kutta method of order four, torque held."""


class Input(StrEnum):
    """What a plant is told."""

    TORQUE = "torque"
    """Joint torques, by `Controller.torque`."""
    VELOCITY = "velocity"
    """Joint velocities, by `VelocityController.velocity`."""
    POSITION = "position"
    """Joint positions, by `PositionTracking.position`."""


@documented
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
    planning_time: float = 0.3
    """Simulated time that planning again takes, while the loop goes on [s]."""

    def __post_init__(self) -> None:
        for name in ("dt", "time_limit", "hold_time", "stall_time"):
            positive(name, getattr(self, name))
        non_negative("planning_time", self.planning_time)
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


@documented
@dataclass(frozen=True, eq=False)
class Task:
    """From a start to a goal among obstacles, and how time is stepped meanwhile.

    Raises:
        InvalidValueError: start or goal is not a configuration, or a plant of no such name.
    """

    arm: Arm
    scene: Scene
    start: Array
    """Configuration at the start (nq,)."""
    goal: Array | None = None
    """Configuration to reach (nq,); None where a controller has none."""
    start_velocity: Array | None = None
    """Velocity at the start (nv,) [rad/s or m/s], of a phase after another; None for rest."""
    name: str = "run"
    title: str = "run"
    margin: float = 0.0
    """Safety margin m that planning and control keep [m]; the certificate proves no contact."""
    passive_speed: float | None = None
    """Declared speed that what moves does not exceed [m/s], before which the arm claims to come to
    rest; None where nothing is claimed of that."""
    kappa: float = 1.0
    """κ of the goal distance."""
    density: DensityParameters = field(default_factory=DensityParameters)
    sensing: SensingParameters = field(default_factory=SensingParameters)
    simulation: SimulationParameters = field(default_factory=SimulationParameters)
    input: Input = Input.TORQUE
    """What the plant is told."""
    plant: str = PLANTS[0]
    """What is driven: one of `PLANTS`, or `ROBOT`."""
    disturbances: Mapping[str, Any] = field(default_factory=dict)
    """How the plant differs from the model, `Disturbances.given`; empty where it does not."""
    settings: Mapping[str, Any] = field(default_factory=dict)
    """What else a scenario says, as JSON data: read by those who plan and control, kept here."""

    def __post_init__(self) -> None:
        one_of("plant", self.plant, (*PLANTS, ROBOT))
        if self.passive_speed is not None:
            positive("passive_speed", self.passive_speed)
        for key in ("start", "goal"):
            if getattr(self, key) is not None:
                q = self.arm.check_configuration(f"{key} configuration", getattr(self, key))
                object.__setattr__(self, key, q)
        if self.start_velocity is not None:
            v = finite_vector("start velocity", self.start_velocity, self.arm.nv)
            object.__setattr__(self, "start_velocity", v)

    def __repr__(self) -> str:
        return f"Task({self.title!r}, {self.arm}, {self.scene})"

    @property
    def large_meshes(self) -> dict[str, float]:
        """Longest side [m] of each mesh above 10 m, link or obstacle: perhaps its unit is wrong."""
        items = [i for i in self.arm.collision_model.geometryObjects if Path(i.meshPath).suffix]
        bodies = (*self.scene, *(held.body for held in self.arm.description.attachments))
        for body in bodies:
            items += geometry_objects(body) if isinstance(body, Mesh) else []
        sides = {item.name: _longest_side(item.geometry) for item in items}
        return {name: side for name, side in sides.items() if side > _LARGE}

    @property
    def begins_in_motion(self) -> bool:
        """Whether it has a velocity at the start, as a phase after another alone may."""
        return self.start_velocity is not None and bool(self.start_velocity.any())

    def goal_error(self, q: Array) -> float:
        """Return the largest joint error at q (nq,) [rad or m]; NaN without a goal."""
        if self.goal is None:
            return float("nan")
        return float(np.abs(self.arm.difference(self.goal, q)).max())

    def to_json(self) -> dict[str, Any]:
        """Return JSON data that suffices to rebuild the task; `from_json` is its inverse."""
        goal = None if self.goal is None else self.arm.angles(self.goal).tolist()
        begun = self.start_velocity
        control = dict(self.settings.get("control", {}))
        control |= {key: getattr(self, key) for key in ("margin", "kappa", "passive_speed")}
        return {
            **self.settings,
            "format": FORMAT,
            "name": self.name,
            "title": self.title,
            "robot": self.arm.description.to_json(),
            "mesh_sha256": self.arm.mesh_hashes(),
            "obstacles": self.scene.to_json(),
            "start": self.arm.angles(self.start).tolist(),
            "goal": goal,
            **({} if begun is None else {"start_velocity": begun.tolist()}),
            "input": str(self.input),
            "plant": self.plant,
            "disturbances": dict(self.disturbances),
            "control": control,
            **{key: asdict(getattr(self, key)) for key in _TABLES},
        }

    @classmethod
    def from_json(cls, data: Any) -> "Task":
        """Rebuild a task from the data of `to_json`, or of a run of version 0.1.

        Raises:
            DensarmError: the data is not a task, or a mesh file has changed since.
        """
        if not isinstance(data, Mapping) or data.get("format") not in (1, FORMAT):
            raise DensarmError(f"scenario: not of format {FORMAT}")
        try:
            arm = Arm(RobotDescription.from_json(data["robot"]))
            control, goal = dict(data["control"]), data["goal"]
            own = _OTHER_KEYS | {item.name for item in fields(cls)}
            task = cls(
                arm=arm,
                scene=Scene.from_json(data["obstacles"]),
                start=arm.configuration(data["start"]),
                goal=None if goal is None else arm.configuration(goal),
                start_velocity=data.get("start_velocity"),
                name=str(data["name"]),
                title=str(data["title"]),
                margin=float(control["margin"]),
                kappa=float(control["kappa"]),
                passive_speed=control.get("passive_speed"),
                input=Input(data.get("input", Input.TORQUE)),
                plant=str(data.get("plant", PLANTS[0])),
                disturbances=dict(data.get("disturbances", {})),
                settings={key: value for key, value in data.items() if key not in own},
                **{key: parse_table(key, kind, data[key]) for key, kind in _TABLES.items()},
            )
            recorded = data["mesh_sha256"]
        except KeyError as error:
            raise DensarmError(f"scenario: the key {error} is missing") from None
        if arm.mesh_hashes() != recorded:
            raise RobotDescriptionError(
                f"robot {arm.name!r}: its mesh files have changed since the recording"
            )
        return task


def _longest_side(shape: coal.CollisionGeometry) -> float:
    shape.computeLocalAABB()
    box = shape.aabb_local
    return float((box.max_ - box.min_).max())


_TABLES: Mapping[str, type[Any]] = {
    "density": DensityParameters,
    "sensing": SensingParameters,
    "simulation": SimulationParameters,
}

_OTHER_KEYS = {"format", "robot", "mesh_sha256", "obstacles"}  # that are no fields
