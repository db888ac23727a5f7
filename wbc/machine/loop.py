"""Interfaces between a controller and what it drives: a loop that is stepped, and a driver of a machine."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Protocol

from wbc.base.checked import checked, fixed
from wbc.base.errors import InputError, WbcError, shown
from wbc.base.numbers import Array
from wbc.base.settings import Period
from wbc.core.signals import Command, Measurement
from wbc.ground import PointCloud
from wbc.robots import RobotDescription

LONGEST_WAIT = 1.0
"""Longest time without a measurement in a loop, s."""


class MachineError(WbcError):
    """A machine that cannot be started: it sends nothing, not from this robot, or cannot be guarded."""


class Loop(Protocol):
    """A robot that is measured and stepped in turn, such as `wbc.Plant` and `wbc.sim.MujocoLoop`."""

    @property
    def description(self) -> RobotDescription:
        """The robot as data."""

    @property
    def control_period(self) -> float:
        """Time that `step` advances, s."""

    def measure(self) -> Measurement:
        """Return the readings of the sensors now."""

    def step(self, command: Command) -> None:
        """Advance by one control period under a command."""


class Driver(ABC):
    """Wire to a machine that runs in real time: a real robot, or one simulated in another process.

    A driver opens its wire at the first call of a method, so that it can be made in one process and used in another.

    Attributes:
        description: The robot.
        gains: Stiffness kp (Nm/rad) and damping kd (Nms/rad) of the machine, each of shape (na,); None for those of the
            description.
        fault: Reason why the joints must be damped; empty while there is none.
        leaves_released: True if the wire sends no command to released joints (`Command.released`), or sends the
            commands of whoever moves them. False if every motor gets a command: released joints are then held where
            they were released.
    """

    description: RobotDescription
    gains: tuple[Array, Array] | None = None
    fault: str = ""
    leaves_released: bool = False

    @abstractmethod
    def read(self, timeout: float) -> Measurement | None:
        """Return the newest measurement that was not returned before; None if none arrives in time.

        Args:
            timeout: Longest time to wait, s; with 0 it returns at once.
        """

    @abstractmethod
    def write(self, command: Command) -> None:
        """Send a command, without waiting."""

    @abstractmethod
    def damp(self) -> None:
        """Send a command that lets the joints sink slowly: damping without stiffness and torque."""

    def clouds(self) -> Sequence[PointCloud]:
        """Return the clouds of points that have arrived since the last call, for a controller that sees the ground."""
        return ()


def check_described(what: str, driver: Driver | Loop) -> None:
    """Raise an `InputError` for a driver, or a loop, without a description of its robot."""
    about = getattr(driver, "description", None)
    if not isinstance(about, RobotDescription):
        raise InputError(f"description of a {what} must be a RobotDescription, got {shown(about)}")


class DriverLoop:
    """Loop around a driver: each step sends a command and waits for the next measurement.

    Attributes:
        description: The robot.
        control_period: Period of the machine's measurements, s.
    """

    control_period: float = fixed("make another loop")

    @checked
    def __init__(self, driver: Driver, control_period: Period) -> None:
        """Store the wire to the machine, and the period of its measurements, s."""
        check_described("driver", driver)
        self.description = driver.description
        self.control_period = control_period
        self._driver = driver
        self._newest: Measurement | None = None

    def measure(self) -> Measurement:
        """Return the newest measurement.

        Raises:
            TimeoutError: The machine sends no measurement.
        """
        if self._newest is None:
            self._newest = self._driver.read(LONGEST_WAIT)
        if self._newest is None:
            raise TimeoutError(f"no measurement within {LONGEST_WAIT:g} s")
        return self._newest

    def step(self, command: Command) -> None:
        """Send a command and wait for the next measurement."""
        self._driver.write(command)
        self._newest = None
        self.measure()
