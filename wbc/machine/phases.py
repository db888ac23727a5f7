"""Phases of a run: a robot that hangs comes to its feet, is balanced, runs under its controller, and is let down."""

from __future__ import annotations

import logging
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from wbc.base.errors import InputError, shown
from wbc.base.numbers import finite_array
from wbc.base.settings import NonNegative, Positive, Share, settings
from wbc.core.drive.control import Control
from wbc.core.drive.gate import CommandGate
from wbc.core.drive.position import PositionControl
from wbc.core.estimation.checks.integrals import REAL_TIME
from wbc.core.estimation.falls import FallDetector
from wbc.core.robot import BASE_DOF, GRAVITY, Robot
from wbc.core.signals import Command, Measurement
from wbc.machine.commands import Parking, mixed, with_gains
from wbc.machine.inlet import Inlet
from wbc.machine.loads import SoleLoads
from wbc.machine.loop import Driver
from wbc.machine.report import Phase
from wbc.machine.start import SafeStart, Stand, standing, warm_up

logger = logging.getLogger(__name__)

NEAR = 0.4
"""Distance of every joint from half-sitting within which a robot that is let down early is balanced, rad."""

TOUCHED, CARRIED, LIFTED = 0.05, 0.3, 0.2
"""Times for which the feet must touch, carry the robot, and carry nothing, before the next phase, s."""

CAUGHT = 0.2
"""Time in which the balance takes over from the servos, s."""


class Over(Exception):
    """End of a run, for a reason."""


@settings(kw_only=True)
class RunSettings:
    """Times and limits of a run.

    Attributes:
        fade: Duration of the rise of stiffness and torques at the start, s.
        speed: Largest mean velocity of a joint on the way to half-sitting, rad/s.
        touch: Share of the weight (by the description) on the soles at which balancing of a hanging robot begins. Below
            a third of this share the robot counts as hanging again.
        load: Share of the weight (by the description) on the soles at which the controller takes over; 0 does not wait.
            The real weight may be 10 % smaller.
        blend: Duration of the transition to the controller, s.
        robot_timeout: Age of the last measurement at which the joints are damped and the run ends, s.
        control_timeout: Time without a tick after which the guard damps the joints, s.
        stop: Duration of the decrease of stiffness and torques at a stop, s.
        priority: Priority of loop and guard under SCHED_FIFO, if the system allows it; None leaves the scheduler as it
            is.
        first: Longest time to wait for the first measurement, s.
        on_fall: Reaction to a fall with a control of your own: "damp" damps the joints and ends the run, "go on" leaves
            the reaction to the control. The controls of this library have `SafetySettings.on_fall`.
    """

    fade: Annotated[Positive, "s"] = 1.0
    speed: Annotated[Positive, "rad/s"] = 0.5
    touch: Share = 0.15
    load: Share = 0.85
    blend: Annotated[Positive, "s"] = 0.5
    robot_timeout: Annotated[Positive, "s"] = 0.015
    control_timeout: Annotated[Positive, "s"] = 0.015
    stop: Annotated[NonNegative, "s"] = 2.0
    priority: Annotated[int, Field(ge=1, le=99)] | None = None
    first: Annotated[Positive, "s"] = 5.0
    on_fall: Literal["damp", "go on"] = "damp"


class Phases:
    """Commands of a run, phase by phase.

    Attributes:
        phase: The present phase.
        begun: All phases so far, each with the time at which it began, s.
        slow: Sentence that the machine runs slower than real time, for which a robot hangs; empty while it keeps up.
        last: The command that was sent last; None before the first one.
    """

    _before: Command  # of the phase before, from which commands are mixed

    def __init__(
        self,
        driver: Driver,
        control: Control,
        robot: Robot,
        inlet: Inlet,
        first: Measurement,
        period: float,
        settings: RunSettings,
    ) -> None:
        """Make what the phases need, before the time counts; `inlet` has taken the first measurement."""
        self._driver, self._control, self._robot, self._inlet = driver, control, robot, inlet
        self._description, self._settings = driver.description, settings
        self.phase, self.begun, self.slow = Phase.START, list[tuple[Phase, float]](), ""
        self._weight = robot.mass * GRAVITY
        self._may_run = True
        self._holding: dict[float, float] = {}  # time for which a condition must hold → since when it does, s
        # Times of the clock at which the run, the phase and the way to half-sitting have begun, s.
        self._begin = self._since = self._started = 0.0
        self.last: Command | None = None
        self._held, self._risen = np.zeros(robot.na), 1.0  # by the stop, and with this share of the gains
        # For a control of one's own, by the attitude that the loads follow; the library's have a test of theirs.
        self._falls = FallDetector(robot, period) if control.drives is None else None
        self._gains = self._description.kp, self._description.kd
        if self._driver.gains is not None:
            kp, kd = finite_array("gains of a driver, kp and kd", self._driver.gains, (2, robot.na))
            self._gains = kp, kd
        self._gate, self._parking = CommandGate(robot, period), Parking(self._gains)
        self._loads = SoleLoads(self._description, period, self._gains)
        self._start = self._begin_start(first, settings.fade)
        soft = self._gains[1] if robot.servos is None else np.minimum(self._gains[1], robot.servos.soft()[1])
        self._stand: Stand | None = None
        drives = control.drives
        if not isinstance(drives, PositionControl):  # its servos stand by themselves
            self._stand = Stand(self._description, period, self._loads, soft)
        if drives is not None:
            drives.watch()
        warm_up(control, robot, period, forces=first.sole_wrench is not None)

    def _begin_start(self, measurement: Measurement, fade: float) -> SafeStart:
        return SafeStart(
            self._robot, measurement, self._loads, fade=fade, speed=self._settings.speed, gains=self._gains
        )

    def begin(self, now: float) -> None:
        """Begin the run at a time of the clock, s."""
        self._begin = now
        self.enter(Phase.START, now)

    def enter(self, phase: Phase, now: float) -> None:
        """Go on to a phase at a time of the clock, s."""
        drives, good = self._control.drives, self._inlet.good
        if self.phase is Phase.RUN and drives is not None and good is not None:
            self._loads.adopt(good.time, *drives.observer.measured_state, drives.observer.load)
            self._inlet.forget()  # its check has rested
        self.phase = phase
        self.begun.append((phase, now - self._begin))
        self._since = now
        self._holding.clear()
        if phase is Phase.START:
            self._started = now
        logger.info("%.3f s: %s", now - self._begin, phase.value)

    def _lasts(self, time: float, holds: bool, now: float) -> bool:
        """Return True once a condition of this phase has held for its time, s; `now` is a time of the clock, s."""
        if not holds:
            self._holding.pop(time, None)
            return False
        return now - self._holding.setdefault(time, now) >= time

    @property
    def checks_itself(self) -> bool:
        """True while a control runs that has a policy of its own for measurements that cannot be used."""
        return self.phase is Phase.RUN and self._control.drives is not None

    def alone(self, now: float) -> bool:
        """Return True while such a control runs by itself, after the transition to it, at a time of the clock, s."""
        return self.checks_itself and now - self._since >= self._settings.blend

    def stop(self, measurement: Measurement, now: float) -> None:
        """Let the robot sink from where a measurement has it."""
        if self.phase is not Phase.STOP:
            self._risen = self._start.part(now - self._started)
            self.enter(Phase.STOP, now)
            self._held = np.array(measurement.joint_position)

    def send(self, command: Command) -> None:
        """Send a command of whatever phase, unless no machine must get it."""
        good = self._inlet.good
        assert good is not None
        try:
            self.last = command = self._gate.admit(command, (good.joint_position, good.joint_velocity))
        except InputError as error:
            of = "the controller" if self.phase is Phase.RUN else f"phase '{self.phase.value}'"
            raise Over(f"InputError of {of}: {error}") from error
        self._driver.write(command)
        self._loads.sent(command)

    def command(self, measurement: Measurement, now: float) -> Command:
        """Return the command of this tick, and go on to the next phase."""
        if self.phase in (Phase.START, Phase.HANG):
            return self._hang(measurement, now)
        if self.phase is Phase.STAND:
            return self._balance(measurement, now)
        if self.phase is Phase.STOP:
            return self._sink(measurement, now)
        return self._run(measurement, now)

    def _hang(self, measurement: Measurement, now: float) -> Command:
        """Go to half-sitting on servos, legs under the body, until the feet touch the ground."""
        settings, elapsed = self._settings, now - self._started
        command = self._start.command(measurement, elapsed)
        arrived = elapsed >= self._start.duration
        if arrived and self.phase is Phase.START:
            self.enter(Phase.HANG, now)
        away = float(np.abs(measurement.joint_position - self._robot.half_sitting[7:]).max())
        # Let down too early it is better balanced from where it is than held by servos too soft to stand on.
        ready = arrived or (elapsed > settings.fade and away < NEAR and self._stand is not None)
        if ready and self._inlet.pace < REAL_TIME:
            if not self.slow:
                self.slow = f"the machine runs at {self._inlet.pace:.1f} of real time"
                logger.error("%s: it hangs until it keeps up", self.slow)
            return command
        self.slow = ""
        touches = self._loads.share >= settings.touch or settings.load == 0.0
        if ready and self._lasts(TOUCHED, touches, now):
            if self._stand is not None:
                self._stand.begin(measurement)
            self.enter(Phase.STAND, now)
            self._before = command
        return command

    def _balance(self, measurement: Measurement, now: float) -> Command:
        """Balance what the feet carry until they carry the robot, or nothing."""
        settings, stand = self._settings, self._stand
        if stand is None:
            command = self._start.command(measurement, now - self._started)
        else:
            command = mixed(self._before, stand.command(measurement), (now - self._since) / CAUGHT)
            if stand.control.stopped:
                raise Over(f"the robot cannot be balanced: {stand.control.reason}")
            if stand.control.damped:
                raise Over(stand.control.status())
        share = self._loads.share
        hangs = share < settings.touch / 3.0 and settings.load > 0.0
        carries = self._lasts(CARRIED, not hangs and share >= settings.load and self._may_run, now)
        if self._lasts(LIFTED, hangs, now):
            self._lift(measurement, now)
        elif carries:
            self._begin_run(stand, now)
        return command

    def _begin_run(self, stand: Stand | None, now: float) -> None:
        """Let the controller begin from where the robot is balanced, or its servos hold it; one may refuse to."""
        try:
            balanced = None if stand is None else np.array(stand.control.observer.robot.q)
            self._control.reset(None if balanced is None else standing(self._robot, balanced))
        except InputError as error:
            logger.warning("the controller does not begin, and the robot is balanced on: %s", error)
            self._may_run = False
        else:
            self.enter(Phase.RUN, now)

    def _run(self, measurement: Measurement, now: float) -> Command:
        """Run the controller; its commands come by and by."""
        given = self._inlet.raw if self.checks_itself else measurement
        try:
            command = self._control.command(given)
            if not isinstance(command, Command):
                raise InputError(f"a control must return a wbc.Command, got {shown(command)}")
            command = command.check(self._description.joint_names)
        except Exception as error:  # whatever a controller does, the machine is damped
            logger.exception("the controller failed")
            raise Over(f"{type(error).__name__} of the controller: {error}") from error
        drives = self._control.drives
        seen = None if drives is None else drives.measurement
        if seen is not None and self.alone(now):
            measurement = seen
            self._inlet.good = seen
        if not self._driver.leaves_released:
            command = self._parking.hold(command, measurement.joint_position)
        if drives is not None and drives.stopped:
            raise Over(f"the controller has stopped: {drives.reason}")
        if drives is None:  # else its observer knows, for a stop
            self._loads.wrenches(measurement)
        self._check_fall(measurement)
        part = (now - self._since) / self._settings.blend
        if part < 1.0:
            if self._stand is not None:
                before = self._stand.command(measurement)
            else:
                before = self._start.command(measurement, now - self._started)
            return mixed(before, with_gains(command, self._gains), part)
        if self._settings.load > 0.0 and seen is not None and seen.sole_wrench is not None:
            carried = float(seen.sole_wrench[:, 2].sum()) / self._weight
            if self._lasts(LIFTED, carried < self._settings.touch / 3.0, now):
                self._may_run = self._control.restarts
                self._lift(measurement, now)
        return command

    def _sink(self, measurement: Measurement, now: float) -> Command:
        """Let stiffness and torques decrease."""
        time = self._settings.stop
        left = 1.0 - (now - self._since) / time if time > 0.0 else 0.0
        if left <= 0.0:
            raise Over("stopped")
        left *= self._risen
        kp, kd, zero = left * self._gains[0], self._gains[1], np.zeros_like(self._held)
        return Command(left * self._start.carry(measurement), self._held, zero, kp=kp, kd=kd)

    def _check_fall(self, measurement: Measurement) -> None:
        """End the run of a robot that has fallen."""
        drives, falls, reason = self._control.drives, self._falls, None
        if drives is not None:
            reason = drives.sensing.falls.reason if drives.damped else None
        elif falls is not None and self._settings.on_fall == "damp":
            q, v = self._loads.posture(measurement), np.zeros(self._robot.nv)
            v[BASE_DOF:] = measurement.joint_velocity
            self._robot.update_kinematics(q, v)
            reason = falls.update()
        if reason is not None:
            raise Over(f"the robot has fallen: {reason.value}")

    def _lift(self, measurement: Measurement, now: float) -> None:
        """Hang again: the feet carry nothing."""
        self._start = self._begin_start(measurement, 0.0)
        self._started = now
        if not self._may_run:
            logger.warning("a %s cannot be reset: the robot is balanced on", type(self._control).__name__)
        self.enter(Phase.HANG, now)
