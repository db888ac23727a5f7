"""The loop of a machine: rate, deadlines, start, watchdogs and stop.

    report = wbc.run(UdpDriver(description), control, rate=500, until=60.0)

`Runner` is the loop of one run; `run` makes one and runs it.
"""

from __future__ import annotations

import logging
import signal
import threading
from collections.abc import Callable
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from wbc.base.checked import checked
from wbc.base.errors import InputError, shown
from wbc.base.numbers import ROUNDING, finite_array
from wbc.base.settings import NonNegative, Positive, Share, settings
from wbc.core.drive.control import Control
from wbc.core.drive.gate import CommandGate
from wbc.core.drive.position import PositionControl
from wbc.core.estimation.consistency import REAL_TIME
from wbc.core.estimation.falls import FallDetector
from wbc.core.robot import BASE_DOF, GRAVITY
from wbc.core.signals import Command, Measurement
from wbc.machine.clock import Clock, Quiet, quiet
from wbc.machine.guard import DAMP_PERIOD, DAMP_TIME, Guard
from wbc.machine.inlet import Inlet
from wbc.machine.loads import SoleLoads
from wbc.machine.loop import (
    Driver,
    MachineError,
    Parking,
    check_driver,
    with_gains,
)
from wbc.machine.report import Phase, RunReport
from wbc.machine.stand import Stand, standing, warm_up
from wbc.machine.start import SafeStart

logger = logging.getLogger(__name__)

KEPT = 1 << 20
"""Ticks whose times are kept: 35 minutes at 500 Hz; later ones replace the first."""

NEAR = 0.4
"""Distance of every joint from half-sitting within which a robot that is let down early is balanced, rad."""

TOUCHED, CARRIED, LIFTED = 0.05, 0.3, 0.2
"""Times for which the feet must touch, carry the robot, and carry nothing, before the next phase, s."""

CAUGHT = 0.2
"""Time in which the balance takes over from the servos, s."""

REFUSAL = 0.1
"""Time for which measurements may be refused, or repeat the last one, before the joints are damped, s."""

DAMP_TICKS = 50
"""Damping commands that are sent at the end."""


class _Over(Exception):
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


class Runner:
    """Loop of one run, for programs that stop it from another thread; `run` makes one and runs it in one call."""

    @checked
    def __init__(
        self,
        driver: Driver,
        control: Control,
        rate: Annotated[Positive, "1/s"] = 500.0,
        *,
        settings: RunSettings | None = None,
        guard: bool = True,
        clock: Clock | None = None,
    ) -> None:
        """Store the parts; nothing is sent.

        Arguments and errors are those of `run`; `clock` replaces the clock in tests.
        """
        check_driver(driver)
        self.period = 1.0 / rate
        if (dt := control.dt) is not None and abs(dt - self.period) > ROUNDING:
            raise InputError(f"rate must be that of the controller, {1.0 / dt:g} Hz, got {rate:g} Hz")
        self.driver, self.control, self.description = driver, control, driver.description
        self.settings = s = settings or RunSettings()
        shortest = min(s.robot_timeout, s.control_timeout)
        if self.period >= shortest:
            raise InputError(
                f"robot_timeout and control_timeout must be longer than the control period, got {s.robot_timeout:g} s "
                f"and {s.control_timeout:g} s at a rate of {rate:g} Hz, {self.period:g} s a period"
            )
        self.phase = Phase.START
        self._robot = self.description.robot()
        self._weight = self._robot.mass * GRAVITY
        self._inlet = Inlet(self._robot, self.period)
        self._may_run = True
        self._holds: float | None = None  # since when what `_lasts` asks for
        self._clock = clock or Clock()
        self._guarded, self._ran = guard, False
        self._guard: Guard | None = None
        self._stop, self._emergency = threading.Event(), threading.Event()
        self._reason = ""
        self._phases: list[tuple[Phase, float]] = []
        self._late, self._busy = np.full((2, KEPT), 0.0)  # touched, so that no page fault waits in the loop
        self.ticks = self._missed = self._skipped = 0
        self._age, self._slow = 0.0, ""
        self._blind = self._blinded = ""  # reason for which no clouds come, and for which none came once
        # For a control of one's own, by the attitude that the loads follow; the library's have a test of theirs.
        self._fallen = self.description.robot() if control.drives is None else None
        self._falls = None if self._fallen is None else FallDetector(self._fallen, self.period)

    def stop(self) -> None:
        """Let the robot sink: stiffness and torques decrease, then the joints are damped."""
        self._stop.set()

    def emergency_stop(self) -> None:
        """Damp the joints at the next tick and end."""
        self._emergency.set()

    @checked
    def run(self, until: Annotated[NonNegative, "s"] | Callable[[], bool] | None = None) -> RunReport:
        """Run until the end or a stop; SIGINT or SIGTERM stops, a second signal is an emergency stop.

        Args:
            until: Time of the end from the beginning, s, or a function that is called in every tick and returns True at
                the end.

        Raises:
            MachineError: No measurement arrives, a measurement is that of another robot, the guard cannot use the
                driver, or the joints could not be damped at the end.
        """
        if self._ran:
            raise InputError("a Runner runs once: make another one")
        self._ran = True
        before = self._catch_signals()
        got = Quiet()
        try:
            self._guard = self._make_guard()
            self._make_parts(self._first())
            with quiet(self.settings.priority) as got:
                self._inlet.forget()  # the parts took their time
                self._loop(until)
        finally:
            try:
                self._damp()
            finally:
                if self._guard is not None:
                    self._guard.close()
                for number, handler in before.items():
                    signal.signal(number, handler)
        kept = min(self.ticks, KEPT)
        return RunReport(
            self._reason,
            tuple(self._phases),
            self.ticks,
            self._missed,
            self._skipped,
            self._late[:kept].copy(),
            self._busy[:kept].copy(),
            self._age,
            got,
            self.period,
            self._blinded,
        )

    def _damp(self) -> None:
        """Damp the joints for a while; where the driver fails, go on trying, and let the guard damp meanwhile.

        Raises `MachineError` if it fails for `DAMP_TIME`.
        """
        clock, guard, sent = self._clock, self._guard, 0
        failed: BaseException | None = None
        end = clock.now() + DAMP_TIME
        while sent < DAMP_TICKS:
            try:
                self.driver.damp()
                sent += 1
            except BaseException as error:  # whatever a driver does, the others are tried
                if failed is None:
                    logger.error("a damping command failed (%s: %s)", type(error).__name__, error)
                if guard is not None:
                    guard.alarm()
                failed = error
                if clock.now() >= end:
                    raise MachineError(
                        f"the joints could not be damped: {sent} of {DAMP_TICKS} commands were sent within "
                        f"{DAMP_TIME:g} s ({type(error).__name__}: {error})"
                    ) from error
            else:
                if guard is not None:
                    guard.beat()
            clock.sleep_until(clock.now() + min(self.period, DAMP_PERIOD))

    def _make_guard(self) -> Guard | None:
        settings = self.settings
        return Guard(self.driver, settings.control_timeout, settings.priority) if self._guarded else None

    def _catch_signals(self) -> dict[int, Any]:
        if threading.current_thread() is not threading.main_thread():
            return {}

        def asked(number: int, frame: object) -> None:
            del number, frame
            (self.emergency_stop if self._stop.is_set() else self.stop)()

        return {number: signal.signal(number, asked) for number in (signal.SIGINT, signal.SIGTERM)}

    def _first(self) -> Measurement:
        """Return the first measurement that can be used."""
        wait, end = self.settings.first, self._clock.now() + self.settings.first
        names = self.description.joint_names
        while True:
            got = self.driver.read(max(0.0, end - self._clock.now()))
            if got is not None:
                if isinstance(got, Measurement) and np.shape(got.joint_position) != (len(names),):
                    count = np.size(got.joint_position)
                    raise MachineError(
                        f"the machine has {count} joints, '{self.description.name}' has {len(names)}"
                    )
                self._inlet.take(got, self._clock.now())
            if self._inlet.good is not None:
                return self._inlet.good
            if self._clock.now() >= end:
                why = self._inlet.refused
                kind = "that can be used" if why else "from the machine"
                raise MachineError(f"no measurement {kind} within {wait:g} s{': ' if why else ''}{why}")
            if got is not None:  # one that cannot be used
                self._clock.sleep_until(self._clock.now() + self.period)

    def _make_parts(self, first: Measurement) -> None:
        """Make what the phases need, before the time counts."""
        robot, period = self._robot, self.period
        self._gains = self.description.kp, self.description.kd
        if self.driver.gains is not None:
            kp, kd = finite_array("gains of a driver, kp and kd", self.driver.gains, (2, robot.na))
            self._gains = kp, kd
        self._gate, self._parking = CommandGate(robot, period), Parking(self._gains)
        self._loads = SoleLoads(self.description, period, self._gains)
        self._start = self._begin_start(first, self.settings.fade)
        soft = self._gains[1] if robot.servos is None else np.minimum(self._gains[1], robot.servos.soft()[1])
        self._stand: Stand | None = None
        drives = self.control.drives
        if not isinstance(drives, PositionControl):  # its servos stand by themselves
            self._stand = Stand(self.description, period, self._loads, soft)
        if drives is not None:
            drives.watch()
        warm_up(self.control, robot, period, forces=first.sole_wrench is not None)

    def _begin_start(self, measurement: Measurement, fade: float) -> SafeStart:
        return SafeStart(
            self._robot, measurement, self._loads, fade=fade, speed=self.settings.speed, gains=self._gains
        )

    def _enter(self, phase: Phase, now: float) -> None:
        drives, good = self.control.drives, self._inlet.good
        if self.phase is Phase.RUN and drives is not None and good is not None:
            self._loads.adopt(good.time, *drives.observer.measured_state, drives.observer.load)
        self.phase = phase
        self._phases.append((phase, now - self._begin))
        self._since, self._holds = now, None
        if phase is Phase.START:
            self._started = now
        logger.info("%.3f s: %s", now - self._begin, phase.value)

    def _loop(self, until: float | Callable[[], bool] | None) -> None:
        clock, driver, period = self._clock, self.driver, self.period
        now = self._begin = self._seen = self._changed = clock.now()
        self._until = until
        self._last: Command | None = None  # sent
        self._before: Command | None = None  # of the phase before, from which commands are mixed
        self._enter(Phase.START, now)
        deadline = now
        while True:
            clock.sleep_until(deadline)
            woken = clock.now()
            newest = driver.read(0.0)
            if newest is None:  # the machine's clock is behind: its measurement is the beat
                left = self._seen + self.settings.robot_timeout - clock.now()
                newest = driver.read(min(period, max(0.0, left)))
                if newest is not None:
                    woken = deadline = max(deadline, clock.now())
            now = clock.now()
            fresh = newest is not None and self._inlet.take(newest, now)
            if newest is not None:
                self._age = max(self._age, now - self._seen)
                self._seen = now
            if fresh:
                self._changed = now
            try:
                self._tick(now, fresh=fresh)
            except _Over as end:
                self._reason = "; ".join(filter(None, (str(end), self._slow)))
                self._enter(Phase.DAMPED, clock.now())
                return
            if self._guard is not None:
                self._guard.beat()
            done = clock.now()
            place = self.ticks % KEPT
            self._late[place], self._busy[place] = woken - deadline, done - woken
            self.ticks += 1
            deadline += period
            if done > deadline:
                self._missed += 1
                lost = int((done - deadline) / period) + 1
                self._skipped += lost
                deadline += lost * period

    def _tick(self, now: float, *, fresh: bool) -> None:
        """Send the command of this tick; `_Over` if the run is."""
        settings, inlet = self.settings, self._inlet
        if self._emergency.is_set():
            raise _Over("emergency stop")
        if fault := self.driver.fault:
            raise _Over(f"fault of the machine: {fault}")
        if now - self._seen >= settings.robot_timeout:
            raise _Over(f"no measurement for {1e3 * (now - self._seen):.0f} ms")
        if now - self._changed >= max(REFUSAL, settings.robot_timeout):
            raise _Over(f"the machine repeats the same measurement for {1e3 * (now - self._changed):.0f} ms")
        if now - inlet.since >= REFUSAL and not self._checks_itself:
            raise _Over(f"measurements refused for {1e3 * (now - inlet.since):.0f} ms: {inlet.refused}")
        measurement = inlet.good
        assert measurement is not None
        if self._stop.is_set() and self.phase is not Phase.STOP:
            self._enter(Phase.STOP, now)
            self._held = np.array(measurement.joint_position)
        if self.phase is Phase.STOP:
            left = 1.0 - (now - self._since) / settings.stop if settings.stop > 0.0 else 0.0
            if left <= 0.0:
                raise _Over("stopped")
            kp, kd, zero = left * self._gains[0], self._gains[1], np.zeros_like(self._held)
            self._send(Command(left * self._start.carry(measurement), self._held, zero, kp=kp, kd=kd))
            return
        if (not fresh or (inlet.refused and not self._checks_itself)) and self._last is not None:
            self.driver.write(self._last)
            return
        self._look()
        self._send(self._command(measurement, now))
        if self._until is not None and (
            now - self._begin >= self._until if isinstance(self._until, float) else self._until()
        ):
            self.stop()

    def _look(self) -> None:
        """Hand on what the machine's cameras see; cameras that fail leave a control blind, which walks on."""
        try:
            for cloud in self.driver.clouds():
                self.control.see(cloud)
        except Exception as error:  # of a camera, or of a cloud that is none
            blind = f"{type(error).__name__}: {error}"
            if blind != self._blind:
                logger.error("no clouds of points (%s): the control goes on without them", blind)
            self._blind = self._blinded = blind
            return
        if self._blind:
            logger.warning("clouds of points come again")
            self._blind = ""

    @property
    def _checks_itself(self) -> bool:
        """True while a control runs that has a policy of its own for measurements that cannot be used."""
        return self.phase is Phase.RUN and self.control.drives is not None

    def _send(self, command: Command) -> None:
        """Send a command of whatever phase, unless no machine must get it."""
        good = self._inlet.good
        assert good is not None
        try:
            self._last = command = self._gate.admit(command, (good.joint_position, good.joint_velocity))
        except InputError as error:
            of = "the controller" if self.phase is Phase.RUN else f"phase '{self.phase.value}'"
            raise _Over(f"InputError of {of}: {error}") from error
        self.driver.write(command)
        self._loads.sent(command)

    def _command(self, measurement: Measurement, now: float) -> Command:
        """Return the command of this tick, and go on to the next phase."""
        if self.phase in (Phase.START, Phase.HANG):
            return self._hang(measurement, now)
        if self.phase is Phase.STAND:
            return self._balance(measurement, now)
        return self._run(measurement, now)

    def _hang(self, measurement: Measurement, now: float) -> Command:
        """Go to half-sitting on servos, legs under the body, until the feet touch the ground."""
        settings, elapsed = self.settings, now - self._started
        command = self._start.command(measurement, elapsed)
        arrived = elapsed >= self._start.duration
        if arrived and self.phase is Phase.START:
            self._enter(Phase.HANG, now)
        away = float(np.abs(measurement.joint_position - self._robot.half_sitting[7:]).max())
        # Let down too early it is better balanced from where it is than held by servos too soft to stand on.
        ready = arrived or (elapsed > settings.fade and away < NEAR and self._stand is not None)
        if ready and self._inlet.pace.ratio < REAL_TIME:
            if not self._slow:
                self._slow = f"the machine runs at {self._inlet.pace.ratio:.1f} of real time"
                logger.error("%s: it hangs until it keeps up", self._slow)
            return command
        self._slow = ""
        if ready and self._lasts(self._loads.share >= settings.touch or settings.load == 0.0, TOUCHED, now):
            if self._stand is not None:
                self._stand.begin(measurement)
            self._enter(Phase.STAND, now)
            self._before = command
        return command

    def _balance(self, measurement: Measurement, now: float) -> Command:
        """Balance what the feet carry until they carry the robot, or nothing."""
        settings, stand = self.settings, self._stand
        if stand is None:
            command = self._start.command(measurement, now - self._started)
        else:
            command = mixed(self._before, stand.command(measurement), (now - self._since) / CAUGHT)
            if stand.control.stopped:
                raise _Over(f"the robot cannot be balanced: {stand.control.reason}")
            if stand.control.damped:
                raise _Over(stand.control.status())
        share = self._loads.share
        if share < settings.touch / 3.0 and settings.load > 0.0:
            if self._lasts(True, LIFTED, now):
                self._lift(measurement, now)
        elif self._lasts(share >= settings.load and self._may_run, CARRIED, now):
            if stand is not None:
                self.control.reset(standing(self._robot, np.array(stand.control.observer.robot.q)))
            self._enter(Phase.RUN, now)
        return command

    def _run(self, measurement: Measurement, now: float) -> Command:
        """Run the controller; its commands come by and by."""
        given = self._inlet.raw if self._checks_itself else measurement
        try:
            command = self.control.command(given)
            if not isinstance(command, Command):
                raise InputError(f"a control must return a wbc.Command, got {shown(command)}")
            command = command.check(self.description.joint_names)
        except Exception as error:  # whatever a controller does, the machine is damped
            logger.exception("the controller failed")
            raise _Over(f"{type(error).__name__} of the controller: {error}") from error
        if not self.driver.leaves_released:
            command = self._parking.hold(command, measurement.joint_position)
        drives = self.control.drives
        if drives is not None and drives.stopped:
            raise _Over(f"the controller has stopped: {drives.reason}")
        if drives is None:  # else its observer knows, for a stop
            self._loads.wrenches(measurement)
        self._check_fall(measurement)
        part = (now - self._since) / self.settings.blend
        if part < 1.0:
            if self._stand is not None:
                before = self._stand.command(measurement)
            else:
                before = self._start.command(measurement, now - self._started)
            return mixed(before, with_gains(command, self._gains), part)
        seen = None if drives is None else drives.measurement
        if self.settings.load > 0.0 and seen is not None and seen.sole_wrench is not None:
            carried = float(seen.sole_wrench[:, 2].sum()) / self._weight
            if self._lasts(carried < self.settings.touch / 3.0, LIFTED, now):
                self._may_run = self.control.restarts
                self._lift(measurement, now)
        return command

    def _check_fall(self, measurement: Measurement) -> None:
        """End the run of a robot that has fallen."""
        drives, falls, reason = self.control.drives, self._falls, None
        if drives is not None:
            reason = drives.falls.reason if drives.damped else None
        elif falls is not None and self._fallen is not None and self.settings.on_fall == "damp":
            q, v = self._loads.posture(measurement), np.zeros(self._fallen.nv)
            v[BASE_DOF:] = measurement.joint_velocity
            self._fallen.update_kinematics(q, v)
            reason = falls.update(q, v)
        if reason is not None:
            raise _Over(f"the robot has fallen: {reason.value}")

    def _lift(self, measurement: Measurement, now: float) -> None:
        """Hang again: the feet carry nothing."""
        self._start = self._begin_start(measurement, 0.0)
        self._started = now
        if not self._may_run:
            logger.warning("a %s cannot be reset: the robot is balanced on", type(self.control).__name__)
        self._enter(Phase.HANG, now)

    def _lasts(self, holds: bool, time: float, now: float) -> bool:
        """Return True once something has held for a time."""
        if not holds:
            self._holds = None
            return False
        if self._holds is None:
            self._holds = now
        return now - self._holds >= time


def mixed(first: Command | None, second: Command, part: float) -> Command:
    """Return a command between two by what they do to the joints: torques, gains and servo torques in proportion.

    At `part` 0 it is the first, with references and gains (None for the second one alone), from 1 on the second.
    """
    if first is None or part >= 1.0:
        return second
    a, b, zero = 1.0 - part, part, np.zeros_like(second.joint_torque)
    kp1, kd1, kp2, kd2 = (
        zero if gains is None else gains for gains in (first.kp, first.kd, second.kp, second.kd)
    )
    q1 = zero if first.joint_position is None else first.joint_position
    v1 = zero if first.joint_velocity is None else first.joint_velocity
    q2 = q1 if second.joint_position is None else second.joint_position
    v2 = zero if second.joint_velocity is None else second.joint_velocity
    kp, kd = a * kp1 + b * kp2, a * kd1 + b * kd2
    # kp q = a kp1 q1 + b kp2 q2: the servos' torque is between both as well.
    q = np.divide(a * kp1 * q1 + b * kp2 * q2, kp, out=np.array(q2), where=kp > 0.0)
    v = np.divide(a * kd1 * v1 + b * kd2 * v2, kd, out=np.array(v2), where=kd > 0.0)
    torque = a * first.joint_torque + b * second.joint_torque
    return Command(torque, q, v, second.sole_stiffness, kp, kd, second.released)


@checked
def run(
    driver: Driver,
    control: Control,
    rate: Annotated[Positive, "1/s"] = 500.0,
    *,
    until: Annotated[NonNegative, "s"] | Callable[[], bool] | None = None,
    settings: RunSettings | None = None,
    guard: bool = True,
) -> RunReport:
    """Drive a machine with a controller.

    First the joints move from their present positions to half-sitting, while gains and torques are faded in. When the
    soles carry the robot, the controller takes over. The run ends with damped joints if a measurement is late or the
    controller fails; if this process dies, the guard damps them. Ctrl-C stops the robot slowly, and a second Ctrl-C at
    once.

    Args:
        driver: Wire to the machine.
        control: Control with a control period of 1 / rate, whose robot is at half-sitting.
        rate: Ticks a second, 1/s.
        until: Time of the end, s, or a function that returns True at the end; None runs until SIGINT or SIGTERM.
        settings: Times and limits.
        guard: Watch this process from another process, which damps the joints if this one dies.

    Returns:
        Reason of the end, phases, missed deadlines and the times of all ticks.

    Raises:
        MachineError: No measurement arrives, a measurement is that of another robot, the guard cannot use the driver,
            or the joints could not be damped at the end.
    """
    return Runner(driver, control, rate, settings=settings, guard=guard).run(until)
