"""Measurement and Command: the interface between a robot, real or simulated, and its controller."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from wbc.core.errors import Array, MeasurementError


@dataclass(frozen=True, slots=True)
class Measurement:
    """Sensor readings of one instant, without ground truth.

    Attributes:
        time: Time stamp, s.
        joint_position: Encoders, shape (na,), rad (or m), in the order of `Robot.joint_names`.
        joint_velocity: Joint velocities from the drives, shape (na,), rad/s (or m/s).
        angular_velocity: Gyroscope, in the IMU frame, shape (3,), rad/s.
        specific_force: Accelerometer (acceleration minus gravity), in the IMU frame, shape (3,), m/s².
        sole_wrench: Wrench of the ground on each sole, [force; moment] in the sole frame at the sole centre,
            shape (number of soles, 6), N and Nm.
        sole_range: Range sensor under the toe of each foot, shape (number of soles,), m; NaN without a hit.
        sole_stiffness: Actual stiffness of each sole, shape (number of soles,), Nm/rad; NaN for a rigid sole.
    """

    time: float
    joint_position: Array
    joint_velocity: Array
    angular_velocity: Array
    specific_force: Array
    sole_wrench: Array
    sole_range: Array = field(default_factory=lambda: np.full(2, np.nan))
    sole_stiffness: Array = field(default_factory=lambda: np.full(2, np.nan))

    def check_finite(self) -> None:
        """Refuse a measurement with NaN or infinity in it.

        Raises:
            MeasurementError: The time, or a signal other than the range and stiffness, holds NaN or infinity.
        """
        if not math.isfinite(self.time):
            raise MeasurementError(f"time of a measurement must be finite, got {self.time}")
        squares = (
            self.joint_position.dot(self.joint_position)
            + self.joint_velocity.dot(self.joint_velocity)
            + self.angular_velocity.dot(self.angular_velocity)
            + self.specific_force.dot(self.specific_force)
            + self.sole_wrench.ravel().dot(self.sole_wrench.ravel())
        )
        if math.isfinite(squares):
            return
        for name in ("joint_position", "joint_velocity", "angular_velocity", "specific_force", "sole_wrench"):
            if not np.isfinite(getattr(self, name)).all():
                raise MeasurementError(
                    f"measurement at {self.time:.4f} s: {name} is not finite: {getattr(self, name)}"
                )


@dataclass(frozen=True, slots=True)
class Command:
    """Command of the drives, valid until the next one.

    In position control `joint_position` and `joint_velocity` are references of the servos and `joint_torque` is
    added to them as a feed-forward. In torque control `joint_position` is None and the servos are off.

    Attributes:
        joint_torque: Torque (feed-forward), shape (na,), Nm (or N).
        joint_position: Servo reference, shape (na,), rad (or m); None in torque control.
        joint_velocity: Servo velocity reference, shape (na,), rad/s (or m/s); None in torque control.
        sole_stiffness: Commanded stiffness of each sole, shape (number of soles,), Nm/rad; None keeps the last one.
    """

    joint_torque: Array
    joint_position: Array | None = None
    joint_velocity: Array | None = None
    sole_stiffness: Array | None = None
