"""Disturbances: how an arm differs from its model, as data, and what that does to a loop."""

import json
from collections import deque
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from densarm.arms.arm import Arm
from densarm.errors import InvalidValueError, UnknownNameError
from densarm.values.arrays import Array
from densarm.values.checks import (
    finite_number,
    finite_tuple,
    non_negative,
    non_negative_integer,
    positive,
)
from densarm.values.documented import documented

PerJoint = float | tuple[float, ...]
"""One number for all joints, or one for each."""

_OF_SIGNALS = ("torque_delay", "encoder_noise", "velocity_noise", "torque_quantum", "pushes")


@documented
@dataclass(frozen=True)
class Push:
    """A shove at one joint, by as much torque as its velocity takes, whatever the arm does.

    Raises:
        InvalidValueError: a value out of its range.
    """

    time: float
    """When it begins [s]."""
    joint: str
    """Name of the joint."""
    velocity: float
    """What it adds to the joint's velocity, evenly over its duration [rad/s or m/s]."""
    duration: float = 0.02
    """[s]."""

    def __post_init__(self) -> None:
        non_negative("pushes.time", self.time)
        finite_number("pushes.velocity", self.velocity)
        positive("pushes.duration", self.duration)


@documented
@dataclass(frozen=True)
class Disturbances:
    """How an arm differs from its model, which no controller is told; by default in nothing.

    Raises:
        InvalidValueError: a value out of its range.
    """

    mass_scale: PerJoint = 1.0
    """Masses and inertias in units of the model's, of what each joint carries up to the next."""
    payload: float = 0.0
    """A point mass [kg]."""
    payload_frame: str = ""
    """Frame that carries it; empty for the end effector's."""
    payload_offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Where it is in that frame [m]."""
    viscous: PerJoint = 0.0
    """Friction that grows with velocity [N·m·s/rad or N·s/m]."""
    coulomb: PerJoint = 0.0
    """Dry friction, which holds a joint up to it [N·m or N]."""
    armature: PerJoint = 0.0
    """Inertia of rotors, beside what the model has [kg·m² or kg]."""
    torque_delay: float = 0.0
    """Time until a torque acts, to the nearest time step; the first one does before [s]."""
    torque_quantum: float = 0.0
    """Torque acts in whole multiples of it; any for zero [N·m or N]."""
    encoder_noise: float = 0.0
    """Standard deviation of each measured position [rad or m]."""
    velocity_noise: float = 0.0
    """Standard deviation of each measured velocity [rad/s or m/s]."""
    base_tilt_deg: float = 0.0
    """Angle by which the base leans about the world's x axis, that is gravity the other way [°]."""
    pushes: tuple[Push, ...] = ()
    """Shoves from outside."""
    seed: int = 0
    """Seed of the noise."""

    def __post_init__(self) -> None:
        for name in ("mass_scale", "viscous", "coulomb", "armature"):
            given = getattr(self, name)
            values = given if isinstance(given, tuple | list | np.ndarray) else (given,)
            check = positive if name == "mass_scale" else non_negative
            checked = tuple(check(name, value) for value in values)
            object.__setattr__(self, name, checked if values is given else checked[0])
        for name in ("payload", "torque_delay", "torque_quantum", "encoder_noise"):
            non_negative(name, getattr(self, name))
        non_negative("velocity_noise", self.velocity_noise)
        offset = finite_tuple("payload_offset", self.payload_offset, 3)
        object.__setattr__(self, "payload_offset", offset)
        if not abs(finite_number("base_tilt_deg", self.base_tilt_deg)) <= 180.0:
            raise InvalidValueError("base_tilt_deg", self.base_tilt_deg, "from -180 to 180")
        object.__setattr__(self, "pushes", tuple(self.pushes))
        non_negative_integer("seed", self.seed)

    @property
    def given(self) -> dict[str, Any]:
        """What is not by default, as JSON data; empty for an arm that is its model."""
        default = asdict(Disturbances())
        told = {key: x for key, x in asdict(self).items() if x != default[key]}
        # Lists where there are tuples, as a record that was read again has them.
        return dict(json.loads(json.dumps(told))) if set(told) - {"seed"} else {}

    @property
    def of_the_body(self) -> dict[str, Any]:
        """Those of `given` that a plant must have itself, not the loop around it."""
        return {k: x for k, x in self.given.items() if k not in (*_OF_SIGNALS, "seed")}

    def joint_values(self, name: str, arm: Arm) -> Array:
        """Return one value for each joint (nv,) of a field that may be one number for all.

        Raises:
            InvalidValueError: neither one number nor one per joint.
        """
        value = np.array(getattr(self, name), np.float64)
        if value.shape not in [(), (arm.nv,)]:
            allowed = f"one number, or {arm.nv}: one per joint of {arm.name!r}"
            raise InvalidValueError(f"disturbances.{name}", getattr(self, name), allowed)
        return np.broadcast_to(value, (arm.nv,)).copy()

    def model(self, arm: Arm) -> pin.Model:
        """Return the arm's model as it truly is: its masses, payload, rotors and gravity.

        Raises:
            UnknownNameError: no such frame to carry the payload.
            InvalidValueError: not one value per joint.
        """
        model = arm.model.copy()
        for joint, scale in enumerate(self.joint_values("mass_scale", arm), 1):
            inertia = model.inertias[joint]
            model.inertias[joint] = pin.Inertia(
                scale * inertia.mass, inertia.lever, scale * inertia.inertia
            )
        if self.payload:
            names = [frame.name for frame in model.frames]
            if self.payload_frame and self.payload_frame not in names:
                raise UnknownNameError("disturbances.payload_frame", self.payload_frame, names)
            carrier = self.payload_frame or arm.end_effector
            frame = model.frames[model.getFrameId(carrier)]
            point = pin.Inertia(self.payload, np.array(self.payload_offset), np.zeros((3, 3)))
            model.appendBodyToJoint(frame.parentJoint, point, frame.placement)
        model.armature = model.armature + self.joint_values("armature", arm)
        model.gravity.linear = self.tilted(model.gravity.linear)
        return model

    def require_fit(self, arm: Arm) -> None:
        """Refuse what is about another arm.

        Raises:
            UnknownNameError: no such frame to carry the payload, or joint to push.
            InvalidValueError: not one value per joint.
        """
        self.model(arm)
        for name in ("viscous", "coulomb"):
            self.joint_values(name, arm)
        for push in self.pushes:
            if push.joint not in arm.joint_names:
                raise UnknownNameError("disturbances.pushes.joint", push.joint, arm.joint_names)

    def tilted(self, gravity: Array) -> Array:
        """Return gravity (3,) [m/s²] as a base that leans feels it."""
        turn = pin.utils.rotate("x", -np.deg2rad(self.base_tilt_deg))
        return np.asarray(turn @ gravity)


class Signals:
    """What lies between a controller and an arm in one run: sensors, a delay, and who pushes.

    Args:
        disturbances: what disturbs them; they fit the arm.
        arm: the arm.
        dt: time step [s].
    """

    def __init__(self, disturbances: Disturbances, arm: Arm, dt: float) -> None:
        self._told, self._arm, self._dt = disturbances, arm, dt
        self._random = np.random.default_rng(disturbances.seed)
        steps = round(disturbances.torque_delay / dt)
        self._sent: deque[Array] = deque(maxlen=steps + 1)

    def measured(self, q: Array, v: Array) -> tuple[Array, Array]:
        """Return what sensors tell of a state, q (nq,) and v (nv,)."""
        told = self._told
        if told.encoder_noise:
            noise = told.encoder_noise * self._random.standard_normal(self._arm.nv)
            q = self._arm.integrate(q, noise)
        if told.velocity_noise:
            v = v + told.velocity_noise * self._random.standard_normal(self._arm.nv)
        return q, v

    def acting(self, u: Array) -> Array:
        """Return the torque that acts during the step for which u (nv,) is commanded."""
        if quantum := self._told.torque_quantum:
            u = quantum * np.round(u / quantum)
        self._sent.append(u)
        return self._sent[0]

    def pushed(self, t: float, v: Array) -> Array:
        """Return the velocity (nv,) with what pushes add to it in the step after t [s]."""
        for push in self._told.pushes:
            # Rounding of t may not give a push one step more.
            if -0.5 * self._dt <= t - push.time < push.duration - 0.5 * self._dt:
                steps = max(1, round(push.duration / self._dt))
                v = v.copy()
                v[self._arm.joint_names.index(push.joint)] += push.velocity / steps
        return v
