"""Common style of the figures: colours, axes, labels and legends."""

from __future__ import annotations

import io
import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from wbc.app.log.reader import Log

if TYPE_CHECKING:
    from matplotlib.axes import Axes

BLUE, ORANGE, GREEN = "#0072B2", "#D55E00", "#009E73"
PINK, SKY, AMBER, BLACK = "#CC79A7", "#56B4E9", "#E69F00", "#222222"
COLOURS = (BLUE, ORANGE, GREEN, PINK, SKY, AMBER, BLACK)
"""Distinct for the colour-blind: M. Okabe, K. Ito, "Color Universal Design", 2008; orange is its vermillion,
and its yellow, too light for a line, is left out."""

LEGEND_ROW = 13.0
"""Height of a row of a legend, points."""
STYLES = ("-", "--", ":", "-.")
PUSH = "#B00020"
"""Red of pushes."""

SUPPORT = "0.88"
"""Grey of support regions."""

as_written = mpl.rc_context({"text.parse_math": False})
"""Decorator of a function that draws: dollars in titles and names of logs and studies are dollars, no mathematics."""


class Drawing(Figure):
    """Figure that a notebook shows as a picture, whatever backend it has."""

    def _repr_png_(self) -> bytes:
        picture = io.BytesIO()
        self.savefig(picture, format="png")
        return picture.getvalue()


def new_figure(width: float, height: float) -> Figure:
    """Return a figure that needs no display; sizes in inches."""
    figure = Drawing(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def grid(figure: Figure, rows: int, columns: int, **options: Any) -> list[list[Axes]]:
    """Return rows × columns axes, as lists even when there is one."""
    made = figure.subplots(rows, columns, squeeze=False, **options)
    for axes in made.ravel():
        axes.spines[["top", "right"]].set_visible(False)
        axes.grid(color="0.93", linewidth=0.6)
        axes.set_axisbelow(True)
    return [list(row) for row in made]


def labels(logs: Sequence[Log]) -> list[str]:
    """Return distinct short names of the logs: their titles, or their files."""
    titles = [str(log.header.get("title", "")) for log in logs]
    if len(set(titles)) == len(titles) and all(titles):
        return titles
    names = [log.path.stem for log in logs]
    return names if len(set(names)) == len(names) else [str(log.path) for log in logs]


def legend(axes: Axes, columns: int = 3, title: str = "") -> None:
    """Put a legend above the axes, and a title above the legend."""
    handles, _ = axes.get_legend_handles_labels()
    if title:
        axes.set_title(
            title, loc="left", fontsize=10, pad=6.0 + LEGEND_ROW * math.ceil(len(handles) / columns)
        )
    if handles:
        axes.legend(
            loc="lower right",
            bbox_to_anchor=(1.0, 1.0),
            ncols=min(columns, len(handles)),
            fontsize=8,
            frameon=False,
            borderaxespad=0.1,
            handlelength=1.6,
            columnspacing=1.2,
        )


def mark_pushes(axes: Axes, log: Log) -> None:
    """Mark pushes over the height of axes over time."""
    if "truth/push/force/x" in log:
        pushed = (np.nan_to_num(log.vector("truth/push/force", 3)) != 0.0).any(axis=1).astype(int)
        for i, (start, end) in enumerate(np.flatnonzero(np.diff([0, *pushed, 0])).reshape(-1, 2).tolist()):
            last = log.time[min(end, len(log) - 1)]
            label = "push" if i == 0 else None
            axes.axvspan(
                log.time[start], last, color=PUSH, alpha=0.25, linewidth=0.0, zorder=1.5, label=label
            )


def mark_states(axes: Axes, log: Log, *, names: bool) -> None:
    """Shade every other state of a program over the height of axes over time, with the names of the states at the top.

    Names are without that of their machine. Of a log without a program nothing is drawn.
    """
    if "program/state" not in log:
        return
    paths = log.texts("program/state")
    starts = [0, *(np.flatnonzero(paths[1:] != paths[:-1]) + 1).tolist()]
    across = axes.get_xaxis_transform()
    for i, (start, end) in enumerate(zip(starts, [*starts[1:], len(log) - 1], strict=True)):
        if i % 2:
            axes.axvspan(log.time[start], log.time[end], color=SKY, alpha=0.12, linewidth=0.0, zorder=0)
        name = str(paths[start]).partition("/")[2]  # empty before the first state and after the last
        if names and name:
            middle = 0.5 * (log.time[start] + log.time[end])
            axes.text(middle, 0.98, name, transform=across, rotation=90, ha="center", va="top", fontsize=7)
