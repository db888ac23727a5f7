"""Figure of the torques of the joints."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from wbc.app.log.reader import Log
from wbc.app.plot.style import COLOURS, ORANGE, SUPPORT, grid, labels, legend, new_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes


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
