"""Figures of an experiment: steps in the paper's arrangement, differences with their intervals, risks and loads."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from wbc.app.plot.style import BLUE, ORANGE, grid, new_figure
from wbc.sim.studies.intervals import FEW, rate_interval
from wbc.sim.studies.study import ALL, ground_of
from wbc.sim.studies.study_table import BESIDE, StudyTable


def steps_figure(table: StudyTable) -> Figure:
    """Draw the mean of each cell (a ground with an amplitude) and arm: grounds down, heights across, arms stacked."""
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


def risks_figure(table: StudyTable) -> Figure:
    """Draw the falls of each arm of a walks study by cause, and its loads over those of the first; by the last row."""
    arms = {arm: table.by_name[table.rows[-1], arm] for arm in table.study.arms}
    figure = new_figure(7.6, 2.8)
    falls, loads = figure.subplots(1, 2)
    places = np.arange(len(arms))
    for cause, colour in (("sideways", BLUE), ("forward", ORANGE)):
        counts = [(cell.falls.get(cause, 0), max(cell.steps, 1) / 1e3) for cell in arms.values()]
        rates = np.array([count / steps for count, steps in counts])
        ends = np.array([rate_interval(*count) for count in counts]).T
        falls.errorbar(
            places, rates, np.abs(ends - rates), color=colour, fmt="o-", markersize=4, capsize=2, label=cause
        )
    first = next(iter(arms.values())).beside
    for name, marker in zip(BESIDE, "osD^", strict=True):
        values = (
            [cell.beside.get(name, np.nan) / first[name] for cell in arms.values()] if name in first else []
        )
        if values:
            loads.plot(places, values, marker + "-", markersize=4, label=BESIDE[name][0].partition(" (")[0])
    loads.axhline(1.0, color="0.3", linewidth=0.8)
    falls.set_ylabel("falls per 1,000 steps", fontsize=8)
    loads.set_ylabel(f"over that of '{next(iter(arms))}'", fontsize=8)
    for axes in (falls, loads):
        axes.set_xticks(places, list(arms), fontsize=7)
        axes.set_ylim(bottom=0.0)
        axes.tick_params(axis="y", labelsize=7)
        if axes.get_legend_handles_labels()[0]:
            axes.legend(fontsize=7)
    return figure


def differences_figure(table: StudyTable) -> Figure:
    """Draw the difference of each arm to the reference in every row with its interval; all arms on one scale.

    What is established after Holm's correction is filled; the band is the margin within which a difference counts as
    none.
    """
    arms = [arm for arm in table.study.arms if arm != table.reference]
    rows, cells = list(table.rows), table.by_name
    figure = new_figure(2.6 + 1.7 * max(len(arms), 1), 1.1 + 0.17 * len(rows))
    for i, axes in enumerate(grid(figure, 1, max(len(arms), 1), sharex=True, sharey=True)[0]):
        if table.margin is not None:
            axes.axvspan(-table.margin, table.margin, color="0.93", lw=0)
        axes.axvline(0.0, color="0.3", linewidth=0.8)
        for place, row in enumerate(rows):
            cell = cells.get((row, arms[i])) if arms else None
            if cell is None or cell.difference is None or cell.difference.mean is None:
                continue
            mean, low, high = cell.difference.mean, cell.difference.low, cell.difference.high
            sure = cell.p_corrected is not None and cell.p_corrected < 0.05
            colour = ORANGE if row == ALL else BLUE
            if low is not None and high is not None and cell.difference.layouts >= FEW:
                axes.plot([low, high], [place, place], color=colour, linewidth=1.2)
            axes.plot(mean, place, "o", color=colour, markersize=4.0, fillstyle="full" if sure else "none")
        axes.set_title(arms[i] if arms else "", fontsize=8)
        axes.set_yticks(range(len(rows)), [row.replace("_", " ") for row in rows], fontsize=6)
        axes.tick_params(axis="x", labelsize=7)
        axes.set_ylim(len(rows) - 0.5, -0.5)
    figure.supxlabel(f"{table.metric.replace('_', ' ')}: difference to {table.reference}", fontsize=8)
    return figure
