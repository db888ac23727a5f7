"""Figure of a study: means of every arm in every cell, with their intervals."""

from __future__ import annotations

from matplotlib.figure import Figure

from wbc.app.plot.style import COLOURS, as_written, grid, legend, new_figure
from wbc.base.checked import checked
from wbc.base.errors import InputError
from wbc.sim.studies.intervals import CONFIDENCE, FEW
from wbc.sim.studies.study_table import StudyTable

ROW = 0.32
"""Height of a row for each arm, inches."""


@as_written
@checked
def draw_study(table: StudyTable) -> Figure:
    """Draw the table of a study: a row for each of its rows, a point with its interval for each arm.

    Means of fewer than eight layouts have no interval.
    """
    arms, cells = list(table.study.arms), table.by_name
    if all(cell.estimate.mean is None for cell in table.cells):
        raise InputError(f"the journal has no '{table.metric}' of the study '{table.study.name}' to draw")
    height = 1.2 + ROW * len(table.rows) * max(1.0, 0.5 * len(arms))
    figure = new_figure(7.0, height)
    ((axes,),) = grid(figure, 1, 1)
    for k, arm in enumerate(arms):
        colour = COLOURS[k % len(COLOURS)]
        aside = (k - 0.5 * (len(arms) - 1)) * 0.7 / len(arms)
        for row, name in enumerate(table.rows):
            cell = cells.get((name, arm))
            if cell is None or cell.estimate.mean is None:
                continue
            mean, low, high = cell.estimate.mean, cell.estimate.low, cell.estimate.high
            known = low is not None and high is not None and cell.estimate.layouts >= FEW
            whiskers = [[mean - low], [high - mean]] if known else None  # type: ignore[operator]
            y = row + aside
            axes.errorbar(mean, y, xerr=whiskers, fmt="o", markersize=4.5, capsize=2.5, color=colour)
        axes.plot([], [], "o", color=colour, label=arm)
    axes.set_yticks(range(len(table.rows)), table.rows)
    axes.set_ylim(len(table.rows) - 0.5, -0.5)
    which = ", completed walks alone" if table.completed_only else ""
    axes.set_xlabel(f"{table.study.titled(table.metric)}{which}, mean and {100 * CONFIDENCE:g} % interval")
    legend(axes, 3, table.study.name)
    return figure
