"""Wrench-driven motion tasks: a frame that yields to the measured wrench, by an impedance or an admittance.

    wrench error  e = low-pass(measured wrench − target wrench)
    compliance    velocity and acceleration from e, the law of each task
    offset        the integral of that velocity, kept by the task
    reference     target pose ∘ offset, with compliance velocity and acceleration as feed-forward

Wrenches are what the surroundings do to the robot, [force; moment] in the task's frame at its origin; a wrench error
moves the frame along itself, away from what pushes. In position control, where the controlled robot integrates its own
accelerations and never sees the measured state, the offset stores how far the frame has yielded.

All laws are differential equations: their constants are times and rates, so that the control period does not matter.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from typing import Annotated, Any, Unpack

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from wbc.base.checked import checked
from wbc.base.errors import InputError, MeasurementError
from wbc.base.numbers import Array, finite_array, finite_scalar, in_range, lag_gain, read_only
from wbc.base.settings import NonNegative
from wbc.core.frames import frame_jacobian, pose_of
from wbc.core.qp.options import POSE_AXES, MotionOptions
from wbc.core.robot import Robot
from wbc.core.signals import Measurement
from wbc.tasks.motion.frame import FrameTask

VELOCITY_BOUND = (0.1, 0.3)
"""Clamp of the compliance velocity, m/s and rad/s: the bounds of mc_rtc's walking stabilizer on CoP tasks."""

SMOOTHING = 0.02
"""Time constant of the low-pass on the wrench error, s: mc_rtc's admittance keeps 0.8 of the last value each 5 ms."""


class ComplianceOptions(MotionOptions, total=False):
    """Options of tasks that yield to a wrench: those of motion tasks, a filter and bounds.

    Attributes:
        time_constant: Time constant of the low-pass on the wrench error, s; none when 0.
        velocity_bound: Clamp of the compliance velocity, shape (6,) or a pair (linear, angular), m/s and rad/s.
        target_wrench: Wrench at which the frame does not yield, [force; moment] in the frame, shape (6,), N and Nm;
            zero by default.
    """

    time_constant: Annotated[NonNegative, "s"]
    velocity_bound: ArrayLike
    target_wrench: ArrayLike | None


class ComplianceTask(FrameTask):
    """Base of motion tasks that yield to a wrench; derive a task with a law of your own in `comply`.

    The rows are along the axes of the frame itself: first position, m, then rotation, rad. Without a wrench error the
    task is a `PoseTask` with rows along the axes of the frame. By default the weight is 10, the stiffness, with which
    the frame follows its reference, 100 1/s², the time constant of the low-pass 0.02 s, and the velocity bound 0.1 m/s
    and 0.3 rad/s.
    """

    __slots__ = (
        "_acceleration", "_measured_wrench", "_motion", "_offset_position", "_offset_rotation", "_period", "_sole",
        "_still", "_target_rates", "_target_wrench", "_time_constant", "_velocity", "_velocity_bound", "_wrench_error",
    )  # fmt: skip
    unit = "m|rad"
    usual = {"weight": 10.0, "stiffness": 100.0}
    law = "compliance"

    @checked
    def __init__(
        self, frame: str, target: pin.SE3 | None = None, **options: Unpack[ComplianceOptions]
    ) -> None:
        """Describe the task on a frame, or a sole by its name; see `ComplianceOptions`.

        The target is the pose in the world without an offset, the present pose when None.
        """
        time_constant = options.pop("time_constant", SMOOTHING)
        velocity_bound = options.pop("velocity_bound", VELOCITY_BOUND)
        target_wrench = options.pop("target_wrench", None)
        self._period = 0.0  # of the ticks so far, s
        super().__init__(frame, self.law, POSE_AXES, target, options)
        self._time_constant = time_constant
        self.velocity_bound = velocity_bound
        self._target_wrench, self._measured_wrench = np.zeros(6), np.zeros(6)
        if target_wrench is not None:
            self.target_wrench = target_wrench
        self._target_rates = np.zeros(self.dim), np.zeros(self.dim)
        self._sole: int | None = None
        self._motion = np.zeros(6)
        self.reset()

    # ---- targets and bounds ---------------------------------------------------------------------------------------

    @property
    def target_wrench(self) -> Array:
        """Wrench at which the frame does not yield, [force; moment] in the frame, shape (6,), N and Nm."""
        return read_only(self._target_wrench)

    @target_wrench.setter
    def target_wrench(self, value: ArrayLike) -> None:
        self._target_wrench = finite_array(f"target wrench of task '{self.name}' (N, Nm)", value, (6,))

    @property
    def measured_wrench(self) -> Array:
        """Last measured wrench, [force; moment] in the frame, shape (6,), N and Nm.

        A task on a sole reads the wrench from each measurement. For any other frame assign the wrench before each tick.
        """
        return read_only(self._measured_wrench)

    @measured_wrench.setter
    def measured_wrench(self, value: ArrayLike) -> None:
        self._measured_wrench = finite_array(f"measured wrench of task '{self.name}' (N, Nm)", value, (6,))

    @property
    def velocity_bound(self) -> Array:
        """Bound of the compliance velocity, [linear; angular], shape (6,), m/s and rad/s; assign this or a pair."""
        return read_only(self._velocity_bound)

    @velocity_bound.setter
    def velocity_bound(self, value: ArrayLike) -> None:
        bound, followed = six(self.name, "velocity bound (m/s, rad/s)", value), np.zeros(6)
        followed[self._choice.keep] = 1.0  # what the task does not follow must not drift away either
        self._velocity_bound = bound * followed

    @property
    def wrench_error(self) -> Array:
        """Wrench error, measured − target, after the low-pass, shape (6,), N and Nm; a copy."""
        return np.array(self._wrench_error)

    @property
    def compliance_velocity(self) -> Array:
        """Velocity with which the frame yields, [linear; angular] along its axes, shape (6,), m/s, rad/s; a copy."""
        return np.array(self._velocity)

    @property
    def offset(self) -> pin.SE3:
        """Offset by which the frame has yielded: the reference pose in the frame of the target."""
        return pose_of(self._offset_rotation, self._offset_position)

    @property
    def reference(self) -> pin.SE3:
        """Reference pose of the frame in the world, target ∘ offset."""
        return self.target * self.offset

    def reset(self) -> None:
        """Set offset, compliance velocity and low-pass to zero."""
        super().reset()
        self._wrench_error, self._velocity, self._acceleration = np.zeros(6), np.zeros(6), np.zeros(6)
        self._still = True  # until the first wrench error
        self._offset_position, self._offset_rotation = np.zeros(3), np.eye(3)

    # ---- the law ------------------------------------------------------------------------------------------------

    @abstractmethod
    def comply(self, error: Array, rate: Array, dt: float) -> tuple[Array, Array]:
        """Return velocity and acceleration with which the frame yields, [linear; angular] along its axes, new arrays.

        The caller then bounds the velocity, and sets it to zero along axes that are not among the `axes` of the task.
        It does not ask before the first wrench error after a reset: a frame stays at rest until then.

        Args:
            error: Filtered wrench error, shape (6,), N and Nm.
            rate: Derivative of the wrench error, shape (6,), N/s and Nm/s; zero without a low-pass.
            dt: Control period, s.
        """

    def offset_vector(self) -> Array:
        """Return the offset as [translation; rotation vector] along the reference's axes, shape (6,), m and rad."""
        vector = np.empty(6)
        np.dot(self._offset_position, self._offset_rotation, out=vector[:3])
        vector[3:] = pin.log3(self._offset_rotation)
        return vector

    @checked
    def bind(self, robot: Robot) -> None:
        """Resolve names; a task on a sole reads the wrench of that sole."""
        for index, sole in enumerate(robot.soles):
            if self.frame in (sole.name, sole.frame):
                self._frame, self._sole = sole.frame, index
        super().bind(robot)

    def _put(self, target: Any, velocity: Array, acceleration: Array) -> None:
        back = self._rotation.T  # rates are along the axes of the frame
        super()._put(
            target, *(np.concatenate([back @ r[:3], back @ r[3:]]) for r in (velocity, acceleration))
        )

    def _feedforward(self) -> tuple[Array, Array]:
        """Return the rates of the target, to which those of the compliance are added in the rows."""
        return self._target_rates

    def observe(self, measurement: Measurement, dt: float) -> None:
        """Yield for one control period dt, s; if the frame is a sole, read its wrench from the measurement first.

        Raises:
            MeasurementError: The wrench contains NaN or infinity; the task does not change.
        """
        if self._sole is not None:
            wrench = measurement.wrenches[self._sole]
            if not math.isfinite(float(wrench.dot(wrench))):
                raise MeasurementError(f"wrench of sole '{self.frame}' is not finite: {wrench}")
            self._measured_wrench[:] = wrench
        self._advance(dt)

    def unobserved(self, dt: float) -> None:
        """Yield to the assigned `measured_wrench` for one control period dt, s.

        A task on a sole is refused, since its wrench comes from the measurement.
        """
        if self._sole is not None:
            super().unobserved(dt)
        self._advance(dt)

    def _advance(self, dt: float) -> None:
        """Yield to `measured_wrench` for a period dt, s."""
        if dt != self._period:
            self._check_damping(self.damping, finite_scalar("control period (s)", dt, above=0.0))
            self._period = dt
        rate, error = self._measured_wrench - self._target_wrench, self._wrench_error
        if self._still and not rate.any():
            return
        self._still = False
        if self._time_constant > 0.0:
            gain = lag_gain(dt, self._time_constant)
            rate -= error
            error += gain * rate
            rate *= (1.0 - gain) / self._time_constant
        else:
            error[:] = rate
            rate[:] = 0.0
        velocity, acceleration = self.comply(error, rate, dt)
        bound = self._velocity_bound
        clamped = np.minimum(np.maximum(velocity, -bound), bound)
        acceleration[clamped != velocity] = 0.0
        self._velocity, self._acceleration = clamped, acceleration
        step = np.dot(self._offset_rotation, clamped[:3])
        step *= dt
        self._offset_position += step
        self._offset_rotation = np.dot(self._offset_rotation, pin.exp3(dt * clamped[3:]))

    def _set_damping(self, damping: Array) -> None:
        self._check_damping(damping, self._period)
        super()._set_damping(damping)

    def _check_damping(self, damping: Array, dt: float) -> None:
        fastest = float(damping.max())
        if fastest * dt >= 2.0:
            raise InputError(
                f"damping of task '{self.name}', {fastest:g} 1/s, is unstable with a control period of {dt:g} s; it "
                f"must be below 2 / period = {2.0 / dt:g} 1/s"
            )

    def evaluate(self, jacobian: Array, error: Array, drift: Array) -> None:
        """Fill the rows; see `Task.evaluate`."""
        model, data, local = self._model, self._data, pin.LOCAL
        target, rotation = self._target, self._rotation
        goal = target.rotation
        difference = np.dot(goal, self._offset_position)
        difference += target.translation
        difference -= self._translation
        turn = np.dot(rotation.T, np.dot(goal, self._offset_rotation))
        np.dot(difference, rotation, out=error[:3])
        error[3:] = -self._turn(turn.T)  # from the target to the frame, along the axes of the frame
        jacobian[:] = frame_jacobian(model, data, self._id, local)
        drift[:] = pin.getFrameClassicalAcceleration(model, data, self._id, local).vector
        self._fed = True
        if self._still:
            self._numbers.velocity[:], self._numbers.acceleration[:] = self._target_rates
            return
        # From the axes of the reference, in which the frame yields, to those of the frame as it stands now.
        motion, rows = self._motion, self._numbers
        for yields, rate, row in (
            (self._velocity, self._target_rates[0], rows.velocity),
            (self._acceleration, self._target_rates[1], rows.acceleration),
        ):
            np.dot(turn, yields[:3], out=motion[:3])
            np.dot(turn, yields[3:], out=motion[3:])
            np.add(rate, motion[self._choice.keep], out=row)


def six(task: str, what: str, value: ArrayLike, *, above_zero: bool = False) -> Array:
    """Return a value for each axis of a frame, [linear; angular], shape (6,), given so or as a pair (linear, angular).

    `what` names it in messages, with its unit. Raises `InputError` for another shape, or a number that is not finite,
    negative, or zero if it must be above zero.
    """
    gain = finite_array(f"{what} of task '{task}'", value)
    if gain.shape == (2,):
        gain = np.repeat(gain, 3)
    if gain.shape != (6,):
        raise InputError(
            f"{what} of task '{task}' must have shape (6,), or be a pair (linear, angular); got shape {gain.shape}"
        )
    return in_range(f"{what} of task '{task}'", gain, 0.0, 0.0 if above_zero else -math.inf, math.inf)


IMPEDANCE_SMOOTHING = 0.05
"""The same of an impedance: cut-off period of mc_rtc's ImpedanceTask."""

IMPEDANCE_BOUND = (1.0, 3.0)
"""Clamp of the velocity of an impedance; ours: the speed of a hand, beyond what a spring should do."""

SPRING = (1000.0, 100.0)
"""N/m and Nm/rad; ours: 10 N move the frame by 1 cm, 10 Nm turn it by 0.1 rad."""

MASS = (10.0, 1.0)
"""kg and kg m²; ours: with the springs, 10 rad/s undamped in all axes."""


class ImpedanceTask(ComplianceTask):
    """Task whose frame yields to the wrench error like a mass on a spring and a damper.

        mass ∘ acceleration + damper ∘ velocity + spring ∘ offset = measured − target wrench

    The offset converges to wrench error / spring, and back to zero when the wrench error ends. Without a mass its time
    constant is damper / spring. By default the time constant of the low-pass is 0.05 s, and the velocity bound is 1 m/s
    and 3 rad/s.

    In contact with surroundings of stiffness K the loop through the low-pass is stable if damper > time constant · K (a
    sufficient condition, by Routh's criterion). For stiff surroundings choose a shorter time constant, more damping, or
    no mass: without a mass the loop is always stable.

    Source: the law is that of mc_rtc's ImpedanceTask (jrl-umi3218/mc_rtc), without a mass that of its
    FirstOrderImpedanceTask, integrated implicitly, so that no choice of mass, damper and control period is unstable by
    itself.
    """

    __slots__ = ("_damper", "_mass", "_spring")
    law = "impedance"

    @checked
    def __init__(
        self,
        frame: str,
        target: pin.SE3 | None = None,
        *,
        mass: ArrayLike = MASS,
        spring: ArrayLike = SPRING,
        damper: ArrayLike | None = None,
        **options: Unpack[ComplianceOptions],
    ) -> None:
        """Describe the task.

        Args:
            frame: Frame of the robot, or the name of a sole.
            target: Pose in the world without an offset; the present pose when None.
            mass: Mass along the axes of the frame, shape (6,) or a pair (linear, angular), kg and kg m², ≥ 0. With zero
                the frame yields like a spring and a damper in parallel.
            spring: Stiffness along the same axes, shape (6,) or a pair, N/m and Nm/rad, ≥ 0.
            damper: Damping along the same axes, shape (6,) or a pair, Ns/m and Nms/rad, > 0; critical, 2·√(mass ·
                spring), when None.
            **options: See `ComplianceOptions`.
        """
        options = {"time_constant": IMPEDANCE_SMOOTHING, "velocity_bound": IMPEDANCE_BOUND, **options}
        super().__init__(frame, target, **options)
        self.mass, self.spring = mass, spring
        self.damper = 2.0 * np.sqrt(self._mass * self._spring) if damper is None else damper

    @property
    def mass(self) -> Array:
        """Mass, shape (6,), kg and kg m²; assign an array of this shape or a pair (linear, angular)."""
        return read_only(self._mass)

    @mass.setter
    def mass(self, value: ArrayLike) -> None:
        self._mass = six(self.name, "mass (kg, kg m²)", value)

    @property
    def spring(self) -> Array:
        """Stiffness, shape (6,), N/m and Nm/rad; assign an array of this shape or a pair (linear, angular)."""
        return read_only(self._spring)

    @spring.setter
    def spring(self, value: ArrayLike) -> None:
        self._spring = six(self.name, "spring (N/m, Nm/rad)", value)

    @property
    def damper(self) -> Array:
        """Damping, shape (6,), Ns/m and Nms/rad; assign an array of this shape or a pair (linear, angular)."""
        return read_only(self._damper)

    @damper.setter
    def damper(self, value: ArrayLike) -> None:
        self._damper = six(self.name, "damper (Ns/m, Nms/rad)", value, above_zero=True)

    def comply(self, error: Array, rate: Array, dt: float) -> tuple[Array, Array]:
        """Solve the law for velocity and offset at the end of the period; see `ComplianceTask.comply`."""
        mass, spring, damper = self._mass, self._spring, self._damper
        force = error - spring * self.offset_vector()
        velocity = (mass * self._velocity + dt * force) / (mass + dt * damper + dt * dt * spring)
        massless = (rate - spring * velocity) / damper
        return velocity, np.where(mass > 0.0, (velocity - self._velocity) / dt, massless)


class AdmittanceTask(ComplianceTask):
    """Task whose frame yields at a velocity proportional to the wrench error, and keeps its offset.

        velocity = admittance ∘ (measured − target wrench), which moves the reference pose

    In contact with surroundings of stiffness K, N/m or Nm/rad, the wrench error decays with the rate admittance · K,
    1/s. There is no overshoot if this rate is at most 1 / (4 · time constant). Without contact the frame moves on at
    the bounded velocity, and so searches for contact.

    Source: the rate form is that of mc_rtc's AdmittanceTask (jrl-umi3218/mc_rtc), with the low-pass as a time
    constant, and acceleration and velocity of the reference fed forward exactly.
    """

    __slots__ = ("_admittance",)
    law = "admittance"

    @checked
    def __init__(
        self,
        frame: str,
        target: pin.SE3 | None = None,
        *,
        admittance: ArrayLike,
        **options: Unpack[ComplianceOptions],
    ) -> None:
        """Describe the task, as a `ComplianceTask` with an admittance along the axes of the frame.

        For example, 1e-4 m/(N s) on ground of 1e5 N/m gives a rate of 10 1/s.
        """
        super().__init__(frame, target, **options)
        self.admittance = admittance

    @property
    def admittance(self) -> Array:
        """Velocity per wrench error, shape (6,), m/(N s) and rad/(Nm s); assign this or a pair (linear, angular)."""
        return read_only(self._admittance)

    @admittance.setter
    def admittance(self, value: ArrayLike) -> None:
        self._admittance = six(self.name, "admittance (m/(N s), rad/(Nm s))", value)

    def comply(self, error: Array, rate: Array, dt: float) -> tuple[Array, Array]:
        """Return admittance ∘ error and its derivative; see `ComplianceTask.comply`."""
        return self._admittance * error, self._admittance * rate
