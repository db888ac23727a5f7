"""`wbc study best`, `choice`, `heights`, `dataset`: from walks to the best stiffness and the table of a model."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter
from pydantic import Field

from wbc.app.commands.study.run import RunOptions, run_trials, summary_text
from wbc.app.commands.study.show import (
    JournalOptions,
    PartOptions,
    StudyName,
)
from wbc.app.files import check_target
from wbc.app.output import Flat, Output, OutputOptions, Report, reports
from wbc.core.errors import InputError
from wbc.core.files import write_text
from wbc.core.settings import Count, Positive, settings, to_json
from wbc.sim.studies.best_stiffness import label_table, labels, stiffness_table
from wbc.sim.studies.journal import Entry, read_journal
from wbc.sim.studies.paper.choice import DEFAULT_MARGIN
from wbc.sim.studies.paper.choice import choice as make_choice
from wbc.sim.studies.stiffness_studies import DatasetSize, half_heights
from wbc.sim.studies.stiffness_studies import dataset as dataset_study
from wbc.sim.studies.study import Study, study_entries


@settings(kw_only=True)
class TableOptions(JournalOptions):
    """Table that a stiffness model learns from.

    Attributes:
        table: Table to write (.csv) that `wbc stiffness train` makes a model of: profiles of the cells' grounds, each
            with the best stiffness of its cell.
        windows: Profiles of that table that are cut out of each ground, as long as a foot's scan.
    """

    table: Path | None = None
    windows: Annotated[int, Field(ge=2)] = 6

    def target(self) -> Path | None:
        """Return the table to write, if any, before any work starts."""
        if self.table is None:
            return None
        return check_target("a stiffness table", self.table, (".csv",), [self.journal])


@settings(kw_only=True)
class BestOptions(TableOptions):
    """Walks that the best stiffness comes from.

    Attributes:
        separate: Find the best stiffness of each cell from its own walks alone; otherwise the curve of the other cells
            is the prior.
        out: File to write the result to as JSON (.json), as studies of the library that rest on it read it.
    """

    separate: bool = False
    out: Annotated[Path | None, Parameter(name=("--output", "-o"))] = None


@settings(kw_only=True)
class ChoiceOptions(TableOptions):
    """Walks that a choice comes from.

    Attributes:
        metric: Part of the results, such as steps_done; more is better. That of the study when not given.
        margin: Gain that counts as none, in the unit of the metric.
        chosen_by: Number of seeds of the study, the first ones, that choose; the others judge. Folds when not given.
    """

    metric: str | None = None
    margin: Positive = DEFAULT_MARGIN
    chosen_by: Count | None = None


@settings(kw_only=True)
class DatasetOptions(DatasetSize):
    """Size of the dataset, and the table made from it.

    Attributes:
        output: Table to write (.csv).
        windows: Profiles that are cut out of each ground, as long as a foot's scan.
        separate: Find the best stiffness of each ground from its own walks alone, as in the paper; otherwise the curve
            of the other grounds is the prior.
        any_code: Take walks of other versions of the code, too.
    """

    output: Path
    windows: Annotated[int, Field(ge=2)] = 6
    separate: bool = False
    any_code: bool = False

    def command(self) -> str:
        """Return the command that makes the same table."""
        names = ("seeds", "amplitudes", "evaluations", "distance", "height", "windows")
        words = "wbc study dataset " + " ".join(f"--{name} {getattr(self, name):g}" for name in names)
        return words + (" --separate" if self.separate else "")


@reports
def dataset(
    *,
    options: Flat[RunOptions],
    size: Flat[DatasetOptions],
    output: OutputOptions = Output(),
) -> Report:
    """Find the best stiffness for ground and amplitude, and write the table that a stiffness model learns from.

    The walks that the journal does not have are run first; the size decides their number, from minutes to the paper's
    6,000 walks (50 evaluations, 2 seeds). `wbc stiffness train` makes a model of the table.
    """
    study = dataset_study(size)
    target = check_target("a stiffness table", size.output, (".csv",), [options.journal])
    summary = run_trials(study, options, any_code=size.any_code)
    entries = read_journal(options.journal)
    found = labels(study, entries, pooled=not size.separate, any_code=size.any_code)
    made = {"command": size.command(), **origin(study, entries, any_code=size.any_code)}
    table = stiffness_table(study, found, windows=size.windows, made=made)
    table.save(target)
    data = {"table": str(target), "rows": len(table), "labels": to_json(found), **summary.to_json()}
    lines = [
        summary_text(study, options, summary),
        label_table(found),
        f"{len(table)} rows written to {target}",
    ]
    return output.report(data, "\n".join(lines))


@reports
def best(
    study: StudyName,
    /,
    *,
    options: Flat[BestOptions],
    part: Flat[PartOptions] = PartOptions(),
    output: OutputOptions = Output(),
) -> Report:
    """Find the best stiffness of each cell of a study whose arms are stiffnesses, from its journal."""
    target, table = None, options.target()
    if options.out is not None:
        target = check_target("a result", options.out, (".json",), [options.journal, study])
    chosen, entries, unused = part.read(study, options)
    found = labels(chosen, entries, pooled=not options.separate, any_code=part.any_code)
    if not found:
        raise InputError(
            f"{options.journal} has no cell of '{chosen.name}' with walks of enough stiffnesses; run the study"
        )
    data = {
        "study": chosen.name,
        "separate": options.separate,
        **origin(chosen, entries, any_code=part.any_code),
        "labels": to_json(found),
    }
    if target is not None:
        write_text(target, json.dumps(data, indent=1) + "\n")
    if table is not None:
        stiffness_table(chosen, found, windows=options.windows, made=data).save(table)
    return output.report(data | unused, label_table(found))


@reports
def choice(
    study: StudyName,
    /,
    *,
    options: Flat[ChoiceOptions],
    part: Flat[PartOptions] = PartOptions(),
    output: OutputOptions = Output(),
) -> Report:
    """Find the best arm of each ground, and what choosing it there is worth over the best single one.

    Of the arms with a stiffness, or of those that --arm names. The worth is judged on layouts that nothing was chosen
    on.
    """
    table = options.target()
    chosen, entries, unused = part.read(study, options)
    made = make_choice(
        chosen,
        entries,
        part.arm,
        metric=options.metric,
        margin=options.margin,
        chosen_by=options.chosen_by,
        any_code=part.any_code,
    )
    data = made.to_json() | origin(chosen, entries, any_code=part.any_code)
    if table is not None:
        stiffness_table(chosen, made.labels(chosen), windows=options.windows, made=data).save(table)
    return output.report(data | unused, made.markdown())


@reports
def heights(
    study: StudyName = "halfway",
    /,
    *,
    options: Flat[JournalOptions],
    part: Flat[PartOptions] = PartOptions(),
    output: OutputOptions = Output(),
) -> Report:
    """Find the height of each ground at which half of the walks are completed, from a journal."""
    chosen, entries, unused = part.read(study, options)
    found = half_heights(chosen, entries, any_code=part.any_code)
    if not found:
        raise InputError(f"{options.journal} has no walks of '{chosen.name}'; run the study")
    data = {
        "study": chosen.name,
        **origin(chosen, entries, any_code=part.any_code),
        "heights_m": found,
        **unused,
    }
    return output.report(data, "\n".join(f"{name:<20} {1e3 * h:5.1f} mm" for name, h in found.items()))


def origin(study: Study, entries: Mapping[str, Entry], *, any_code: bool) -> dict[str, Any]:
    """Return the origin of a result: counts of trials by status, versions of the code, seeds."""
    found = study_entries(study, entries, any_code=any_code)
    used = [(trial, entry) for trial, entry in found if entry is not None]
    versions = {json.dumps(entry.version, sort_keys=True) for _, entry in used}
    return {
        "trials": dict(Counter(entry.status for _, entry in used)),
        "versions": [json.loads(version) for version in sorted(versions)],
        "seeds": sorted({trial.seed for trial, _ in used}),
    }
