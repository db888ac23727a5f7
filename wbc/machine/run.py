"""The loop of a machine: rate, deadlines, watchdogs and stop; `wbc.machine.phases` makes its commands.

    report = wbc.run(UdpDriver(description), control, rate=500, until=60.0)

`Runner` is the loop of one run; `run` makes one and runs it.
"""

from __future__ import annotations

import logging
import signal
import threading
from collections.abc import Callable
from typing import Annotated, Any

from wbc.base.checked import checked
from wbc.base.errors import InputError
from wbc.base.settings import NonNegative, Positive
from wbc.core.drive.control import Control
from wbc.core.signals import Measurement
from wbc.machine.clock import Clock, Quiet, quiet
from wbc.machine.guard import DAMP_PERIOD, DAMP_TIME, Guard
from wbc.machine.inlet import Inlet
from wbc.machine.loop import Driver, MachineError, check_described
from wbc.machine.phases import Over, Phases, RunSettings
from wbc.machine.report import Phase, RunReport

logger = logging.getLogger(__name__)

REFUSAL = 0.1
"""Time for which measurements may be refused, or repeat the last one, before the joints are damped, s."""

DAMP_TICKS = 50
"""Damping commands that are sent at the end."""


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
        check_described("driver", driver)
        self._robot = robot = driver.description.robot()
        robot.needs_feet("a run")
        drives = control.drives
        if drives is not None and drives.controller.robot.joint_names != robot.joint_names:
            raise InputError(f"the control is for {drives.controller.robot!r}, its machine is {robot!r}")
        self.period = 1.0 / rate
        control.check_period(self.period)
        if not control.restarts:
            control.reset()  # refuses a walk that has walked
        self.driver, self.control, self.description = driver, control, driver.description
        self.settings = s = settings or RunSettings()
        shortest = min(s.robot_timeout, s.control_timeout)
        if self.period >= shortest:
            raise InputError(
                f"robot_timeout and control_timeout must be longer than the control period, got {s.robot_timeout:g} s "
                f"and {s.control_timeout:g} s at a rate of {rate:g} Hz, {self.period:g} s a period"
            )
        self._inlet = Inlet(robot, self.period)
        self._phases: Phases | None = None
        self._report = RunReport(self.period)
        self._clock = clock or Clock()
        self._guarded, self._ran = guard, False
        self._guard: Guard | None = None
        self._stop, self._emergency = threading.Event(), threading.Event()
        self._seen = self._changed = 0.0  # arrival of the last measurement, and of the last new one, s

    @property
    def phase(self) -> Phase:
        """Present phase."""
        return Phase.START if self._phases is None else self._phases.phase

    @property
    def ticks(self) -> int:
        """Number of ticks so far."""
        return self._report.ticks

    def stop(self) -> None:
        """Let the robot sink: stiffness and torques decrease, then the joints are damped."""
        self._stop.set()

    def emergency_stop(self) -> None:
        """Damp the joints at the next tick and end."""
        self._emergency.set()

    @checked
    def run(self, until: Annotated[NonNegative, "s"] | Callable[[], bool] | None = None) -> RunReport:
        """Run until the end or a stop; SIGINT or SIGTERM stops, a second signal is an emergency stop.

        The time of the end and errors are as in `run`.
        """
        if self._ran:
            raise InputError("a Runner runs once: make another one")
        self._ran = True
        before = self._catch_signals()
        got = Quiet()
        try:
            self._guard = self._make_guard()
            first = self._first()
            self._phases = phases = Phases(
                self.driver, self.control, self._robot, self._inlet, first, self.period, self.settings
            )
            with quiet(self.settings.priority) as got:
                self._inlet.forget()  # making the phases took its time
                self._loop(phases, until)
        finally:
            try:
                self._damp()
            finally:
                if self._guard is not None:
                    self._guard.close()
                for number, handler in before.items():
                    signal.signal(number, handler)
        report = self._report
        report.phases, report.quiet = tuple(phases.begun), got
        report.end()
        return report

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
        while True:
            got = self.driver.read(max(0.0, end - self._clock.now()))
            if got is not None:
                self._inlet.take(got, self._clock.now())
            if self._inlet.good is not None:
                return self._inlet.good
            if self._clock.now() >= end:
                why = self._inlet.refused
                kind = "that can be used" if why else "from the machine"
                raise MachineError(f"no measurement {kind} within {wait:g} s{': ' if why else ''}{why}")
            if got is not None:  # one that cannot be used
                self._clock.sleep_until(self._clock.now() + self.period)

    def _loop(self, phases: Phases, until: float | Callable[[], bool] | None) -> None:
        clock, driver, report = self._clock, self.driver, self._report
        now = begin = self._seen = self._changed = clock.now()
        phases.begin(now)
        deadline = now
        while True:
            clock.sleep_until(deadline)
            woken = clock.now()
            newest = driver.read(0.0)
            if newest is None:  # the machine's clock is behind: its measurement is the beat
                left = self._seen + self.settings.robot_timeout - clock.now()
                newest = driver.read(min(self.period, max(0.0, left)))
                if newest is not None:
                    woken = deadline = max(deadline, clock.now())
            now = clock.now()
            fresh = newest is not None and self._inlet.take(newest, now, check=not phases.alone(now))
            if newest is not None:
                report.ages = max(report.ages, now - self._seen)
                self._seen = now
            if fresh:
                self._changed = now
            try:
                made = self._tick(phases, now, fresh=fresh)
            except Over as end:
                report.reason = "; ".join(filter(None, (str(end), phases.slow)))
                phases.enter(Phase.DAMPED, clock.now())
                return
            # The function `until` is asked in every tick but those of a stop.
            if made and (until() if callable(until) else until is not None and now - begin >= until):
                self.stop()
            if self._guard is not None:
                self._guard.beat()
            deadline = report.add(deadline, woken, clock.now())

    def _tick(self, phases: Phases, now: float, *, fresh: bool) -> bool:
        """Send the command of this tick; True if it is a new one, and not of the stop. `Over` if the run is."""
        settings, inlet = self.settings, self._inlet
        if self._emergency.is_set():
            raise Over("emergency stop")
        if fault := self.driver.fault:
            raise Over(f"fault of the machine: {fault}")
        if now - self._seen >= settings.robot_timeout:
            raise Over(f"no measurement for {1e3 * (now - self._seen):.0f} ms")
        if now - self._changed >= max(REFUSAL, settings.robot_timeout):
            raise Over(f"the machine repeats the same measurement for {1e3 * (now - self._changed):.0f} ms")
        if now - inlet.since >= REFUSAL and not phases.checks_itself:
            raise Over(f"measurements refused for {1e3 * (now - inlet.since):.0f} ms: {inlet.refused}")
        measurement = inlet.good
        assert measurement is not None
        stops = self._stop.is_set()
        if stops:
            phases.stop(measurement, now)
        elif (not fresh or (inlet.refused and not phases.checks_itself)) and phases.last is not None:
            self.driver.write(phases.last)
            return False
        else:
            self._look()
        phases.send(phases.command(measurement, now))
        return not stops

    def _look(self) -> None:
        """Hand on what the machine's cameras see; cameras that fail leave a control blind, which walks on."""
        try:
            for cloud in self.driver.clouds():
                self.control.see(cloud)
        except Exception as error:  # of a camera, or of a cloud that is none
            blind = f"{type(error).__name__}: {error}"
            if blind != self._report.blind:
                logger.error("no clouds of points (%s): the control goes on without them", blind)
            self._report.blind = blind


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
    """Drive a machine with a controller, from its present posture to damped joints; return a report.

    First the joints move from their present positions to half-sitting, while gains and torques are faded in. When the
    soles carry the robot, the controller takes over. The run ends with damped joints if a measurement is late or the
    controller fails; if this process dies, the guard damps them. Ctrl-C stops the robot slowly, and a second Ctrl-C at
    once.

    Args:
        driver: Wire to the machine.
        control: Control with a control period of 1 / rate, whose robot is at half-sitting; a walk that has walked is
            an `InputError`.
        rate: Ticks a second, 1/s.
        until: Time of the end, s, or a function that returns True at the end; None runs until SIGINT or SIGTERM.
        settings: Times and limits.
        guard: Watch this process from another process, which damps the joints if this one dies.

    Returns:
        Reason of the end, phases, missed deadlines and the times of all ticks.

    Raises:
        MachineError: No measurement arrives that can be used, the guard cannot use the driver, or the joints could not
            be damped at the end.
    """
    return Runner(driver, control, rate, settings=settings, guard=guard).run(until)
