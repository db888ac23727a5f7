"""The way of a machine from any posture to the stand: references, gains and torques of the first seconds."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from wbc.core.errors import Array
from wbc.core.signals import Command, Measurement
from wbc.machine.loads import SoleLoads
from wbc.robots import RobotDescription


class SafeStart:
    """Ramp from the measured posture to half-sitting.

    The servos hold the measured posture while their stiffness rises, then the joints go to half-sitting along a
    quintic. Feed-forward torques carry the limbs as they hang, less what the sole wrenches carry; they rise with the
    stiffness.

    Attributes:
        duration: Time until the joints have arrived, s.
        done: True when they have.
    """

    def __init__(
        self,
        description: RobotDescription,
        first: Measurement,
        loads: SoleLoads,
        *,
        fade: float,
        speed: float,
        gains: tuple[Array, Array] | None = None,
    ) -> None:
        """Plan the motion.

        Args:
            description: The robot.
            first: Measurement of the posture from which it starts.
            loads: Wrenches on the soles.
            fade: Time in which stiffness and torques rise, s.
            speed: Largest mean speed of a joint on the way, rad/s.
            gains: kp and kd of the machine, each of shape (na,); the description's when None.
        """
        self._robot, self._loads = description.robot(), loads
        self._kp, self._kd = (description.kp, description.kd) if gains is None else gains
        self._from = np.array(first.joint_position)
        self._to = np.array(self._robot.half_sitting[7:])
        self._fade = fade
        self._way = max(0.5, float(np.abs(self._to - self._from).max()) / speed)
        self.duration = fade + self._way
        self._zero = np.zeros(self._robot.na)
        self._soles = [self._robot.frame_id(sole.frame) for sole in self._robot.soles]
        self.done = False

    def command(self, measurement: Measurement, elapsed: float) -> Command:
        """Return the command at a time.

        Args:
            measurement: Measurement of this tick.
            elapsed: Time since the start, s.
        """
        part = min(1.0, elapsed / self._fade)
        s = min(1.0, max(0.0, (elapsed - self._fade) / self._way))
        shape = s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
        rate = 30.0 * s**2 * (1.0 - s) ** 2 / self._way
        way = self._to - self._from
        self.done = s >= 1.0
        return Command(
            part * self.carry(measurement),
            self._from + shape * way,
            rate * way,
            kp=part * self._kp,
            kd=self._kd,
        )

    def carry(self, measurement: Measurement) -> Array:
        """Return the torques that hold the limbs against gravity and the sole wrenches, shape (na,), Nm."""
        robot, q = self._robot, self._loads.posture(measurement)
        torque = np.array(pin.computeGeneralizedGravity(robot.model, robot.data, q)[6:])
        for frame, wrench in zip(self._soles, self._loads.wrenches(measurement), strict=True):
            if np.isfinite(wrench).all() and wrench[2] > 0.0:
                jacobian = pin.computeFrameJacobian(robot.model, robot.data, q, frame, pin.LOCAL)
                torque -= jacobian[:, 6:].T @ wrench
        limit: Array = np.clip(torque, -robot.torque_limit, robot.torque_limit)
        return limit

    def blend(self, command: Command, measurement: Measurement, part: float) -> Command:
        """Return a command between holding half-sitting (0) and one of the controller (1).

        Args:
            command: The controller's.
            measurement: Measurement of this tick.
            part: From 0 to 1.
        """
        torque = (1.0 - part) * self.carry(measurement) + part * command.joint_torque
        kp = (1.0 - part) * self._kp
        kd = (1.0 - part) * self._kd
        if command.joint_position is None:
            return Command(torque, self._to, self._zero, command.sole_stiffness, kp, kd)
        own_kp = self._kp if command.kp is None else command.kp
        own_kd = self._kd if command.kd is None else command.kd
        position = (1.0 - part) * self._to + part * command.joint_position
        velocity = self._zero if command.joint_velocity is None else part * command.joint_velocity
        return Command(
            torque, position, velocity, command.sole_stiffness, kp + part * own_kp, kd + part * own_kd
        )
