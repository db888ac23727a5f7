"""Small motions of a robot that stands at half-sitting, and the measurements while it makes them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from wbc.core.errors import Array, MeasurementError, shown
from wbc.core.signals import Command, Measurement
from wbc.machine.loop import Loop

Gains = tuple[Array, Array]
"""kp and kd of all joints."""


@dataclass(frozen=True, eq=False)
class Record:
    """Measurements of one motion, one row a control period, each taken after the command of its row.

    Attributes:
        position: Joint positions, shape (ticks, na).
        velocity: Joint velocities, shape (ticks, na).
        torque: Measured joint torques, shape (ticks, na); NaN where there are none.
        gyroscope: Shape (ticks, 3).
        accelerometer: Shape (ticks, 3).
        wrench: Sole wrenches, shape (ticks, soles, 6); NaN without force sensors.
        time: Time stamps, shape (ticks,).
    """

    position: Array
    velocity: Array
    torque: Array
    gyroscope: Array
    accelerometer: Array
    wrench: Array
    time: Array

    def settled(self, name: str) -> Array:
        """Return the mean of a signal over the last third."""
        values: Array = getattr(self, name)
        mean: Array = values[-max(1, len(values) // 3) :].mean(axis=0)
        return mean


class Excitation:
    """Commands around half-sitting, sent to a loop.

    Attributes:
        robot: The robot at half-sitting.
        reference: Joint positions at half-sitting, shape (na,).
        count: Control periods so far.
    """

    def __init__(self, loop: Loop) -> None:
        """Store the loop.

        Args:
            loop: The loop; its robot is at half-sitting.
        """
        self._loop = loop
        self.period = loop.control_period
        self.robot = loop.description.robot()
        self.reference = np.array(self.robot.half_sitting[7:])
        self.count = 0
        self.records: list[Record] = []
        self._zero = np.zeros(self.robot.na)

    def measure(self) -> Measurement:
        """Return the measurement now.

        Raises:
            MeasurementError: The loop returns something else.
        """
        measurement = self._loop.measure()
        if not isinstance(measurement, Measurement):
            raise MeasurementError(f"measure() of a loop must return a Measurement, got {shown(measurement)}")
        return measurement

    def ticks(self, seconds: float) -> int:
        """Return the control periods in a time, at least 6."""
        return max(6, round(seconds / self.period))

    def hold(
        self,
        seconds: float,
        *,
        torque: Array | None = None,
        velocity: Array | None = None,
        gains: Gains | None = None,
    ) -> Record:
        """Hold half-sitting, with a feed-forward torque or a velocity reference added, by gains of one's own."""
        tau = self._zero if torque is None else torque
        rate = self._zero if velocity is None else velocity
        kp, kd = (None, None) if gains is None else gains
        return self._run([Command(tau, self.reference, rate, kp=kp, kd=kd)] * self.ticks(seconds))

    def move(self, step: Array, seconds: float) -> tuple[Record, Record]:
        """Move the references by a step and hold there, then come back; return both records.

        Args:
            step: Change of the joint positions, shape (na,), rad.
            seconds: Time of one way, the second half of it at rest.
        """
        n = self.ticks(seconds)
        shape = self.profile(seconds)
        s = np.clip(2.0 * np.arange(1, n + 1) / n, 0.0, 1.0)
        rate = 2.0 / (n * self.period) * 30.0 * s**2 * (1.0 - s) ** 2
        there = [
            Command(self._zero, self.reference + a * step, b * step) for a, b in zip(shape, rate, strict=True)
        ]
        back = [
            Command(self._zero, self.reference + (1.0 - a) * step, -b * step)
            for a, b in zip(shape, rate, strict=True)
        ]
        return self._run(there), self._run(back)

    def profile(self, seconds: float) -> Array:
        """Return the motion from 0 to 1 that `move` makes, shape (ticks,)."""
        n = self.ticks(seconds)
        s = np.clip(2.0 * np.arange(1, n + 1) / n, 0.0, 1.0)
        shape: Array = s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
        return shape

    def base_motion(self, com: tuple[float, float], turn: tuple[float, float, float]) -> tuple[Array, Array]:
        """Return the joint motion that shifts the centre of mass and turns the base, the soles in their places.

        Args:
            com: Shift of the centre of mass, forward and to the left, m.
            turn: Rotation of the base about x, y and z of the world, rad.

        Returns:
            Change of the joint positions, shape (na,), and the configuration there, shape (nq,).
        """
        robot = self.robot
        model, data, q0 = robot.model, robot.data, np.array(robot.half_sitting)
        robot.update(q0, np.zeros(robot.nv))
        pin.computeJointJacobians(model, data, q0)
        world = pin.LOCAL_WORLD_ALIGNED
        rows = [pin.getFrameJacobian(model, data, robot.frame_id(sole.frame), world) for sole in robot.soles]
        target = [np.zeros(6) for _ in robot.soles]
        rows += [
            robot.com_jacobian[:2],
            pin.getFrameJacobian(model, data, robot.frame_id(robot.base_frame), world)[3:],
        ]
        target += [np.array(com), np.array(turn)]
        velocity = np.linalg.lstsq(np.vstack(rows), np.concatenate(target), rcond=1e-6)[0]
        return velocity[6:], pin.integrate(model, q0, velocity)

    def _run(self, commands: list[Command]) -> Record:
        rows = []
        for command in commands:
            self._loop.step(command)
            rows.append(self.measure())
        self.count += len(rows)
        none, no_wrench = np.full(self.robot.na, np.nan), np.full((len(self.robot.soles), 6), np.nan)
        record = Record(
            np.array([m.joint_position for m in rows]),
            np.array([m.joint_velocity for m in rows]),
            np.array([none if m.joint_torque is None else m.joint_torque for m in rows]),
            np.array([m.angular_velocity for m in rows]),
            np.array([m.specific_force for m in rows]),
            np.array([no_wrench if m.sole_wrench is None else m.sole_wrench for m in rows]),
            np.array([m.time for m in rows]),
        )
        self.records.append(record)
        return record
