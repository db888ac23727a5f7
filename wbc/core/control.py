"""Position and torque control: from a controller's accelerations and torques to commands of a robot's drives.

Position control integrates the accelerations to references of joint position and velocity, as mc_rtc does: the
controlled robot (the model that moves as commanded) and the estimated robot (from sensors) are two objects. Torque
control sends the torques and needs the estimate alone.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from dataclasses import field, replace
from time import perf_counter
from typing import Annotated, Literal, cast

import numpy as np
import pinocchio as pin

from wbc.core.arguments import checked
from wbc.core.errors import Array, InputError, MeasurementError, finite_array, positive, scalar
from wbc.core.estimation.consistency import ConsistencyMonitor, ConsistencySettings
from wbc.core.estimation.delay import SentCommands
from wbc.core.estimation.observer import Observer
from wbc.core.estimation.plausibility import Plausibility, PlausibilitySettings
from wbc.core.estimation.wrenches import WrenchEstimator
from wbc.core.gate import CommandGate, GateSettings
from wbc.core.lag import lag_gain
from wbc.core.qp.controller import Controller
from wbc.core.qp.solution import Solution
from wbc.core.qp.solver import Status
from wbc.core.robot import Robot
from wbc.core.settings import NonNegative, Positive, settings
from wbc.core.signals import Command, Measurement, WrenchSource

logger = logging.getLogger(__name__)

Mode = Literal["position", "torque", "hybrid"]
"""Control mode of the drives."""

Prepare = Callable[[Robot, Measurement], None]
"""Function called once a tick with the estimated robot and the measurement, to move targets of tasks and contacts."""

Feedforward = Callable[[Solution], Array]
"""Function called once a tick after the QP has been solved; returns joint torques, shape (na,), Nm."""


@settings
class FailurePolicy:
    """Reaction to ticks without a solution or with a measurement that cannot be used.

    The last good command is held while the motion is damped; when failures continue, the robot is stopped: position
    control freezes its references, torque control only damps. A stopped control stays stopped until `reset`.

    Attributes:
        damping_time: Time constant with which reference velocities decay while a command is held, s.
        joint_damping: Damping torque in torque control, as part of the torque limit per rad/s.
        stop_after: Time of uninterrupted failure after which the robot is stopped, s.
    """

    damping_time: Annotated[Positive, "s"] = 0.05
    joint_damping: Annotated[NonNegative, "s/rad"] = 0.02
    stop_after: Annotated[NonNegative, "s"] = 0.1


@settings
class SafetySettings:
    """Ranges of what comes into a control and of what leaves it.

    Attributes:
        plausibility: Ranges that measurements must keep.
        consistency: Bounds beyond which sensors contradict each other.
        gate: Limits of commands, beside those of the robot.
    """

    plausibility: PlausibilitySettings = field(default_factory=PlausibilitySettings)
    consistency: ConsistencySettings = field(default_factory=ConsistencySettings)
    gate: GateSettings = field(default_factory=GateSettings)


class _Control:
    """Base of both modes: plausibility, observer, failures, the last solution and the gate."""

    _follows_estimate = True

    def __init__(
        self,
        controller: Controller,
        observer: Observer | None,
        policy: FailurePolicy | None,
        prepare: Prepare | None,
        safety: SafetySettings | None,
    ) -> None:
        self.controller = controller
        self.prepare = prepare
        self.observer = Observer(controller.robot) if observer is None else observer
        if self.observer.robot.model is not controller.robot.model:
            raise InputError("the observer must estimate the same robot model that the controller uses")
        self.policy = policy or FailurePolicy()
        robot, dt, safety = controller.robot, controller.dt, safety or SafetySettings()
        self.plausibility = Plausibility(robot, dt, safety.plausibility)
        self.monitor = ConsistencyMonitor(robot, dt, self.plausibility.names, safety.consistency)
        self.gate = CommandGate(robot, dt, safety.gate)
        gains = None if robot.servos is None else (robot.servos.kp, robot.servos.kd)
        # For feet without force sensors: made when a measurement comes without wrenches.
        self.wrenches: WrenchEstimator | None = None
        self._sent = SentCommands(gains, robot.torque_limit, dt, self.observer.settings.delay)
        self.failures = 0
        self.reason = ""
        self.solution: Solution | None = None
        self.measurement: Measurement | None = None
        self._torques = np.zeros(controller.robot.na)
        self._failing = 0

    @property
    def failing(self) -> bool:
        """True if the last tick has failed."""
        return self._failing > 0

    @property
    def stopped(self) -> bool:
        """True after failures have gone on for too long; `reset` starts again."""
        return self._failing * self.controller.dt > self.policy.stop_after

    def _forget(self) -> None:
        """Clear failures, the last solution and the last torques."""
        self.controller.reset()
        self.solution = None
        self._torques = np.zeros_like(self._torques)
        self._failing = 0
        self.reason = ""
        self.plausibility.reset()
        self.monitor.reset()
        self.gate.reset(self.controller.robot.q[7:])
        self.wrenches = None
        self._sent.reset()

    def status(self) -> str:
        """Return in one line how the control is: "ok", or what is refused, doubted, clipped, relaxed or failing."""
        parts = []
        if self.stopped:
            parts.append(f"stopped: {self.reason}")
        elif self._failing:
            parts.append(f"failing: {self.reason}")
        if self.plausibility.faults:
            parts.append(f"refused: {', '.join(self.plausibility.faults)}")
        if self.monitor.doubts:
            parts.append(f"doubtful: {', '.join(self.monitor.doubts)}")
        if self.solution is not None and self.solution.status is Status.RELAXED and not self._failing:
            parts.append("relaxed: hard tasks and contacts cannot all be satisfied")
        if self.gate.faults:
            parts.append(f"command clipped: {', '.join(self.gate.faults)}")
        return "; ".join(parts) or "ok"

    def _think(self, measurement: Measurement, soles: Sequence[pin.SE3 | None] | None = None) -> bool:
        """Estimate, prepare and solve; True if there is a solution, otherwise `reason` says why not."""
        controller, robot = self.controller, self.controller.robot
        start = perf_counter()
        try:
            self.measurement = measurement = self._estimate(measurement, soles)
            estimate = self.observer.robot
            if self._follows_estimate and estimate is not robot:
                robot.update(estimate.q, estimate.v)
            controller.model_time = perf_counter() - start
            if self.prepare is not None:
                self.prepare(estimate, measurement)
            self.solution = solution = controller.solve(measurement)
            if solution.ok and not self.stopped:
                self._use(solution)
        except MeasurementError as error:
            return self._fail(f"measurement refused: {error}")
        except Exception as error:  # of tasks and callbacks of the user: a robot gets a command in every tick
            return self._fail(f"{type(error).__name__} in the tick: {error}", error)
        if not self.solution.ok:
            return self._fail(self.solution.status.value)
        if self.stopped:
            return self._fail("failed for too long")
        self._failing = 0
        self.observer.commanded(solution.accelerations, controller.dt)
        return True

    def _send(self, command: Command) -> Command:
        """Remember a command, for the torques that it makes, and return it."""
        if self.wrenches is not None:
            self._sent.sent(command)
        return command

    def _use(self, solution: Solution) -> None:
        """Take over the torques of a solution."""
        self._torques = solution.torques

    def _estimate(self, measurement: Measurement, soles: Sequence[pin.SE3 | None] | None) -> Measurement:
        """Update the estimate from what is plausible of a measurement, and return that."""
        blind = type(measurement) is Measurement and measurement.sole_wrench is None
        if blind:
            if self.wrenches is None:
                robot, settings = self.controller.robot, self.observer.settings
                self.wrenches = WrenchEstimator(robot, self.controller.dt, settings.wrenches)
            measurement = replace(measurement, sole_wrench=self.wrenches.wrench.copy())
        measurement, renewed = self.plausibility.check(measurement)
        if renewed:
            self.observer.resume(measurement.time - self.controller.dt)
        self.observer.update(measurement, soles, plausible=True)
        if blind:
            measurement = self._with_wrenches(measurement)
        observer = self.observer
        vertical = float(observer.inertial.rotation[2].dot(measurement.specific_force))
        self.monitor.update(
            self.plausibility.values,
            measurement,
            vertical,
            observer.foot_rotation,
            observer.stance_rotation,
            observer.inertial.unexplained,
        )
        return measurement

    def _with_wrenches(self, measurement: Measurement) -> Measurement:
        """Return a measurement with wrenches estimated from the torques that acted when it was made."""
        assert self.wrenches is not None
        torque, source = measurement.joint_torque, "measured torques"
        if torque is None or not np.isfinite(torque).all():
            torque, source = self._sent.torque(measurement), "commanded torques"
        if torque is not None:
            self.wrenches.update(*self.observer.measured_state, torque)
        return replace(
            measurement,
            sole_wrench=self.wrenches.wrench.copy(),
            wrench_source=cast(WrenchSource, source),
        )

    def _fail(self, reason: str, error: Exception | None = None) -> bool:
        """Count a failed tick and log the first of a row and the stop."""
        stopped = self.stopped
        self.observer.commanded(np.zeros(self.controller.robot.nv), self.controller.dt)
        self.failures += 1
        self._failing += 1
        if self._failing == 1 or self.stopped != stopped:
            self.reason = reason
            state = "; stopped" if self.stopped else "; command held"
            logger.error("tick failed (%s)%s", reason, state, exc_info=error)
        return False


class TorqueControl(_Control):
    """Torque control: sends the torques of the solution; the controller's robot is the estimated one.

    Attributes:
        controller: The controller.
        observer: Observer that estimates the state from measurements.
        solution: Result of the last tick.
        measurement: Measurement of the last tick, with what was refused replaced by predictions.
        failures: Number of failed ticks so far.
        plausibility: Check of measurements.
        monitor: Monitor of sensors that contradict each other.
        gate: Limits of commands.
    """

    @checked
    def __init__(
        self,
        controller: Controller,
        observer: Observer | None = None,
        policy: FailurePolicy | None = None,
        *,
        prepare: Prepare | None = None,
        safety: SafetySettings | None = None,
    ) -> None:
        """Connect a controller to its observer.

        Args:
            controller: The controller.
            observer: Observer of the same robot model; a new one when None. If it estimates into the controller's own
                robot (`Observer(robot, adopt=True)`) the model is updated once a tick instead of twice.
            policy: Reaction to failures.
            prepare: Function called once a tick before the QP is solved.
            safety: Ranges of measurements and commands.

        Raises:
            InputError: An observer of another robot model.
        """
        if observer is None:
            observer = Observer(controller.robot, adopt=True)
        super().__init__(controller, observer, policy, prepare, safety)

    def reset(self, q: Array | None = None) -> None:
        """Restart from a configuration at rest.

        Args:
            q: Configuration, shape (nq,); half-sitting when None.
        """
        self.observer.reset(q)
        robot = self.controller.robot
        robot.update(self.observer.robot.q, self.observer.robot.v)
        self._forget()

    def command(self, measurement: Measurement) -> Command:
        """Run one tick.

        Args:
            measurement: Measurement of this tick.

        Returns:
            Torques to apply until the next tick. Nothing is raised: a failed tick follows the policy.
        """
        if self._think(measurement):
            return self._send(self.gate.pass_on(self._torques))
        velocity = self.plausibility.joint_velocity(measurement)
        damping = -self.policy.joint_damping * np.minimum(self.controller.robot.torque_limit, 1e6) * velocity
        return self._send(self.gate.pass_on(damping if self.stopped else self._torques + damping))


class PositionControl(_Control):
    """Position control: integrates the accelerations of the solution to references of joint position and velocity.

    Attributes:
        controller: The controller.
        observer: Observer that estimates the state from measurements.
        feedback: "open": the controller sees the robot as commanded; sensors act only through tasks that listen to
            them. "closed": it sees the estimated robot, and the references are drawn to the estimate.
        feedforward: True to add the torques of the solution to the servos; a function to add its torques instead.
        solution: Result of the last tick.
        measurement: Measurement of the last tick, with what was refused replaced by predictions.
        failures: Number of failed ticks so far.
        plausibility: Check of measurements.
        monitor: Monitor of sensors that contradict each other.
        gate: Limits of commands.
        q: Configuration of the commanded robot, shape (nq,).
        v: Its velocity, shape (nv,).
    """

    @checked
    def __init__(
        self,
        controller: Controller,
        observer: Observer | None = None,
        policy: FailurePolicy | None = None,
        *,
        feedback: Literal["open", "closed"] = "open",
        feedforward: bool | Feedforward = True,
        reference_time: float = 0.1,
        prepare: Prepare | None = None,
        safety: SafetySettings | None = None,
    ) -> None:
        """Connect a controller to its observer.

        Args:
            controller: The controller; in open loop its robot becomes the commanded robot, starting from its
                present state.
            observer: Observer of the same robot model; a new one when None.
            policy: Reaction to failures.
            feedback: "open" or "closed"; see the attribute.
            feedforward: Add the torques of the solution to the servos, against the sag of position servos. A function
                replaces them by torques of its own.
            reference_time: Time constant with which closed-loop references are drawn to the estimate, s.
            prepare: Function called once a tick before the QP is solved.
            safety: Ranges of measurements and commands.

        Raises:
            InputError: An observer of another robot model, an unknown feedback, or servos that are too soft.
        """
        if feedback not in ("open", "closed"):
            raise InputError(f"feedback must be 'open' or 'closed', got '{feedback}'")
        if feedback == "open" and observer is not None and observer.robot is controller.robot:
            raise InputError(
                "in open loop the observer needs a robot of its own: Observer(robot), not adopt=True"
            )
        if controller.robot.servos is not None:
            controller.robot.servos.check_position_control()
        super().__init__(controller, observer, policy, prepare, safety)
        self.feedback = feedback
        self._follows_estimate = feedback == "closed"
        self.feedforward = feedforward
        self._pull = lag_gain(controller.dt, positive("reference time (s)", reference_time))
        self.q = np.array(controller.robot.q)
        self.v = np.array(controller.robot.v)
        self._step = np.zeros(controller.robot.nv)
        self._dt, self._half_square = scalar(controller.dt), scalar(0.5 * controller.dt * controller.dt)
        self._soles = [controller.robot.placement(sole.frame) for sole in controller.robot.soles]

    def reset(self, q: Array | None = None) -> None:
        """Restart from a configuration at rest.

        Args:
            q: Configuration, shape (nq,); half-sitting when None.
        """
        robot = self.controller.robot
        self.q[:] = robot.half_sitting if q is None else finite_array("configuration", q, (robot.nq,))
        self.v[:] = 0.0
        robot.update(self.q, self.v)
        self.observer.reset(self.q)
        self._forget()

    def command(self, measurement: Measurement) -> Command:
        """Run one tick.

        Args:
            measurement: Measurement of this tick.

        Returns:
            References that the servos should reach at the next tick, and feed-forward torques. Nothing is raised: a
            failed tick follows the policy.
        """
        dt, robot, soles = self.controller.dt, self.controller.robot, None
        if self.feedback == "open":
            # The estimate is kept in the commanded robot's world: loaded feet are where that robot has them.
            robot.update(self.q, self.v)
            soles = self._soles
        if self._think(measurement, soles):
            assert self.solution is not None
            acceleration = self.solution.accelerations
        else:
            acceleration = -self.v / (dt if self.stopped else max(self.policy.damping_time, dt))
        # Constant acceleration over the period, for which the braking law of the joint limits is made.
        step = np.multiply(acceleration, self._half_square, out=self._step)
        step += self.v * self._dt
        self.q[:] = pin.integrate(robot.model, self.q, step)
        self.v += np.multiply(acceleration, self._dt, out=step)
        command = self.gate.pass_on(self._torques, self.q[7:].copy(), self.v[6:].copy())
        if self.gate.faults:  # the commanded robot is where the command says
            assert command.joint_position is not None and command.joint_velocity is not None
            self.q[7:], self.v[6:] = command.joint_position, command.joint_velocity
        return self._send(command)

    def _use(self, solution: Solution) -> None:
        if callable(self.feedforward):
            self._torques = self.feedforward(solution)
        elif self.feedforward:
            self._torques = solution.torques
        if self.feedback == "closed":
            self._draw_to_estimate()

    def _draw_to_estimate(self) -> None:
        estimate = self.observer.robot
        difference = pin.difference(estimate.model, self.q, estimate.q)
        self.q[:] = pin.integrate(estimate.model, self.q, self._pull * difference)
        self.v += self._pull * (estimate.v - self.v)
