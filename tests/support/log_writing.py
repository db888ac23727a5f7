"""A log of made-up numbers, for tests and for the programs that they start."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from wbc.app.log.header import FORMAT
from wbc.app.log.signals import Signals, Tick
from wbc.app.log.writer import ROWS, LogWriter

__all__ = ["HEADER", "ROWS", "signals", "values", "write"]

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
