"""Figure of an experiment in the paper's arrangement: a block of arms for each ground, colour for steps."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from wbc.app.plot.style import new_figure
from wbc.sim.studies.study import ground_of
from wbc.sim.studies.study_table import ALL, StudyTable


def steps_figure(table: StudyTable) -> Figure:
    """Draw the mean of each cell and arm: grounds down, heights across, arms stacked in each block.

    Args:
        table: Table of a study whose cells are grounds with amplitudes.
    """
    rows = [row for row in table.rows if row != ALL]
    grounds = list(dict.fromkeys(map(ground_of, rows)))
    heights = list(dict.fromkeys(row.removeprefix(ground_of(row)).lstrip(", ") for row in rows))
    arms, cells = list(table.study.arms), table.by_name
    values = np.full((len(grounds) * (len(arms) + 1), max(len(heights), 1)), np.nan)
    for row in rows:
        top = grounds.index(ground_of(row)) * (len(arms) + 1)
        column = heights.index(row.removeprefix(ground_of(row)).lstrip(", "))
        for i, arm in enumerate(arms):
            if (row, arm) in cells and cells[row, arm].estimate.mean is not None:
                values[top + i, column] = cells[row, arm].estimate.mean
    figure = new_figure(3.0 + 0.9 * len(heights), 1.0 + 0.16 * len(values))
    axes = figure.subplots()
    image = axes.imshow(values, aspect="auto", cmap="viridis")
    places = [g * (len(arms) + 1) + i for g in range(len(grounds)) for i in range(len(arms))]
    names = [f"{ground}: {arm}" if i == 0 else arm for ground in grounds for i, arm in enumerate(arms)]
    axes.set_yticks(places, names, fontsize=6)
    axes.set_xticks(range(len(heights)), heights, fontsize=7)
    figure.colorbar(image, ax=axes, label=table.metric.replace("_", " "))
    return figure
