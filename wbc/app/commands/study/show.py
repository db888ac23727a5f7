"""`wbc study`: the studies, and the tables and figures of their journals; `wbc.app.commands.study.run` runs them."""

from __future__ import annotations

import csv
import json
import logging
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from wbc.app.files import check_target, read_object
from wbc.app.output import Flat, Output, OutputOptions, Report, reports
from wbc.core.errors import InputError
from wbc.core.files import replacing
from wbc.core.settings import Positive, settings, to_json
from wbc.sim.studies.catalog import STUDIES, study_by_name
from wbc.sim.studies.journal import Entry, read_journal
from wbc.sim.studies.study import Study, left_out
from wbc.sim.studies.study_table import StudyTable, study_rows, study_table
from wbc.sim.studies.swing_summary import swing_summaries, swing_table

logger = logging.getLogger(__name__)

StudyName = Annotated[
    str, Parameter(help="Study: the name of one that `wbc study list` shows, or a file with one as JSON.")
]


@settings(kw_only=True)
class JournalOptions:
    """Journal that a result is made from.

    Attributes:
        journal: File that `wbc study run` has written.
    """

    journal: Path

    def entries(self) -> Mapping[str, Entry]:
        """Return the entries of the journal.

        Raises:
            InputError: There is no journal.
        """
        if not self.journal.exists():
            raise InputError(f"there is no journal {self.journal}; `wbc study run` writes it")
        return read_journal(self.journal)


@settings(kw_only=True)
class ShownPartOptions:
    """Part of a study.

    Attributes:
        cell: Only these cells, by name or beginning of a name.
        arm: Only these arms.
        seeds: Only the first so many seeds.
        scale: Only this share of the seeds, at least one.
    """

    cell: tuple[str, ...] = ()
    arm: tuple[str, ...] = ()
    seeds: int | None = None
    scale: float = 1.0

    def part(self, study: str) -> Study:
        """Return this part of a study."""
        return read_study(study).narrowed(self.cell, self.arm, self.seeds).scaled(self.scale)


@settings(kw_only=True)
class PartOptions(ShownPartOptions):
    """Part of a study, with results.

    Attributes:
        any_code: Take results of other versions of the code, too.
    """

    any_code: bool = False

    def read(self, study: str, options: JournalOptions) -> tuple[Study, Mapping[str, Entry], dict[str, Any]]:
        """Return this part of a study, the entries of a journal, and the numbers of those left out, with a warning."""
        chosen, entries = self.part(study), options.entries()
        return chosen, entries, note_left_out(chosen, entries, any_code=self.any_code)


@settings(kw_only=True)
class TableOptions(JournalOptions):
    """Metric and rows of a table.

    Attributes:
        metric: Part of the results, such as steps_done, zmp_error.mean or peak_torque_ratio; that of the study when
            not given.
        completed: Only walks that were completed.
        by: Part of the specs, such as terrain or gait.swing_height; cells that agree in it become one row. May be given
            several times.
        margin: Difference that counts as none, in the unit of the metric: differences are tested for being smaller.
    """

    metric: str | None = None
    completed: bool = False
    by: tuple[str, ...] = ()
    margin: Positive | None = None

    def table(self, study: Study, entries: Mapping[str, Entry], *, any_code: bool) -> StudyTable:
        """Return the table."""
        return study_table(
            study,
            entries,
            metric=self.metric,
            completed_only=self.completed,
            by=self.by,
            margin=self.margin,
            any_code=any_code,
        )


@settings(kw_only=True)
class FigureOptions(TableOptions):
    """Metric and rows of a table, and the figure of it.

    Attributes:
        out: Figure to write (.png, .svg or .pdf).
    """

    out: Annotated[Path, Parameter(alias="-o")]


@settings(kw_only=True)
class ExportOptions(JournalOptions):
    """Journal and the spreadsheet made from it.

    Attributes:
        out: Table to write (.csv), a row for each trial.
    """

    out: Annotated[Path, Parameter(alias="-o")]


@reports
def list_studies(*, output: OutputOptions = Output()) -> Report:
    """List the studies that come with the library."""
    facts = [study_facts(name) for name in STUDIES]
    lines = [f"{fact['name']:<22} {fact['trials'] or '':>5} trials  {fact['about']}" for fact in facts]
    return output.report({"studies": facts}, "\n".join(lines))


def study_facts(name: str) -> dict[str, Any]:
    """Return name, question and number of trials of a study; the reason if it depends on one that was not run."""
    try:
        study = study_by_name(name)
    except InputError as error:
        return {"name": name, "about": f"not yet: {error}", "trials": None}
    return {"name": name, "about": study.about, "trials": study.size}


@reports
def show(
    study: StudyName,
    /,
    *,
    part: Flat[ShownPartOptions] = ShownPartOptions(),
    output: OutputOptions = Output(),
) -> Report:
    """Print a study as JSON, to be changed and run."""
    chosen = part.part(study)
    for _ in chosen.trials():
        pass  # what cannot be run is refused, as `run` refuses it
    data = chosen.to_json()
    return output.report(data, json.dumps(data, indent=2))


@reports
def table(
    study: StudyName,
    /,
    *,
    options: Flat[TableOptions],
    part: Flat[PartOptions] = PartOptions(),
    output: OutputOptions = Output(),
) -> Report:
    """Make the table of a study: means with intervals, paired differences, how walks ended. As Markdown or JSON."""
    chosen, entries, unused = part.read(study, options)
    made = options.table(chosen, entries, any_code=part.any_code)
    return output.report(made.to_json() | unused, made.markdown())


@reports
def plot(
    study: StudyName,
    /,
    *,
    options: Flat[FigureOptions],
    part: Flat[PartOptions] = PartOptions(),
    output: OutputOptions = Output(),
) -> Report:
    """Draw the table of a study: each arm's mean and its difference to the reference, with intervals."""
    from wbc.app.plot.output import check_output, save  # noqa: PLC0415 - slow to import
    from wbc.app.plot.study import study_figure  # noqa: PLC0415

    target = check_output(options.out, [options.journal, study])
    chosen, entries, unused = part.read(study, options)
    made = options.table(chosen, entries, any_code=part.any_code)
    save({made.study.name: study_figure(made)}, target)
    return output.report({"figure": str(target), **made.to_json(), **unused}, str(target))


@reports
def export(
    study: StudyName,
    /,
    *,
    options: Flat[ExportOptions],
    part: Flat[PartOptions] = PartOptions(),
    output: OutputOptions = Output(),
) -> Report:
    """Write all results of a study to a table, for a spreadsheet or a data frame."""
    target = check_target("a table", options.out, (".csv",), [options.journal, study])
    chosen, entries, unused = part.read(study, options)
    columns, rows = study_rows(chosen, entries, any_code=part.any_code)
    with replacing(target) as new, new.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(columns)
        writer.writerows(rows)
    data = {"table": str(target), "rows": len(rows), "columns": columns, **unused}
    return output.report(data, f"{len(rows)} rows with {len(columns)} columns written to {target}")


@reports
def swings(
    study: StudyName,
    /,
    *,
    options: Flat[JournalOptions],
    part: Flat[PartOptions] = PartOptions(),
    output: OutputOptions = Output(),
) -> Report:
    """Sum up the swings of soles of variable stiffness: reached in time, error of the scan, time before touch-down."""
    chosen, entries, unused = part.read(study, options)
    summaries = swing_summaries(chosen, entries, any_code=part.any_code)
    if not summaries:
        raise InputError(f"{options.journal} has no walk of '{chosen.name}' on soles of variable stiffness")
    return output.report({"study": chosen.name, "rows": to_json(summaries), **unused}, swing_table(summaries))


def note_left_out(study: Study, entries: Mapping[str, Entry], *, any_code: bool) -> dict[str, Any]:
    """Warn of entries of a journal that are not used, and return their numbers as a part of a result."""
    unused = left_out(study, entries, any_code=any_code)
    text = unused.text()
    if text is not None:
        logger.warning("%s", text)
    return {"left_out": to_json(unused)}


def read_study(name: str) -> Study:
    """Return a study by name, or out of a file.

    Raises:
        UnknownNameError: Neither a study nor a file.
        InputError: The file holds no study.
    """
    path = Path(name)
    if name in STUDIES or not (path.suffix == ".json" or path.exists()):
        return study_by_name(name)
    return Study.from_json(read_object("study", path))
