"""Tables of a study: means with intervals, paired differences, outcomes; and its rows for a spreadsheet."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from wbc.core.arguments import checked
from wbc.core.errors import InputError, unknown_name
from wbc.core.settings import to_json
from wbc.sim.studies.intervals import (
    CONFIDENCE,
    Equivalence,
    Estimate,
    equivalence,
    holm,
    mean_interval,
    paired_difference,
    pairs_of,
    share_interval,
    share_text,
    sign_flip_p,
)
from wbc.sim.studies.journal import Entry, canonical
from wbc.sim.studies.study import ALL, METRICS, Study, StudyTrial, study_entries


@dataclass(frozen=True)
class TableCell:
    """Result of one arm in one row.

    Attributes:
        row: Name of the row.
        arm: Name of the arm.
        estimate: Mean of the metric; in a row of several cells over the grounds that all arms of the row have.
        difference: Difference to the reference arm, pair by pair; None for the reference itself.
        p: p-value of no difference, by flipping signs (`sign_flip_p`).
        p_corrected: The same corrected for the number of rows and arms that are compared (`holm`); None in the row of
            all cells, which repeats the others.
        equivalence: Test of no difference beyond a margin; None without a margin.
        statuses: Status of the trials → number; "missing" have not been run.
        outcomes: Outcome of the walks → number.
        completed: Share of completed walks: ends of its exact interval; None without walks.
        fall_reasons: Reason of the falls → number.
        directions: Direction in which falls began → number.
    """

    row: str
    arm: str
    estimate: Estimate
    difference: Estimate | None
    p: float | None
    p_corrected: float | None
    equivalence: Equivalence | None
    statuses: dict[str, int]
    outcomes: dict[str, int]
    completed: tuple[float, float] | None
    fall_reasons: dict[str, int]
    directions: dict[str, int]

    def to_json(self) -> dict[str, Any]:
        """Return the result as plain values."""
        values = to_json(self)
        return {"row": values.pop("row"), "arm": values.pop("arm"), **values.pop("estimate"), **values}


@dataclass(frozen=True)
class StudyTable:
    """The table of a study.

    Attributes:
        study: The study.
        metric: Part of the results that the table is about.
        completed_only: Only completed walks are counted.
        by: Parts of the specs by which cells were put together; empty if each cell is a row.
        reference: Arm that the others are compared with.
        margin: Difference that counts as none; None if equivalence is not tested.
        rows: Names of the rows; the last one has all cells together if there are several.
        cells: Results, row by row.
    """

    study: Study
    metric: str
    completed_only: bool
    by: tuple[str, ...]
    reference: str
    margin: float | None
    rows: tuple[str, ...]
    cells: tuple[TableCell, ...]

    def to_json(self) -> dict[str, Any]:
        """Return the table as plain values."""
        return {
            "study": self.study.name,
            "metric": self.metric,
            "completed_only": self.completed_only,
            "by": list(self.by),
            "confidence": CONFIDENCE,
            "reference": self.reference,
            "margin": self.margin,
            "cells": [cell.to_json() for cell in self.cells],
        }

    @property
    def by_name(self) -> dict[tuple[str, str], TableCell]:
        """Row and arm → result."""
        return {(cell.row, cell.arm): cell for cell in self.cells}

    def markdown(self) -> str:
        """Return three tables: means, paired differences, outcomes; in brackets the number of trials or pairs."""
        arms, cells = list(self.study.arms), self.by_name
        which = ", completed walks alone" if self.completed_only else ""
        parts = [
            f"{self.metric}{which}: mean [95 % interval]\n\n" + _grid(self.rows, arms, cells, _mean_text)
        ]
        if len(arms) > 1:
            title = (
                f"Difference to '{self.reference}' on the same layouts: mean [95 % interval]; * p < 5 % after Holm's "
                "correction for all rows and arms"
            )
            if self.margin is not None:
                title += f"; = smaller than {self.margin:g} (two one-sided tests, 5 %)"
            others = [arm for arm in arms if arm != self.reference]
            parts.append(title + "\n\n" + _grid(self.rows, others, cells, _difference_text))
        if any(cell.outcomes for cell in self.cells):
            parts.append("How they ended\n\n" + _grid(self.rows, arms, cells, _ending_text))
        return "\n\n".join(parts)


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


def _mean_text(cell: TableCell) -> str:
    return f"{cell.estimate.text()} ({cell.estimate.n})"


def _difference_text(cell: TableCell) -> str:
    if cell.difference is None:
        return ""
    marks = "*" if cell.p_corrected is not None and cell.p_corrected < 0.05 else ""
    marks += "=" if cell.equivalence is not None and cell.equivalence.equivalent else ""
    return f"{cell.difference.text()} ({cell.difference.n}){marks and ' ' + marks}"


def _ending_text(cell: TableCell) -> str:
    total = sum(cell.outcomes.values())
    parts = [share_text(cell.outcomes.get("completed", 0), total) if total else "0 of 0 completed"]
    parts += [f"{n} {reason}" for reason, n in sorted(cell.fall_reasons.items(), key=lambda item: -item[1])]
    parts += [f"{n} {direction}" for direction, n in sorted(cell.directions.items(), key=lambda i: -i[1])]
    parts += [
        f"{cell.outcomes[name]} {name}" for name in ("strayed", "unfinished") if cell.outcomes.get(name)
    ]
    bad = ("diverged", "timeout", "crashed", "missing")
    parts += [f"{cell.statuses[name]} {name}" for name in bad if cell.statuses.get(name)]
    return ", ".join(parts)


@dataclass
class _Column:
    """Results of one arm in one row, while they are collected."""

    values: dict[Hashable, float] = field(default_factory=dict)  # (cell, seed) → metric
    layouts: dict[Hashable, Hashable] = field(default_factory=dict)  # (cell, seed) → ground and seed
    statuses: Counter[str] = field(default_factory=Counter)
    outcomes: Counter[str] = field(default_factory=Counter)
    reasons: Counter[str] = field(default_factory=Counter)
    directions: Counter[str] = field(default_factory=Counter)

    def count(self, entry: Entry | None) -> None:
        """Count status, outcome and fall of a trial."""
        self.statuses["missing" if entry is None else entry.status] += 1
        result = None if entry is None or entry.status != "done" else entry.result
        if result is None or result.get("outcome") is None:
            return
        self.outcomes[result["outcome"]] += 1
        if result.get("fall_reason"):
            self.reasons[result["fall_reason"]] += 1
        if result.get("fall"):
            self.directions[result["fall"]["direction"]] += 1


@checked
def study_table(
    study: Study,
    entries: Mapping[str, Entry],
    *,
    metric: str | None = None,
    completed_only: bool = False,
    by: Sequence[str] = (),
    margin: float | None = None,
    any_code: bool = False,
) -> StudyTable:
    """Make the table of a study.

    Trials that diverged, crashed or timed out are counted, and enter no mean. In a row of several cells, means are over
    the grounds (cell and seed) that all its arms have, so that missing walks favour no arm; differences are over the
    grounds that an arm and the reference have. Intervals are those of layouts: cells that differ in the gait, say, walk
    the same layouts, which are drawn together.

    Args:
        study: The study.
        entries: Entries of a journal, by key.
        metric: Part of the results; that of the study when None.
        completed_only: Leave out walks that were not completed, and their pairs.
        by: Parts of the specs, such as "terrain" or "gait.swing_height": cells that agree in them are one row. Without
            any, each cell is a row.
        margin: Difference that counts as none, in the unit of the metric, to test for equivalence.
        any_code: Take results of other versions of the code, too.

    Raises:
        UnknownNameError: A metric that no result has, or a part that no spec has.
    """
    name = metric or study.metric or METRICS[study.kind]
    reference = study.reference or next(iter(study.arms))
    columns: dict[tuple[str, str], _Column] = {}
    members: dict[str, set[str]] = {}  # row → its cells
    trials = list(study_entries(study, entries, any_code=any_code))
    reach = reach_of((entry for _, entry in trials), name)
    for trial, entry in trials:
        row = _row(trial, by) if len(by) else trial.cell
        value = value_of(entry, name, completed_only=completed_only)
        layout = layout_of(trial.plain)
        for title in (row, ALL):
            members.setdefault(title, set()).add(trial.cell)
            column = columns.setdefault((title, trial.arm), _Column())
            column.count(entry)
            if value is not None:
                column.values[trial.cell, trial.seed] = value
                column.layouts[trial.cell, trial.seed] = layout
    rows = [row for row in members if row != ALL]
    if len(rows) > 1:
        rows.append(ALL)
    cells = []
    for row in rows:
        in_row = {arm: columns[row, arm] for arm in study.arms if (row, arm) in columns}
        common = _common(in_row) if len(members[row]) > 1 else None
        base = in_row[reference].values if reference in in_row else {}
        for arm, column in in_row.items():
            values, layouts = column.values, column.layouts
            counted = [pair for pair in values if common is None or pair in common]
            differences = {} if arm == reference else pairs_of(values, base)
            compared = list(differences.values()), [layouts[pair] for pair in differences]
            total, done = sum(column.outcomes.values()), column.outcomes["completed"]
            cells.append(
                TableCell(
                    row=row,
                    arm=arm,
                    estimate=mean_interval(
                        [values[pair] for pair in counted], [layouts[pair] for pair in counted]
                    ),
                    difference=None if arm == reference else paired_difference(values, base, layouts=layouts),
                    p=sign_flip_p(*compared) if differences else None,
                    p_corrected=None,
                    equivalence=equivalence(compared[0], margin, compared[1], reach=reach)
                    if differences and margin is not None
                    else None,
                    statuses=dict(column.statuses),
                    outcomes=dict(column.outcomes),
                    completed=share_interval(done, total) if total else None,
                    fall_reasons=dict(column.reasons),
                    directions=dict(column.directions),
                )
            )
    corrected = holm([None if cell.row == ALL else cell.p for cell in cells])
    found = tuple(replace(cell, p_corrected=p) for cell, p in zip(cells, corrected, strict=True))
    return StudyTable(study, name, completed_only, tuple(by), reference, margin, tuple(rows), found)


def layout_of(spec: Mapping[str, Any]) -> Hashable:
    """Return what tells the layout of a trial from others: ground and seed; trials that agree in it share the ground.

    Args:
        spec: Spec of the trial, as plain values.
    """
    return spec.get("terrain"), spec.get("amplitude"), canonical(spec.get("terrain_params")), spec.get("seed")


def _common(columns: Mapping[str, _Column]) -> set[Hashable]:
    """Return the grounds that all arms with any values have."""
    sets = [set(column.values) for column in columns.values() if column.values]
    return set.intersection(*sets) if sets else set()


def _row(trial: StudyTrial, by: Sequence[str]) -> str:
    """Return the name of the row of a trial when cells are put together."""
    values = [part_of(trial.plain, name, "part of a spec") for name in by]
    return ", ".join(
        f"{name.rpartition('.')[2]} {value:g}" if isinstance(value, (int, float)) else str(value)
        for name, value in zip(by, values, strict=True)
    )


def value_of(entry: Entry | None, name: str, *, completed_only: bool = False) -> float | None:
    """Return a number of a trial's result; None where it was not measured or is not counted.

    Args:
        entry: The trial's entry; None if it has not been run.
        name: Part of the result, such as "zmp_error.mean".
        completed_only: Only walks that were completed are counted.

    Raises:
        UnknownNameError: The result has no such part.
        InputError: The part is no number.
    """
    if entry is None or entry.status != "done" or entry.result is None:
        return None
    if completed_only and entry.result.get("outcome") != "completed":
        return None
    value = part_of(entry.result, name, "part of a result")
    if value is None:
        return None
    if isinstance(value, (bool, int, float)):
        return float(value)
    raise InputError(f"'{name}' of a result is no number but {value!r}")


def reach_of(entries: Iterable[Entry | None], name: str) -> float | None:
    """Return the greatest difference that two results can have; None where there is no limit to it.

    Args:
        entries: Entries of the trials; None for those that have not been run.
        name: Part of the results: the steps done differ by those planned, answers of yes or no by 1.
    """
    results = [each.result for each in entries if each is not None and each.status == "done" and each.result]
    if name == "steps_done":
        planned = [float(result.get("steps_planned") or 0.0) for result in results]
        done = [float(result["steps_done"]) for result in results]  # more than planned where steps were added
        return max((*planned, *done), default=None) if all(planned) else None
    values = [part_of(result, name, "part of a result") for result in results]
    answers = [value for value in values if value is not None]
    return 1.0 if answers and all(isinstance(value, bool) for value in answers) else None


def study_rows(
    study: Study, entries: Mapping[str, Entry], *, any_code: bool = False
) -> tuple[list[str], list[list[Any]]]:
    """Return all trials of a study as rows for a spreadsheet or a data frame.

    Args:
        study: The study.
        entries: Entries of a journal, by key.
        any_code: Take results of other versions of the code, too.

    Returns:
        Names of the columns and the rows: cell, arm, seed, status, and every part of the results that is no list, such
        as "zmp_error.mean"; None where a trial does not have it.
    """
    first = ["cell", "arm", "seed", "status"]
    found: list[tuple[list[Any], dict[str, Any]]] = []
    columns: dict[str, None] = {}
    for trial, entry in study_entries(study, entries, any_code=any_code):
        status = "missing" if entry is None else entry.status
        parts = flattened({} if entry is None else entry.result or {})
        columns |= dict.fromkeys(parts)
        found.append(([trial.cell, trial.arm, trial.seed, status], parts))
    names = [name for name in columns if name not in first]
    return [*first, *names], [[*head, *(parts.get(name) for name in names)] for head, parts in found]


def flattened(data: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Return plain values by their dotted names; lists are left out."""
    result: dict[str, Any] = {}
    for key, value in data.items():
        if isinstance(value, Mapping):
            result |= flattened(value, f"{prefix}{key}.")
        elif not isinstance(value, (list, tuple)):
            result[prefix + key] = value
    return result


def part_of(data: Mapping[str, Any], name: str, what: str) -> Any:
    """Return a part of plain data by its dotted name.

    Args:
        data: Objects within objects.
        name: Such as "zmp_error.mean".
        what: Noun for the message, such as "part of a spec".

    Raises:
        UnknownNameError: There is no such part.
    """
    value: Any = data
    for key in name.split("."):
        if not isinstance(value, Mapping) or key not in value:
            known = [f"{a}.{b}" for a, v in data.items() if isinstance(v, Mapping) for b in v]
            unknown_name(what, name, [*data, *known])
        value = value[key]
    return value
