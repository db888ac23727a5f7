"""Figures of centre of mass, DCM and ZMP: over time, and from above."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from wbc.app.drift import Drift
from wbc.app.log.reader import Log
from wbc.app.log.stances import stances, support_box
from wbc.app.plot.style import (
    BLUE,
    ORANGE,
    PUSH,
    SUPPORT,
    grid,
    labels,
    legend,
    mark_pushes,
    mark_states,
    new_figure,
)
from wbc.app.view.marks import COM_COLOUR, DCM_COLOUR, SIDE_COLOURS, ZMP_COLOUR
from wbc.base.numbers import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LINES = (
    ("ZMP planned", "zmp/reference", ZMP_COLOUR, ":", 1.0),
    ("ZMP measured", "zmp/measured", ZMP_COLOUR, "-", 0.8),
    ("DCM planned", "dcm/reference", DCM_COLOUR, "--", 0.9),
    ("DCM estimated", "dcm/estimated", DCM_COLOUR, "-", 1.0),
    ("CoM planned", "com/reference", COM_COLOUR, "--", 0.9),
    ("CoM estimated", "com/estimated", COM_COLOUR, "-", 1.2),
)

TRUE_FOOT = "truth/foot/left/position/x"
"""Signal of a log that has the true places of the feet."""


def draw_balance(logs: Sequence[Log]) -> Figure:
    """Draw x, y and the error of the DCM, or the sway without a walk, one column for each log."""
    figure = new_figure(max(11.0, 7.0 * len(logs)), 9.5)
    heights = (2.2, 2.2, 1.0)[: 2 + any(np.any(np.nan_to_num(_errors(log))) for log in logs)]
    rows = grid(figure, len(heights), len(logs), sharex="col", height_ratios=heights)
    for column, (log, name) in enumerate(zip(logs, labels(logs), strict=True)):
        _one_balance([row[column] for row in rows], log, name)
    return figure


def _one_balance(axes: list[Axes], log: Log, name: str) -> None:
    time, (low, high) = log.time, support_box(log)
    for i, (ax, axis) in enumerate(zip(axes, "xy", strict=False)):
        ax.fill_between(
            time, low[:, i], high[:, i], step="post", color=SUPPORT, linewidth=0.0, label="support"
        )
        for label, group, colour, style, width in LINES:
            if f"{group}/x" in log and np.isfinite(log.vector(group, 2)).any():
                ax.plot(time, log.vector(group, 2)[:, i], style, color=colour, linewidth=width, label=label)
        ax.set_ylabel(f"{axis} (m)")
        if np.isfinite(low[:, i]).any():
            room = 0.15 * float(np.nanmax(high[:, i]) - np.nanmin(low[:, i]))
            ax.set_ylim(np.nanmin(low[:, i]) - room, np.nanmax(high[:, i]) + room)
    for ax in axes:
        mark_states(ax, log, names=ax is axes[0])
        mark_pushes(ax, log)
    legend(axes[0], columns=4, title=name)
    axes[-1].set_xlabel("time (s)")
    if len(axes) < 3:
        return
    errors = _errors(log)
    for i, (axis, tint) in enumerate((("x", BLUE), ("y", ORANGE))):
        axes[2].plot(time, 1e3 * errors[:, i], color=tint, linewidth=0.8, label=axis)
    axes[2].set_ylabel("DCM error (mm)" if "dcm/reference/x" in log else "CoM off its mean (mm)")
    legend(axes[2], columns=3)


def _errors(log: Log) -> Array:
    """Return the error of the DCM, or the sway of the CoM without a walk, shape (ticks, 2), m.

    It is zero where the walk decides its steps from the DCM as it is: there is no other one that it should follow.
    """
    if "stabilizer/dcm_error/x" in log:
        return log.vector("stabilizer/dcm_error", 2)
    if "dcm/reference/x" in log:
        return log.vector("dcm/reference", 2) - log.vector("dcm/estimated", 2)
    com = log.vector("com/estimated", 2)
    sway: Array = com - np.nanmean(com, axis=0)
    return sway


def draw_plan(logs: Sequence[Log]) -> Figure:
    """Draw footsteps and paths from above in the true world, as far as it is known, one row for each log."""
    spans = [_span(log) for log in logs]
    width = 12.0
    heights = [min(6.0, max(1.6, 0.86 * width * (s[3] - s[2]) / (s[1] - s[0]))) for s in spans]
    figure = new_figure(width, sum(heights) + 0.9 * len(logs))
    rows = grid(figure, len(logs), 1, height_ratios=heights)
    for (ax,), log, name, span in zip(rows, logs, labels(logs), spans, strict=True):
        _one_plan(ax, log, name)
        ax.set(xlim=span[:2], ylim=span[2:], aspect="equal", xlabel="x (m)", ylabel="y (m)")
    return figure


def _span(log: Log) -> tuple[float, float, float, float]:
    """Return the bounds of the footsteps with a margin: lower and upper x, lower and upper y, m."""
    kinds = ("reference", "truth")[: 1 + (TRUE_FOOT in log)]
    shapes = [stance.corners for which in kinds for stance in stances(log, which)]
    (x0, y0, _), (x1, y1, _) = np.min(shapes, axis=(0, 1)), np.max(shapes, axis=(0, 1))
    room = 0.04 + 0.02 * max(x1 - x0, y1 - y0)
    return float(x0 - room), float(x1 + room), float(y0 - room), float(y1 + room)


def _one_plan(ax: Axes, log: Log, name: str) -> None:
    truth, drift = TRUE_FOOT in log, Drift.of(log)
    for stance in stances(log):
        colour, shape = SIDE_COLOURS[stance.side], stance.corners[:, :2]
        ax.add_patch(Polygon(shape, facecolor=colour, alpha=0.13, edgecolor="none"))
        ax.add_patch(Polygon(shape, fill=False, edgecolor=colour, linewidth=0.7, linestyle="--"))
    for stance in stances(log, "truth") if truth else ():
        colour = SIDE_COLOURS[stance.side]
        ax.add_patch(Polygon(stance.corners[:, :2], fill=False, edgecolor=colour, linewidth=1.1))
    for label, group, colour, style, line in LINES:
        if label.endswith("measured") or label.endswith("estimated"):
            points = drift(log.vector(group, 2))
            ax.plot(points[:, 0], points[:, 1], style, color=colour, linewidth=line, label=label.split()[0])
    for side, colour in SIDE_COLOURS.items():
        ax.plot([], [], color=colour, linewidth=1.1, label=f"{side} sole" + (", true" if truth else ""))
        ax.plot([], [], "--", color=colour, linewidth=0.7, label=f"{side} sole, planned")
    if truth and "truth/push/point/x" in log:
        _mark_pushes(ax, log)
    legend(ax, columns=8, title=f"{name}; at the end {drift.text(-1)}" if truth else name)


def _mark_pushes(ax: Axes, log: Log) -> None:
    force = np.nan_to_num(log.vector("truth/push/force", 2))
    pushed = (force != 0.0).any(axis=1)
    for i, tick in enumerate(np.flatnonzero(pushed & ~np.concatenate([[False], pushed[:-1]])).tolist()):
        point, along = log.vector("truth/push/point", 2)[tick], force[tick] / np.linalg.norm(force[tick])
        ax.annotate(
            "", point + 0.06 * along, (point[0], point[1]), arrowprops={"arrowstyle": "-|>", "color": PUSH}
        )
        ax.plot(*point, "o", color=PUSH, markersize=4.0, label=None if i else "push")
