"""FrankaRobot: torque at 1 kHz to a Franka Research 3, by libfranka."""

import contextlib
from typing import Any

import numpy as np
import pinocchio as pin

from densarm.arms.arm import Arm
from densarm.certificates.task import Input
from densarm.errors import InvalidValueError, RobotError
from densarm.hardware.robot import Reading, driver, in_its_words
from densarm.values.arrays import Array

_JOINTS = 7
_RATE_SHARE = 0.999  # of the torque rate: beyond it the robot stops
_REST = 0.01  # [rad/s], from which control is ended as after a motion


class FrankaRobot:
    r"""A Franka Research 3 behind libfranka's network protocol.

    The robot adds gravity's torque. What is sent is

    .. math:: \tau_J = c + s\,(\tau - g(q) - c), \qquad c = (\tau_J^d + \tau_J^-) / 2

    with the largest s ≤ 1 by which no joint's torque changes by more than its rate allows in a
    millisecond, neither from τ_J^d, by which the robot acted when it told its state, nor from
    τ_J^-, which was sent last: a late command reaches the robot after a state that does not tell it
    yet. Where they are too far apart for both, the robot lost commands, and c = τ_J^d. Where torque
    changes faster the robot stops, by its reflex `controller_torque_discontinuity`. densarm's laws
    keep to the rate themselves, so that s = 1 unless a packet was late or lost. τ_J keeps the
    torque limits too, as the robot wants it.

    Args:
        address: the robot's, or a simulator's.
        arm: its model; g is of its bodies, as they are told to the robot, its gripper's included.
        needs_real_time: whether to refuse a kernel that is not for real time, as libfranka does.

    Attributes:
        state: pylibfranka's `RobotState` that was read last.

    Raises:
        DensarmError: pylibfranka is not installed.
        InvalidValueError: the arm has not seven joints.
        RobotError: nothing answers there, the robot cannot be driven now, or runs another version.

    Source: libfranka, `rate_limiting.h` and `ActiveControl`.
    """

    input = Input.TORQUE
    period = 1e-3

    def __init__(self, address: str, arm: Arm, *, needs_real_time: bool = False) -> None:
        self._franka = franka = driver("pylibfranka", "franka")
        if arm.nv != _JOINTS:
            raise InvalidValueError("joints of the arm", arm.nv, f"{_JOINTS}, a Franka's")
        arm.require_masses("torque")
        self._address, self._model, self._data = address, arm.model, arm.model.createData()
        rate = np.minimum(arm.limits.torque_rate, 1000.0)  # N·m/s, of every Franka
        self._effort = arm.limits.effort  # of what is sent too, which gravity is no part of
        self._step = _RATE_SHARE * self.period * rate
        self._failures = (RuntimeError, franka.FrankaException)
        self._control: Any = None
        self._sent = np.zeros(_JOINTS)  # [N·m], while it is controlled
        config = franka.RealtimeConfig
        try:
            self._robot = franka.Robot(
                address, config.kEnforce if needs_real_time else config.kIgnore
            )
            self.state = self._robot.read_once()
        except self._failures as error:
            raise in_its_words(self._address, "cannot be reached", error) from None
        self.require_ready()

    def require_ready(self) -> None:
        """Raise `RobotError` unless the robot waits for commands."""
        state, mode = self.state, self._franka.RobotMode
        if state.robot_mode == mode.Idle and not state.current_errors:
            return
        errors = str(state.current_errors or state.last_motion_errors)
        what = f"in mode {state.robot_mode.name}" + (f", for {errors}" if errors != "[]" else "")
        mend = {
            "UserStopped": "release its stop",
            "Reflex": "clear its way, then call recover()",
            "Guiding": "release its guiding button",
        }.get(state.robot_mode.name, "see its Desk")
        raise RobotError(f"the robot at {self._address} is {what}: {mend}")

    def recover(self) -> None:
        """Clear a reflex, so that the robot can be driven again.

        Raises:
            RobotError: it cannot be cleared.
        """
        try:
            self._robot.automatic_error_recovery()
            self.state = self._robot.read_once()
        except self._failures as error:
            raise in_its_words(self._address, "does not recover", error) from None
        self.require_ready()

    def read(self) -> Reading:
        """Act as `Robot.read`."""
        try:
            if self._control is None:
                self.state = self._robot.read_once()
            else:
                self.state, _ = self._control.readOnce()
        except self._failures as error:
            self._control = None
            raise in_its_words(self._address, "stopped", error) from None
        state = self.state
        return Reading(state.time.to_sec(), np.array(state.q), np.array(state.dq))

    def command(self, u: Array) -> None:
        """Act as `Robot.command`, u the torque with gravity's [N·m]."""
        state = self.state
        free = u - pin.computeGeneralizedGravity(self._model, self._data, np.array(state.q))
        acting = np.array(state.tau_J_d)
        middle = 0.5 * (acting + (acting if self._control is None else self._sent))
        room = self._step - np.abs(acting - middle)
        if room.min() <= 0.0:
            middle, room = acting, self._step
        change = free - middle
        change /= max(1.0, float((np.abs(change) / room).max()))
        self._sent = np.clip(middle + change, -self._effort, self._effort)
        try:
            if self._control is None:
                self._control = self._robot.start_torque_control()
                self.state, _ = self._control.readOnce()
            self._control.writeOnce(self._franka.Torques(self._sent.tolist()))
        except self._failures as error:
            self._control = None
            raise in_its_words(self._address, "stopped", error) from None

    def stop(self) -> None:
        """Act as `Robot.stop`: the robot goes on holding itself."""
        control, self._control = self._control, None
        if control is None:
            return
        with contextlib.suppress(*self._failures):
            self.state, _ = control.readOnce()
            if np.abs(self.state.dq).max() <= _REST:
                last = self._franka.Torques(self.state.tau_J_d)
                last.motion_finished = True
                control.writeOnce(last)
                return
        with contextlib.suppress(*self._failures):
            self._robot.stop()
