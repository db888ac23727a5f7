"""Signals of a log by groups, and names without spaces, for conversions."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from wbc.app.log.reader import Log
from wbc.app.log.signals import Signal
from wbc.core.errors import Array

Progress = Callable[[int, int], None]
"""Called with the number of finished parts and of all."""


@dataclass(eq=False)
class Group:
    """Signals with a common beginning of their names.

    Attributes:
        name: The beginning, without spaces.
        numbers: Last part of the name → signal, of those with a number in at least one tick.
        values: Their values, shape (ticks, numbers).
        objects: Last part of the name → signal and its texts or lists, None in ticks without one.
    """

    name: str
    numbers: dict[str, Signal] = field(default_factory=dict)
    values: Array = field(default_factory=lambda: np.empty((0, 0)))
    objects: dict[str, tuple[Signal, Any]] = field(default_factory=dict)


def groups_of(log: Log) -> list[Group]:
    """Return the signals of a log by groups, in the order of the file, without time and signals without a value."""
    groups: dict[str, Group] = {}
    for name, signal in log.signals.items():
        above, _, part = plain(name).rpartition("/")
        group = groups.setdefault(above or part, Group(above or part))
        if signal.kind in ("text", "list"):
            values = log.texts(name) if signal.kind == "text" else log.lists(name)
            if any(value is not None for value in values):
                group.objects[part] = signal, values
        elif name != "time" and np.isfinite(log[name]).any():
            group.numbers[part] = signal
    for group in groups.values():
        columns = [log[signal.name] for signal in group.numbers.values()]
        group.values = np.column_stack(columns) if columns else np.empty((len(log), 0))
    return [group for group in groups.values() if group.numbers or group.objects]


def plain(name: str) -> str:
    """Return a name without spaces."""
    return "_".join(name.split())
