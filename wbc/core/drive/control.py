"""Controls: their protocol, one tick of a robot's drives, which is the same in all modes, and ticks that fail.

    state = drives.estimate(measurement)    plausibility, observer, monitor      never raises
    …targets of tasks and contacts, from the state…
    command = drives.act(state)             QP, drive, gate                      never raises

`command` does both, for targets that come from elsewhere. A control with a law of its own ends its tick with `relay` in
place of `act`. The modes are in `wbc.core.drive`: `wbc.core.drive.position` integrates accelerations to references of
the servos, `wbc.core.drive.torque` sends torques, alone or with references.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import field, replace
from time import perf_counter
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
import pinocchio as pin

from wbc.base.checked import checked
from wbc.base.errors import InputError, MeasurementError
from wbc.base.numbers import ROUNDING, Array
from wbc.base.settings import NonNegative, Positive, settings
from wbc.core.drive.gate import CommandGate
from wbc.core.estimation.consistency import AccelerometerCheck, ConsistencyMonitor
from wbc.core.estimation.falls import FallDetector, FallReason
from wbc.core.estimation.observer import Observer
from wbc.core.estimation.plausibility import Plausibility, PlausibilitySettings
from wbc.core.estimation.wrenches import WrenchEstimator
from wbc.core.qp.controller import Controller
from wbc.core.qp.released import ReleasedJoints
from wbc.core.qp.solving.solution import Solution
from wbc.core.qp.solving.solver import Status
from wbc.core.robot import GRAVITY, Robot
from wbc.core.signals import Command, Measurement

logger = logging.getLogger(__name__)

FEET_STAY = 0.35
"""Distance of the DCM from the nearest sole that nothing recovers whose feet stay, as a multiple of the CoM height."""

UNUSUAL = {
    Status.RELAXED: ("relaxed: limits, hard tasks and contacts cannot all be satisfied",),
    Status.BADLY_SCALED: ("badly scaled: weights span too many decades, or friction is nearly zero",),
}
"""Words of `status` for a tick that was solved in another way than it was asked for."""

Mode = Literal["position", "torque", "hybrid"]
"""Control mode of the drives."""


class State(NamedTuple):
    """Estimated state of the robot in one control tick.

    Attributes:
        robot: Estimated robot; valid until the next tick. In position control it has frames, the centre of mass and
            their velocities, in torque and hybrid control Jacobians and dynamics, too.
        measurement: Measurement in which refused values are replaced by predictions, and missing wrenches by estimates.
            In a tick that has failed it is the measurement as received.
        load: Filtered vertical forces on the soles, shape (number of soles,), N.
        received: Measurement as received.
        ok: False if the tick has already failed, by its measurement or by the estimation.
        time: Time since the control was made, s; one control period in each tick.
        dcm: Divergent component of motion minus its estimated bias, shape (3,), m. None if the control does not
            estimate the bias, and while hands grip an object.
        turned: Angle by which the feet have turned about the vertical in the last period, rad; see `InertialFilter`.
        hip_turn: Turn of the pelvis against the heading of a walk that is asked for, rad.
        hand_wrench: Wrench of the surroundings on the hands, [force; moment] at the world origin, shape (6,), N and Nm;
            None without.
        compliance: Depth of a foot over its load, m/N, as the ground and the soles under the last steps have it.
    """

    robot: Robot
    measurement: Measurement
    load: Array
    received: Measurement
    ok: bool
    time: float = 0.0
    dcm: Array | None = None
    turned: float = 0.0
    hip_turn: float = 0.0
    hand_wrench: Array | None = None
    compliance: float = 0.0


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
    """Ranges of measurements and commands, and the reaction to a fall.

    Attributes:
        plausibility: Ranges that measurements must keep.
        on_fall: Reaction to a fall, after which nothing recovers: "damp" sends damping alone until `reset`, "go on"
            solves on, for a controller that stands up or falls in a way of its own.
    """

    plausibility: PlausibilitySettings = field(default_factory=PlausibilitySettings)
    on_fall: Literal["damp", "go on"] = "damp"


class Control:
    """Protocol of whatever answers a measurement with a command: drives, a walk, a policy, its guard, or a program.

    Whoever runs a control (`wbc.run`, trials, programs, logs and views) asks for nothing but what is here. A control of
    your own derives from this class. With drives it writes `act`, which ends with `drives.act` or `drives.relay`, and
    has the estimate, the tests of sensors and of falls, and the failure policy of its drives. Without drives it writes
    `command`. The page of controls has examples.

    Attributes:
        drives: Position, torque or hybrid control with controller and observer, which makes the commands of this tick;
            None for a control without.
        restarts: True for a control that `reset` lets begin anew at any time; others are reset before their first tick
            alone.
    """

    __slots__ = ()

    drives: DriveControl | None = None
    restarts: bool = False

    @staticmethod
    def instead_of(value: object) -> str:
        """Return advice how to make a control of an object of another type; empty if there is none."""
        return "derive its class from wbc.Control" if callable(getattr(value, "command", None)) else ""

    def command(self, measurement: Measurement) -> Command:
        """Run one tick, and return its command."""
        if self.drives is None:
            raise NotImplementedError(
                f"{type(self).__name__} without drives must have a `command` of its own"
            )
        return self.act(self.drives.estimate(measurement))

    def act(self, state: State) -> Command:
        """End a tick whose state the drives have estimated, and return its command."""
        raise NotImplementedError(f"{type(self).__name__} must have an `act` of its own")

    @property
    def acting(self) -> Control:
        """Control that makes the commands now: itself, or the one that a program or a guard runs."""
        return self

    @property
    def dt(self) -> float | None:
        """Control period, s; None for any."""
        return None if self.drives is None else self.drives.controller.dt

    def check_period(self, period: float) -> None:
        """Refuse a loop whose period, s, is not that of the control, by an `InputError`."""
        if (dt := self.dt) is not None and abs(dt - period) > ROUNDING:
            own, other = (f"{1e3 * each:g} ms ({1.0 / each:g} Hz)" for each in (dt, period))
            raise InputError(
                f"the control is made for a period of {own}, its loop has {other}: give both the same"
            )

    @property
    def fallen(self) -> FallReason | None:
        """Reason of the robot's fall; None while it has not fallen, or nobody looks."""
        return None if self.drives is None else self.drives.fallen

    def status(self) -> str:
        """Return in one line how the control is; see `DriveControl.status`."""
        return "ok" if self.drives is None else self.drives.status()

    def see(self, seen: Any) -> None:
        """Take a `wbc.ground.PointCloud` or a map of the ground; a control that does not see the ground ignores it."""

    def reset(self, q: Array | None = None) -> None:
        """Begin from a configuration at rest, shape (nq,); half-sitting when None."""
        if self.drives is not None:
            self.drives.reset(q)


class DriveControl(Control):
    """Base of all modes: plausibility, observer, failures, the last solution and the gate.

    A mode has `reset`, and two methods that make a command: `_follow` a solution, or `_hold` without one.

    Attributes:
        controller: The controller.
        observer: Observer that estimates the state from measurements.
        failure_policy: Reaction to failures.
        measurement: Measurement of the last tick, with what was refused replaced by predictions.
        time: Time since the control was made, s; one control period in each tick.
        wrenches: Estimator of the wrenches of feet without force sensors; None while they are measured.
        failures: Number of failed ticks so far.
        reason: Reason of the last failure, or of the first of a row.
        plausibility: Check of measurements.
        monitor: Monitor of sensors that contradict each other, after `watch`; None in a simulation as a rule.
        accelerometer: Check of the direction of the specific force.
        gate: Limits of commands.
        falls: Detector of a fall, by the estimate.
    """

    restarts = True
    _follows_estimate = True
    _moves_references = False  # the solution is integrated to references of the joints

    def __init__(
        self,
        controller: Controller,
        observer: Observer | None,
        failure_policy: FailurePolicy | None,
        safety: SafetySettings | None,
    ) -> None:
        """Connect a controller to its observer, of the same robot model; where one is None, a new one is made.

        `failure_policy` is the reaction to failures, `safety` the ranges of measurements and commands.
        """
        self.controller = controller
        self.observer = Observer(controller.robot) if observer is None else observer
        if self.observer.robot.model is not controller.robot.model:
            raise InputError("the observer must estimate the same robot model that the controller uses")
        controller.run_by("position" if self._moves_references else "torque", self.observer.robot)
        self.failure_policy = failure_policy or FailurePolicy()
        robot, dt, safety = controller.robot, controller.dt, safety or SafetySettings()
        self.plausibility = Plausibility(robot, dt, safety.plausibility)
        self.monitor: ConsistencyMonitor | None = None
        self.accelerometer = AccelerometerCheck(dt)
        self.gate = CommandGate(robot, dt)
        self.wrenches: WrenchEstimator | None = None
        self.failures = 0
        self.reason = ""
        self.measurement: Measurement | None = None
        self.time = 0.0
        self.falls, self._on_fall = FallDetector(self.observer.robot, dt), safety.on_fall
        self._dcm_limit = FEET_STAY
        self._torques = np.zeros(controller.robot.na)
        # Last good command of a law, and its torques, positions, kp and kd.
        self._relayed: Command | None = None
        self._kept = tuple(np.zeros((4, controller.robot.na)))
        self._failing = 0
        # Acceleration that the last command asks for: that of the solution, or none of another command.
        self._asked = self._unasked = np.zeros(controller.robot.nv)

    @property
    def drives(self) -> DriveControl:  # type: ignore[override]  # nobody assigns it
        """Itself."""
        return self

    def reset(self, q: Array | None = None) -> None:
        """Begin anew from a configuration at rest, shape (nq,); half-sitting when None."""
        raise NotImplementedError

    @property
    def solution(self) -> Solution | None:
        """Result of the QP in the last tick; None before the first one."""
        return self.controller.solution

    @property
    def failing(self) -> bool:
        """True if the last tick has failed."""
        return self._failing > 0

    @property
    def stopped(self) -> bool:
        """True after failures have gone on for too long; `reset` starts again."""
        return self._failing * self.controller.dt > self.failure_policy.stop_after

    @property
    def fallen(self) -> FallReason | None:
        """Reason of the robot's fall, also of one that its stop will lead to; None while it has not fallen."""
        return self.falls.reason or (FallReason.SOLVER if self.stopped else None)

    @property
    def damped(self) -> bool:
        """True once a fall has ended in damping; `reset` starts again."""
        return self.falls.reason is not None and self._on_fall == "damp"

    def _forget(self) -> None:
        """Clear failures, a fall, the last measurement, the last solution and the last torques."""
        self.controller.reset()
        self.measurement = None
        self.falls.reset()
        self._torques, self._relayed = np.zeros_like(self._torques), None
        self._asked = self._unasked
        self._failing = 0
        self.reason = ""
        self.plausibility.reset()
        if self.monitor is not None:
            self.monitor.reset()
        self.accelerometer.reset()
        self.gate.reset(self.controller.robot.q[7:])
        self.wrenches = None

    def status(self) -> str:
        """Return in one line how the control is: "ok", or what is refused, doubted, clipped, relaxed or failing."""
        parts = []
        if self.falls.reason is not None:
            parts.append(f"fallen: {self.falls.reason.value}{'; damped' if self.damped else ''}")
        if self.stopped:
            parts.append(f"stopped: {self.reason}")
        elif self._failing:
            parts.append(f"failing: {self.reason}")
        if self._balance_lost():
            parts.append("balance lost: the DCM is out of reach")
        if self.plausibility.faults:
            parts.append(f"refused: {', '.join(self.plausibility.faults)}")
        if self.accelerometer.left_out:
            parts.append("refused: accelerometer, which contradicts attitude and legs")
        parts += [each for each in (self.plausibility.pull, self.plausibility.pace) if each]
        if self.monitor is not None and self.monitor.doubts:
            parts.append(f"doubtful: {', '.join(self.monitor.doubts)}")
        if self.solution is not None and not self._failing:
            parts += UNUSUAL.get(self.solution.status, ())
        if self.gate.faults:
            parts.append(f"command clipped: {', '.join(self.gate.faults)}")
        return "; ".join(parts) or "ok"

    def watch(self) -> ConsistencyMonitor:
        """Compare the sensors with each other from the next tick on, as under `wbc.run`; return the monitor.

        `status` then names sensors that are frozen, dead or contradict each other.
        """
        if self.monitor is None:
            robot, dt = self.controller.robot, self.controller.dt
            self.monitor = ConsistencyMonitor(robot, dt, self.plausibility.names)
        return self.monitor

    @property
    def dcm_limit(self) -> float:
        """Distance of the DCM from the nearest sole from which on `status` calls balance lost, over the CoM's height.

        A walk sets that of its steps.
        """
        return self._dcm_limit

    @dcm_limit.setter
    @checked
    def dcm_limit(self, value: Annotated[Positive, ""]) -> None:
        self._dcm_limit = value

    def _balance_lost(self) -> bool:
        """Return True if the DCM is out of reach of feet and steps."""
        robot = self.observer.robot
        soles = [robot.placement(sole.frame).translation for sole in robot.soles]
        height = max(float(robot.com[2]) - min(float(sole[2]) for sole in soles), 0.0)
        dcm = robot.com[:2] + robot.com_velocity[:2] * math.sqrt(height / GRAVITY)
        return min(math.hypot(*(dcm - sole[:2])) for sole in soles) > self._dcm_limit * height

    def estimate(self, measurement: Measurement) -> State:
        """Begin a tick: estimate the state, bring the controller's robot there, and return it.

        `State.ok` is False for a measurement that cannot be used; nothing is raised.
        """
        observer, start, dt, last = self.observer, perf_counter(), self.controller.dt, self.measurement
        self.time = time = self.time + dt
        try:
            released, soles = self.controller.released, self._reference_soles()
            self.measurement = plausible = self._estimate(measurement, soles)
            estimate, robot = observer.robot, self.controller.robot
            if self._follows_estimate and estimate is not robot:
                robot.update(estimate.q, estimate.v)
            if self.falls.reason is None and (reason := self.falls.update(estimate.q, estimate.v)):
                self._fall(reason)
            if released is not None:
                solved = None if self.solution is None else self.solution.accelerations
                torque = plausible.joint_torque
                passed = dt if last is None else plausible.time - last.time
                released.update(robot.q, robot.v, passed if passed > 0.0 else dt, torque, solved)
            self.controller.model_time = perf_counter() - start
        except Exception as error:  # a robot gets a command in every tick
            failed = State(observer.robot, measurement, observer.load, measurement, True, time)
            return self.refuse(failed, error)
        turned, sinks = observer.inertial.turned, observer.sinking.compliance
        return State(
            estimate, plausible, observer.load, measurement, True, time, None, turned, compliance=sinks
        )

    def refuse(self, state: State, error: Exception) -> State:
        """Fail a tick whose targets could not be computed: return its state for `act`, which holds the robot then."""
        if isinstance(error, MeasurementError):
            self._fail(f"measurement refused: {error}")
        else:
            self._fail(f"{type(error).__name__} in the tick: {error}", error)
        return state._replace(ok=False)

    def act(self, state: State, wrenches: Mapping[str, Array] | None = None) -> Command:
        """End a tick: solve the QP, and return the command of the drives; a failed tick follows the failure policy.

        Args:
            state: State of this tick.
            wrenches: Name of a contact → wrench from which the torques are computed in place of that of the solution,
                shape (6,), N and Nm, in the frame of the contact; for example the desired wrenches of a stabilizer
                (`StabilizerTask.wrenches`).
        """
        self._asked = self._unasked
        if self.damped:
            command = self._damp(state)
        else:
            solution = self._solve(state, wrenches) if state.ok else None
            command = self._hold(state) if solution is None else self._follow(state, solution)
        self._relayed = None
        return self._finish(command)

    def relay(self, state: State, law: Callable[[State], Command]) -> Command:
        """End a tick with the command of another law than the QP's, such as that of a policy.

        Torques and gains of joints that somebody else moves are taken out. The joints of a robot that has fallen, or
        whose ticks have failed for too long, are damped. A law that raises an exception fails the tick. A tick that has
        failed holds the last command of the law, with a velocity reference of zero.

        Args:
            state: State of this tick.
            law: Function of the state that makes the command; it is called in ticks alone that have not failed.
        """
        self._asked = self._unasked
        if self.damped or self.stopped:
            return self._finish(self._damp(state))
        command = None
        if state.ok:
            try:
                self._keep(command := law(state))
                self._failing = 0
            except Exception as error:  # of a law of the user's own
                state, command = self.refuse(state, error), None
        return self._finish(self._hold_relayed(state) if command is None else command)

    def _hold_relayed(self, state: State) -> Command:
        """Return the last command of a law at rest, within the limits; what the drives hold where there is none."""
        if (last := self._relayed) is None:
            return self._hold(state)
        torque, position, kp, kd = self._kept
        if last.joint_position is None:
            return self.gate.pass_on(torque + self._damping(state))
        self.gate.reset(position)  # a law need not move the references of the gate
        still = np.zeros_like(position)
        if last.kp is None or last.kd is None:
            return self.gate.pass_on(torque, position, still)
        damping = self.failure_policy.joint_damping * self.controller.robot.torque_limit
        gains = kp, np.where(kd > 0.0, kd, damping)  # no joint of a torque alone speeds up
        return self.gate.pass_on_with_gains(
            torque, position, still, gains, self.plausibility.joints(state.received)
        )

    def _keep(self, command: Command) -> None:
        """Keep the parts of a law's command that are held, since its arrays belong to who gets it."""
        torque, position, kp, kd = self._kept
        torque[:] = command.joint_torque
        if command.joint_position is not None:
            position[:] = command.joint_position
            if command.kp is not None and command.kd is not None:
                kp[:], kd[:] = command.kp, command.kd
        self._relayed = command

    def _finish(self, command: Command) -> Command:
        """End a tick with a command, whose arrays are its own: joints that somebody else moves get nothing of it."""
        if (released := self.released) is not None:
            for part in (command.joint_torque, command.kp, command.kd):
                if part is not None:
                    part[released.index] = 0.0
            command = replace(command, released=released.mask)
        if self.wrenches is not None:
            self.wrenches.sent(command)
        self.observer.commanded(self._asked, self.controller.dt)
        return command

    def release(self, joints: Sequence[str]) -> ReleasedJoints | None:
        """Leave joints to somebody else from the next tick on, those and no others; see `Controller.release`.

        They have no torque, no reference and no gain in a command (`Command.released`), whose motion enters the QP as
        known. An encoder of theirs beyond its range is named, and no failure.

        Args:
            joints: Names; not of a leg.

        Returns:
            The joints, which can be told their targets (`ReleasedJoints.tell`); None where all are taken back.

        Raises:
            UnknownNameError: No joint of the robot.
            InputError: A joint of a leg, or one twice.
        """
        return self.controller.release(joints)

    @property
    def released(self) -> ReleasedJoints | None:
        """Joints that nothing is commanded for, as somebody else moves them; None while there are none."""
        released = self.controller.released
        return None if released is None or released.commanded else released

    def _reference_soles(self) -> Sequence[pin.SE3 | None] | None:
        """Return where the controlled robot has its soles, up to date; None where the estimate says where they are."""
        return None

    def _follow(self, state: State, solution: Solution) -> Command:
        """Return the command that follows from a solution, and `_torques`."""
        raise NotImplementedError

    def _hold(self, state: State) -> Command:
        """Return the command of a tick that has failed."""
        raise NotImplementedError

    def _damp(self, state: State) -> Command:
        """Return the command of a robot that has fallen: no stiffness, no torque, damping alone."""
        raise NotImplementedError

    def _damping(self, state: State) -> Array:
        """Return the torques that damp the joints, shape (na,), Nm."""
        velocity = np.nan_to_num(self.plausibility.joints(state.received)[1], nan=0.0)
        return np.asarray(-self.failure_policy.joint_damping * self.controller.robot.torque_limit * velocity)

    def _fall(self, reason: FallReason) -> None:
        """Log a fall; a robot that leans on something with its hands has its support elsewhere than under its feet."""
        soles = {sole.frame for sole in self.controller.robot.soles}
        if reason is FallReason.DOWN and any(
            contact.active and contact.frame not in soles for contact in self.controller.contacts
        ):
            self.falls.reset()
            return
        then = "the joints are damped" if self.damped else "the control goes on"
        logger.error("the robot has fallen (%s): %s", reason.value, then)

    def _solve(self, state: State, wrenches: Mapping[str, Array] | None) -> Solution | None:
        """Solve, and take over the torques; None if there is no solution, and `reason` says why not."""
        try:
            solution = self.controller.solve(state.measurement)
            if solution.ok and not self.stopped:
                self._torques = self._torques_of(solution, wrenches)
                if (released := self.released) is not None:
                    self._torques = self._torques.copy()
                    self._torques[released.index] = 0.0
        except Exception as error:  # of tasks of the user
            self.refuse(state, error)
            return None
        if not solution.ok or self.stopped:
            self._fail("failed for too long" if solution.ok else solution.status.value)
            return None
        self._failing = 0
        self._asked = solution.accelerations
        return solution

    def _torques_of(self, solution: Solution, wrenches: Mapping[str, Array] | None) -> Array:
        """Return the torques that the drives get with a solution, shape (na,), Nm."""
        return self.controller.torques(solution, wrenches)

    def _estimate(self, measurement: Measurement, soles: Sequence[pin.SE3 | None] | None) -> Measurement:
        """Update the estimate from what is plausible of a measurement, and return that."""
        blind = type(measurement) is Measurement and measurement.sole_wrench is None
        if blind:
            measurement = self._estimator().fill(measurement)
        released = self.controller.released
        forgiven = None if released is None else released.mask
        measurement, renewed = self.plausibility.check(measurement, felt=not blind, forgiven=forgiven)
        if measurement.sole_wrench is None:  # a sensor that is refused for too long
            blind, measurement = True, self._estimator().fill(measurement)
        observer = self.observer
        if renewed:
            observer.resume(measurement.time - self.controller.dt)
        measurement = self.accelerometer.check(measurement, observer)
        observer.update(measurement, soles, plausible=True)
        if blind:
            measurement = self._estimator().observe(measurement, *observer.measured_state, observer.lifts)
        if self.monitor is not None:
            asked = None if self._asked is self._unasked or not self._follows_estimate else self._asked
            self.monitor.update(self.plausibility.values, measurement, observer, asked)
        return measurement

    def _estimator(self) -> WrenchEstimator:
        """Return the estimator of wrenches, which is made when it is needed first."""
        if self.wrenches is None:
            robot, settings = self.controller.robot, self.observer.settings
            dt, delay = self.controller.dt, settings.delay
            self.wrenches = WrenchEstimator(robot, dt, settings.wrenches, delay=delay)
        return self.wrenches

    def _fail(self, reason: str, error: Exception | None = None) -> None:
        """Count a failed tick and log the first of a row and the stop."""
        stopped = self.stopped
        self.failures += 1
        self._failing += 1
        if self._failing == 1 or self.stopped != stopped:
            self.reason = reason
            state = "; stopped" if self.stopped else "; command held"
            logger.error("tick failed (%s)%s", reason, state, exc_info=error)
