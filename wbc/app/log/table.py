"""What a log holds: its signals, and the columns of the rows in which they are collected."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from wbc.core.errors import InputError

Kind = Literal["number", "double", "whole", "flag", "text", "list"]
"""How a signal is stored: 4-byte float, 8-byte float, 4-byte integer, truth value, text, list of 4-byte floats."""

XYZ = ("x", "y", "z")
XY = ("x", "y")
QUATERNION = ("x", "y", "z", "w")
WRENCH = ("fx", "fy", "fz", "mx", "my", "mz")
WRENCH_UNITS = ("N", "N", "N", "Nm", "Nm", "Nm")


@dataclass(frozen=True)
class Signal:
    """One column of a log.

    Attributes:
        name: Its parts are separated by "/".
        unit: "1" where there is none.
        about: What it is, with its frame.
        kind: How it is stored.
    """

    name: str
    unit: str = "1"
    about: str = ""
    kind: Kind = "number"

    def __post_init__(self) -> None:
        if not self.name or any(not part.strip() for part in self.name.split("/")) or "\n" in self.name:
            raise InputError(f"a signal's name is made of parts separated by '/', got {self.name!r}")


class Columns:
    """Columns of the rows, in the order in which they are asked for.

    Rows are float64. A text or a list is an object kept beside the rows, and its column holds the object's number.

    Attributes:
        signals: What each column is; None for columns that are used on the way and not written.
        texts: Texts that have occurred, by number.
    """

    def __init__(self) -> None:
        self.signals: list[Signal | None] = []
        self.texts: list[str] = []
        self._numbers: dict[str, int] = {}
        self._names: set[str] = set()

    def add(self, name: str, unit: str = "1", about: str = "", kind: Kind = "number") -> int:
        """Take a column.

        Returns:
            Its place.

        Raises:
            InputError: The name is taken, or is none.
        """
        if name in self._names:
            raise InputError(f"there is a signal '{name}' already; choose another name")
        self.signals.append(Signal(name, unit, about, kind))
        self._names.add(name)
        return len(self.signals) - 1

    def group(
        self, name: str, parts: Sequence[str], units: str | Sequence[str] = "1", about: str = ""
    ) -> slice:
        """Take one column for each part of a group.

        Args:
            name: Of the group.
            parts: Last part of each name.
            units: One for all, or one each.
            about: What they are.

        Returns:
            Their places.
        """
        return self.each([f"{name}/{part}" for part in parts], units, about)

    def each(self, names: Sequence[str], units: str | Sequence[str] = "1", about: str = "") -> slice:
        """Take one column for each name; arguments as for `group`."""
        start = len(self.signals)
        units = [units] * len(names) if isinstance(units, str) else units
        for name, unit in zip(names, units, strict=True):
            self.add(name, unit, about)
        return slice(start, len(self.signals))

    def hidden(self, width: int) -> slice:
        """Take columns that are not written."""
        start = len(self.signals)
        self.signals += [None] * width
        return slice(start, len(self.signals))

    def text(self, text: str) -> int:
        """Return the number of a text."""
        number = self._numbers.get(text)
        if number is None:
            number = len(self.texts)
            self.texts.append(text)
            self._numbers[text] = number
        return number
