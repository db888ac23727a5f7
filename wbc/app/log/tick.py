"""One tick as a recorder gets it, and the base class of sources of signals."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, NamedTuple

from wbc.core.control import PositionControl, TorqueControl
from wbc.core.errors import Array
from wbc.core.qp.controller import Controller
from wbc.core.robot import Robot
from wbc.core.signals import Command, Measurement
from wbc.walking.control import WalkingControl

if TYPE_CHECKING:
    from wbc.sim import Plant

Control = PositionControl | TorqueControl | WalkingControl
"""Controllers that answer a measurement with a command."""


class Tick(NamedTuple):
    """State of a run after a command has been computed and before the plant takes it.

    Attributes:
        plant: The plant; None without one.
        control: The walk, or position or torque control.
        measurement: Input of the control.
        command: Output of the control.
    """

    plant: Plant | None
    control: Control
    measurement: Measurement
    command: Command

    @property
    def drives(self) -> PositionControl | TorqueControl:
        """Position or torque control, also that inside a walk."""
        control = self.control
        return control.control if isinstance(control, WalkingControl) else control

    @property
    def controller(self) -> Controller:
        """The whole-body controller."""
        return self.control.controller

    @property
    def robot(self) -> Robot:
        """The controller's robot, for names and sizes."""
        return self.controller.robot


class Source(ABC):
    """Some signals of a log: `write` copies values in every tick, `finish` computes from them once a batch.

    A control tick pays for `write` alone.
    """

    @abstractmethod
    def write(self, tick: Tick, row: Array) -> None:
        """Fill all columns of this source in a row, whatever the row holds."""

    def finish(self, rows: Array) -> None:  # noqa: B027 - optional
        """Fill columns from others, for many rows at once, shape (rows, columns)."""


def copy(row: Array, places: slice, values: Array | None) -> None:
    """Copy values into a row; NaN where there are none."""
    row[places] = float("nan") if values is None else values
