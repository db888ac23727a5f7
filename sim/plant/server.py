"""A simulated robot in a process of its own: real time, commands over a wire, damping when none come."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Annotated, Any

import mujoco
import numpy as np

from wbc.base.checked import checked
from wbc.base.errors import InputError, check_parts, shown
from wbc.base.numbers import Array
from wbc.base.settings import NonNegative, Positive
from wbc.core.signals import Command
from wbc.machine.clock import Clock
from wbc.sim.plant.mujoco_robot import MujocoRobot

logger = logging.getLogger(__name__)

DAMPING = 0.1
"""Damping of joints without a command, as a share of the servos'."""

BAND_STIFFNESS, BAND_DAMPING = 400.0, 40.0
"""Elastic band over the robot's mass: stiffness, 1/s², and damping, 1/s, at which a hanging mass comes to rest without
swinging, with 20 rad/s: it stretches by 25 mm."""

BAND_TILT, BAND_TURN = 0.05, 0.02
"""The same about the level axes over those along them, m²: as of bands that hold the robot 0.2 m beside its middle."""

RAISED, LOWERING, LETTING_GO = 0.05, 1.0, 1.0
"""Height by which the band holds the robot above the ground, m; times in which it is let down and then released, s."""


class RobotServer:
    """Server that runs a simulated robot in real time.

    Until the first command its servos hold the posture, as if the robot was in a rack; after a reset of the loop they
    do so again. A command of bad values and a
    request for damping leave the robot in the rack.

    Attributes:
        loop: The simulated robot.
        damped: True while the joints are damped.
        silent: Time since the last command, s.
        late: Number of periods that began late by more than one period.
    """

    @checked
    def __init__(
        self,
        loop: MujocoRobot,
        wire: Any,
        *,
        watchdog: Annotated[Positive, "s"] = 0.015,
        band: Annotated[NonNegative, "s"] = 0.0,
        clock: Clock | None = None,
    ) -> None:
        """Connect a simulated robot to a wire.

        Args:
            loop: The simulated robot.
            wire: Robot's end of the wire: `receive()` returns whether anything has asked for damping, and the newest
                command or None, since the last call; `send(measurement)` sends one.
            watchdog: Longest time for which a command acts, s; after it the joints are damped, from the beginning of
                the control period in which the time ends.
            band: Time for which the robot hangs on an elastic band before it is lowered, s.
            clock: Clock of the watchdog and of the periods; when None, that of this machine.
        """
        check_parts("a wire", wire, "receive", "send")
        self.loop, self._wire = loop, wire
        self._watchdog, self._band, self._clock = watchdog, band, clock or Clock()
        if watchdog <= loop.control_period:
            raise InputError(
                f"watchdog must be longer than the control period of the loop, {loop.control_period:g} s, "
                f"got {watchdog:g} s"
            )
        self.damped, self.silent, self.late = False, 0.0, 0
        self._zero = np.zeros(loop.robot.na)
        self._root = loop.places.root
        mass = loop.robot.mass
        self._stiffness, self._damping = BAND_STIFFNESS * mass, BAND_DAMPING * mass
        self._begin()

    def _begin(self) -> None:
        """Put the robot into the rack and on the band where it is, at the begin and after a reset of the loop."""
        self._rack: Command | None = self.loop.hold()
        self._command: Command | None = None
        self._last = -np.inf
        self._top = self.loop.data.xpos[self._root].copy() + [0.0, 0.0, RAISED]

    def run(self, until: Callable[[], bool]) -> None:
        """Run in real time.

        Args:
            until: Function that is called in every period; the server ends when it returns True.
        """
        period, clock = self.loop.control_period, self._clock
        deadline = clock.now()
        while not until():
            if clock.now() > deadline + period:
                self.late += 1
                deadline = clock.now()
            clock.sleep_until(deadline)
            self.step()
            deadline += period

    def step(self) -> None:
        """Advance by one control period."""
        if self.loop.ticks == 0:
            self._begin()
        self._command = self._choose(*self._receive())
        self.damped = self._command is None
        band, data = self._pull(), self.loop.data
        data.xfrc_applied[self._root] += band  # beside other forces on the base, and for this period alone
        try:
            self.loop.step(self._sinking() if self._command is None else self._command)
        except InputError as error:  # a command for another period, which has not moved the robot
            logger.warning("%s: the joints are damped", error)
            self._command, self.damped = None, True
            self.loop.step(self._sinking())
        finally:
            if self.loop.diverged is None:  # what has diverged is without forces
                data.xfrc_applied[self._root] -= band
        self._wire.send(self.loop.measure())

    def _receive(self) -> tuple[bool, Command | None]:
        """Return whether damping is asked for, or a bad command has come, and the newest command."""
        refused, command = self._wire.receive()
        now = self._clock.now()
        try:
            if command is not None:
                if not isinstance(command, Command):
                    raise InputError(f"a robot takes a Command, got {shown(command)}")
                command.check(self.loop.robot.joint_names)
        except InputError as error:
            logger.warning("%s: the %s", error, "joints are damped" if self._rack is None else "rack holds")
            refused = True
        if command is not None and not refused:
            self._last, self._rack = now, None
        self.silent = now - self._last
        return refused, command

    def _choose(self, refused: bool, newest: Command | None) -> Command | None:
        """Return the command of this period: that of the rack, the newest or the last one; None to damp the joints."""
        if self._rack is not None:
            return self._rack
        if refused or self.silent + self.loop.control_period > self._watchdog:
            return None
        return self._command if newest is None else newest

    def _sinking(self) -> Command:
        q: Array = self.loop.data.qpos[self.loop.places.joint_qpos]
        return Command(self._zero, q, self._zero, kp=self._zero, kd=DAMPING * self.loop.description.kd)

    def _pull(self) -> Array:
        """Return force and moment of the band, shape (6,), N and Nm: it holds the robot, lets it down, releases it."""
        force = np.zeros(6)
        past = self.loop.time - self._band
        if self._band <= 0.0 or past > LOWERING + LETTING_GO or self.loop.diverged is not None:
            return force
        down = max(0.0, min(1.0, past / LOWERING)) * RAISED
        velocity = np.zeros(6)
        data, kind = self.loop.data, mujoco.mjtObj.mjOBJ_XBODY
        mujoco.mj_objectVelocity(self.loop.model, data, kind, self._root, velocity, 0)
        fade = max(0.0, min(1.0, (LOWERING + LETTING_GO - past) / LETTING_GO))
        force[:3] = (
            self._stiffness * (self._top - [0.0, 0.0, down] - data.xpos[self._root])
            - self._damping * velocity[3:]
        )
        rotation = data.xmat[self._root].reshape(3, 3)
        tilt = np.cross(rotation[:, 2], [0.0, 0.0, 1.0])
        force[3:] = BAND_TILT * self._stiffness * tilt - BAND_TURN * self._damping * velocity[:3]
        return fade * force
