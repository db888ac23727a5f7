"""Figures of the forces on the feet and the torques of the joints."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from wbc.app.log.reader import Log
from wbc.app.plot.style import (
    BLACK,
    COLOURS,
    ORANGE,
    SIDE_COLOURS,
    SUPPORT,
    grid,
    labels,
    legend,
    limit_to,
    mark_states,
    new_figure,
)
from wbc.core.robot import GRAVITY, SIDES

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FEET_ROWS = (
    ("normal force (N)", "fz"),
    ("shear force (N)", None),
    ("roll moment (Nm)", "mx"),
    ("pitch moment (Nm)", "my"),
)
"""Rows of the figure, each with its part of the wrench; None is the norm of the horizontal force."""


def draw_feet(logs: Sequence[Log]) -> Figure:
    """Draw the wrenches of the feet, measured (solid) and desired (dashed), one column for each log."""
    figure = new_figure(max(11.0, 7.0 * len(logs)), 9.5)
    rows = grid(figure, len(FEET_ROWS), len(logs), sharex=True, sharey="row")
    for column, (log, name) in enumerate(zip(logs, labels(logs), strict=True)):
        axes = [row[column] for row in rows]
        for ax, (label, part) in zip(axes, FEET_ROWS, strict=True):
            _one_part(ax, log, part)
            mark_states(ax, log, names=ax is axes[0])
            if column == 0:
                ax.set_ylabel(label)
        weight = float(log.header["robot"]["mass_kg"]) * GRAVITY
        axes[0].axhline(weight, color=BLACK, linewidth=0.8, linestyle=":", label="weight")
        legend(axes[0], columns=5)
        axes[0].set_title(name, loc="left", fontsize=10)
        axes[-1].set_xlabel("time (s)")
    return figure


def _one_part(ax: Axes, log: Log, part: str | None) -> None:
    shown = []
    for side in SIDES:
        for which, style, opacity in (("measured", "-", 0.5), ("desired", "--", 1.0)):
            group = f"foot/{side}/wrench_{which}"
            if f"{group}/fz" not in log:
                continue
            values = (
                np.hypot(log[f"{group}/fx"], log[f"{group}/fy"]) if part is None else log[f"{group}/{part}"]
            )
            ax.plot(
                log.time,
                values,
                style,
                color=SIDE_COLOURS[side],
                alpha=opacity,
                linewidth=0.9,
                label=f"{side} {which}",
            )
            shown.append(values)
    # Impacts are ten times as high as the rest and may leave the axes.
    joined = np.concatenate(shown)
    joined = joined[np.isfinite(joined)]
    if joined.size:
        limit_to(ax, np.percentile(joined, [0.1, 99.9]), margin=0.1)


def draw_torque(logs: Sequence[Log]) -> Figure:
    """Draw torque over limit: for one log over time, for several the largest of each joint of any robot."""
    joints = [[part.rpartition("/")[2] for part in log.parts("truth/joint/torque_ratio")] for log in logs]
    names = list(dict.fromkeys(itertools.chain(*joints)))
    rows = max(4.0, 0.22 * len(names) + 1.8)
    figure = new_figure(11.0 if len(logs) == 1 else 8.0, rows)
    if len(logs) == 1:
        left, right = grid(figure, 1, 2, width_ratios=(3.0, 1.0), sharey=True)[0]
        _torque_map(figure, left, logs[0], names)
    else:
        right = grid(figure, 1, 1)[0][0]
        right.set_yticks(range(len(names)), names, fontsize=8)
        right.set_ylim(len(names) - 0.5, -0.5)
    for i, (log, label) in enumerate(zip(logs, labels(logs), strict=True)):
        ratio = np.abs(log["truth/joint/torque_ratio"])
        share = 0.8 / len(logs)
        places = np.array([names.index(joint) for joint in joints[i]]) + share * (i - 0.5 * (len(logs) - 1))
        top = np.nanmax(ratio, axis=0)
        right.barh(places, top, height=0.9 * share, color=COLOURS[i % len(COLOURS)], alpha=0.45)
        right.barh(
            places,
            np.nanpercentile(ratio, 99, axis=0),
            height=0.9 * share,
            color=COLOURS[i % len(COLOURS)],
            label=label,
        )
    right.axvline(1.0, color=ORANGE, linewidth=1.2, linestyle="--")
    right.set_xlim(0.0, max(1.05, right.get_xlim()[1]))
    right.set_xlabel("|torque| / limit\n(99 % of the ticks; pale: largest)")
    if len(logs) > 1:
        legend(right, columns=3)
    return figure


def _torque_map(figure: Figure, ax: Axes, log: Log, names: list[str]) -> None:
    ratio = np.abs(log["truth/joint/torque_ratio"])
    image = ax.imshow(
        ratio.T,
        aspect="auto",
        interpolation="nearest",
        cmap="cividis",
        vmin=0.0,
        vmax=1.0,
        extent=(float(log.time[0]), float(log.time[-1]), len(names) - 0.5, -0.5),
    )
    ax.set_yticks(range(len(names)), names, fontsize=8)
    ax.set_xlabel("time (s)")
    ax.grid(False)
    ax.set_title(f"{labels([log])[0]}: |torque| / limit", loc="left", fontsize=10)
    figure.colorbar(image, ax=ax, location="bottom", pad=0.01, aspect=50, label="|torque| / limit")
    ax.set_facecolor(SUPPORT)
