"""Control of a robot's drives: what all modes have in common, from a measurement to a solution, and ticks that fail.

The modes are in `wbc.core.drive`: `wbc.core.drive.position` integrates accelerations to references of the servos,
`wbc.core.drive.torque` sends torques, `wbc.core.drive.hybrid` both.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Sequence
from dataclasses import field, replace
from time import perf_counter
from typing import Annotated, Literal, cast

import numpy as np
import pinocchio as pin

from wbc.core.errors import Array, InputError, MeasurementError, shown
from wbc.core.estimation.consistency import ConsistencyMonitor, ConsistencySettings
from wbc.core.estimation.delay import SentCommands
from wbc.core.estimation.observer import Observer
from wbc.core.estimation.plausibility import Plausibility, PlausibilitySettings
from wbc.core.estimation.wrenches import WrenchEstimator
from wbc.core.gate import CommandGate, GateSettings
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
        joint_damping: Damping of a joint in torque control over its torque limit, s/rad.
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


class DriveControl:
    """Base of all modes: plausibility, observer, failures, the last solution and the gate.

    A mode has `reset` and `command`, which calls `_think` for a solution and `_send` with what follows from it.

    Attributes:
        controller: The controller.
        observer: Observer that estimates the state from measurements.
        policy: Reaction to failures.
        prepare: Function called once a tick before the QP is solved; None for none.
        solution: Result of the last tick.
        measurement: Measurement of the last tick, with what was refused replaced by predictions.
        wrenches: Estimator of the wrenches of feet without force sensors; None while they are measured.
        failures: Number of failed ticks so far.
        reason: Reason of the last failure, or of the first of a row.
        plausibility: Check of measurements.
        monitor: Monitor of sensors that contradict each other.
        gate: Limits of commands.
    """

    _follows_estimate = True

    def __init__(
        self,
        controller: Controller,
        observer: Observer | None,
        policy: FailurePolicy | None,
        prepare: Prepare | None,
        safety: SafetySettings | None,
    ) -> None:
        if prepare is not None and not callable(prepare):
            raise InputError(
                f"prepare must be a function of robot and measurement, or none, got {shown(prepare)}"
            )
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
        # Made when a measurement comes without wrenches.
        self.wrenches: WrenchEstimator | None = None
        self._sent = SentCommands(gains, robot.torque_limit, dt, self.observer.settings.delay)
        self.failures = 0
        self.reason = ""
        self.solution: Solution | None = None
        self.measurement: Measurement | None = None
        self._torques = np.zeros(controller.robot.na)
        self._failing = 0
        self._stamp = math.nan  # of the last measurement with wrenches estimated, s

    @property
    def failing(self) -> bool:
        """True if the last tick has failed."""
        return self._failing > 0

    @property
    def stopped(self) -> bool:
        """True after failures have gone on for too long; `reset` starts again."""
        return self._failing * self.controller.dt > self.policy.stop_after

    def _forget(self) -> None:
        """Clear failures, the last measurement, the last solution and the last torques."""
        self.controller.reset()
        self.solution = self.measurement = None
        self._torques = np.zeros_like(self._torques)
        self._failing = 0
        self.reason = ""
        self.plausibility.reset()
        self.monitor.reset()
        self.gate.reset(self.controller.robot.q[7:])
        self.wrenches, self._stamp = None, math.nan
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
        if self.plausibility.pace:
            parts.append(self.plausibility.pace)
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
            passed, self._stamp = measurement.time - self._stamp, measurement.time
            self.wrenches.update(*self.observer.measured_state, torque, passed)
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
