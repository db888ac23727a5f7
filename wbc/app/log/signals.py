"""Signals of a log: one tick as a recorder gets it, and descriptions with the functions that read values from it."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, Generic, Literal, NamedTuple, TypeVar, TypeVarTuple, cast

from wbc.base.errors import InputError, shown
from wbc.base.numbers import Array
from wbc.core.drive.control import Control, DriveControl
from wbc.core.qp.controller import Controller
from wbc.core.qp.solving.solution import Solution
from wbc.core.robot import SIDES, Robot
from wbc.core.signals import Command, Measurement
from wbc.robots import RobotDescription
from wbc.sim.simulation.simulation import GroundTruth, Simulation
from wbc.tasks.behaviours import Program
from wbc.tasks.stabilizer.stabilizer import StabilizerOutput
from wbc.walking.control import WalkingControl
from wbc.walking.source import Reference

XYZ, XY, QUATERNION = ("x", "y", "z"), ("x", "y"), ("x", "y", "z", "w")
WRENCH = ("fx", "fy", "fz", "mx", "my", "mz")
WRENCH_UNITS = ("N", "N", "N", "Nm", "Nm", "Nm")
"""Names and units of the parts of points, quaternions and wrenches."""

T = TypeVar("T")
Ts = TypeVarTuple("Ts")

Kind = Literal["number", "double", "whole", "flag", "text", "list"]
"""Storage of a signal: 4-byte float, 8-byte float, 4-byte integer, truth value, text, list of 4-byte floats."""


@dataclass(slots=True, eq=False)
class Tick:
    """State of a run after a command has been computed and before the plant takes it; None for what a run has not.

    Attributes:
        plant: The plant or loop.
        control: The control.
        measurement: Input of the control.
        command: Output of the control.
        description: The robot as data.
        solution: Solution of the QP.
        truth: True state of a loop that is no `Plant`.
        estimate: Estimated robot in this tick.
        model: Robot of a run without a control, for names and sizes.
        program: The control, if it is a program.
        drives: Drives of the control.
        walking: The control that makes the commands, if it is a walk.
        reference: Reference of the walk.
        output: Output of the stabilizer to that reference.
    """

    plant: Simulation | None
    control: Control | None
    measurement: Measurement
    command: Command
    description: RobotDescription | None = None
    solution: Solution | None = None
    truth: GroundTruth | None = None
    estimate: Robot | None = None
    model: Robot | None = None
    program: Program | None = field(init=False)
    drives: DriveControl | None = field(init=False)
    walking: WalkingControl | None = field(init=False)
    reference: Reference | None = field(init=False)
    output: StabilizerOutput | None = field(init=False)

    def __post_init__(self) -> None:
        control = self.control
        self.program = control if isinstance(control, Program) else None
        self.drives, acting = (None, None) if control is None else (control.drives, control.acting)
        self.walking = acting if isinstance(acting, WalkingControl) else None
        self.reference = None if self.walking is None else self.walking.reference
        self.output = None if self.walking is None or self.reference is None else self.walking.output

    @property
    def controller(self) -> Controller | None:
        """The whole-body controller."""
        return None if self.drives is None else self.drives.controller

    @property
    def robot(self) -> Robot:
        """The robot, for names and sizes."""
        if self.controller is not None:
            return self.controller.robot
        assert self.model is not None
        return self.model


Read = Callable[[Tick], Any]
"""Value of a signal in a tick; None where there is none."""


class Signal(NamedTuple):
    """One column of a log.

    Attributes:
        name: Parts separated by "/".
        unit: Unit of the signal; "1" for a signal without a unit.
        about: Description, with the frame.
        kind: Storage.
    """

    name: str
    unit: str = "1"
    about: str = ""
    kind: Kind = "number"


class Signals:
    """Signals in the order of the file, and the functions that read their values.

    Attributes:
        columns: Each signal with its place: in the row of numbers that `read` fills, or among the texts and lists.
        width: Length of a row of numbers.
    """

    def __init__(self) -> None:
        self.columns: list[tuple[Signal, int]] = []
        self.width = 0
        self._numbers: list[tuple[Read, int | slice, str]] = []  # with the name of the first of them
        self._objects: list[Read] = []
        self._names: set[str] = set()

    def one(self, name: str, unit: str, about: str, read: Read, kind: Kind = "number") -> None:
        """Describe a signal of a single value."""
        if kind in ("text", "list"):
            self._add(Signal(name, unit, about, kind), len(self._objects))
            self._objects.append(read)
        else:
            self._numbers.append((read, self.width, name))
            self._add(Signal(name, unit, about, kind), self.width)
            self.width += 1

    def each(
        self, names: Sequence[str], units: str | Sequence[str], about: str, read: Read, kind: Kind = "number"
    ) -> None:
        """Describe signals whose values are one array; units are one for all, or one each."""
        start, self.width = self.width, self.width + len(names)
        units = [units] * len(names) if isinstance(units, str) else units
        for i, (name, unit) in enumerate(zip(names, units, strict=True)):
            self._add(Signal(name, unit, about, kind), start + i)
        self._numbers.append((read, slice(start, self.width), next(iter(names), "")))

    def group(
        self,
        name: str,
        parts: Sequence[str],
        units: str | Sequence[str],
        about: str,
        read: Read,
        kind: Kind = "number",
    ) -> None:
        """Describe the parts of an array, each by the name of the group and its own."""
        self.each([f"{name}/{part}" for part in parts], units, about, read, kind)

    def _add(self, signal: Signal, place: int) -> None:
        if signal.name in self._names:
            raise InputError(f"there is a signal '{signal.name}' already; choose another name")
        self._names.add(signal.name)
        self.columns.append((signal, place))

    def read(self, tick: Tick, row: Array) -> list[Any]:
        """Fill a row with the numbers of a tick and return its texts and lists."""
        row.fill(math.nan)
        for read, place, name in self._numbers:
            if (value := read(tick)) is not None:
                try:
                    row[place] = value
                except (TypeError, ValueError) as error:
                    raise InputError(f"'{name}' of a log cannot keep {shown(value)}") from error
        return [read(tick) for read in self._objects]


class TickPart(Generic[T]):
    """Part of a tick that not every tick has."""

    def __init__(self, find: Callable[[Tick], T | None]) -> None:
        self._find = find

    def __call__(self, read: Callable[[T, *Ts], Any], *more: *Ts) -> Read:
        """Return the value of a signal that is read from the part, and from more arguments; None without the part."""
        find = self._find
        return lambda tick: None if (part := find(tick)) is None else read(part, *more)


def cached(find: Callable[[Tick], T]) -> Callable[[Tick], T]:
    """Return a function that computes a value once a tick, for several signals."""
    last: list[Any] = [None, None]

    def found(tick: Tick) -> T:
        if last[0] is not tick:
            last[:] = tick, find(tick)
        return cast(T, last[1])

    return found


def add_motion(signals: Signals, name: str, what: str, frame: str, pose: Read, velocity: Read | None) -> None:
    """Describe the pose (position, quaternion) and velocity (linear, angular) of a base or sole."""
    about = "sole centre, world" if what == "sole" else "world"
    parts = [f"{name}/position/{axis}" for axis in XYZ]
    parts += [f"{name}/orientation/{axis}" for axis in QUATERNION]
    signals.each(parts, ["m"] * 3 + ["1"] * 4, f"{about}; {what} frame in the world", pose)
    if velocity is not None:
        parts = [f"{name}/{kind}_velocity/{axis}" for kind in ("linear", "angular") for axis in XYZ]
        signals.each(parts, ["m/s"] * 3 + ["rad/s"] * 3, frame, velocity)


def foot_names(robot: Robot) -> list[str]:
    """Return the names of the feet in a log: left and right, or the names of the soles of any other robot."""
    names = [sole.name for sole in robot.soles]
    return list(SIDES) if names == ["left_foot", "right_foot"] else names


def joint_units(robot: Robot) -> list[str]:
    """Return the unit of each joint's position: rad, or m for a prismatic joint."""
    kinds = [robot.model.joints[number].shortname() for number in robot.joint_numbers]
    return ["m" if kind.startswith("JointModelP") else "rad" for kind in kinds]


def torque_units(robot: Robot) -> list[str]:
    """Return the unit of each joint's torque: Nm, or N for a prismatic joint."""
    return ["N" if unit == "m" else "Nm" for unit in joint_units(robot)]


def position_signal(joint: str, robot: Robot) -> str:
    """Return the name of the signal of a joint's true position; sole hinges are not in the robot model."""
    return f"truth/joint/position/{joint}" if joint in robot.joint_names else f"truth/sole/{joint}"
