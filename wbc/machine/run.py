"""The loop of a machine: rate, deadlines, start, watchdogs and stop.

    report = wbc.run(UdpDriver(description), control, rate=500, until=60.0)

`Runner` is the loop of one run; `run` makes one and runs it.
"""

from __future__ import annotations

import logging
import signal
import threading
from collections.abc import Callable
from typing import Annotated, Any, Protocol

import numpy as np
from pydantic import Field

from wbc.core.arguments import checked
from wbc.core.errors import InputError, check_parts, non_negative, positive
from wbc.core.robot import GRAVITY
from wbc.core.settings import NonNegative, Positive, Share, settings
from wbc.core.signals import Command, Measurement
from wbc.machine.clock import Clock, Quiet, quiet
from wbc.machine.guard import Guard
from wbc.machine.loads import SoleLoads
from wbc.machine.loop import Driver, MachineError
from wbc.machine.report import Phase, RunReport
from wbc.machine.start import SafeStart
from wbc.robots import RobotDescription

logger = logging.getLogger(__name__)

KEPT = 1 << 20
"""Ticks whose times are kept: 35 minutes at 500 Hz; later ones replace the first."""

DAMP_TICKS = 50
"""Damping commands that are sent at the end."""


class Control(Protocol):
    """Controller that answers a measurement with a command, such as `wbc.TorqueControl` or a `wbc.WalkingControl`."""

    def command(self, measurement: Measurement) -> Command:
        """Run one tick."""


@settings(kw_only=True)
class RunSettings:
    """Times and limits of a run.

    Attributes:
        fade: Time in which stiffness and torques rise at the start, s.
        speed: Largest mean speed of a joint on the way to half-sitting, rad/s.
        load: Share of the weight on the soles from which the controller takes over; 0 does not wait.
        blend: Time in which the controller takes over, s.
        robot_timeout: Age of the last measurement from which the joints are damped and the run ends, s.
        control_timeout: Time without a tick after which the guard damps, s.
        stop: Time in which stiffness and torques fall at a stop, s.
        priority: Priority of loop and guard under SCHED_FIFO, if they may; None does not ask.
        first: Longest time until the first measurement, s.
    """

    fade: Annotated[Positive, "s"] = 1.0
    speed: Annotated[Positive, "rad/s"] = 0.5
    load: Share = 0.8
    blend: Annotated[Positive, "s"] = 0.5
    robot_timeout: Annotated[Positive, "s"] = 0.015
    control_timeout: Annotated[Positive, "s"] = 0.015
    stop: Annotated[NonNegative, "s"] = 2.0
    priority: Annotated[int, Field(ge=1, le=99)] | None = None
    first: Annotated[Positive, "s"] = 5.0


class Runner:
    """The loop of one run, for programs that stop it from elsewhere; `run` is this in one call."""

    @checked
    def __init__(
        self,
        driver: Driver,
        control: Control,
        rate: float = 500.0,
        *,
        description: RobotDescription | None = None,
        settings: RunSettings | None = None,
        guard: bool = True,
        clock: Clock | None = None,
    ) -> None:
        """Store what runs; nothing is sent.

        Args:
            driver: Wire to the machine.
            control: The controller; its control period is 1 / rate.
            rate: Ticks a second, 1/s.
            description: The robot; the driver's when None.
            settings: Times and limits.
            guard: Watch the loop from a process of its own, which damps when the loop dies.
            clock: Clock, for tests.

        Raises:
            InputError: A rate that is not the controller's, a timeout within a control period, a driver that does not
                know its robot, or an object that is no driver or no controller.
        """
        check_parts("a driver", driver, "read", "write", "damp")
        check_parts("a controller", control, "command")
        self.period = 1.0 / positive("rate (1/s)", rate)
        controller: Any = getattr(control, "controller", None)
        if controller is not None and abs(controller.dt - self.period) > 1e-9:
            raise InputError(
                f"rate must be that of the controller, {1.0 / controller.dt:g} Hz, got {rate:g} Hz"
            )
        found = description if description is not None else getattr(driver, "description", None)
        if found is None:
            raise InputError("a driver without a description of its robot needs one: run(…, description=…)")
        self.description: RobotDescription = found
        self.driver, self.control = driver, control
        self.settings = s = settings or RunSettings()
        shortest = min(s.robot_timeout, s.control_timeout)
        if self.period >= shortest:
            raise InputError(
                f"robot_timeout and control_timeout must be longer than the control period, got {s.robot_timeout:g} s "
                f"and {s.control_timeout:g} s at a rate of {rate:g} Hz, {self.period:g} s a period"
            )
        self.phase = Phase.START
        self._clock = clock or Clock()
        self._guarded, self._ran = guard, False
        self._guard: Guard | None = None
        self._stop, self._emergency = threading.Event(), threading.Event()
        self._reason = ""
        self._phases: list[tuple[Phase, float]] = []
        self._late, self._busy = np.zeros(KEPT), np.zeros(KEPT)
        self._late[:] = self._busy[:] = 0.0  # touched, so that no page fault waits in the loop
        self.ticks = self._missed = self._skipped = 0
        self._age = 0.0

    def stop(self) -> None:
        """Let the robot sink: stiffness and torques fall, then the joints are damped."""
        self._stop.set()

    def emergency_stop(self) -> None:
        """Damp the joints at the next tick and end."""
        self._emergency.set()

    def run(self, until: float | Callable[[], bool] | None = None) -> RunReport:
        """Run until told to stop; SIGINT and SIGTERM stop, a second one is an emergency stop.

        Args:
            until: Time from the beginning (s), or a function that returns True at the end, called every tick.

        Raises:
            MachineError: No measurement comes, or one of another robot; the guard cannot use the driver.
            InputError: This runner has run already, or `until` is neither a time nor a function.
        """
        if until is not None and not callable(until):
            until = non_negative("time of the end (s)", until)
        if self._ran:
            raise InputError("a Runner runs once: make another one")
        self._ran = True
        before = self._catch_signals()
        got = Quiet()
        try:
            self._guard = self._make_guard()
            first = self.driver.read(self.settings.first)
            if first is None:
                raise MachineError(f"no measurement from the machine within {self.settings.first:g} s")
            if first.joint_position.shape != (len(self.description.joint_names),):
                raise MachineError(
                    f"the machine has {first.joint_position.size} joints, '{self.description.name}' has "
                    f"{len(self.description.joint_names)}"
                )
            if not np.isfinite(first.joint_position).all():
                raise MachineError(f"the machine's joint positions are not finite: {first.joint_position}")
            self._warm_up(forces=first.sole_wrench is not None)
            with quiet(self.settings.priority) as got:
                self._loop(first, until)
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
        )

    def _damp(self) -> None:
        """Damp the joints for a while; the guard rests, since the loop has ended."""
        if self._guard is not None:
            self._guard.rest()
        for _ in range(DAMP_TICKS):
            self.driver.damp()
            self._clock.sleep_until(self._clock.now() + min(self.period, 0.002))

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

    def _warm_up(self, *, forces: bool) -> None:
        """Run ticks on a robot at rest, so that the first real ones do not load code and memory."""
        reset = getattr(self.control, "reset", None)
        if reset is None:
            return
        robot = self.description.robot()
        imu = robot.placement(robot.imu_frame).rotation
        wrench = np.zeros((len(robot.soles), 6))
        wrench[:, 2] = robot.mass * GRAVITY / len(robot.soles)
        for i in range(20):
            self.control.command(
                Measurement(
                    i * self.period,
                    robot.half_sitting[7:].copy(),
                    np.zeros(robot.na),
                    np.zeros(3),
                    imu.T @ np.array([0.0, 0.0, GRAVITY]),
                    wrench if forces else None,
                )
            )
        reset()

    def _enter(self, phase: Phase, now: float) -> None:
        self.phase = phase
        self._phases.append((phase, now - self._begin))
        self._since = now
        logger.info("%.3f s: %s", now - self._begin, phase.value)

    def _end(self, reason: str) -> bool:
        self._reason = reason
        return False

    def _loop(self, measurement: Measurement, until: float | Callable[[], bool] | None) -> None:
        clock, driver, period = self._clock, self.driver, self.period
        now = self._begin = self._seen = clock.now()
        self._gains = getattr(driver, "gains", None) or (self.description.kp, self.description.kd)
        self._loads = SoleLoads(self.description, period, self._gains)
        self._start = SafeStart(
            self.description,
            measurement,
            self._loads,
            fade=self.settings.fade,
            speed=self.settings.speed,
            gains=self._gains,
        )
        self._weight = self.description.robot().mass * GRAVITY
        self._loaded_since: float | None = None
        self._until = until
        self._last: Command | None = None
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
            if newest is not None:
                measurement = newest
                self._age = max(self._age, now - self._seen)
                self._seen = now
            if not self._tick(measurement, now, fresh=newest is not None):
                driver.damp()
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

    def _tick(self, measurement: Measurement, now: float, *, fresh: bool) -> bool:
        """Send the command of this tick; False if the run is over, with its reason."""
        settings = self.settings
        if self._emergency.is_set():
            return self._end("emergency stop")
        if now - self._seen >= settings.robot_timeout:
            return self._end(f"no measurement for {1e3 * (now - self._seen):.0f} ms")
        if self._stop.is_set() and self.phase is not Phase.STOP:
            self._enter(Phase.STOP, now)
            self._held = np.array(measurement.joint_position)
            self._reason = "stopped"
        elapsed = now - self._since
        if self.phase is Phase.STOP:
            left = 1.0 - elapsed / settings.stop if settings.stop > 0.0 else 0.0
            if left <= 0.0:
                return False
            zero = np.zeros_like(self._held)
            kp, kd = left * self._gains[0], self._gains[1]
            self._send(Command(left * self._start.carry(measurement), self._held, zero, kp=kp, kd=kd))
            return True
        if not fresh and self._last is not None:
            self.driver.write(self._last)
            return True
        command = self._command(measurement, now, elapsed)
        if command is None:
            return False
        self._last = command
        self._send(command)
        if self._until is not None and (
            now - self._begin >= self._until if isinstance(self._until, float) else self._until()
        ):
            self.stop()
        return True

    def _send(self, command: Command) -> None:
        self.driver.write(command)
        self._loads.sent(command)

    def _command(self, measurement: Measurement, now: float, elapsed: float) -> Command | None:
        """Return the command of this tick; None if the controller has failed."""
        settings, start = self.settings, self._start
        if self.phase in (Phase.START, Phase.WAIT):
            command = start.command(measurement, now - self._begin)
            if start.done and self.phase is Phase.START:
                self._enter(Phase.WAIT, now)
            if self.phase is Phase.WAIT and self._loaded(measurement, now):
                self._enter(Phase.RUN, now)
            return command
        try:
            command = self.control.command(measurement)
            command.check(self.description.joint_names)
        except Exception as error:  # whatever a controller does, the machine is damped
            logger.exception("the controller failed")
            self._end(f"{type(error).__name__} of the controller: {error}")
            return None
        inner = getattr(self.control, "control", self.control)
        if getattr(inner, "stopped", False):
            self._end(f"the controller has stopped: {getattr(inner, 'reason', '')}")
            return None
        if elapsed < settings.blend:
            return start.blend(command, measurement, elapsed / settings.blend)
        return command

    def _loaded(self, measurement: Measurement, now: float) -> bool:
        """Return True if the soles have carried the robot for a while."""
        load = float(self._loads.wrenches(measurement)[:, 2].sum())
        if self.settings.load > 0.0 and not load > self.settings.load * self._weight:
            self._loaded_since = None
            return False
        if self._loaded_since is None:
            self._loaded_since = now
        return now - self._loaded_since > 0.3


def run(
    driver: Driver,
    control: Control,
    rate: float = 500.0,
    *,
    until: float | Callable[[], bool] | None = None,
    description: RobotDescription | None = None,
    settings: RunSettings | None = None,
    guard: bool = True,
) -> RunReport:
    """Drive a machine with a controller.

    The joints go from wherever they are to half-sitting, gains and torques faded in; when the soles carry the robot the
    controller takes over. A measurement that is late, a controller that fails, and the guard, if this process dies, end
    in damping. Ctrl-C stops, twice at once.

    Args:
        driver: Wire to the machine: an object with `read`, `write` and `damp` (`wbc.machine.Driver`).
        control: The controller, made with a control period of 1 / rate and a robot at half-sitting.
        rate: Ticks a second, 1/s.
        until: Time (s) or a function that returns True at the end; None runs until a signal.
        description: The robot; the driver's when None.
        settings: Times and limits.
        guard: Watch this process from another one.

    Returns:
        Reason of the end, phases, missed deadlines and the times of all ticks.

    Raises:
        InputError: A rate that is not the controller's, or an argument that is not what it should be.
        MachineError: No measurement comes, or one of another robot; the guard cannot use the driver.
    """
    return Runner(driver, control, rate, description=description, settings=settings, guard=guard).run(until)
