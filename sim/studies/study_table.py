"""Tables of a study: means, paired differences, falls by cause and loads; and its rows as a data frame."""

from __future__ import annotations

import functools
import operator
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from wbc.base.checked import checked
from wbc.base.errors import InputError, unknown_name
from wbc.base.settings import to_json
from wbc.sim.studies.intervals import (
    CONFIDENCE,
    Estimate,
    holm,
    mean_interval,
    rate_text,
    share_interval,
    share_text,
    sign_flip_p,
)
from wbc.sim.studies.journal import Entry, canonical
from wbc.sim.studies.study import ALL, Study, StudyTrial, study_entries

if TYPE_CHECKING:
    import pandas as pd

CAUSES = ("forward", "sideways", "backward", "dropped")
"""Causes of falls, as tables count them."""

COLUMNS = {
    "impact": ("landing peak (x weight)", 1.0),
    "zmp_error.mean": ("ZMP error (mm)", 1e3),
    "contact_area.mean": ("contact area (cm²)", 1e4),
    "cost_of_transport": ("cost of transport", 1.0),
    "vibration": ("vibration (10⁶ rad/s²)", 1e-6),
    "slip": ("slip (mm)", 1e3),
}
"""Parts of the result of a walk that stand beside its steps: title and factor."""

FAMILIES = 8
"""Least number of families of grounds that are the clusters of a row; with fewer the layouts are."""

KEYS = ("cell", "arm", "seed", "status")
"""First columns of a study's rows."""

GROUND = ["cell", "seed"]
"""Columns that tell the ground of a trial."""


@dataclass(frozen=True)
class TableCell:
    """Result of one arm in one row.

    Attributes:
        estimate: Mean of the metric; in a row of several cells over the grounds that all arms of the row have.
        difference: Difference to the reference arm, pair by pair; None for the reference itself.
        p_corrected: The same corrected for the number of rows and arms that are compared (`holm`); None in the row of
            all cells, which repeats the others.
        completed: Share of completed walks: ends of its exact interval; None without walks.
    """

    row: str
    arm: str
    estimate: Estimate
    difference: Estimate | None
    p: float | None  # p-value of no difference, by flipping signs (`sign_flip_p`)
    p_corrected: float | None
    statuses: dict[str, int]  # status of the trials → number; "missing" have not been run
    outcomes: dict[str, int]  # outcome of the walks → number
    completed: tuple[float, float] | None
    falls: dict[str, int]  # cause of the falls → number; empty without walks
    steps: int  # number of steps of all walks: the time at risk
    beside: dict[str, float]  # part of `COLUMNS` → mean, over the same walks as the estimate
    clusters: str  # what is drawn for the intervals: "families", with all of their layouts, or "layouts"

    def to_json(self) -> dict[str, Any]:
        """Return the result as plain values."""
        values = to_json(self)
        return {"row": values.pop("row"), "arm": values.pop("arm"), **values.pop("estimate"), **values}


@dataclass(frozen=True)
class StudyTable:
    """Table of a study."""

    study: Study  # the study
    metric: str  # part of the results that the table is about
    completed_only: bool  # only completed walks are counted
    by: tuple[str, ...]  # parts of the specs by which cells were put together; empty if each cell is a row
    reference: str  # arm that the others are compared with
    rows: tuple[str, ...]  # names of the rows; the last one has all cells together if there are several
    cells: tuple[TableCell, ...]  # results, row by row

    def to_json(self) -> dict[str, Any]:
        """Return the table as plain values."""
        names = ("metric", "completed_only", "by", "reference")
        own = {name: to_json(getattr(self, name)) for name in names}
        cells = [cell.to_json() for cell in self.cells]
        return {"study": self.study.name, "confidence": CONFIDENCE, **own, "cells": cells}

    @property
    def by_name(self) -> dict[tuple[str, str], TableCell]:
        """Row and arm → result."""
        return {(cell.row, cell.arm): cell for cell in self.cells}

    def markdown(self) -> str:
        """Return the rule of decision and three tables: means, paired differences, and falls by cause with loads."""
        arms, cells, last = list(self.study.arms), self.by_name, self.rows[-1]
        which = ", completed walks alone" if self.completed_only else ""
        over = cells[last, arms[0]].clusters if (last, arms[0]) in cells else "layouts"
        decision = self.study.decision
        parts = [
            f"Decision: {decision}" if decision else "Exploratory: the study has no rule of decision.",
            f"{self.study.titled(self.metric)}{which}: mean, in the last row [95 % interval over {over}] (trials)\n\n"
            + _grid(self.rows, arms, cells, lambda cell: _mean_text(cell, interval=cell.row == last)),
        ]
        if len(arms) > 1:
            title = (
                f"Difference to '{self.reference}' on the same layouts: mean [95 % interval over layouts, in the last "
                f"row over {over}] (pairs); * p < 5 % after Holm's correction for all rows and arms"
            )
            others = [arm for arm in arms if arm != self.reference]
            parts.append(title + "\n\n" + _grid(self.rows, others, cells, _difference_text))
        return "\n\n".join([*parts, self.ends()])

    def ends(self) -> str:
        """Return how the walks of each arm ended: completed, falls per 1,000 steps by cause, loads, lost trials."""
        cells = self.by_name
        arms = {arm: cells[self.rows[-1], arm] for arm in self.study.arms if (self.rows[-1], arm) in cells}
        beside = [name for name in COLUMNS if any(name in cell.beside for cell in arms.values())]
        lines, lost = [], []
        for arm, cell in arms.items():
            if total := sum(cell.outcomes.values()):
                falls = [_rate(cell.falls.get(cause, 0), cell.steps) for cause in CAUSES]
                loads = [f"{COLUMNS[n][1] * cell.beside[n]:.3g}" if n in cell.beside else "–" for n in beside]
                done = share_text(cell.outcomes.get("completed", 0), total).replace(" completed", "")
                lines.append(f"| {' | '.join((arm, done, *falls, *loads))} |")
            others = {**cell.outcomes, **cell.statuses}
            names = ("strayed", "unfinished", "diverged", "timeout", "crashed", "missing")
            lost += [f"{others[name]} of '{arm}' {name}" for name in names if others.get(name)]
        head = ("", "completed", *CAUSES, *(COLUMNS[name][0] for name in beside))
        title = "Falls per 1,000 steps by cause [95 %, exact Poisson], and means of what stands beside them"
        table = [f"| {' | '.join(head)} |", "|---|" + "---|" * (len(head) - 1), *lines]
        text = title + "\n\n" + "\n".join(table) if lines else ""
        return "\n\n".join(part for part in (text, "; ".join(lost)) if part)


def _grid(
    rows: Sequence[str],
    columns: Sequence[str],
    cells: Mapping[tuple[str, str], TableCell],
    text: Callable[[TableCell], str],
) -> str:
    lines = ["| | " + " | ".join(columns) + " |", "|---|" + "---|" * len(columns)]
    for row in rows:
        values = [text(cells[row, column]) if (row, column) in cells else "" for column in columns]
        lines.append(f"| {row} | " + " | ".join(values) + " |")
    return "\n".join(lines)


def _rate(falls: int, steps: int) -> str:
    """Return falls per 1,000 steps as a text; their number where no step was taken, which gives no rate."""
    return rate_text(falls, steps / 1e3) if steps else f"{falls} in 0 steps" if falls else "–"


def _mean_text(cell: TableCell, *, interval: bool) -> str:
    mean = cell.estimate.text() if interval else cell.estimate.text().partition(" ")[0]
    return f"{mean} ({cell.estimate.n})"


def _difference_text(cell: TableCell) -> str:
    if cell.difference is None:
        return ""
    mark = " *" if cell.p_corrected is not None and cell.p_corrected < 0.05 else ""
    return f"{cell.difference.text()} ({cell.difference.n}){mark}"


def cause_of(result: Mapping[str, Any]) -> str | None:
    """Return the cause of a fall, one of `CAUSES`; None without a fall."""
    fall = result.get("fall")
    if not isinstance(fall, Mapping):
        return None
    cause = "dropped" if fall.get("reason") == "height" else fall.get("cause")
    return "sideways" if cause in ("left", "right") else cause if cause in CAUSES else None


@checked
def study_frame(study: Study, entries: Mapping[str, Entry]) -> pd.DataFrame:
    """Return all trials of a study as rows of a data frame.

    The columns are cell, arm, seed, status ("missing" for a trial that has not been run), and every part of the results
    that is not a list, such as "zmp_error.mean". Missing values are NaN or None.
    """
    return _frame(list(study_entries(study, entries)))


def _frame(found: Sequence[tuple[StudyTrial, Entry | None]]) -> pd.DataFrame:
    """Return trials with their entries as rows of a data frame; see `study_frame`."""
    import pandas as pd  # noqa: PLC0415 - slow to import

    head = pd.DataFrame(
        [(t.cell, t.arm, t.seed, "missing" if e is None else e.status) for t, e in found], columns=KEYS
    )
    results = pd.json_normalize([{} if entry is None else dict(entry.result or {}) for _, entry in found])
    results = results.loc[:, ~results.columns.duplicated()]
    lists = [
        name for name, column in results.items() if column.map(lambda v: isinstance(v, (list, tuple))).any()
    ]
    return head.join(results.drop(columns=[*lists, *(name for name in KEYS if name in results)]))


@checked
def study_table(
    study: Study,
    entries: Mapping[str, Entry],
    *,
    metric: str | None = None,
    completed_only: bool = False,
    by: Sequence[str] = (),
) -> StudyTable:
    """Make the table of a study.

    Trials that diverged, crashed or timed out are counted, but are not part of any mean. In a row of several cells, a
    mean is taken over the grounds (cell and seed) that all arms have, so that missing walks favour no arm. A difference
    is taken over the grounds that the arm and the reference have.

    The bootstrap of the intervals draws layouts. Cells that differ only in the gait, for example, have the same
    layouts, and these are drawn together. In a row of eight families or more the bootstrap draws families, each with
    all of its layouts, because the question is then what holds on other grounds.

    Args:
        study: The study.
        entries: Entries of a journal, by key.
        metric: Part of the results that the table shows; that of the study when None.
        completed_only: Leave out walks that were not completed, and the walks of other arms on the same grounds.
        by: Parts of the specs, such as "terrain" or "gait.swing_height"; cells with equal parts become one row. Without
            any, each cell is a row.
    """
    name, by = metric or study.measured, tuple(by)
    reference = study.reference or next(iter(study.arms))
    trials = list(study_entries(study, entries))
    frame = _frame(trials)
    frame["value"] = _values(frame, name, completed_only=completed_only)
    frame["row"] = [_row(trial.plain, by) if by else trial.cell for trial, _ in trials]
    frame["layouts"] = [layout_of(trial.plain) for trial, _ in trials]
    frame["families"] = [trial.plain.get("terrain") for trial, _ in trials]
    frame["cause"] = [None if e is None or e.result is None else cause_of(e.result) for _, e in trials]
    rows = list(dict.fromkeys(frame["row"]))
    parts = {row: frame[frame["row"] == row] for row in rows} | ({ALL: frame} if len(rows) > 1 else {})
    cells = []
    for row, part in parts.items():
        values = part.pivot(index=GROUND, columns="arm", values="value")
        walked = values.dropna(axis="columns", how="all")
        common = walked.dropna().index if part["cell"].nunique() > 1 else values.index
        base = values.reindex(columns=[reference])[reference]
        for arm in (each for each in study.arms if each in values):
            own = part[part["arm"] == arm].set_index(GROUND)
            cells.append(_table_cell(row, arm, own, common, None if arm == reference else base))
    corrected = holm([None if cell.row == ALL else cell.p for cell in cells])
    found = tuple(replace(cell, p_corrected=p) for cell, p in zip(cells, corrected, strict=True))
    return StudyTable(study, name, completed_only, by, reference, tuple(parts), found)


def _table_cell(
    row: str, arm: str, own: pd.DataFrame, common: pd.Index[Any], base: pd.Series | None
) -> TableCell:
    """Return the result of an arm in a row, by its trials at their grounds, before the correction of its p-value.

    Means are over the common grounds; the difference is that to the values of the reference, None for itself.
    """
    known = own[own["value"].notna()]
    counted = known[known.index.isin(common)]
    clusters = "families" if counted["families"].nunique() >= FAMILIES else "layouts"
    difference = p = None
    if base is not None:
        more = (known["value"] - base.reindex(known.index)).dropna()
        units = known.loc[more.index, clusters].tolist()
        difference = mean_interval(more.tolist(), units)
        p = sign_flip_p(more.tolist(), units) if units else None
    done = own[own["status"] == "done"]
    outcomes = done["outcome"].value_counts().to_dict() if "outcome" in done else {}
    total = sum(outcomes.values())
    beside = [n for n in COLUMNS if total and n in counted and counted[n].notna().any()]
    return TableCell(
        row=row,
        arm=arm,
        estimate=mean_interval(counted["value"].tolist(), counted[clusters].tolist()),
        difference=difference,
        p=p,
        p_corrected=None,
        statuses=own["status"].value_counts().to_dict(),
        outcomes=outcomes,
        completed=share_interval(outcomes.get("completed", 0), total) if total else None,
        falls=done["cause"].value_counts().to_dict() if total else {},
        steps=int(_numbers(done, "steps_done").sum()) if total and "steps_done" in done else 0,
        beside={n: float(_numbers(counted, n).mean()) for n in beside},
        clusters=clusters,
    )


def _values(frame: pd.DataFrame, name: str, *, completed_only: bool) -> pd.Series:
    """Return a number of each result, such as "zmp_error.mean"; NaN where it was not measured or is not counted."""
    import pandas as pd  # noqa: PLC0415 - slow to import

    counts = frame["status"] == "done"
    absent = [part for part in (name, *["outcome"] * completed_only) if part not in frame]
    if absent:
        if counts.any():
            unknown_name("part of a result", absent[0], [each for each in frame if each not in KEYS])
        return pd.Series(float("nan"), frame.index)
    if completed_only:
        counts &= frame["outcome"] == "completed"
    return _numbers(frame, name).where(counts)


def _numbers(frame: pd.DataFrame, name: str) -> pd.Series:
    """Return a column of the results as numbers; an `InputError` if they are none."""
    import pandas as pd  # noqa: PLC0415 - slow to import

    try:
        return pd.to_numeric(frame[name]).astype(float)
    except (TypeError, ValueError, OverflowError) as error:
        raise InputError(f"'{name}' of the results must be numbers: {error}") from error


def layout_of(spec: Mapping[str, Any]) -> Hashable:
    """Return what tells the layout of a trial from others, ground and seed; trials that agree share the ground."""
    return spec.get("terrain"), spec.get("amplitude"), canonical(spec.get("terrain_params")), spec.get("seed")


def _row(spec: Mapping[str, Any], by: Sequence[str]) -> str:
    """Return the name of the row of a trial when cells are put together."""
    values = {name: part_of(spec, name) for name in by}
    return ", ".join(
        f"{name.rpartition('.')[2]} {str(value).removesuffix('.0')}"
        if isinstance(value, (int, float))
        else str(value)
        for name, value in values.items()
    )


def part_of(spec: Mapping[str, Any], name: str) -> Any:
    """Return a part of a spec as plain data by its dotted name."""
    try:
        return functools.reduce(operator.getitem, name.split("."), spec)
    except (LookupError, TypeError):
        known = [f"{a}.{b}" for a, v in spec.items() if isinstance(v, Mapping) for b in v]
        unknown_name("part of a spec", name, [*spec, *known])
