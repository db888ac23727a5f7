"""Wrenches on the soles of a machine that no controller drives yet: measured, or felt through its joints."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from wbc.core.errors import Array
from wbc.core.estimation.delay import SentCommands
from wbc.core.estimation.wrenches import WrenchEstimator
from wbc.core.robot import BASE_DOF, GRAVITY
from wbc.core.signals import Command, Measurement
from wbc.robots import RobotDescription

GAP = 2.5
"""Control periods between two measurements from which on the estimate begins anew."""


class SoleLoads:
    """Wrenches on the soles, whether a machine has force sensors or not.

    Without them they are estimated from the torques of the joints, those that the drives report or else those of the
    commands, of a robot that hardly moves: its base is upright as the accelerometer says, and does not travel.
    """

    def __init__(self, description: RobotDescription, period: float, gains: tuple[Array, Array]) -> None:
        """Make the estimator.

        Args:
            description: The robot.
            period: Control period, s.
            gains: kp and kd of the machine, each of shape (na,).
        """
        self._robot = robot = description.robot()
        self._period = period
        self._estimator = WrenchEstimator(robot, period)
        self._sent = SentCommands(gains, robot.torque_limit, period, 0.0)
        imu = robot.placement(robot.imu_frame).rotation
        self._base_from_imu = np.array(robot.placement(robot.base_frame).rotation.T @ imu)
        self._time = -np.inf
        self._velocity = np.zeros(robot.nv)

    def sent(self, command: Command) -> None:
        """Take over the command that is sent now."""
        self._sent.sent(command)

    def posture(self, measurement: Measurement) -> Array:
        """Return the measured posture, the base as the accelerometer says, shape (nq,)."""
        q = np.array(self._robot.half_sitting)
        q[7:] = measurement.joint_position
        up = self._base_from_imu @ measurement.specific_force
        size = float(np.linalg.norm(up))
        if size > 0.5 * GRAVITY:
            upright = pin.Quaternion.FromTwoVectors(up / size, np.array([0.0, 0.0, 1.0]))
            q[3:7] = upright.coeffs()
        return q

    def wrenches(self, measurement: Measurement) -> Array:
        """Return the wrench on each sole, in the sole frame, shape (number of soles, 6), N and Nm.

        Args:
            measurement: Measurement of this tick; asked a second time, the answer is the same.
        """
        if measurement.sole_wrench is not None:
            return measurement.sole_wrench
        estimator, passed = self._estimator, measurement.time - self._time
        if passed == 0.0:
            return estimator.wrench
        self._time = measurement.time
        torque = measurement.joint_torque
        if torque is None:
            torque = self._sent.torque(measurement)
        if torque is None:  # nothing has been sent: nothing is known
            estimator.wrench[:] = 0.0
            return estimator.wrench
        if not 0.0 < passed < GAP * self._period:
            estimator.reset()
        self._velocity[3:BASE_DOF] = self._base_from_imu @ measurement.angular_velocity
        self._velocity[BASE_DOF:] = measurement.joint_velocity
        return estimator.update(self.posture(measurement), self._velocity, torque)
