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
from dataclasses import replace
from time import perf_counter
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
import pinocchio as pin

from wbc.base.checked import checked, fixed, result
from wbc.base.errors import InputError, MeasurementError
from wbc.base.numbers import ROUNDING, Array
from wbc.base.settings import Positive
from wbc.core.drive.failures import FailurePolicy, FailureRecord
from wbc.core.drive.gate import CommandGate
from wbc.core.drive.sensing import SafetySettings, Sensing
from wbc.core.estimation.checks.consistency import ConsistencyMonitor
from wbc.core.estimation.checks.refusal import few
from wbc.core.estimation.falls import FallReason
from wbc.core.estimation.observer import Observer
from wbc.core.qp.controller import Controller
from wbc.core.qp.released import ReleasedJoints
from wbc.core.qp.solving.solution import Solution
from wbc.core.qp.solving.solver import Status
from wbc.core.robot import GRAVITY, Robot
from wbc.core.signals import Command, Measurement

logger = logging.getLogger(__name__)

ANOTHER = "make another control"
"""Advice on options that stay."""

RESTART = "`reset` begins from another configuration"
"""Advice in place of an assignment to the references of a control."""

RUN = "it follows from the run, and `reset` begins another one"
"""Advice in place of an assignment to what a control says of its run."""

FEET_STAY = 0.35
"""Distance of the DCM from the nearest sole that nothing recovers whose feet stay, as a multiple of the CoM height."""

UNUSUAL = {
    Status.RELAXED: ("relaxed: limits, hard tasks and contacts cannot all be satisfied",),
    Status.BADLY_SCALED: ("badly scaled: weights span too many decades, or friction is nearly zero",),
}
"""Words for a tick that was solved in another way than it was asked for."""

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


class Control:
    """Base of all controls, which answer a measurement with a command: drives, walks, policies, guards, programs.

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
    """Base of all modes: one tick, from the estimate over the solution of the QP, or another law, to the gate.

    A mode has `reset`, and three methods that make a command: `_follow` a solution, `_hold` in a tick that has failed,
    and `_damp` after a fall. Its properties say how a run goes; the parts are for who needs more of them.

    Attributes:
        controller: The controller.
        observer: Observer that estimates the state from measurements.
        sensing: Checks of measurements, observer, monitor, falls and clock.
        gate: Limits of commands.
        measurement: Last measurement that was used, with what was refused replaced by predictions; None before one.
        time: Time since the control was made, s; one control period in each tick.
        failures: Number of failed ticks so far.
        reason: Reason of the last failure; of failures in successive ticks, that of the first.
        failing: True if the last tick has failed.
        stopped: True after failures have gone on for too long; `reset` starts again.
        solution: Result of the QP in the last tick; None before the first one.
        damped: True once a fall has ended in damping; `reset` starts again.
    """

    controller: Controller = fixed(ANOTHER)
    observer: Observer = fixed(ANOTHER)
    measurement: Measurement | None = result("sensing.measurement", RUN)
    time: float = result("sensing.time", RUN)
    failures: int = result("_record.count", RUN)
    reason: str = result("_record.reason", RUN)
    failing: bool = result("_record.failing", RUN)
    stopped: bool = result("_record.stopped", RUN)
    solution: Solution | None = result("controller.solution", RUN)
    damped: bool = result("sensing.damped", RUN)
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
        self.observer = observer = Observer(controller.robot) if observer is None else observer
        if observer.robot.model is not controller.robot.model:
            raise InputError("the observer must estimate the same robot model that the controller uses")
        controller.run_by("position" if self._moves_references else "torque", observer.robot)
        robot, dt = controller.robot, controller.dt
        self.sensing = Sensing(robot, observer, dt, safety or SafetySettings())
        self._record = FailureRecord(failure_policy or FailurePolicy(), robot.torque_limit, dt)
        self.gate = CommandGate(robot, dt)
        self._dcm_limit = FEET_STAY
        self._torques = np.zeros(robot.na)  # of the last solution
        self._held: Command | None = None  # the last command of a law, in ticks of laws

    def share(self, other: DriveControl) -> None:
        """Drive a robot in turns with other drives: have their estimate, checks, failures, clock and gate from now on.

        Only one of the two drives the robot in a tick. Ranges of measurements and reactions to failures and falls are
        those of the other drives.

        Raises:
            InputError: Drives on another observer, or with another control period.
        """
        if other.observer is not self.observer:
            raise InputError("drives that share an estimate must be made with the same observer")
        if (own := self.controller.dt) != (period := other.controller.dt):
            raise InputError(
                f"drives that share an estimate must have the same period, got {own:g} s and {period:g} s"
            )
        self.sensing, self._record, self.gate = other.sensing, other._record, other.gate

    def _forget(self) -> None:
        """Forget the run so far: measurements, a fall, failures, and the last solution and command."""
        self.sensing.reset()
        self._record.reset()
        self._begin()

    def _begin(self) -> None:
        """Begin where the robot is, without a last solution or command."""
        self.controller.reset()
        self._torques, self._held = np.zeros_like(self._torques), None
        self.gate.reset(self.controller.robot.q[7:])

    @property
    def drives(self) -> DriveControl:  # type: ignore[override]  # nobody assigns it
        """Itself."""
        return self

    def reset(self, q: Array | None = None) -> None:
        """Begin anew from a configuration at rest, shape (nq,); half-sitting when None."""
        raise NotImplementedError

    # ---- what is known ------------------------------------------------------------------------------------------

    @property
    def fallen(self) -> FallReason | None:
        """Reason of the robot's fall, also of one that its stop will lead to; None while it has not fallen."""
        return self.sensing.falls.reason or (FallReason.SOLVER if self.stopped else None)

    def status(self) -> str:
        """Return in one line how the control is: "ok", or what is refused, doubted, clipped, relaxed or failing."""
        parts, sensing, record = list[str](), self.sensing, self._record
        plausibility, monitor = sensing.plausibility, sensing.monitor
        if sensing.falls.reason is not None:
            parts.append(f"fallen: {sensing.falls.reason.value}{'; damped' if sensing.damped else ''}")
        if record.failing:
            parts.append(f"{'stopped' if record.stopped else 'failing'}: {record.reason}")
        if balance_lost(self.observer.robot, self._dcm_limit):
            parts.append("balance lost: the DCM is out of reach")
        if plausibility.faults:
            parts.append(f"refused: {few(plausibility.faults)}")
        if sensing.accelerometer.left_out:
            parts.append("refused: accelerometer, which contradicts attitude and legs")
        if plausibility.stamps.pace:
            parts.append(plausibility.stamps.pace)
        if monitor is not None and monitor.doubts:
            parts.append(f"doubtful: {', '.join(monitor.doubts)}")
        if self.solution is not None and not record.failing:
            parts += UNUSUAL.get(self.solution.status, ())
        if self.gate.faults:
            parts.append(f"command clipped: {', '.join(self.gate.faults)}")
        return "; ".join(parts) or "ok"

    def watch(self) -> ConsistencyMonitor:
        """Compare the sensors with each other from the next tick on, as under `wbc.run`; return the monitor.

        `status` then names sensors that are frozen, dead or contradict each other.
        """
        return self.sensing.watch()

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

    # ---- the tick -----------------------------------------------------------------------------------------------

    def estimate(self, measurement: Measurement) -> State:
        """Begin a tick: estimate the state, bring the controller's robot there, and return it.

        `State.ok` is False for a measurement that cannot be used; nothing is raised.
        """
        sensing, observer, start, dt = self.sensing, self.observer, perf_counter(), self.controller.dt
        last = sensing.measurement
        time = sensing.tick()
        try:
            released, soles = self.controller.released, self._reference_soles()
            forgiven = None if released is None else released.mask
            plausible = sensing.update(measurement, soles, forgiven, follows=self._follows_estimate)
            estimate, robot = observer.robot, self.controller.robot
            if self._follows_estimate and estimate is not robot:
                robot.update(estimate.q, estimate.v)
            if sensing.falls.reason is None and (reason := sensing.falls.update()):
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
        turned, sinks = observer.inertial.correction.turned, observer.sinking.compliance
        return State(
            estimate, plausible, observer.load, measurement, True, time, turned=turned, compliance=sinks
        )

    def refuse(self, state: State, error: Exception) -> State:
        """Fail a tick whose targets could not be computed: return its state for `act`, which holds the robot then.

        A tick that has failed already stays as it is: it counts once.
        """
        if not state.ok:
            return state
        if isinstance(error, MeasurementError):
            self._record.add(f"measurement refused: {error}")
        else:
            self._record.add(f"{type(error).__name__} in the tick: {error}", error)
        return state._replace(ok=False)

    def act(self, state: State, wrenches: Mapping[str, Array] | None = None) -> Command:
        """End a tick: solve the QP, and return the command of the drives; a failed tick follows the failure policy.

        Args:
            state: State of this tick.
            wrenches: Name of a contact → wrench from which the torques are computed in place of that of the solution,
                shape (6,), N and Nm, in the frame of the contact; for example the desired wrenches of a stabilizer
                (`StabilizerTask.wrenches`).
        """
        self._held = acceleration = None
        if self.damped:
            command = self._damp(state)
        elif not state.ok or (solution := self._solve(state, wrenches)) is None:
            command = self._hold(state)
        else:
            command, acceleration = self._follow(state, solution), solution.accelerations
        return self._finish(command, acceleration)

    def relay(self, state: State, law: Callable[[State], Command]) -> Command:
        """End a tick with the command of another law than the QP's, such as that of a policy.

        The command passes `CommandGate.admit`. Torques and gains of joints that somebody else moves are taken out. The
        joints of a robot that has fallen, or whose ticks have failed for too long, are damped. A law that raises an
        exception fails the tick, and so does a command that the gate refuses. A tick that has failed holds the last
        command of the law, with a velocity reference of zero.

        Args:
            state: State of this tick.
            law: Function of the state that makes the command; it is called in ticks alone that have not failed.
        """
        if self.damped or self.stopped:
            return self._finish(self._damp(state))
        if state.ok:
            try:
                self.gate.faults = ()  # a law may make its command by the gate
                asked = law(state)
                command = self.gate.admit(asked, self.joints(state), self.gate.faults)
            except Exception as error:  # of a law of the user's own
                state = self.refuse(state, error)
            else:
                self._held = asked.copy()  # its arrays belong to who gets it
                self._record.good()
                return self._finish(command)
        if self._held is None:
            return self._finish(self._hold(state))
        return self._finish(self._at_rest(self._held, state))

    def _at_rest(self, command: Command, state: State) -> Command:
        """Return the last command of a law with a velocity reference of zero; joints without damping get ours."""
        gate, damping, measured = self.gate, self._record.damping, self.joints(state)
        torque, position, kp, kd = command.joint_torque, command.joint_position, command.kp, command.kd
        if position is None:
            return gate.pass_on(torque - damping * np.nan_to_num(measured[1], nan=0.0))
        gains = {} if kp is None or kd is None else {"kp": kp, "kd": np.where(kd > 0.0, kd, damping)}
        # With gains no joint of a torque alone speeds up.
        still = Command(torque, position, np.zeros_like(position), period=gate.period, **gains)
        return gate.admit(still, measured)

    def _finish(self, command: Command, acceleration: Array | None = None) -> Command:
        """End a tick with a command, whose arrays are its own: joints that somebody else moves get nothing of it.

        It asks for an acceleration, shape (nv,); None for a command that is not of a solution.
        """
        if (released := self.released) is not None:
            for part in (command.joint_torque, command.kp, command.kd):
                if part is not None:
                    part[released.index] = 0.0
            command = replace(command, released=released.mask)
        self.sensing.sent(command, acceleration)
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
        """Return the command of a solution, whose torques for the drives are `_torques`."""
        raise NotImplementedError

    def _hold(self, state: State) -> Command:
        """Return the command of a tick that has failed, after one of the QP; once stopped, that of a robot at rest."""
        raise NotImplementedError

    def _damp(self, state: State) -> Command:
        """Return the command of a robot that has fallen: no stiffness, no torque, damping alone."""
        raise NotImplementedError

    def joints(self, state: State) -> tuple[Array, Array]:
        """Return q and q̇ of the joints as received, shape (na,) each; NaN where they are impossible or refused."""
        return self.sensing.plausibility.joints(state.received)

    def _fall(self, reason: FallReason) -> None:
        """Log a fall; a robot that leans on something with its hands has its support elsewhere than under its feet."""
        soles = {sole.frame for sole in self.controller.robot.soles}
        if reason is FallReason.DOWN and any(
            contact.active and contact.frame not in soles for contact in self.controller.contacts
        ):
            self.sensing.falls.reset()
            return
        then = "the joints are damped" if self.damped else "the control goes on"
        logger.error("the robot has fallen (%s): %s", reason.value, then)

    def _solve(self, state: State, wrenches: Mapping[str, Array] | None) -> Solution | None:
        """Solve, and take over the torques; None if there is no solution, and `reason` says why not."""
        try:
            solution = self.controller.solve(state.measurement)
            good = solution.ok and not self.stopped
            if good:
                self._torques = self._torques_of(solution, wrenches)
                if (released := self.released) is not None:
                    self._torques = self._torques.copy()
                    self._torques[released.index] = 0.0
        except Exception as error:  # of tasks of the user
            self.refuse(state, error)
            return None
        if not good:
            self._record.add("failed for too long" if solution.ok else solution.status.value)
            return None
        self._record.good()
        return solution

    def _torques_of(self, solution: Solution, wrenches: Mapping[str, Array] | None) -> Array:
        """Return the torques that the drives get with a solution, shape (na,), Nm."""
        return self.controller.torques(solution, wrenches)


def balance_lost(robot: Robot, limit: float) -> bool:
    """Return True if the DCM is further from the soles than a limit, a multiple of the height of the CoM."""
    soles = [robot.placement(sole.frame).translation for sole in robot.soles]
    height = max(float(robot.com[2]) - min(float(sole[2]) for sole in soles), 0.0)
    dcm = robot.com[:2] + robot.com_velocity[:2] * math.sqrt(height / GRAVITY)
    return min(math.hypot(*(dcm - sole[:2])) for sole in soles) > limit * height
