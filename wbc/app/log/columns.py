"""Signals of a log, and the columns of the rows in which they are collected."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

from wbc.core.errors import InputError
from wbc.core.robot import SIDES, Robot
from wbc.core.settings import settings

Kind = Literal["number", "double", "whole", "flag", "text", "list"]
"""Storage of a signal: 4-byte float, 8-byte float, 4-byte integer, truth value, text, list of 4-byte floats."""

XYZ = ("x", "y", "z")
XY = ("x", "y")
QUATERNION = ("x", "y", "z", "w")
WRENCH = ("fx", "fy", "fz", "mx", "my", "mz")
WRENCH_UNITS = ("N", "N", "N", "Nm", "Nm", "Nm")


@settings
class Signal:
    """One column of a log.

    Attributes:
        name: Parts separated by "/".
        unit: "1" without a unit.
        about: Description, with the frame.
        kind: Storage.
    """

    name: str
    unit: str = "1"
    about: str = ""
    kind: Kind = "number"

    def __post_init__(self) -> None:
        if not self.name or any(not part.strip() for part in self.name.split("/")) or "\n" in self.name:
            raise InputError(f"a signal's name is made of parts separated by '/', got {self.name!r}")


class Columns:
    """Columns of the rows, in the order in which they were added.

    Rows are float64. A text or a list is stored beside the rows, and its column holds the index of it.

    Attributes:
        signals: Signal of each column; None for intermediate columns, which are not written.
        texts: Texts that have occurred; columns hold indices into this list.
    """

    def __init__(self) -> None:
        self.signals: list[Signal | None] = []
        self.texts: list[str] = []
        self._numbers: dict[str, int] = {}
        self._names: set[str] = set()
        self._groups: set[str] = set()

    def add(self, name: str, unit: str = "1", about: str = "", kind: Kind = "number") -> int:
        """Add a column and return its index.

        Raises:
            InputError: The name is taken or malformed.
        """
        if name in self._names:
            raise InputError(f"there is a signal '{name}' already; choose another name")
        signal = Signal(name, unit, about, kind)
        parts = name.split("/")
        groups = {"/".join(parts[:i]) for i in range(1, len(parts))}
        if name in self._groups or (taken := groups & self._names):
            what = f"a group '{name}'" if name in self._groups else f"a signal '{taken.pop()}'"
            raise InputError(f"signal '{name}' cannot be: there is {what} already; choose another name")
        self._groups |= groups
        self.signals.append(signal)
        self._names.add(name)
        return len(self.signals) - 1

    def group(
        self, name: str, parts: Sequence[str], units: str | Sequence[str] = "1", about: str = ""
    ) -> slice:
        """Add one column for each part of a group and return their indices.

        Args:
            name: Name of the group.
            parts: Last part of each signal's name.
            units: One unit for all, or one each.
            about: Description of all.
        """
        return self.each([f"{name}/{part}" for part in parts], units, about)

    def each(self, names: Sequence[str], units: str | Sequence[str] = "1", about: str = "") -> slice:
        """Add one column for each name; arguments as for `group`."""
        start = len(self.signals)
        units = [units] * len(names) if isinstance(units, str) else units
        for name, unit in zip(names, units, strict=True):
            self.add(name, unit, about)
        return self.since(start)

    def since(self, start: int) -> slice:
        """Return the indices of all columns from one on."""
        return slice(start, len(self.signals))

    def hidden(self, width: int) -> slice:
        """Add intermediate columns, which are not written."""
        start = len(self.signals)
        self.signals += [None] * width
        return self.since(start)

    def text(self, text: str) -> int:
        """Return the index of a text."""
        number = self._numbers.get(text)
        if number is None:
            number = len(self.texts)
            self.texts.append(text)
            self._numbers[text] = number
        return number


def foot_names(robot: Robot) -> list[str]:
    """Return the names of the feet in a log: left and right, or the names of the soles of any other robot."""
    names = [sole.name for sole in robot.soles]
    return list(SIDES) if names == ["left_foot", "right_foot"] else names


def joint_units(robot: Robot) -> list[str]:
    """Return the unit of each joint's position: rad, or m for a prismatic joint."""
    kinds = [joint.shortname() for joint in robot.model.joints[2:]]
    return ["m" if kind.startswith("JointModelP") else "rad" for kind in kinds]


def torque_units(robot: Robot) -> list[str]:
    """Return the unit of each joint's torque: Nm, or N for a prismatic joint."""
    return ["N" if unit == "m" else "Nm" for unit in joint_units(robot)]


def position_signal(joint: str, robot: Robot) -> str:
    """Return the name of the signal of a joint's true position; sole hinges are not in the robot model."""
    return f"truth/joint/position/{joint}" if joint in robot.joint_names else f"truth/sole/{joint}"
