"""`wbc study show` and `table`: the studies, and tables and figures of their journals."""

from __future__ import annotations

import csv
import json
import logging
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import Parameter
from pydantic import Field

from wbc.app.files import check_picture, check_target, read_object
from wbc.app.output import Flat, Output, OutputOptions, Report, reports
from wbc.core.changes import changed, read_changes
from wbc.core.errors import InputError
from wbc.core.files import replacing, write_text
from wbc.core.settings import Count, Positive, settings, to_json
from wbc.sim.studies.best_stiffness import label_table, labels, stiffness_table
from wbc.sim.studies.catalog import STUDIES, study_by_name
from wbc.sim.studies.journal import Entry, read_journal
from wbc.sim.studies.paper.choice import DEFAULT_MARGIN, choice
from wbc.sim.studies.stiffness_studies import DatasetSize, dataset, half_heights
from wbc.sim.studies.study import Study, left_out, study_entries
from wbc.sim.studies.study_table import study_rows, study_table
from wbc.sim.studies.swing_summary import swing_summaries, swing_table

logger = logging.getLogger(__name__)

StudyName = Annotated[
    str, Parameter(help="Study: the name of one that `wbc study show` lists, or a file with one as JSON.")
]


def entries_of(journal: Path, *, any_code: bool = False) -> Mapping[str, Entry]:
    """Return the entries of a journal; `InputError` if there is none."""
    if not journal.exists():
        raise InputError(f"there is no journal {journal}; `wbc study run` writes it")
    return read_journal(journal, any_code=any_code)


@settings(kw_only=True)
class ShownPartOptions:
    """Part of a study.

    Attributes:
        cell: Only these cells, by name or beginning of a name.
        arm: Only these arms.
        seeds: Only the first so many seeds.
        set: Size of the study dataset, each as name=value: seeds, amplitudes, evaluations, distance, height.
    """

    cell: tuple[str, ...] = ()
    arm: tuple[str, ...] = ()
    seeds: int | None = None
    set: tuple[str, ...] = ()

    def part(self, study: str) -> Study:
        """Return this part of a study."""
        return read_study(study, self.set).narrowed(self.cell, self.arm, self.seeds)


@settings(kw_only=True)
class PartOptions(ShownPartOptions):
    """Part of a study, with results.

    Attributes:
        any_code: Take results of other versions of the code, too.
    """

    any_code: bool = False

    def read(self, study: str, journal: Path) -> tuple[Study, Mapping[str, Entry], dict[str, Any]]:
        """Return this part of a study, the entries of a journal, and the numbers of those left out, with a warning."""
        chosen, entries = self.part(study), entries_of(journal, any_code=self.any_code)
        unused = left_out(chosen, entries)
        if (text := unused.text()) is not None:
            logger.warning("%s", text)
        return chosen, entries, {"left_out": to_json(unused)}


@settings(kw_only=True)
class TableOptions:
    """What is made of a journal, and what is written of it.

    Attributes:
        journal: File that `wbc study run` has written.
        of: arms (means with intervals and paired differences), swings of variable soles, heights at which half of the
            walks are completed, best (stiffness of each cell), or choice (best arm of each ground, and its worth).
        metric: Part of the results, such as steps_done, zmp_error.mean or peak_torque_ratio; that of the study if not
            given.
        completed: Only walks that were completed.
        by: Part of the specs, such as terrain or gait.swing_height; cells that agree in it become one row. May be given
            several times.
        margin: Difference that counts as none, in the unit of the metric.
        separate: Find each best stiffness from its own walks alone; else the curve of the other cells is the prior.
        chosen_by: Number of seeds, the first ones, that make a choice; the others judge it. Folds if not given.
        table: Table to write (.csv) of best and choice that `wbc stiffness train` makes a model of.
        windows: Profiles of that table that are cut out of each ground, as long as a foot's scan.
        out: File to write: a figure of the arms (.png, .svg, .pdf), a row for each trial (.csv), the result (.json).
    """

    journal: Path
    of: Literal["arms", "swings", "heights", "best", "choice"] = "arms"
    metric: str | None = None
    completed: bool = False
    by: tuple[str, ...] = ()
    margin: Positive | None = None
    separate: bool = False
    chosen_by: Count | None = None
    table: Path | None = None
    windows: Annotated[int, Field(ge=2)] = 6
    out: Annotated[Path | None, Parameter(alias="-o")] = None

    def __post_init__(self) -> None:
        for each in fields(self):
            if each.name in OPTIONS[self.of] or not any(each.name in names for names in OPTIONS.values()):
                continue
            if getattr(self, each.name) != each.default:
                raise InputError(f"--{each.name.replace('_', '-')} is no option of --of {self.of}")


OPTIONS = {
    "arms": ("metric", "completed", "by", "margin"),
    "swings": (),
    "heights": (),
    "best": ("separate", "table", "windows"),
    "choice": ("metric", "margin", "chosen_by", "table", "windows"),
}
"""What is made of a journal → options that belong to it."""


def study_facts(name: str) -> dict[str, Any]:
    """Return name, question and number of trials of a study; the reason if it depends on one that was not run."""
    try:
        study = study_by_name(name)
    except InputError as error:
        return {"name": name, "about": f"not yet: {error}", "trials": None}
    return {"name": name, "about": study.about, "trials": study.size}


@reports
def show(
    study: Annotated[
        str | None, Parameter(help="Study, or a file with one; all are listed when left out.")
    ] = None,
    /,
    *,
    part: Flat[ShownPartOptions] = ShownPartOptions(),
    output: OutputOptions = Output(),
) -> Report:
    """Print a study as JSON, to be changed and run, or list those that come with the library."""
    if study is None:
        facts = [study_facts(name) for name in STUDIES]
        lines = [f"{fact['name']:<22} {fact['trials'] or '':>5} trials  {fact['about']}" for fact in facts]
        return output.report({"studies": facts}, "\n".join(lines))
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
    """Make a table of a study from its journal, a figure, a spreadsheet, or data to learn from."""
    out: Path | None = options.out
    inputs: list[str | Path] = [options.journal, study]
    figure = options.of == "arms" and out is not None and out.suffix.lower() not in (".csv", ".json")
    if figure:
        out = check_picture(out, inputs)
    elif out is not None:
        endings = (".csv", ".json") if options.of == "arms" else (".json",)
        out = check_target("a result", out, endings, inputs)
    target = None
    if options.table is not None:
        target = check_target("a stiffness table", options.table, (".csv",), inputs)
    chosen, entries, unused = part.read(study, options.journal)
    if out is not None and out.suffix.lower() == ".csv":
        return output.report(*_export(chosen, entries, out, unused))
    data, text, found = _made(chosen, entries, options, part.arm, out if figure else None)
    if out is not None and not figure:
        write_text(out, json.dumps(data, indent=1) + "\n")
    if target is not None:
        stiffness_table(chosen, found, windows=options.windows, made=data).save(target)
    return output.report(data | unused, text)


def _made(
    study: Study,
    entries: Mapping[str, Entry],
    options: TableOptions,
    arms: tuple[str, ...],
    picture: Path | None,
) -> tuple[dict[str, Any], str, Any]:
    """Return what is made of a journal as plain values and as text, and its labels of stiffness, if any.

    Of the arms a picture is drawn if asked for: the mean of each and its difference to the reference, with intervals.
    """
    if options.of == "arms":
        table = study_table(
            study,
            entries,
            metric=options.metric,
            completed_only=options.completed,
            by=options.by,
            margin=options.margin,
        )
        if picture is None:
            return table.to_json(), table.markdown(), {}
        from wbc.app.plot.output import save  # noqa: PLC0415 - slow to import
        from wbc.app.plot.study import study_figure  # noqa: PLC0415

        save({table.study.name: study_figure(table)}, picture)
        return {"figure": str(picture), **table.to_json()}, str(picture), {}
    if options.of == "swings":
        summaries = swing_summaries(study, entries)
        if not summaries:
            raise InputError(
                f"{options.journal} has no walk of '{study.name}' on soles of variable stiffness"
            )
        return {"study": study.name, "rows": to_json(summaries)}, swing_table(summaries), {}
    if options.of == "choice":
        chosen = choice(
            study,
            entries,
            arms,
            metric=options.metric,
            margin=DEFAULT_MARGIN if options.margin is None else options.margin,
            chosen_by=options.chosen_by,
        )
        stiffness = {} if options.table is None else chosen.labels(study)
        return chosen.to_json() | origin(study, entries), chosen.markdown(), stiffness
    data = {"study": study.name, **origin(study, entries)}
    if options.of == "heights":
        heights = half_heights(study, entries)
        if not heights:
            raise InputError(f"{options.journal} has no walks of '{study.name}'; run the study")
        text = "\n".join(f"{name:<20} {1e3 * height:5.1f} mm" for name, height in heights.items())
        return data | {"heights_m": heights}, text, {}
    found = labels(study, entries, pooled=not options.separate)
    if not found:
        raise InputError(
            f"{options.journal} has no cell of '{study.name}' with walks of enough stiffnesses; run the study"
        )
    return data | {"separate": options.separate, "labels": to_json(found)}, label_table(found), found


def _export(
    study: Study, entries: Mapping[str, Entry], target: Path, unused: dict[str, Any]
) -> tuple[dict[str, Any], str]:
    """Write all results to a table, for a spreadsheet or a data frame."""
    columns, rows = study_rows(study, entries)
    with replacing(target) as new, new.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(columns)
        writer.writerows(rows)
    data = {"table": str(target), "rows": len(rows), "columns": columns, **unused}
    return data, f"{len(rows)} rows with {len(columns)} columns written to {target}"


def origin(study: Study, entries: Mapping[str, Entry]) -> dict[str, Any]:
    """Return the origin of a result: counts of trials by status, versions of the code, seeds."""
    found = study_entries(study, entries)
    used = [(trial, entry) for trial, entry in found if entry is not None]
    versions = {json.dumps(entry.version, sort_keys=True) for _, entry in used}
    return {
        "trials": dict(Counter(entry.status for _, entry in used)),
        "versions": [json.loads(version) for version in sorted(versions)],
        "seeds": sorted({trial.seed for trial, _ in used}),
    }


def read_study(name: str, size: Sequence[str] = ()) -> Study:
    """Return a study by name, or out of a file; size is that of the study 'dataset', each as name=value.

    Raises `UnknownNameError` for neither, `InputError` for a file without a study, or a size for another study.
    """
    if size:
        if name != "dataset":
            raise InputError(f"the study 'dataset' alone has a size to --set, got '{name}'")
        return dataset(changed(DatasetSize(), read_changes(size)))
    path = Path(name)
    if name in STUDIES or not (path.suffix == ".json" or path.exists()):
        return study_by_name(name)
    return Study.from_json(read_object("study", path))
