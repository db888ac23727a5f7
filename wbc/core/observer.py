"""Base pose and velocity from encoders, IMU and foot wrenches, without ground truth.

Each loaded foot holds the robot at one point that rests on the ground, its anchor. The anchor is the material
point of the sole at the measured centre of pressure and moves over the sole with it, so a foot may roll over
its edge, over a stone or on soft phalanges: nothing assumes that the sole is flat or parallel to the ground.
The base hangs on both anchors, each in proportion to its load, and the joints' velocities with the anchors at
rest give the velocity, which the IMU smooths (`wbc.core.inertial`).

For a rigid sole that rolls without slip the construction is exact; a sole that deforms leaves the velocity
that its material point at the centre of pressure has.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import pinocchio as pin

from wbc.core.errors import Array, InputError, MeasurementError, finite_array, non_negative
from wbc.core.inertial import InertialFilter, InertialSettings
from wbc.core.robot import BASE_DOF, Robot
from wbc.core.signals import Measurement

SIGNALS = ("joint_position", "joint_velocity", "angular_velocity", "specific_force", "sole_wrench")
"""What an estimate is made of, as `Measurement` calls it."""


@dataclass(frozen=True)
class ObserverSettings:
    """Settings of the observer.

    Attributes:
        inertial: Time constants of the inertial part.
        anchor_at_cop: Anchor each foot at its centre of pressure; at the sole centre when False, which takes
            the sole for flat and resting as a whole.
        min_load: Normal force below which a foot holds nothing, N.
        load_time_constant: Low-pass of the normal forces, s; 0 for none.
        cop_time_constant: Low-pass of the centres of pressure, s; 0 for none.
        slip_time_constant: How fast loaded feet that disagree settle between themselves, s.
        reference_time_constant: How fast anchors follow the sole placements given to `update`, s.
    """

    inertial: InertialSettings = field(default_factory=InertialSettings)
    anchor_at_cop: bool = True
    min_load: float = 20.0
    load_time_constant: float = 0.01
    cop_time_constant: float = 0.02
    slip_time_constant: float = 0.2
    reference_time_constant: float = 0.1

    def __post_init__(self) -> None:
        non_negative("min_load (N)", self.min_load)
        for name in ("load", "cop", "slip", "reference"):
            non_negative(f"{name}_time_constant (s)", getattr(self, f"{name}_time_constant"))


class Observer:
    """Estimates the state of a robot from its sensors.

    Attributes:
        robot: The estimated robot; updated in place by every `update`.
        settings: Settings.
        inertial: Attitude, velocity and gyro bias of the IMU.
        load: Normal forces after the low-pass, shape (number of soles,), N.
        share: Part of the base that hangs on each foot, shape (number of soles,); sums to 1, or 0 in flight.
        cop: Centres of pressure in the sole frames after the low-pass, shape (number of soles, 2), m.
        anchor: Resting points of the feet in the world, shape (number of soles, 3), m.
    """

    def __init__(
        self,
        robot: Robot,
        settings: ObserverSettings | None = None,
        *,
        adopt: bool = False,
        dynamics: bool = True,
    ) -> None:
        """Start at rest in the configuration that the robot has.

        Args:
            robot: Robot to estimate.
            settings: Settings; the defaults when None.
            adopt: Estimate into `robot` itself instead of a clone, as a controller of the estimated robot wants.
            dynamics: Keep mass matrix, bias forces and Jacobians of the estimated robot up to date, too. Without them
                (`Robot.update_kinematics`) an update is quicker; an adopted robot always has them.
        """
        q = np.array(robot.q)
        self.robot = robot if adopt else robot.clone()
        self._update_robot = self.robot.update if adopt or dynamics else self.robot.update_kinematics
        self.settings = settings or ObserverSettings()
        self.inertial = InertialFilter(self.settings.inertial)
        n = len(robot.soles)
        self._soles = [robot.frame_id(sole.frame) for sole in robot.soles]
        self._shapes = ((robot.na,), (robot.na,), (3,), (3,), (n, 6))
        self._half = [(0.5 * sole.length, 0.5 * sole.width) for sole in robot.soles]
        self._imu = robot.frame_id(robot.imu_frame)
        self._data = robot.model.createData()  # kinematics with the base at the origin
        self._q = pin.neutral(robot.model)
        self._v = np.zeros(robot.nv)
        self.load, self.share = np.zeros(n), np.zeros(n)
        self.cop, self.anchor = np.zeros((n, 2)), np.zeros((n, 3))
        self._anchor_yaw = [0.0] * n
        self._loads, self._shares = [0.0] * n, [0.0] * n
        # Live views of Pinocchio's frames, and memory for what is made of them.
        imu, soles = self._data.oMf[self._imu], [self._data.oMf[sole] for sole in self._soles]
        self._imu_rotation_t, self._imu_position = imu.rotation.T, imu.translation
        self._sole_columns = [sole.rotation[:, :2] for sole in soles]
        self._sole_positions = [sole.translation for sole in soles]
        self._robot_soles = [self.robot.data.oMf[sole] for sole in self._soles]
        self._sole_axes = np.zeros((n, 3, 2))
        self._arms = np.zeros((n, 3, 1))
        self._cop_columns = self.cop[:, :, None]
        self._origin = np.array((0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0))
        self._wrenches = np.zeros((n, 6))
        self._position = np.zeros(3)
        self._time: float | None = None
        self.reset(q)

    @property
    def net_wrench(self) -> Array:
        """What the ground does to the robot, unfiltered, [force; moment] at the world origin, shape (6,), N and Nm."""
        net = pin.Force.Zero()
        for placement, wrench in zip(self._robot_soles, self._wrenches, strict=True):
            net += placement.act(pin.Force(wrench))
        return np.array(net.vector)

    @property
    def in_flight(self) -> bool:
        """True when no foot carries more than the minimum load."""
        return not any(self._shares)

    def reset(self, q: Array | None = None, specific_force: Array | None = None) -> None:
        """Forget everything but the gyro bias and start at rest from a configuration.

        Args:
            q: Configuration, shape (nq,); half-sitting when None.
            specific_force: Accelerometer of the robot at rest, in the IMU frame, shape (3,), m/s²: roll and
                pitch are then taken from it instead of q.

        Raises:
            InputError: A configuration of the wrong shape or not finite.
        """
        robot = self.robot
        q = robot.half_sitting if q is None else finite_array("configuration", q, (robot.nq,))
        robot.update(q, np.zeros(robot.nv))
        self.inertial.reset(robot.placement(self._imu).rotation)
        if specific_force is not None:
            base_to_imu = robot.placement(self._imu).rotation.T @ robot.placement(robot.base_frame).rotation
            self.inertial.align(finite_array("specific force (m/s²)", specific_force, (3,)))
            tilted = np.array(q)
            tilted[3:7] = pin.Quaternion(self.inertial.rotation @ base_to_imu).coeffs()
            robot.update(tilted, np.zeros(robot.nv))
        self._position = np.array(robot.q[:3])
        self._time = None
        n = len(self._soles)
        self._loads, self._shares = [0.0] * n, [0.0] * n
        self.load[:] = 0.0
        self.share[:] = 0.0
        self.cop[:] = 0.0
        self._wrenches[:] = 0.0
        for i, sole in enumerate(self._soles):
            placement = robot.placement(sole)
            self.anchor[i] = placement.translation
            self._anchor_yaw[i] = _yaw(placement.rotation)

    def update(self, measurement: Measurement, soles: Sequence[pin.SE3 | None] | None = None) -> Robot:
        """Take in one measurement.

        Args:
            measurement: Sensors; its time stamp gives the period.
            soles: Where the controller's model has its soles in the world; loaded feet are drawn there, so
                that the estimate does not wander off from the controller's world. Odometry when None.

        Returns:
            The estimated robot, the same object each time.

        Raises:
            MeasurementError: Not finite, of the wrong shape, or older than the last one.
        """
        self._check(measurement)
        first = self._time is None
        dt = 0.0 if self._time is None else measurement.time - self._time
        self._time = measurement.time

        # Kinematics in the base frame, as if the base rested at the origin.
        model, data = self.robot.model, self._data
        self._q[7:] = measurement.joint_position
        self._v[BASE_DOF:] = measurement.joint_velocity
        pin.forwardKinematics(model, data, self._q, self._v)
        for frame in (self._imu, *self._soles):
            pin.updateFramePlacement(model, data, frame)
        imu_rate = pin.getFrameVelocity(model, data, self._imu, pin.LOCAL_WORLD_ALIGNED)

        gyro = measurement.angular_velocity
        self.inertial.predict(gyro, measurement.specific_force, dt)
        base = self.inertial.rotation.dot(self._imu_rotation_t)
        spin = self.inertial.rotation.dot(gyro - self.inertial.gyro_bias) - base.dot(imu_rate.angular)

        self._update_loads(measurement.sole_wrench, dt, base, first)
        np.matmul(
            self._sole_axes, self._cop_columns, out=self._arms
        )  # from sole centres to centres of pressure
        arms = self._arms[:, :, 0]
        yaw_error = 0.0
        velocity, turning = None, spin.tolist()
        if not self.in_flight:
            slip = [0.0, 0.0, 0.0]  # what the velocity of the anchors would be if the base only turned
            for i, sole in enumerate(self._soles):
                share = self._shares[i]
                if share == 0.0:
                    continue
                rate = pin.getFrameVelocity(model, data, sole, pin.LOCAL_WORLD_ALIGNED)
                point = base.dot(self._sole_positions[i] + arms[i]).tolist()
                sliding = _moved(rate.linear.tolist(), rate.angular.tolist(), arms[i].tolist())
                moved = _moved(base.dot(np.array(sliding)).tolist(), turning, point)
                slip = [total + share * value for total, value in zip(slip, moved, strict=True)]
                yaw = _yaw(base, self._sole_axes[i])
                yaw_error += share * _wrap(self._anchor_yaw[i] - yaw)
            velocity = -np.array(slip)
        imu_arm = np.array(
            _moved(base.dot(imu_rate.linear).tolist(), turning, base.dot(self._imu_position).tolist())
        )
        if first and velocity is not None:
            self.inertial.velocity = velocity + imu_arm
        self.inertial.correct(None if velocity is None else velocity + imu_arm, yaw_error, dt)

        base = self.inertial.rotation.dot(self._imu_rotation_t)
        base_velocity = self.inertial.velocity - imu_arm
        self._update_position(base, base_velocity, arms, soles, dt)

        q, v = self._q, self._v
        q[:3] = self._position
        q[3:7] = pin.Quaternion(base).normalized().coeffs()
        np.dot(base_velocity, base, out=v[:3])
        np.dot(spin, base, out=v[3:6])
        self._update_robot(q, v)
        q[:7] = self._origin
        v[:BASE_DOF] = 0.0
        self._wrenches[:] = measurement.sole_wrench
        return self.robot

    def _check(self, measurement: Measurement) -> None:
        m = measurement
        shapes = (
            m.joint_position.shape,
            m.joint_velocity.shape,
            m.angular_velocity.shape,
            m.specific_force.shape,
            m.sole_wrench.shape,
        )
        if shapes != self._shapes:
            for name, got, shape in zip(SIGNALS, shapes, self._shapes, strict=True):
                if got != shape:
                    raise MeasurementError(f"{name} must have shape {shape} for {self.robot!r}, got {got}")
        measurement.check_finite()
        if self._time is not None and measurement.time < self._time:
            raise MeasurementError(
                f"measurement at {measurement.time:g} s is older than the last, {self._time:g} s"
            )

    def _update_loads(self, wrenches: Array, dt: float, base: Array, first: bool) -> None:
        """Loads, shares and centres of pressure; an anchor moves over the sole with the latter."""
        s = self.settings
        gain = 1.0 if first else _gain(dt, s.load_time_constant)
        rows = wrenches.tolist()
        total = 0.0
        for i, row in enumerate(rows):
            load = self._loads[i] = self._loads[i] + gain * (max(row[2], 0.0) - self._loads[i])
            self._shares[i] = max(load - s.min_load, 0.0)
            total += self._shares[i]
        if total > 0.0:
            self._shares = [share / total for share in self._shares]
        self.load[:] = self._loads
        self.share[:] = self._shares
        for axes, columns in zip(self._sole_axes, self._sole_columns, strict=True):
            axes[:] = columns
        if not s.anchor_at_cop:
            return
        gain = 1.0 if first else _gain(dt, s.cop_time_constant)
        for i, (_, _, force, roll, pitch, _) in enumerate(rows):
            x = y = 0.0
            if force > s.min_load:
                length, width = self._half[i]
                x = min(max(-pitch / force, -length), length)
                y = min(max(roll / force, -width), width)
            old_x, old_y = self.cop[i].tolist()
            dx, dy = gain * (x - old_x), gain * (y - old_y)
            self.cop[i] = (old_x + dx, old_y + dy)
            self.anchor[i] += base.dot(self._sole_axes[i].dot(np.array((dx, dy))))

    def _update_position(
        self,
        base: Array,
        base_velocity: Array,
        arms: Array,
        soles: Sequence[pin.SE3 | None] | None,
        dt: float,
    ) -> None:
        """Hang the base on the anchors; anchors that carry little follow the base."""
        s, shares = self.settings, self._shares
        n = len(shares)
        reach = [base.dot(self._sole_positions[i] + arms[i]) for i in range(n)]
        yaws = [_yaw(base, self._sole_axes[i]) for i in range(n)]
        if soles is not None:
            if len(soles) != n:
                raise InputError(f"one sole placement for each of {n} soles, got {len(soles)}")
            gain = _gain(dt, s.reference_time_constant)
            for i, reference in enumerate(soles):
                if reference is None or shares[i] == 0.0:
                    continue
                over = base.dot(arms[i])
                over += reference.translation
                _draw(self.anchor[i], over, gain)
                self._anchor_yaw[i] += gain * _wrap(_yaw(reference.rotation) - self._anchor_yaw[i])
        if self.in_flight:
            self._position = self._position + dt * base_velocity
        else:
            position = np.zeros(3)
            for i in range(n):
                if shares[i] != 0.0:
                    position += shares[i] * (self.anchor[i] - reach[i])
            self._position = position
        # Feet that disagree settle between themselves; equal gains leave their common place and yaw alone.
        common = sum(w * _wrap(a - yaw) for w, a, yaw in zip(shares, self._anchor_yaw, yaws, strict=True))
        slip = _gain(dt, s.slip_time_constant)
        for i in range(n):
            gain = 1.0 if shares[i] == 0.0 else slip
            reach[i] += self._position
            _draw(self.anchor[i], reach[i], gain)
            self._anchor_yaw[i] += gain * _wrap(yaws[i] + common - self._anchor_yaw[i])


def _draw(point: Array, goal: Array, gain: float) -> None:
    """Move a point of three coordinates part of the way to a goal, in place."""
    (x, y, z), (to_x, to_y, to_z) = point.tolist(), goal.tolist()
    point[:] = (x + gain * (to_x - x), y + gain * (to_y - y), z + gain * (to_z - z))


def _moved(
    velocity: Sequence[float], spin: Sequence[float], arm: Sequence[float]
) -> tuple[float, float, float]:
    """Velocity of another point of a body: spin × arm + velocity."""
    (vx, vy, vz), (ax, ay, az), (bx, by, bz) = velocity, spin, arm
    return ay * bz - az * by + vx, az * bx - ax * bz + vy, ax * by - ay * bx + vz


def _yaw(rotation: Array, axes: Array | None = None) -> float:
    """Heading of the x axis of a frame; with `axes`, of the frame whose first axis they hold, turned by `rotation`."""
    if axes is None:
        return math.atan2(rotation[1, 0], rotation[0, 0])
    x, y, _ = rotation.dot(axes[:, 0]).tolist()
    return math.atan2(y, x)


def _wrap(angle: float) -> float:
    return math.remainder(angle, 2.0 * math.pi)


def _gain(dt: float, time_constant: float) -> float:
    """Share of the way to its input that a first-order low-pass goes in dt."""
    return 1.0 if time_constant <= 0.0 else -math.expm1(-dt / time_constant)
