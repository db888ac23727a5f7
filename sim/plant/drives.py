"""Drives of the joints: servos with feed-forward torque, or torque alone."""

from __future__ import annotations

import math
from typing import Literal

import mujoco
import numpy as np

from wbc.core.errors import Array, InputError
from wbc.core.signals import Command
from wbc.robots.description import RobotDescription

Interpolation = Literal["hold", "linear"]


class Drives:
    """Actuator targets of a plant.

    Position control: kp (q_ref − q) + kd (q̇_ref − q̇) + τ. The gains on q and q̇ are in the actuators' bias, which the
    integrator sees; the rest is the target, and in torque control all of it is.

    Attributes:
        target: Targets at the end of the control period, shape (na,).
        start: Targets at its begin; the array `target` itself when commands are held.
    """

    def __init__(
        self, model: mujoco.MjModel, description: RobotDescription, interpolation: Interpolation
    ) -> None:
        """Take the servo gains.

        Args:
            model: MuJoCo's model, its actuators in the order of the joints; servos are switched in it.
            description: The robot.
            interpolation: "hold" or "linear".
        """
        self._model = model
        self._joint_names = description.joint_names
        self._kp, self._kd = np.array(description.kp), np.array(description.kd)
        self._servo_bias = np.array(model.actuator_biasprm)
        self.target, self._servo_part = np.zeros(model.nu), np.zeros(model.nu)
        self.start = np.zeros(model.nu) if interpolation == "linear" else self.target
        self._position_control = True

    def reset(self, position: Array) -> None:
        """Hold joint positions, shape (na,), with the servos."""
        self._switch_servos(on=True)
        np.multiply(self._kp, position, out=self.target)
        self.start[:] = self.target

    def read(self, command: Command) -> Array:
        """Check a command and return its targets, shape (na,), valid until the next call; nothing else changes.

        Raises:
            InputError: A reference of the wrong shape or not finite, or a velocity without a position.
        """
        position, velocity, torque = command.joint_position, command.joint_velocity, command.joint_torque
        shape = self.target.shape
        if (
            _shape(torque) != shape
            or (position is not None and _shape(position) != shape)
            or (velocity is not None and _shape(velocity) != shape)
        ):
            raise InputError(
                f"joint references of a command must be arrays of shape {shape}, got torque {_shape(torque)}, "
                f"position {_shape(position)}, velocity {_shape(velocity)}"
            )
        if position is None:
            if velocity is not None:
                raise InputError("a command with a velocity reference needs a position reference, too")
            target = torque
        else:
            target = np.multiply(self._kp, position, out=self._servo_part)
            if velocity is not None:
                target += self._kd * velocity
            target += torque
        if not math.isfinite(target.dot(target)):
            self._refuse(command)
        return target

    def follow(self, target: Array, *, position_control: bool) -> None:
        """Take targets that `read` returned for the coming control period.

        Args:
            target: Targets, shape (na,).
            position_control: True with servos; a change of it is not interpolated.
        """
        if position_control is not self._position_control:
            self._switch_servos(on=position_control)
            self.target[:] = target
        if self.start is not self.target:
            self.start[:] = self.target
        self.target[:] = target

    def _switch_servos(self, *, on: bool) -> None:
        """Set the gains of the servos: they are the bias of the actuators."""
        self._position_control = on
        self._model.actuator_biasprm[:] = self._servo_bias if on else 0.0

    def _refuse(self, command: Command) -> None:
        for name in ("joint_position", "joint_velocity", "joint_torque"):
            value = getattr(command, name)
            if value is not None and not np.isfinite(value).all():
                joint = self._joint_names[int(np.argmin(np.isfinite(value)))]
                raise InputError(f"command: {name} of joint '{joint}' is not finite")
        raise InputError("command: references so large that their squares are not finite")


def _shape(array: Array | None) -> tuple[int, ...] | None:
    """Return the shape of an array, None for anything else."""
    return getattr(array, "shape", None)
