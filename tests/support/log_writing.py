"""A log of made-up numbers, for tests and for the programs that they start."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from wbc.app.log.columns import Columns
from wbc.app.log.header import FORMAT
from wbc.app.log.writer import ROWS, LogWriter

__all__ = ["HEADER", "ROWS", "columns", "values", "write"]

HEADER = {"format": FORMAT, "program": "wbc test"}


def columns() -> Columns:
    made = Columns()
    made.add("time", "s", "clock", "double")
    made.group("com/estimated", ("x", "y", "z"), "m", "world")
    made.hidden(2)
    made.add("walk/phase", "1", "phase", "text")
    made.add("foot/contact", "1", "touches", "flag")
    made.add("walk/step", "1", "step", "whole")
    made.add("scan", "m", "profile", "list")
    return made


def values(i: int) -> tuple[float, float, float, float]:
    return 0.1 + 0.005 * i, 1.0 / (i + 1.0), -float(i), 1e-9 * i


def write(path: Path, ticks: int) -> LogWriter:
    """Write ticks without ending the file."""
    made, writer = columns(), LogWriter(path)
    writer.begin(made, HEADER)
    for i in range(ticks):
        row = writer.row
        row[0:4] = values(i)
        row[4:6] = np.nan
        row[6] = made.text("single" if i % 3 else "double") if i % 5 else np.nan
        row[7], row[8] = i % 2, i
        row[9] = writer.keep(np.arange(i % 4)) if i % 7 == 0 else np.nan
        writer.commit()
    return writer
