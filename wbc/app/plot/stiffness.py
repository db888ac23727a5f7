"""Figure of the stiffness of the soles, and of the ground that was scanned before each decision."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure

from wbc.app.log.reader import Log
from wbc.app.plot.style import grid, labels, legend, mark_pushes, new_figure
from wbc.app.view.marks import SIDE_COLOURS
from wbc.base.numbers import Array
from wbc.core.robot import SIDES

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def draw_stiffness(logs: Sequence[Log]) -> Figure:
    """Draw stiffness and range over time and the scanned ground along the walk, one column for each log."""
    parts: list[Callable[[Axes, Log, str], None]] = [_one_stiffness]
    if any(_has_ranges(log) for log in logs):
        parts.append(_one_range)
    if any(scans(log) for log in logs):
        parts.append(_one_ground)
    figure = new_figure(max(9.0, 7.0 * len(logs)), 2.7 * len(parts))
    rows = grid(figure, len(parts), len(logs))
    for column, (log, name) in enumerate(zip(logs, labels(logs), strict=True)):
        for part, row in zip(parts, rows, strict=True):
            part(row[column], log, name)
    return figure


def _has_ranges(log: Log) -> bool:
    names = [f"foot/{side}/range" for side in SIDES]
    return all(name in log for name in names) and any(np.isfinite(log[name]).any() for name in names)


def _one_range(ax: Axes, log: Log, _: str) -> None:
    if not _has_ranges(log):
        ax.set_visible(False)
        return
    for side in SIDES:
        ax.plot(
            log.time, 1e3 * log[f"foot/{side}/range"], color=SIDE_COLOURS[side], linewidth=0.9, label=side
        )
    mark_pushes(ax, log)
    ax.set(ylabel="range under the toe (mm)", xlabel="time (s)")
    legend(ax, columns=3)


def _one_stiffness(ax: Axes, log: Log, name: str) -> None:
    for side in SIDES:
        colour, time, signal = SIDE_COLOURS[side], log.time, f"foot/{side}/stiffness"
        ax.plot(time, log[signal], color=colour, linewidth=1.2, label=f"{side} actual")
        wanted = log[f"{signal}_command"]
        ax.plot(time, wanted, "--", color=colour, linewidth=1.0, label=f"{side} commanded")
    ax.set_ylabel("stiffness (Nm/rad)")
    ax.set_ylim(bottom=0.0)
    ax.set_xlabel("time (s)")
    mark_pushes(ax, log)
    legend(ax, columns=5, title=name)


def _one_ground(ax: Axes, log: Log, _: str) -> None:
    steps = scans(log)
    ax.set_visible(bool(steps))
    for side, x, z, stiffness in steps:
        colour, top = SIDE_COLOURS[side], (float(x[z.argmax()]), 1e3 * float(z.max()))
        ax.plot(x, 1e3 * z, color=colour, linewidth=1.3)
        above: dict[str, Any] = {"xytext": (0, 3), "textcoords": "offset points", "ha": "center"}
        ax.annotate(f"{stiffness:.0f}", top, fontsize=7, color=colour, **above)
    for side in SIDES:
        ax.plot([], [], color=SIDE_COLOURS[side], label=f"{side}, stiffness in Nm/rad")
    ax.set(xlabel="along the walk (m)", ylabel="scanned ground (mm)")
    legend(ax, columns=2)


def scans(log: Log) -> list[tuple[str, Array, Array, float]]:
    """Return side, x (m), z (m) and commanded stiffness (Nm/rad) of each step with a profile."""
    if "stiffness/scan/x" not in log:
        return []
    sides, commanded = log.texts("stiffness/side"), log["stiffness/commanded"]
    pairs = zip(log.lists("stiffness/scan/x"), log.lists("stiffness/scan/z"), strict=True)
    return [
        (str(sides[i]), x, z, float(commanded[i]))
        for i, (x, z) in enumerate(pairs)
        if x is not None and z is not None and np.size(x)
    ]
