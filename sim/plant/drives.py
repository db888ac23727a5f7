"""Drives of the joints: servos with feed-forward torque, on their own gains or those of a command, or torque alone."""

from __future__ import annotations

import math

import mujoco
import numpy as np

from wbc.base.errors import InputError, shown
from wbc.base.numbers import Array
from wbc.core.signals import Command
from wbc.robots.description import RobotDescription

Gains = tuple[Array, Array]
"""kp and kd of all joints."""

Targets = tuple[Array, Gains | None]
"""Controls of the actuators, and gains of the servos; without gains they are off."""


class Drives:
    """Actuator targets of a plant, whose actuators come in the order of the joints.

    Position control: kp (q_ref − q) + kd (q̇_ref − q̇) + τ. The gains on q and q̇ are in the actuators' bias, which the
    integrator sees; the rest is the target, and in torque control all of it is. A command that brings gains (hybrid
    control) has them until the next one.
    """

    def __init__(self, model: mujoco.MjModel, description: RobotDescription) -> None:
        self._model = model
        self._joint_names = description.joint_names
        self._own = np.array(description.kp), np.array(description.kd)
        self._servo_part = np.zeros(model.nu)
        self._gains: Gains | None = self._own  # those at work; None: servos off

    def reset(self, position: Array, controls: Array) -> None:
        """Hold joint positions, shape (na,), with the servos."""
        self._switch(self._own)
        np.multiply(self._own[0], position, out=controls)

    def read(self, command: Command) -> Targets:
        """Return the targets of a command, whose arrays the next one overwrites, or raise an `InputError`."""
        position, velocity, torque = command.joint_position, command.joint_velocity, command.joint_torque
        kp, kd, shape = command.kp, command.kd, self._servo_part.shape
        gains: Gains | None = None
        wrong = getattr(torque, "shape", None) != shape
        for part in (position, velocity, kp, kd, released := command.released):
            wrong = wrong or (part is not None and getattr(part, "shape", None) != shape)
        if wrong or (released is not None and released.dtype != bool):
            command.check(self._joint_names)
            raise InputError(f"parts of a command must be NumPy arrays, got {shown(command)}")
        if position is None:
            if velocity is not None or kp is not None or kd is not None:
                command.check(self._joint_names)  # zeros are none
            target = torque
        else:
            gains = own = self._checked_gains(command)
            target = np.multiply(own[0], position, out=self._servo_part)
            if velocity is not None:
                target += own[1] * velocity
            target += torque
        if not math.isfinite(target.dot(target)):
            command.check(self._joint_names)
            raise InputError("command: references so large that their squares are not finite")
        return target, gains

    def follow(self, targets: Targets, controls: Array) -> None:
        """Write targets into the controls of the simulation; gains change suddenly."""
        target, gains = targets
        if gains is not self._gains:
            self._switch(gains)
        controls[:] = target

    def _switch(self, gains: Gains | None) -> None:
        """Set the gains of the servos: they are the bias of the actuators."""
        self._gains = gains
        bias = self._model.actuator_biasprm
        bias[:, 1], bias[:, 2] = (0.0, 0.0) if gains is None else (-gains[0], -gains[1])

    def _checked_gains(self, command: Command) -> Gains:
        if command.kp is None and command.kd is None:
            return self._own
        kp, kd = command.gains(self._own)
        if not ((kp >= 0.0) & (kd >= 0.0)).all() or not math.isfinite(kp.dot(kp) + kd.dot(kd)):
            command.check(self._joint_names)
        at_work = self._gains
        if at_work is not None and np.array_equal(kp, at_work[0]) and np.array_equal(kd, at_work[1]):
            return at_work
        return np.array(kp), np.array(kd)
