"""Figure of a study's table."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from wbc.app.plot.style import COLOURS, grid, new_figure
from wbc.core.errors import InputError
from wbc.sim.studies.intervals import Estimate
from wbc.sim.studies.study_table import StudyTable

if TYPE_CHECKING:
    from matplotlib.axes import Axes

DODGE = 0.6
"""Share of the space between two arms that their rows take."""

MARKERS = "os^DvPX"


def study_figure(table: StudyTable) -> Figure:
    """Draw a table: each arm's mean and its difference to the reference, with intervals; a colour per row.

    Raises `InputError` for more than seven rows, which have no distinct colours, or nothing to draw.
    """
    rows, arms = table.rows, list(table.study.arms)
    if len(rows) > len(COLOURS):
        raise InputError(
            f"{len(rows)} rows are too many for one figure, {len(COLOURS)} at most; put cells together by a part of "
            f"their specs, such as 'terrain'"
        )
    cells = table.by_name
    means = {row: [getattr(cells.get((row, arm)), "estimate", None) for arm in arms] for row in rows}
    if not any(e is not None and e.mean is not None for row in means.values() for e in row):
        raise InputError(f"there is nothing to draw: no trial of '{table.study.name}' has a {table.metric}")
    others = [arm for arm in arms if arm != table.reference]
    panels = 2 if others else 1
    figure = new_figure(2.0 + 0.55 * panels * max(len(arms), 4), 3.6)
    axes = grid(figure, 1, panels)[0]
    _draw(axes[0], arms, means)
    axes[0].set_ylabel(table.metric.replace("_", " ").replace(".", ", "))
    if others:
        more = {row: [getattr(cells.get((row, arm)), "difference", None) for arm in others] for row in rows}
        _draw(axes[1], others, more)
        axes[1].axhline(0.0, color="0.3", linewidth=0.8)
        axes[1].set_ylabel(f"difference to {table.reference}")
    figure.legend(
        *axes[0].get_legend_handles_labels(), loc="outside upper left", ncols=4, fontsize=8, frameon=False
    )
    return figure


def _draw(axes: Axes, arms: list[str], rows: dict[str, list[Estimate | None]]) -> None:
    """Draw means with intervals, side by side where several rows share an arm."""
    places = np.arange(len(arms), dtype=float)
    for i, (row, estimates) in enumerate(rows.items()):
        shift = DODGE * ((i + 0.5) / len(rows) - 0.5)
        numbers = np.array([_numbers(e) for e in estimates])
        mean, low, high = numbers.T
        axes.errorbar(
            places + shift,
            mean,
            yerr=np.abs(np.vstack([mean - low, high - mean])),
            fmt=MARKERS[i],
            color=COLOURS[i],
            markersize=4.0,
            linewidth=1.2,
            label=row.replace("_", " "),
        )
    axes.set_xticks(places, arms, rotation=30 if max(map(len, arms)) > 5 else 0)


def _numbers(estimate: Estimate | None) -> tuple[float, float, float]:
    """Return mean and ends of the interval; NaN without a mean, no width for a single value."""
    if estimate is None or estimate.mean is None:
        return math.nan, math.nan, math.nan
    low = estimate.mean if estimate.low is None else estimate.low
    high = estimate.mean if estimate.high is None else estimate.high
    return estimate.mean, low, high
