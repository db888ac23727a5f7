"""`wbc study show`, `table` and `plot`: the studies, and tables and figures of their journals."""

from __future__ import annotations

import json
import logging
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from wbc.app.files import PICTURES, read_object
from wbc.app.output import Report, reports
from wbc.base.errors import InputError, one_line, printable
from wbc.base.files import check_target, replacing, write_text
from wbc.base.registry import allow_code
from wbc.base.settings import settings, to_json
from wbc.sim.studies.journal import Entry, read_journal
from wbc.sim.studies.study import Study, left_out
from wbc.sim.studies.study_table import StudyTable, study_frame, study_table

logger = logging.getLogger(__name__)

StudyFile = Annotated[Path, Parameter(help="File with a study as JSON, such as those of examples/studies.")]


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
        code: Python file that the study or its journal names and that may be run; may be given several times. Beside
            these, only the file of the study's own kind is run.
    """

    cell: tuple[str, ...] = ()
    arm: tuple[str, ...] = ()
    seeds: int | None = None
    code: tuple[Path, ...] = ()

    def __post_init__(self) -> None:
        allow_code(self.code)

    def part(self, study: Path) -> Study:
        """Return this part of a study in a file."""
        return read_study(study).narrowed(self.cell, self.arm, self.seeds)


@settings(kw_only=True)
class PartOptions(ShownPartOptions):
    """Part of a study, with results.

    Attributes:
        any_code: Take results of other versions of the code, too.
    """

    any_code: bool = False


@settings(kw_only=True)
class ResultOptions:
    """Part of the results in a journal, and the file that they are written to.

    Attributes:
        journal: File that `wbc study run` has written.
        metric: Part of the results, such as steps_done, zmp_error.mean or peak_torque_ratio; that of the study if not
            given.
        completed: Only walks that were completed.
        by: Part of the specs, such as terrain or gait.swing_height; cells that agree in it become one row. May be given
            several times.
        out: File to write. Of a table: a row for each trial, with units in the heads of the columns (.csv), or the
            result (.json). Of a figure: .png, .pdf, .svg or .jpg, the name of the journal with .png when not given.
    """

    journal: Path
    metric: str | None = None
    completed: bool = False
    by: tuple[str, ...] = ()
    out: Annotated[Path | None, Parameter(alias="-o")] = None

    def table(self, study: Study, entries: Mapping[str, Entry]) -> StudyTable:
        """Return the table of a study; what the entries of the journal cannot give is refused by its name."""
        try:
            return study_table(study, entries, metric=self.metric, completed_only=self.completed, by=self.by)
        except InputError as error:
            raise InputError(f"{self.journal}: {error}") from error


@reports
def show(
    study: Annotated[
        Path, Parameter(help="File with a study as JSON, or a folder whose studies are listed.")
    ],
    /,
    *,
    part: ShownPartOptions,
) -> Report:
    """Print a study, or a part of it, as JSON, or list the studies of a folder."""
    if study.is_dir():
        studies = [read_study(path) for path in sorted(study.glob("*.json"))]
        facts = [{"name": each.name, "about": each.about, "trials": each.size} for each in studies]
        lines = [
            f"{one_line(each.name):<22} {each.size:>5} trials  {one_line(each.about)}" for each in studies
        ]
        return Report({"studies": facts}, "\n".join(lines))
    chosen = part.part(study)
    for _ in chosen.trials():
        pass  # what cannot be run is refused, as `run` refuses it
    data = chosen.to_json()
    return Report(data, json.dumps(data, indent=2))


@reports
def table(study: StudyFile, /, *, options: ResultOptions, part: PartOptions) -> Report:
    """Make a table of a study from its journal, or a spreadsheet."""
    target = options.out
    if target is not None:
        target = check_target("a table", target, (".csv", ".json"), [options.journal, study])
    chosen, entries, unused = _results(study, options, part)
    if target is not None and target.suffix.lower() == ".csv":
        frame = study_frame(chosen, entries)
        with replacing(target) as new:
            heads = [_cell(chosen.titled(name)) for name in frame.columns]
            frame.map(_cell).to_csv(new, index=False, header=heads)
        facts = {"table": str(target), "rows": len(frame), "columns": list(frame.columns), **unused}
        return Report(facts, f"{len(frame)} rows with {len(frame.columns)} columns written to {target}")
    made = options.table(chosen, entries)
    data, text = made.to_json() | unused, made.markdown()
    if target is not None:
        write_text(target, json.dumps(data, indent=1) + "\n")
    return Report(data, text)


@reports
def plot(study: StudyFile, /, *, options: ResultOptions, part: PartOptions) -> Report:
    """Draw a study from its journal: means of every arm in every cell, with their intervals."""
    from wbc.app.plot.output import save  # noqa: PLC0415 - slow to import
    from wbc.app.plot.study import draw_study  # noqa: PLC0415

    target = check_target(
        "a picture",
        options.out or f"{options.journal.name.partition('.')[0]}.png",
        PICTURES,
        [options.journal, study],
    )
    chosen, entries, unused = _results(study, options, part)
    save({chosen.name: draw_study(options.table(chosen, entries))}, target)
    return Report({"picture": str(target), **unused}, str(target))


def _cell(value: Any) -> Any:
    """Return a value as a spreadsheet shows it: a text that would be a formula gets an apostrophe before it."""
    if not isinstance(value, str):
        return value
    return f"'{printable(value)}" if value.lstrip().startswith(("=", "+", "-", "@")) else printable(value)


def _results(
    study: Path, options: ResultOptions, part: PartOptions
) -> tuple[Study, Mapping[str, Entry], dict[str, Any]]:
    """Return a part of a study, the entries of its journal, and what of them is left out, which is also told."""
    chosen, entries = part.part(study), entries_of(options.journal, any_code=part.any_code)
    rest = left_out(chosen, entries)
    if (warning := rest.text()) is not None:
        logger.warning("%s", warning)
    return chosen, entries, {"left_out": to_json(rest)}


def read_study(path: Path) -> Study:
    """Return the study in a file; `InputError` for one without."""
    return Study.from_json(read_object("study", path))
