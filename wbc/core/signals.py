"""Measurement and Command: the interface between a robot, real or simulated, and its controller."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from wbc.base.errors import InputError, MeasurementError
from wbc.base.numbers import Array

WrenchSource = Literal["sensor", "measured torques", "commanded torques"]
"""Origin of the wrenches on the soles."""

SIGNALS = ("joint_position", "joint_velocity", "angular_velocity", "specific_force", "sole_wrench")
"""Fields of a `Measurement` that an estimate is made of."""

LARGEST_COMMAND = 1e6
"""Largest torque, reference or gain of a command, in their units: what is beyond is an error."""


@dataclass(frozen=True, slots=True)
class Measurement:
    """Sensor readings of one instant, without ground truth.

    All of them belong to one instant, once a control period. Joints come in the order of `Robot.joint_names`, by name,
    whatever the order of drives on a bus or of actuators in a simulator. Angles and torques are those of the joint,
    behind the gear.

    Attributes:
        time: Clock of the sensors when they were read, not of the arrival of the message, s; rises by the control
            period from one measurement to the next, from any start.
        joint_position: Encoders, shape (na,), rad (m for prismatic joints); positive about the axis of the joint in the
            robot's model, zero where the model is at zero.
        joint_velocity: Joint velocities from the drives, shape (na,), rad/s (or m/s); the derivative of
            `joint_position`, same sign.
        angular_velocity: Gyroscope, angular velocity of the IMU against the world, in the IMU frame
            (`Robot.imu_frame`), shape (3,), rad/s.
        specific_force: Accelerometer: acceleration minus gravity, in the IMU frame, shape (3,), m/s². At rest it is
            9.81 m/s² upwards: (0, 0, +9.81) for an IMU that stands upright.
        sole_wrench: Wrench of the ground on each sole, [force; moment] in the sole frame at the sole centre, left foot
            first, shape (number of soles, 6), N and Nm. The normal force of a standing robot is positive, both
            together its weight; zero in the air. The weight of the foot below the sensor may be missing. None: feet
            without force sensors, whose wrenches a control estimates from the torques of the joints.
        sole_range: Range sensor under the toe of each foot, shape (number of soles,), m; NaN without a hit or without
            a sensor.
        sole_stiffness: Actual stiffness of each sole, shape (number of soles,), Nm/rad; NaN for a rigid sole.
        joint_torque: Torque that each drive applies to its joint as measured or computed from its current, shape
            (na,), Nm (or N); positive accelerates the joint in the direction of its positive velocity. None: not
            measured.
        hand_wrenches: Wrench of the surroundings on each hand, [force; moment] in the hand's frame at its origin, in
            the order of `Robot.frames`, shape (number of hands, 6), N and Nm; a load that is held counts, the hand's
            own weight does not. NaN for a hand without a reading; None: no force sensors at the wrists.
        wrench_source: Origin of `sole_wrench`: "sensor", or "measured torques" or "commanded torques" where a control
            has estimated it.
    """

    time: float
    joint_position: Array
    joint_velocity: Array
    angular_velocity: Array
    specific_force: Array
    sole_wrench: Array | None
    sole_range: Array = field(default_factory=lambda: np.full(2, np.nan))
    sole_stiffness: Array = field(default_factory=lambda: np.full(2, np.nan))
    joint_torque: Array | None = None
    wrench_source: WrenchSource = "sensor"
    hand_wrenches: Array | None = None

    @property
    def wrenches(self) -> Array:
        """`sole_wrench`; a `MeasurementError` where it is neither measured nor estimated yet."""
        if self.sole_wrench is None:
            raise MeasurementError(
                f"measurement at {self.time:.4f} s has no sole_wrench; a control estimates it (Control.measurement)"
            )
        return self.sole_wrench


@dataclass(frozen=True, slots=True)
class Command:
    """Command of the drives, valid until the next one.

    In position control `joint_position` and `joint_velocity` are references of the servos and `joint_torque` is
    added to them as a feed-forward: each drive applies kp (q_ref − q) + kd (q̇_ref − q̇) + τ, with the machine's own
    gains unless the command brings others. In torque control `joint_position` is None and the servos are off. Order,
    signs and units of joints are those of a `Measurement`. A command comes once a control period; a machine that gets
    none for some periods must not hold the last one for ever.

    Attributes:
        joint_torque: Torque, or feed-forward of the servos, shape (na,), Nm (or N).
        joint_position: Servo reference, to be reached at the next command, shape (na,), rad (or m); None in torque
            control: kp and kd are zero.
        joint_velocity: Servo velocity reference, shape (na,), rad/s (or m/s); None in torque control, and taken as zero
            where a position reference comes without one.
        sole_stiffness: Commanded stiffness of each sole, shape (number of soles,), Nm/rad; None keeps the last one.
        kp: Stiffness of each servo in this period, shape (na,), Nm/rad (or N/m); None: the machine's own, which are
            `RobotDescription.kp` in the plant.
        kd: Damping of each servo in this period, shape (na,), Nms/rad (or Ns/m); None: the machine's own,
            `RobotDescription.kd`.
        released: True for each joint that somebody else moves, shape (na,): nothing here is meant for it. None: all
            are the control's.
        period: Control period that it is made for, s: a simulated robot that advances by another one refuses it. None
            fits any.
    """

    joint_torque: Array
    joint_position: Array | None = None
    joint_velocity: Array | None = None
    sole_stiffness: Array | None = None
    kp: Array | None = None
    kd: Array | None = None
    released: NDArray[np.bool_] | None = None
    period: float | None = None

    def copy(self) -> Command:
        """Return the same command with arrays of its own."""

        def own(part: Array | None) -> Array | None:
            return None if part is None else part.copy()

        return Command(
            self.joint_torque.copy(),
            own(self.joint_position),
            own(self.joint_velocity),
            own(self.sole_stiffness),
            own(self.kp),
            own(self.kd),
            self.released,
            self.period,
        )

    def check(self, joint_names: Sequence[str]) -> None:
        """Refuse what no drive must get: a wrong shape, not finite, beyond `LARGEST_COMMAND`, negative gains."""
        na = len(joint_names)
        for name in ("joint_torque", "joint_position", "joint_velocity", "kp", "kd"):
            value = getattr(self, name)
            if value is None and name != "joint_torque":
                continue
            array = np.asarray(value)
            if array.shape != (na,) or array.dtype.kind not in "iuf":
                raise InputError(f"{name} of a command must be numbers of shape ({na},), got {value!r}")
            if not (np.abs(array) <= LARGEST_COMMAND).all():  # or NaN
                place = int(np.argmin(np.abs(array) <= LARGEST_COMMAND))
                found = (
                    f"is {array[place]:g}, beyond ±{LARGEST_COMMAND:g}"
                    if np.isfinite(array[place])
                    else "is not finite"
                )
                raise InputError(f"command: {name} of joint '{joint_names[place]}' {found}")
            if name in ("kp", "kd") and (array < 0.0).any():
                joint = joint_names[int(np.argmax(array < 0.0))]
                raise InputError(f"command: {name} of joint '{joint}' must be finite and not negative")


class Control(Protocol):
    """Controller that answers a measurement with a command, such as `wbc.TorqueControl` or a `wbc.WalkingControl`."""

    def command(self, measurement: Measurement, /) -> Command:
        """Run one tick."""
