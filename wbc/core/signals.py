"""Measurement and Command: the interface between a robot, real or simulated, and its controller."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from wbc.base.errors import InputError, MeasurementError, shown
from wbc.base.numbers import FLOAT64, Array, finite_array, finite_scalar, in_range
from wbc.core.robot import GRAVITY, Robot

WrenchSource = Literal["sensor", "measured torques", "commanded torques"]
"""Origin of the wrenches on the soles."""

SIGNALS = ("joint_position", "joint_velocity", "angular_velocity", "specific_force", "sole_wrench")
"""Fields of a `Measurement` that an estimate is made of."""

LARGEST_COMMAND = 1e6
"""Largest torque, reference or gain of a command, in their units: what is beyond is an error."""


@dataclass(frozen=True, slots=True)
class Measurement:
    """Sensor readings of one instant, without ground truth.

    All readings belong to one instant. A robot gives one measurement in each control period. The joints are in the
    order of `Robot.joint_names`, which may differ from the order of the drives on a bus or of the actuators in a
    simulator. Angles and torques are those on the joint's side of the gear.

    Attributes:
        time: Time at which the sensors were read, by their own clock, s. It is not the time at which the message
            arrived. It may start anywhere, and rises by the control period from one measurement to the next.
        joint_position: Joint positions by the encoders, shape (na,), rad (m for prismatic joints). Signs and zeros are
            those of the robot's model.
        joint_velocity: Joint velocities from the drives, shape (na,), rad/s (or m/s); the derivative of
            `joint_position`, same sign.
        angular_velocity: Angular velocity by the gyroscope: that of the IMU relative to the world, in the IMU frame
            (`Robot.imu_frame`), shape (3,), rad/s.
        specific_force: Specific force by the accelerometer: acceleration minus gravity, in the IMU frame, shape (3,),
            m/s². At rest it is 9.81 m/s² upwards: (0, 0, +9.81) for an IMU whose z axis points up.
        sole_wrench: Wrench of the ground on each sole, [force; moment] in the sole frame at the sole centre, left foot
            first, shape (number of soles, 6), N and Nm. The normal forces of a standing robot are positive, and their
            sum is its weight. They are zero in the air. The weight of the foot below the sensor may be missing. None if
            the feet have no force sensors: a control then estimates the wrenches from the joint torques.
        sole_range: Range sensor under the toe of each foot, shape (number of soles,), m. NaN without a sensor, without
            a hit, and between two readings of a slow sensor: a reading belongs to the pose at which it was taken.
        sole_stiffness: Actual stiffness of each sole, shape (number of soles,), Nm/rad; NaN for a rigid sole.
        joint_torque: Torque that each drive applies to its joint, measured or computed from its current, shape (na,),
            Nm (or N). A positive torque accelerates the joint in its positive direction. None if it is not measured.
        hand_wrenches: Wrench of the surroundings on each hand, [force; moment] in the hand's frame at its origin, in
            the order of `Robot.frames`, shape (number of hands, 6), N and Nm. The weight of a load in the hand is part
            of it, the weight of the hand itself is not. NaN for a hand without a reading. None if the wrists have no
            force sensors.
        wrench_source: Origin of `sole_wrench`: "sensor", or, where a control has estimated it, "measured torques" or
            "commanded torques".
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

    @classmethod
    def resting(cls, robot: Robot) -> Measurement:
        """Return the readings of a robot at rest in its configuration at time 0, its weight on its soles."""
        n = len(robot.soles)
        wrench, unread = np.zeros((n, 6)), np.full((2, n), np.nan)
        wrench[:, 2] = robot.mass * GRAVITY / max(n, 1)
        up = robot.placement(robot.imu_frame).rotation.T @ np.array([0.0, 0.0, GRAVITY])
        position, still = np.array(robot.q[robot.base_nq :]), np.zeros(robot.na)
        return cls(0.0, position, still, np.zeros(3), up, wrench, *unread)

    @property
    def wrenches(self) -> Array:
        """`sole_wrench`, shape (number of soles, 6), N and Nm; raises a `MeasurementError` while there is none."""
        if self.sole_wrench is None:
            raise MeasurementError(
                f"measurement at {self.time:.4f} s has no sole_wrench; a control estimates it (Control.measurement)"
            )
        return self.sole_wrench


@dataclass(frozen=True, slots=True)
class Command:
    """Command of the drives, valid until the next command.

    In position control `joint_position` and `joint_velocity` are references of the servos and `joint_torque` is
    added to them as a feed-forward: each drive applies kp (q_ref − q) + kd (q̇_ref − q̇) + τ, with the machine's own
    gains unless the command brings others. In torque control `joint_position` is None and the servos are off. Order,
    signs and units of joints are those of a `Measurement`. A machine gets one command in each control period. If it
    gets none for some periods, it must not hold the last command for ever.

    Attributes:
        joint_torque: Torque of each joint, or feed-forward torque of its servo, shape (na,), Nm (or N).
        joint_position: Servo reference, to be reached at the next command, shape (na,), rad (or m). None in torque
            control, where kp and kd count as zero.
        joint_velocity: Servo velocity reference, shape (na,), rad/s (or m/s); None in torque control. With a position
            reference, None counts as zero.
        sole_stiffness: Commanded stiffness of each sole, shape (number of soles,), Nm/rad; None keeps the last one.
        kp: Stiffness of each servo in this period, shape (na,), Nm/rad (or N/m). None stands for the machine's own
            stiffness; in the plant this is `RobotDescription.kp`.
        kd: Damping of each servo in this period, shape (na,), Nms/rad (or Ns/m). None stands for the machine's own
            damping; in the plant this is `RobotDescription.kd`.
        released: True for each joint that another controller moves, shape (na,): the command has no values for it.
            None if the control commands all joints.
        period: Control period for which the command is made, s. A simulated robot with another control period refuses
            the command. None fits every period.
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
        """Return a copy of the command, with its own arrays."""
        parts = ("joint_torque", "joint_position", "joint_velocity", "sole_stiffness", "kp", "kd", "released")
        return replace(self, **{n: part.copy() for n in parts if (part := getattr(self, n)) is not None})

    def check(self, joint_names: Sequence[str]) -> Command:
        """Return the command with arrays of floats; what no drive must get is an `InputError`.

        That is a wrong shape, a value that is not finite or beyond `LARGEST_COMMAND`, a negative gain or stiffness, a
        period that is not positive, and a servo without a position reference. How many soles there are is not known
        here.
        """
        na, others = len(joint_names), dict[str, Any]()
        for name in ("joint_torque", "joint_position", "joint_velocity", "kp", "kd"):
            value = getattr(self, name)
            if value is None and name != "joint_torque":
                continue
            array = np.asarray(value)
            if array.shape != (na,) or array.dtype.kind not in "iuf":
                raise InputError(f"{name} of a command must be numbers of shape ({na},), got {value!r}")
            least = 0.0 if name in ("kp", "kd") else -LARGEST_COMMAND
            good = (array >= least) & (array <= LARGEST_COMMAND)  # NaN is not
            if not good[place := int(good.argmin())]:
                raise InputError(
                    f"command: {name} of joint '{joint_names[place]}' must be a finite number from {least:g} to "
                    f"{LARGEST_COMMAND:g}, got {array[place]:g}"
                )
            if array is not value or array.dtype is not FLOAT64:
                others[name] = array.astype(np.float64)
        if self.sole_stiffness is not None:
            stiffness = finite_array("command: sole_stiffness", self.sole_stiffness)
            in_range("command: sole_stiffness", stiffness, 0.0, -np.inf, LARGEST_COMMAND)
        if self.period is not None:
            finite_scalar("period of a command (s)", self.period, above=0.0)
        if (released := self.released) is not None and (
            np.shape(released) != (na,) or np.asarray(released).dtype.kind != "b"
        ):
            raise InputError(
                f"released of a command must be truth values of shape ({na},), got {shown(released)}"
            )
        for name in ("joint_velocity", "kp", "kd"):
            value = getattr(self, name)
            if self.joint_position is None and value is not None and np.any(value):
                raise InputError(
                    "a command with a velocity reference or gains needs a position reference, too, "
                    f"got {name} without joint_position"
                )
        return replace(self, **others) if others else self

    def gains(self, own: tuple[Array, Array]) -> tuple[Array, Array]:
        """Return kp and kd of the servos, each of shape (na,): those of the command, else the machine's own."""
        return own[0] if self.kp is None else self.kp, own[1] if self.kd is None else self.kd

    def drive_torque(self, position: Array, velocity: Array, own: tuple[Array, Array]) -> Array:
        """Return the torque of the drives before their limits: τ + kp (q_ref − q) + kd (q̇_ref − q̇), shape (na,), Nm.

        Positions and velocities of the joints are those at hand; `own` are kp and kd of the machine, for a command
        that brings none. All have the shape (na,). Without a position reference the torque is τ alone.
        """
        if self.joint_position is None:
            return self.joint_torque
        kp, kd = self.gains(own)
        rate = -velocity if self.joint_velocity is None else self.joint_velocity - velocity
        torque: Array = self.joint_torque + kp * (self.joint_position - position) + kd * rate
        return torque
