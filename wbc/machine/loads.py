"""Forces that hold a machine before its controller does: on the soles, and others, such as of a crane or a hand."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from wbc.base.numbers import Array, lag_gain
from wbc.core.estimation.wrenches import WrenchEstimator
from wbc.core.robot import BASE_DOF, GRAVITY
from wbc.core.signals import Command, Measurement
from wbc.robots import RobotDescription

SMOOTHING = 0.15
"""Time constant of the normal forces, s: fed forward faster, what the servos themselves press would swing."""

QUICK = 0.02
"""Time constant of the load that tells a touch of the ground, s."""

HOLD = 0.05
"""Time constant of the forces of whatever else holds the robot, s."""

SWING = 3.0
"""Time constant with which the attitude follows the accelerometer, s: longer than a swing on a band."""

FORGET = 0.3
"""Time constant with which the velocity of the base, by the accelerometer, is forgotten, s."""

GAP, LOST = 0.02, 0.2
"""Time between two measurements from which on the estimate of forces begins anew, and all of it, s."""


class SoleLoads:
    """Loads of the soles, and the generalised forces of whatever else holds the robot.

    Without force sensors the joints of each leg tell the wrench of its foot, by the torques that the drives report or
    else those of the commands; the balance of momentum of the whole robot tells what the rest is. Roll and pitch of the
    base are followed by the gyroscope and drawn to the accelerometer's mean over a swing.

    Attributes:
        normal: Normal forces on the soles, smoothed, shape (number of soles,), N.
        outside: Generalised forces of whatever else holds the robot, smoothed, shape (nv,), N and Nm.
    """

    def __init__(self, description: RobotDescription, period: float, gains: tuple[Array, Array]) -> None:
        """Make the estimator; `gains` are kp and kd of the machine, each of shape (na,)."""
        self._robot = robot = description.robot()
        self._gap = max(GAP, 2.5 * period)
        self._estimator = WrenchEstimator(robot, period, gains=gains)
        imu = robot.placement(robot.imu_frame).rotation
        self._base_from_imu = np.array(robot.placement(robot.base_frame).rotation.T @ imu)
        self._weight = robot.mass * GRAVITY
        self._time, self._age = -np.inf, 0.0
        self._attitude: Array = np.eye(3)
        self._speed, self._velocity = np.zeros(3), np.zeros(robot.nv)
        self._wrench = np.zeros((len(robot.soles), 6))
        self._quick = np.zeros(len(robot.soles))
        self.normal, self.outside = np.zeros(len(robot.soles)), np.zeros(robot.nv)

    def sent(self, command: Command) -> None:
        """Take over the command that is sent now."""
        self._estimator.sent(command)

    @property
    def share(self) -> float:
        """Share of the described robot's weight on the soles, hardly smoothed."""
        return float(self._quick.sum()) / self._weight

    def posture(self, measurement: Measurement) -> Array:
        """Return the joints of a measurement that `wrenches` has seen, with roll and pitch of the base, shape (nq,)."""
        q = np.array(self._robot.half_sitting)
        q[7:] = measurement.joint_position
        q[3:7] = pin.Quaternion(self._attitude).coeffs()
        return q

    def adopt(self, time: float, q: Array, v: Array, normal: Array) -> None:
        """Go on from what an observer has estimated at a time stamp, s, and from the normal forces on the soles, N.

        Configuration and velocity have the shapes (nq,) and (nv,), the forces (number of soles,).
        """
        self._attitude = pin.Quaternion(q[3:7]).matrix()
        self._speed = self._attitude @ v[:3]
        self.normal, self._quick = np.maximum(normal, 0.0), np.maximum(normal, 0.0)
        self._wrench = np.zeros_like(self._wrench)
        self._wrench[:, 2] = self.normal
        self._time, self._age = time, SWING
        self._estimator.reset()

    def wrenches(self, measurement: Measurement, state: tuple[Array, Array] | None = None) -> Array:
        """Return the wrench on each sole, in the sole frame, shape (number of soles, 6), N and Nm.

        Asked a second time in a tick, the answer is the same. `state` is configuration and velocity by an observer, of
        which the base counts; by gyroscope and accelerometer when None.
        """
        passed = measurement.time - self._time
        if passed == 0.0:
            return self._wrench
        begins = not 0.0 < passed < self._gap
        self._time = measurement.time
        lost = not 0.0 < passed < LOST
        passed = 0.0 if begins else passed
        if lost:  # what was followed before is not that of now
            self._age, self._speed, self._attitude = 0.0, np.zeros(3), np.eye(3)
        self._lean(measurement, passed, begins)
        estimator = self._estimator
        torque = estimator.torque(measurement)
        if torque is None:  # nothing has been sent: nothing is known
            estimator.wrench[:] = 0.0
        else:
            if begins:
                estimator.reset()
            q, v = self.posture(measurement), self._velocity
            if state is None:
                v[:3] = self._attitude.T @ self._speed
                v[3:BASE_DOF] = self._base_from_imu @ measurement.angular_velocity
            else:
                q[:7], v[:BASE_DOF] = state[0][:7], state[1][:BASE_DOF]
            v[BASE_DOF:] = measurement.joint_velocity
            estimator.update(q, v, torque, passed, held=True)
        self._wrench = estimator.wrench if measurement.sole_wrench is None else measurement.sole_wrench
        self.outside += lag_gain(passed, HOLD) * (estimator.outside - self.outside)
        pressed = np.maximum(self._wrench[:, 2], 0.0)
        if lost and measurement.sole_wrench is not None:
            self.normal, self._quick = pressed.copy(), pressed.copy()
        self.normal += lag_gain(passed, SMOOTHING) * (pressed - self.normal)
        self._quick += lag_gain(passed, QUICK) * (pressed - self._quick)
        return self._wrench

    def _lean(self, measurement: Measurement, passed: float, begins: bool) -> None:
        """Follow roll and pitch of the base, and its velocity."""
        up = self._base_from_imu @ measurement.specific_force
        size = float(np.linalg.norm(up))
        if not begins:
            self._age += passed
            self._attitude = self._attitude @ pin.exp3(
                passed * (self._base_from_imu @ measurement.angular_velocity)
            )
            if abs(size - GRAVITY) < 0.7 * GRAVITY:  # neither in free fall nor in an impact
                self._speed += passed * (self._attitude @ up - [0.0, 0.0, GRAVITY])
            self._speed *= np.exp(-passed / FORGET)
        if size > 0.5 * GRAVITY:
            upright = pin.Quaternion.FromTwoVectors(self._attitude @ up / size, np.array([0.0, 0.0, 1.0]))
            # At first the mean of all until now, of the very first the whole.
            share = 1.0 if self._age == 0.0 else lag_gain(passed, min(max(self._age, 0.1), SWING))
            self._attitude = pin.exp3(share * pin.log3(upright.matrix())) @ self._attitude
