"""A log of made-up numbers, for tests and for the programs that they start."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from wbc.app.log.header import FORMAT
from wbc.app.log.reader import AXES, Log
from wbc.app.log.signals import Kind, Signals, Tick
from wbc.app.log.writer import ROWS, LogWriter

__all__ = ["HEADER", "ROWS", "made_log", "signals", "values", "write"]

HEADER = {"format": FORMAT, "program": "wbc test"}


def signals() -> Signals:
    """Signals of which nothing is read: `write` fills the rows."""
    made = Signals()
    made.one("time", "s", "clock", unread, "double")
    made.group("com/estimated", ("x", "y", "z"), "m", "world", unread)
    made.one("walk/phase", "1", "phase", unread, "text")
    made.one("foot/contact", "1", "touches", unread, "flag")
    made.one("walk/step", "1", "step", unread, "whole")
    made.one("scan", "m", "profile", unread, "list")
    return made


def unread(tick: Tick) -> None:
    """Never called."""


def values(i: int) -> tuple[float, float, float, float]:
    return 0.1 + 0.005 * i, 1.0 / (i + 1.0), -float(i), 1e-9 * i


def write(path: Path, ticks: int) -> LogWriter:
    """Write ticks without ending the file."""
    writer = LogWriter(path)
    writer.begin(signals(), HEADER)
    for i in range(ticks):
        time, *com = values(i)
        writer.row[:] = (time, *com, i % 2, i)
        phase = ("single" if i % 3 else "double") if i % 5 else None
        writer.commit([phase, np.arange(float(i % 4)) if i % 7 == 0 else None])
    return writer


def made_log(path: Path, columns: Mapping[str, Any], **header: Any) -> Log:
    """Write a log of given numbers, texts and lists, and open it.

    An array of shape (ticks, n) becomes the parts of a vector; a list of texts, or of arrays, has None for nothing.
    """
    made, whole, objects = Signals(), [], []
    for name, values in columns.items():
        if isinstance(values, list):
            kind: Kind = "text" if any(isinstance(value, str) for value in values) else "list"
            made.one(name, "1", "", unread, kind)
            objects.append(values)
        elif np.ndim(values) == 1:
            made.one(name, "m", "", unread, "double")
            whole.append(np.asarray(values, dtype=float)[:, None])
        else:
            made.group(name, list(AXES[np.shape(values)[1]]), "m", "", unread, "double")
            whole.append(np.asarray(values, dtype=float))
    writer = LogWriter(path)
    writer.begin(made, HEADER | header)
    rows = np.concatenate(whole, axis=1)
    for i, row in enumerate(rows):
        writer.row[:] = row
        writer.commit([values[i] for values in objects])
    writer.close()
    return Log.open(path)
