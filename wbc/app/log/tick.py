"""One tick as a recorder gets it, and the base class of sources of signals."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, NamedTuple

from wbc.core.drive.position import PositionControl
from wbc.core.drive.torque import TorqueControl
from wbc.core.errors import Array
from wbc.core.qp.controller import Controller
from wbc.core.qp.solution import Solution
from wbc.core.robot import Robot
from wbc.core.signals import Command, Measurement
from wbc.walking.progress import WalkingLike

if TYPE_CHECKING:
    from wbc.robots import RobotDescription
    from wbc.sim import MujocoLoop, Plant
    from wbc.sim.plant import GroundTruth

Control = PositionControl | TorqueControl | WalkingLike
"""Controllers that answer a measurement with a command."""


class Tick(NamedTuple):
    """State of a run after a command has been computed and before the plant takes it.

    Attributes:
        plant: The plant or loop; None without one.
        control: The walk, or position or torque control; None for a controller of one's own.
        measurement: Input of the control.
        command: Output of the control.
        description: The robot as data; None if only its model is known.
        solution: Solution of the QP; None without one.
        truth: True state of a loop that is no `Plant`; None if nobody knows it.
        estimate: Estimated robot, up to date; None if nothing estimates it.
        model: Robot of a run without a control, for names and sizes.
    """

    plant: Plant | MujocoLoop | None
    control: Control | None
    measurement: Measurement
    command: Command
    description: RobotDescription | None = None
    solution: Solution | None = None
    truth: GroundTruth | None = None
    estimate: Robot | None = None
    model: Robot | None = None

    @property
    def drives(self) -> PositionControl | TorqueControl | None:
        """Position or torque control, also that inside a walk; None for a controller of one's own."""
        return None if self.control is None else drives_of(self.control)

    @property
    def walking(self) -> WalkingLike | None:
        """Controller of a walk; None for any other."""
        control = self.control
        return None if isinstance(control, (PositionControl, TorqueControl)) else control

    @property
    def controller(self) -> Controller | None:
        """The whole-body controller; None for a controller of one's own."""
        return None if self.control is None else self.control.controller

    @property
    def robot(self) -> Robot:
        """The robot, for names and sizes."""
        if self.controller is not None:
            return self.controller.robot
        assert self.model is not None
        return self.model


def drives_of(control: Control) -> PositionControl | TorqueControl:
    """Return position or torque control, also that inside a walk."""
    return control if isinstance(control, (PositionControl, TorqueControl)) else control.control


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
