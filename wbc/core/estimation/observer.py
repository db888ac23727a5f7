"""Observer: base pose and velocity from encoders, IMU and foot wrenches, without ground truth.

Each loaded foot has one point at rest on the ground, its anchor. The anchor is the material point of the sole at the
measured centre of pressure (CoP) and moves over the sole with it, so a foot may roll over its edge, over a stone or on
soft phalanges: the sole need not be flat or parallel to the ground. The base position follows from both anchors, each
weighted by its load; the joint velocities with the anchors at rest give the base velocity, which the IMU smooths
(`wbc.core.estimation.inertial`). The headings of the feet bound the drift of the gyroscope's yaw, except of a foot that
spins: on one stone, or on an edge, a sole has no area that resists torsion, and its heading says nothing of the body's.
`Observer.update` has the order of a tick.

For a rigid sole that rolls without slip the construction is exact; a sole that deforms leaves the velocity
that its material point at the centre of pressure has.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import field, replace
from typing import Annotated

import numpy as np
import pinocchio as pin
from pydantic import Field

from wbc.base.checked import checked, fixed, result
from wbc.base.errors import InputError, MeasurementError, shown
from wbc.base.numbers import ROUNDING, Array, lag_gain
from wbc.base.settings import NonNegative, Number, Positive, settings
from wbc.base.vectors import Rotation, Vector, add_cross, quaternion, turned, turned_all
from wbc.core.estimation.checks.stamps import stamp_of
from wbc.core.estimation.foot import STILL, FeetAtRest, FootEstimate, RestDetector, SoleMotion
from wbc.core.estimation.inertial import InertialFilter, InertialSettings
from wbc.core.estimation.outside import OutsideSettings, OutsideWrench
from wbc.core.estimation.sinking import Sinking
from wbc.core.frames import heading, net_wrench
from wbc.core.robot import GRAVITY, Robot
from wbc.core.signals import SIGNALS, Measurement

LONGEST_DELAY = 0.1
"""Longest delay that can be stated, s."""

Soles = Sequence[pin.SE3 | None]
"""Placements of the soles in the world; None for one that is not known."""

ORIGIN = np.array((0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0))
"""Configuration of a base at the origin."""


@settings
class ObserverSettings:
    """Settings of the estimate of the base.

    Attributes:
        inertial: Time constants of the inertial part.
        min_load: Normal force below which a foot has no share in the estimate, N; less for a light robot
            (`Robot.force_scale`).
        load_time_constant: Time constant of the low-pass of the normal forces, s; 0 for none.
        cop_time_constant: Time constant of the low-pass of the CoPs, s; 0 for none.
        slip_time_constant: Time constant with which anchors of loaded feet settle when their distance changes, s.
        spin: Speed of a foot about the vertical, by encoders and gyroscope, from which its heading is no reference for
            the yaw until it rests again, rad/s. Eight times the noise of a foot at rest: the encoder of a hip yaw joint
            has 0.0125 rad/s, the gyroscope 0.002 rad/s.
        slip: Speed of a loaded foot, by gyroscope and accelerometer, from which the foot is no reference, m/s. Such a
            foot slips, or something other than the ground loads it, for example a hit. A foot that stands has a speed
            of 0.05 m/s by these sensors. On ground that gives, the speed at which the foot sinks is added.
        reference_time_constant: Time constant with which anchors follow the sole placements given to `update`, s.
        measurement_delay: Age of a measurement when it arrives, s. The estimate is carried ahead over this and the next
            delay, to when a command will take effect.
        command_delay: Time from a command to its effect, s.
        outside: Estimate of the wrench that the surroundings put on the robot besides the ground; None for none.
    """

    inertial: InertialSettings = field(default_factory=InertialSettings)
    min_load: Annotated[NonNegative, "N"] = 20.0
    load_time_constant: Annotated[NonNegative, "s"] = 0.01
    cop_time_constant: Annotated[NonNegative, "s"] = 0.02
    slip_time_constant: Annotated[NonNegative, "s"] = 0.2
    spin: Annotated[Positive, "rad/s"] = 0.1
    slip: Annotated[Positive, "m/s"] = 0.3
    reference_time_constant: Annotated[NonNegative, "s"] = 0.1
    measurement_delay: Annotated[float, Field(ge=0.0, le=LONGEST_DELAY), "s"] = 0.0
    command_delay: Annotated[float, Field(ge=0.0, le=LONGEST_DELAY), "s"] = 0.0
    outside: OutsideSettings | None = None

    @property
    def delay(self) -> float:
        """Sum of the delays of measurement and command, s."""
        return self.measurement_delay + self.command_delay


class DelayPredictor:
    """Carries a state ahead by the sum of the delays of measurements and commands, to when a command takes effect.

    A measurement is `measurement_delay` old when it arrives, and a command takes effect `command_delay` after it was
    sent. The commands that act in between are known, and so, by the model, are the accelerations that they cause: the
    state is carried ahead with them, from the estimate anew in every tick.

    Source: O. J. M. Smith's predictor, ISA Journal 6(2), 1959.
    """

    def __init__(self, model: pin.Model, delay: float) -> None:
        """Start at rest; the delay is the sum of those of measurement and command, s."""
        self._model, self._delay = model, delay
        self._sent: deque[tuple[Array, float]] = deque()
        self._covered = 0.0
        self._step, self._v = np.zeros(model.nv), np.zeros(model.nv)

    def reset(self) -> None:
        """Forget the accelerations: the robot is at rest."""
        self._sent.clear()
        self._covered = 0.0

    def commanded(self, acceleration: Array, dt: float) -> None:
        """Take over the acceleration, shape (nv,), of the command that is sent now and valid for dt, s."""
        self._sent.append((acceleration, dt))
        self._covered += dt
        while self._covered - self._sent[0][1] >= self._delay - ROUNDING:
            self._covered -= self._sent.popleft()[1]

    def ahead(self, q: Array, v: Array) -> tuple[Array, Array]:
        """Return configuration and velocity, shapes (nq,) and (nv,), after the delay from those at the measurement."""
        step, velocity = self._step, self._v
        np.multiply(v, self._delay, out=step)
        velocity[:] = v
        left = min(self._covered, self._delay)  # of the delay, from when each command begins to act
        surplus = self._covered - left
        for acceleration, dt in self._sent:
            acts = dt - surplus
            surplus = 0.0
            velocity += acts * acceleration
            step += acts * (left - 0.5 * acts) * acceleration
            left -= acts
        return pin.integrate(self._model, q, step), velocity


class Observer:
    """Estimator of the state of a robot from its sensors.

    Attributes:
        robot: The estimated robot; updated in place by every `update`.
        settings: Its `ObserverSettings`.
        inertial: Attitude, velocity and gyro bias of the IMU.
        rest: Feet that rest in this tick, the references of the estimate, and those that move.
        load_shares: Shares of the load that the feet bear in this tick; also of a foot that moves.
        sinking: Compliance of ground and soles; a foot that takes over load sinks by it.
        outside: Observer of the wrench of the surroundings except the ground; None while it is not estimated.
        time: Time stamp of the last measurement, s; None before one.
    """

    robot: Robot = fixed("make another observer")
    settings: ObserverSettings = result(
        "_settings", "make another observer; `retune` changes the inertial part"
    )

    @checked
    def __init__(
        self, robot: Robot, settings: ObserverSettings | None = None, *, adopt: bool = False
    ) -> None:
        """Start at rest in the present configuration of the robot.

        Args:
            robot: Robot to estimate.
            settings: Settings; the defaults when None.
            adopt: Write the estimate into `robot` itself instead of a clone, for a controller of the estimated robot.
                It then has mass matrix, bias forces and Jacobians, too. A clone has frames, the centre of mass and
                their velocities (`Robot.update_kinematics`).
        """
        robot.needs_feet("an observer of the base")
        q = np.array(robot.q)
        self.robot = robot if adopt else robot.clone()
        self._update_robot = self.robot.update if adopt else self.robot.update_kinematics
        self._settings = settings or ObserverSettings()
        self.inertial = InertialFilter(self._settings.inertial)
        self._min_load = self._settings.min_load * robot.force_scale
        n = len(robot.soles)
        self._soles = [robot.frame_id(sole.frame) for sole in robot.soles]
        self._shapes = ((robot.na,), (robot.na,), (3,), (3,), (n, 6))
        self._imu = robot.frame_id(robot.imu_frame)
        self._data = robot.model.createData()  # kinematics with the base at the origin
        self._q = pin.neutral(robot.model)
        self._v = np.zeros(robot.nv)
        delay = self._settings.delay
        self._predictor = DelayPredictor(robot.model, delay) if delay > ROUNDING else None
        # Views of base and joints, and of the pose of the base and its rates: quicker than slices.
        self._parts = self._q[:7], self._q[7:], self._v[:6], self._v[6:]
        self._base = self._q[:7], self._v[:3], self._v[3:6]
        self._frames = self._imu, *self._soles
        # Live views of Pinocchio's frames.
        imu, soles = self._data.oMf[self._imu], [self._data.oMf[sole] for sole in self._soles]
        self._imu_rotation_t, self._imu_position = imu.rotation.T, imu.translation
        self._sole_frames = [(sole.rotation, sole.translation) for sole in soles]
        self._robot_soles = [self.robot.data.oMf[sole] for sole in self._soles]
        outside = self._settings.outside
        self.sinking = Sinking(robot.mass * GRAVITY)
        self.outside = None if outside is None else OutsideWrench(self.robot, outside)
        self.reset(q)

    def observe_outside(self) -> OutsideWrench:
        """Estimate the wrench of the surroundings from the next tick on, and return the observer of this wrench."""
        if self.outside is None:
            self.outside = OutsideWrench(self.robot)
        return self.outside

    @checked
    def retune(self, settings: InertialSettings) -> None:
        """Change the time constants of attitude and velocity."""
        self.inertial.retune(settings)
        self._settings = replace(self._settings, inertial=settings)

    @property
    def load(self) -> Array:
        """Normal forces after the low-pass, shape (number of soles,), N."""
        return np.array([foot.load for foot in self._feet])

    @property
    def foot_velocities(self) -> list[Vector]:
        """Velocities of the feet's CoPs against the IMU, by encoders and gyroscope, in the world, m/s; a new list."""
        x, y, z = self._imu_motion
        return [(u - x, v - y, w - z) for u, v, w in (motion.velocity for motion in self._motions)]

    @property
    def foot_rotations(self) -> list[Vector]:
        """Angular velocities of the feet by encoders and gyroscope, along the world axes, rad/s; a new list."""
        return [motion.rotation for motion in self._motions]

    @property
    def net_wrench(self) -> Array:
        """Wrench of the ground on the robot, unfiltered, [force; moment] at the world origin, shape (6,), N and Nm."""
        return net_wrench(self._wrenches, self._robot_soles)

    def reset(self, q: Array | None = None) -> None:
        """Restart at rest from a configuration, shape (nq,), half-sitting when None; the gyroscope's bias is kept."""
        robot = self.robot
        q = robot.half_sitting if q is None else robot.check_configuration("configuration", q)
        robot.update(q, np.zeros(robot.nv))
        self.inertial.reset(robot.placement(self._imu).rotation)
        self._position: Vector = tuple(robot.q[:3].tolist())
        self.time: float | None = None
        self._q[:], self._v[:] = robot.q, robot.v
        if self._predictor is not None:
            self._predictor.reset()
        if self.outside is not None:
            self.outside.reset()
        self.sinking.reset()
        self._feet = [
            FootEstimate(sole, robot.placement(sole.frame), self._min_load, self.sinking)
            for sole in robot.soles
        ]
        n = len(self._feet)
        self._detector, self.load_shares = RestDetector(n), [0.0] * n
        self.rest = FeetAtRest([0.0] * n, [False] * n, [False] * n)
        # Of the last tick: wrenches on the soles, motions of the feet, and that of the IMU while the base only turns.
        self._wrenches = [[0.0] * 6] * n
        self._motions = [SoleMotion(STILL, STILL, STILL, STILL, STILL, 0.0)] * n
        self._imu_motion: Vector = STILL

    @property
    def measured_state(self) -> tuple[Array, Array]:
        """Configuration, shape (nq,), and velocity, shape (nv,), at the last measurement; valid until the next one."""
        return self._q, self._v

    def commanded(self, acceleration: Array, dt: float) -> None:
        """Take the acceleration, shape (nv,), of the command that is sent now for dt, s, to bridge known delays."""
        if self._predictor is not None:
            self._predictor.commanded(acceleration, dt)

    @checked
    def resume(self, time: Annotated[Number, "s"]) -> None:
        """Continue from another time stamp, s, without integrating over the gap."""
        self.time = time

    def update(
        self,
        measurement: Measurement,
        soles: Soles | None = None,
        *,
        plausible: bool = False,
    ) -> Robot:
        """Update the estimate with one measurement.

        Args:
            measurement: Measurement; the period is the difference of its time stamp from the last one.
            soles: Placements of the soles in the world according to the controller's model. The estimate of loaded feet
                converges to them, so that it does not drift away from the controller's world. When None, the position
                is integrated (odometry).
            plausible: True for a measurement that `Plausibility.check` has returned; it is then not checked again.

        Returns:
            The estimated robot, the same object each time.

        Raises:
            MeasurementError: The measurement is not finite, has a wrong shape, or is older than the last one.
        """
        if not plausible:
            self._check(measurement)
        if soles is not None and len(soles) != len(self._feet):
            raise InputError(f"one sole placement for each of {len(self._feet)} soles, got {len(soles)}")
        first = self.time is None
        dt = 0.0 if self.time is None else measurement.time - self.time
        self.time = measurement.time

        inertial, gyro = self.inertial, measurement.angular_velocity
        imu = self._move_joints(measurement)
        inertial.predict(gyro, measurement.specific_force, dt)
        turn = inertial.rotation.dot(self._imu_rotation_t)  # of the base
        spin = inertial.rotation.dot(gyro - inertial.gyro_bias) - turn.dot(imu.angular)
        self._wrenches = measurement.wrenches.tolist()
        self._move_feet(turn.tolist(), spin.tolist(), imu, dt, first)
        self._correct(dt, first)

        turn = inertial.rotation.dot(self._imu_rotation_t)
        base, velocity = turn.tolist(), inertial.velocity - np.array(self._imu_motion)
        self._place(base, velocity, soles, dt)
        pose, linear, angular = self._base
        pose[:] = *self._position, *quaternion(base)
        np.dot(velocity, turn, out=linear)
        np.dot(spin, turn, out=angular)
        if self._predictor is not None:
            self._update_robot(*self._predictor.ahead(self._q, self._v))
        else:
            self._update_robot(self._q, self._v)
        if self.outside is not None:
            self.outside.update(measurement.wrenches, dt)
        return self.robot

    def _move_joints(self, measurement: Measurement) -> pin.Motion:
        """Move the joints under a base that rests at the origin; return the velocity of the IMU."""
        model, data, (base, joints, base_rate, joint_rates) = self.robot.model, self._data, self._parts
        base[:], base_rate[:] = ORIGIN, 0.0
        joints[:], joint_rates[:] = measurement.joint_position, measurement.joint_velocity
        pin.forwardKinematics(model, data, self._q, self._v)
        for frame in self._frames:
            pin.updateFramePlacement(model, data, frame)
        return pin.getFrameVelocity(model, data, self._imu, pin.LOCAL_WORLD_ALIGNED)

    def _move_feet(self, base: Rotation, spin: Vector, imu: pin.Motion, dt: float, first: bool) -> None:
        """Take in what the feet bear and how they move, and find those that rest.

        `base` is the rotation of the base, `spin` its angular velocity in the world, rad/s; `imu` is the velocity of
        the IMU in the base frame.
        """
        s, model, data, inertial = self._settings, self.robot.model, self._data, self.inertial
        moving, at_imu = turned_all(base, (imu.linear.tolist(), self._imu_position.tolist()))
        self._imu_motion = x, y, z = add_cross(moving, spin, at_imu)
        gains = 1.0, 1.0  # the first tick is unfiltered
        if not first:
            gains = lag_gain(dt, s.load_time_constant), lag_gain(dt, s.cop_time_constant)
        motions: list[SoleMotion] = []
        loads: list[float] = []
        for foot, frame, (rotation, place), wrench in zip(
            self._feet, self._soles, self._sole_frames, self._wrenches, strict=True
        ):
            rate = pin.getFrameVelocity(model, data, frame, pin.LOCAL_WORLD_ALIGNED)
            sole = rotation.tolist(), place.tolist()
            motions.append(foot.update(wrench, sole, rate, base, spin, gains, dt))
            loads.append(max(foot.load - self._min_load, 0.0))
        total = sum(loads)
        shares = [load / total for load in loads] if total > 0.0 else loads
        self._motions, self.load_shares = motions, shares
        u, v, w = inertial.velocity.tolist()
        velocity, steady = None if first else (u - x, v - y, w - z), inertial.steady - complex(x, y)
        self.rest = self._detector.update(motions, shares, velocity, steady, s.slip + self.sinking.speed, dt)

    def _check(self, m: Measurement) -> None:
        time = stamp_of(m.time)
        for name, shape in zip(SIGNALS, self._shapes, strict=True):
            value = m.wrenches if name == "sole_wrench" else getattr(m, name)
            good = type(value) is np.ndarray and value.dtype.kind in "iuf" and value.shape == shape
            if not (good and np.isfinite(value).all()):
                raise MeasurementError(
                    f"measurement at {time} s: {name} must be finite, of shape {shape} and an array of real numbers, "
                    f"got {shown(value)}"
                )
        if not math.isfinite(time) or (self.time is not None and time < self.time):
            raise MeasurementError(f"time of a measurement must be finite and rise, got {time} s")

    def _correct(self, dt: float, first: bool) -> None:
        """Correct attitude and velocity by the feet that rest; feet that slip or strike the ground count otherwise.

        A foot that spins tells no yaw: its heading follows.
        """
        inertial, rest, yaw_error = self.inertial, self.rest, 0.0
        legs: Vector | None = None  # velocity of the IMU, m/s
        if any(rest.shares):
            # Of the base: minus the velocity that the anchors would have if the base only turned.
            vx = vy = vz = 0.0
            for foot, motion, share in zip(self._feet, self._motions, rest.shares, strict=True):
                if share == 0.0:
                    continue
                x, y, z = motion.velocity
                vx, vy, vz = vx - share * x, vy - share * y, vz - share * z
                if abs(motion.rotation[2]) > self._settings.spin:
                    foot.yaw = motion.heading
                else:
                    yaw_error += share * math.remainder(foot.yaw - motion.heading, math.tau)
            x, y, z = self._imu_motion
            legs = vx + x, vy + y, vz + z
        slides = True in rest.slides if legs is None else rest.sliding
        inertial.correct(legs, yaw_error, dt, struck=first or rest.struck, slides=slides)

    def _place(self, base: Rotation, velocity: Array, soles: Soles | None, dt: float) -> None:
        """Place the base by the anchors, in flight by its velocity in the world, m/s, and let the anchors settle.

        `base` is the rotation of the base; `soles` are placements in the controller's model.
        """
        feet, shares = self._feet, self.rest.shares
        # In the world: from the base to the CoPs, and first axes of the soles.
        parts = turned_all(base, [part for motion in self._motions for part in (motion.point, motion.axis)])
        reach, yaws = parts[::2], [math.atan2(y, x) for x, y, _ in parts[1::2]]
        self.sinking.update(
            [foot.load for foot in feet],
            [height - foot.rolled for (_, _, height), foot in zip(reach, feet, strict=True)],
            dt,
            carry=all(self.load_shares),
        )
        if soles is not None:
            self._follow(soles, base, dt)
        x = y = z = 0.0
        if any(shares):
            for share, foot, (u, v, w) in zip(shares, feet, reach, strict=True):
                at_x, at_y, at_z = foot.anchor
                x, y, z = x + share * (at_x - u), y + share * (at_y - v), z + share * (at_z - w)
        else:
            (x, y, z), (u, v, w) = self._position, velocity.tolist()
            x, y, z = x + dt * u, y + dt * v, z + dt * w
        self._position = x, y, z
        # Anchors whose distance changes settle: equal gains leave the common position and yaw unchanged. Those of feet
        # without a share follow the base.
        common = 0.0
        for share, foot, yaw in zip(shares, feet, yaws, strict=True):
            common += share * math.remainder(foot.yaw - yaw, math.tau)
        slip = lag_gain(dt, self._settings.slip_time_constant)
        for share, foot, (u, v, w), yaw in zip(shares, feet, reach, yaws, strict=True):
            foot.draw((x + u, y + v, z + w), yaw + common, 1.0 if share == 0.0 else slip)

    def _follow(self, soles: Soles, base: Rotation, dt: float) -> None:
        """Draw the anchors of feet that rest to the placements of the soles in the controller's model."""
        gain = lag_gain(dt, self._settings.reference_time_constant)
        for share, foot, motion, sole in zip(self.rest.shares, self._feet, self._motions, soles, strict=True):
            if sole is not None and share != 0.0:
                (x, y, z), (u, v, w) = sole.translation.tolist(), turned(base, motion.arm)
                foot.draw((x + u, y + v, z + w), heading(sole.rotation), gain)
