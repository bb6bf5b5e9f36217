"""Upright: a direction of a frame that points up, within an angle, and how fast joints tilt it."""

import math
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from densarm.arms.arm import Arm
from densarm.arms.inverse_kinematics import Mechanism, mechanism_of
from densarm.arms.joint_space import compose, place_joints, sliding_joints
from densarm.arms.models import frame_index
from densarm.errors import InvalidValueError
from densarm.values.arrays import Array
from densarm.values.checks import positive
from densarm.values.kernels import compiled

TILT = 0.1
"""How far what points up may tilt by default [rad]."""

_LEAST = 0.01  # [rad], a part of which is for tracking errors
_PARALLEL = 1e-9


def checked_tilt(tilt: float) -> float:
    """Return a largest tilt [rad], if it is from 0.01 to π/2.

    Raises:
        InvalidValueError: it is not.
    """
    if not _LEAST <= positive("tilt", tilt) < 0.5 * np.pi:
        raise InvalidValueError("tilt", tilt, f"from {_LEAST:g} to π/2 rad")
    return float(tilt)


class Upright(NamedTuple):
    """A direction of a frame that is to point up, as that of a cup in a hand."""

    frame: str
    """Name of the frame."""
    up: Array
    """The direction as the frame has it, a unit vector (3,)."""
    within: float
    """The largest angle between it and the world's z [rad]."""

    @classmethod
    def from_start(cls, arm: Arm, q: Array, frame: str, within: float) -> "Upright":
        """Return that which points up at a configuration (nq,).

        Raises:
            UnknownNameError: no such frame.
            InvalidValueError: an angle that `checked_tilt` refuses, or a frame that no joint moves.
        """
        mechanism_of(arm, frame)
        return cls(frame, arm.pose(q, frame).placement.rotation[2].copy(), checked_tilt(within))

    def tilts(self, arm: Arm, q: Array) -> Array:
        """Return the angles between it and the world's z at configurations (N, nq), (N,) [rad]."""
        tilts = np.empty(len(q))
        _write_tilts(mechanism_of(arm, self.frame), self.up, arm.angles(q), tilts)
        return tilts

    def largest_tilts(self, arm: Arm, q: Array, departure: Array) -> Array:
        """Return bounds on the tilt from each configuration to the next (N - 1,) [rad].

        Args:
            arm: the arm.
            q: configurations (N, nq).
            departure: how far the motion departs from each chord at most (N - 1, nv) [rad or m].
        """
        tilts, steps = self.tilts(arm, q), np.abs(arm.difference(q[:-1], q[1:]))
        return 0.5 * (tilts[:-1] + tilts[1:] + (steps + 2.0 * departure) @ self.rates(arm))

    def rates(self, arm: Arm) -> Array:
        r"""Return how fast joints tilt it at most (nv,) [rad/rad].

        .. math:: |\mathrm{tilt}(q_b) - \mathrm{tilt}(q_a)| \le \sum_j r_j |\Delta q_j|

        One of a joint that turns, none of one that slides, does not carry the frame, or has a
        vertical axis whatever the joints before it do.
        """
        model, rates = arm.model, np.where(sliding_joints(arm.model), 0.0, 1.0)
        carrying = list(model.supports[model.frames[frame_index(model, self.frame)].parentJoint])
        columns = [model.joints[joint].idx_v for joint in carrying[1:]]
        rates[np.setdiff1d(np.arange(arm.nv), columns)] = 0.0
        axes = pin.computeJointJacobians(model, arm.data, pin.neutral(model))[3:]
        for column in columns:
            if rates[column] and np.linalg.norm(axes[:2, column]) > _PARALLEL:
                break
            rates[column] = 0.0
        return rates

    def to_json(self) -> dict[str, Any]:
        """Return it as JSON data; `from_json` is its inverse."""
        return {**self._asdict(), "up": self.up.tolist()}

    @classmethod
    def from_json(cls, data: Any) -> "Upright":
        """Return it of the data of `to_json`."""
        return cls(str(data["frame"]), np.array(data["up"], np.float64), float(data["within"]))


@compiled
def _write_tilts(arm: Mechanism, up: Array, angles: Array, out: Array) -> None:
    """Write the angles (N,) from the world's z of a direction of a frame, at positions (N, nv)."""
    poses, frame, rest = np.empty((arm.parent.size, 12)), np.empty(12), np.zeros(angles.shape[1])
    for n in range(angles.shape[0]):
        place_joints(arm.parent, arm.joints, angles[n], rest, 0.0, poses)
        compose(poses[arm.last], arm.tool, frame)
        x = frame[0] * up[0] + frame[1] * up[1] + frame[2] * up[2]
        y = frame[3] * up[0] + frame[4] * up[1] + frame[5] * up[2]
        z = frame[6] * up[0] + frame[7] * up[1] + frame[8] * up[2]
        out[n] = math.atan2(math.hypot(x, y), z)
