"""Figure of the computing time of the controller's ticks."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from wbc.app.log.reader import Log
from wbc.app.plot.style import BLACK, COLOURS, grid, labels, legend, new_figure
from wbc.core.errors import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes

PARTS = ("model", "assembly", "solve", "decode")


def draw_timing(logs: Sequence[Log]) -> Figure:
    """Draw the computing time of the ticks over time, and its exceedance."""
    figure = new_figure(11.0, 5.0)
    left, right = grid(figure, 1, 2, width_ratios=(1.6, 1.0))[0]
    names = labels(logs)
    for i, (log, name) in enumerate(zip(logs, names, strict=True)):
        total = 1e6 * np.sum([log[f"tick/{part}"] for part in PARTS], axis=0)
        colour = COLOURS[i % len(COLOURS)]
        known = total[np.isfinite(total)]
        text = f"{name}: median {np.median(known):.0f} µs, 99 % {np.percentile(known, 99):.0f} µs"
        left.plot(log.time, total, ".", markersize=1.5, color=colour, label=text if len(logs) > 1 else None)
        _exceedance(right, total, colour if len(logs) > 1 else BLACK, name if len(logs) > 1 else "whole tick")
        if len(logs) == 1:
            left.set_title(text, loc="left", fontsize=10)
            for part, part_colour in zip(PARTS, COLOURS, strict=False):
                _exceedance(right, 1e6 * log[f"tick/{part}"], part_colour, part)
    left.set(xlabel="time (s)", ylabel="controller's tick (µs)", yscale="log")
    right.set(xlabel="µs", ylabel="share of ticks that took longer", xscale="log", yscale="log")
    stated = logs[0].header["control_period"]
    period = 1e6 * float(np.median(np.diff(logs[0].time)) if stated is None else stated)
    for ax in (left.axhline, right.axvline):
        ax(period, color="0.4", linewidth=1.0, linestyle="--")
    left.text(
        0.01,
        period,
        "control period",
        va="bottom",
        fontsize=8,
        color="0.4",
        transform=left.get_yaxis_transform(),
    )
    left.set_ylim(top=2.0 * max(period, left.get_ylim()[1]))
    if len(logs) > 1:
        legend(left, columns=1, markerscale=6)
    right.legend(fontsize=8, frameon=False, loc="lower left")
    return figure


def _exceedance(ax: Axes, times: Array, colour: str, label: str) -> None:
    """Draw the share of the values above each value."""
    values = np.sort(times[np.isfinite(times)])
    share = 1.0 - np.arange(values.size) / values.size
    ax.plot(values, share, color=colour, linewidth=1.4, label=label, drawstyle="steps-post")
