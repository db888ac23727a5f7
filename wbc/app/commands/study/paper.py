"""`wbc study paper`: all experiments of the paper and the questions beside them, with their report, by one command."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

from pydantic import Field

from wbc.app.commands.study.optimize import OptimizeOptions, run_optimisation
from wbc.app.commands.study.run import RunOptions, run_trials
from wbc.app.output import Flat, Output, OutputOptions, Report, reports
from wbc.app.plot.experiments import steps_figure
from wbc.core.errors import InputError, choose
from wbc.core.files import save_figure, write_text
from wbc.core.settings import Count, Positive, settings
from wbc.feet.stiffness.comparison import candidates, compare, comparison_table
from wbc.sim.studies.best_stiffness import label_table, labels, stiffness_table
from wbc.sim.studies.catalog import study_by_name
from wbc.sim.studies.journal import Journal, read_journal
from wbc.sim.studies.optimization import FIRST_DESIGN, TABLE_II, check_journal, table_two
from wbc.sim.studies.paper import table_four
from wbc.sim.studies.provenance import code_version
from wbc.sim.studies.stiffness_studies import DatasetSize, dataset
from wbc.sim.studies.study import Study, merged
from wbc.sim.studies.study_table import study_table

STUDY_PARTS = ("authority", "oracle", "fig5", "fig5_legacy", "table4", "table4_legacy")
"""Parts that are studies of the catalog."""

PARTS = (*STUDY_PARTS, "optimize", "optimize_legacy", "dataset")
"""All parts: studies, optimisations (wide bounds on eleven grounds, the paper's bounds and law on four), data set."""

LEGACY_GROUNDS = ("flat", "stones", "cylinder_obstacles", "roof_tiles")
"""Grounds of the optimisation with the paper's law and bounds."""

BUDGET, WALKS_OF_DATASET = 400, 6000
"""Walks of an optimisation on one ground and of the data set at full scale; the paper's."""

MARGIN = 0.5
"""Difference that counts as none in the tables, steps."""


@settings(kw_only=True)
class PaperOptions:
    """Size of the experiments.

    Attributes:
        folder: Folder for journals, tables, figures and the report.
        scale: Share of the walks, of each experiment at least one seed; 0.05 takes about half an hour on two cores.
        only: Only these parts: authority, oracle, fig5, fig5_legacy, table4, table4_legacy, optimize, optimize_legacy,
            dataset.
        cells: Only the first so many cells of each study and grounds of each optimisation, to see it work.
        distance: Length of each walk, m; the studies' own when not given.
        workers: Number of processes on this machine.
        cluster: Run through Dask instead: address of a scheduler, or "local".
        any_code: Take walks of other versions of the code, too.
    """

    folder: Path
    scale: Annotated[float, Field(gt=0.0, le=1.0)] = 1.0
    only: tuple[str, ...] = ()
    cells: Count | None = None
    distance: Annotated[Positive, "m"] | None = None
    workers: Count = 1
    cluster: str | None = None
    any_code: bool = False

    def __post_init__(self) -> None:
        for name in self.only:
            choose("part of the paper's experiments", name, PARTS)

    def run(self, part: str) -> RunOptions:
        """Return the options of the sweep of a part."""
        return RunOptions(journal=self.folder / f"{part}.jsonl", workers=self.workers, cluster=self.cluster)

    def sized(self, study: Study) -> Study:
        """Return a study at this scale."""
        small = study.scaled(self.scale)
        if self.distance is not None:
            small = replace(small, base=merged(small.base, {"plan": {"distance": self.distance}}))
        return small.narrowed([cell.name for cell in small.cells[: self.cells]])


@reports
def paper(*, options: Flat[PaperOptions], output: OutputOptions = Output()) -> Report:
    """Run all experiments of the paper and the questions beside them, and write their report.

    Everything resumes: what the journals in the folder have is not run again.
    """
    if options.folder.exists() and not options.folder.is_dir():
        raise InputError(f"{options.folder} is no folder")
    parts = options.only or PARTS
    for part in parts:
        journal = options.folder / f"{part}.jsonl"
        check_journal(read_journal(journal), lambda spec: True, part, any_code=options.any_code)
    options.folder.mkdir(parents=True, exist_ok=True)
    texts = []
    for part in parts:
        if part == "dataset":
            text = _dataset(options)
        elif part in STUDY_PARTS:
            text = _study(part, options)
        else:
            text = _optimisation(part, options)
        write_text(options.folder / f"{part}.md", text + "\n")
        texts.append(f"## {part}\n\n{text}")
    title = f"# Experiments of the paper, scale {options.scale:g}, code `{code_version()}`"
    report = options.folder / "report.md"
    write_text(report, "\n\n".join([title, *texts]) + "\n")
    return output.report({"report": str(report), "parts": list(parts)}, str(report))


def _study(part: str, options: PaperOptions) -> str:
    study = options.sized(study_by_name(part))
    summary = run_trials(study, options.run(part), any_code=options.any_code)
    entries = read_journal(options.folder / f"{part}.jsonl")
    table = study_table(study, entries, margin=MARGIN, any_code=options.any_code)
    texts = [f"{study.about}; {summary.total} walks", table.markdown()]
    if part.startswith("table4"):
        texts.insert(1, table_four(table))
    picture = options.folder / f"{part}.png"
    save_figure(steps_figure(table), picture, dpi=110.0)
    return "\n\n".join([*texts, f"![Steps of each arm.]({picture.name})"])


def _optimisation(part: str, options: PaperOptions) -> str:
    legacy = part == "optimize_legacy"
    grounds = (LEGACY_GROUNDS if legacy else tuple(TABLE_II))[: options.cells]
    run = OptimizeOptions(
        journal=options.folder / f"{part}.jsonl",
        workers=options.workers,
        cluster=options.cluster,
        budget=max(round(options.scale * BUDGET), FIRST_DESIGN + 1),
        validate=max(round(20 * options.scale), 1),
        bounds="paper" if legacy else "wide",
        law="legacy" if legacy else "default",
        distance=options.distance or 3.0,
        any_code=options.any_code,
    )
    found, _, judged = run_optimisation(grounds, run)
    return "\n\n".join([table_two(found), *(f"{name}\n\n{t.markdown()}" for name, t in judged.items())])


def _dataset(options: PaperOptions) -> str:
    """Run the walks of the data set, write its table, and judge models on it by all folds."""
    evaluations = max(round(50 * options.scale), 4)
    size = DatasetSize(seeds=2, amplitudes=5, evaluations=evaluations, distance=options.distance or 3.0)
    study = dataset(size)
    study = study.narrowed([cell.name for cell in study.cells[: options.cells]])
    summary = run_trials(study, options.run("dataset"), any_code=options.any_code)
    with Journal(options.folder / "dataset.jsonl") as journal:
        entries = journal.entries
    found = labels(study, entries, any_code=options.any_code)
    if not found:
        return f"{summary.total} walks, too few for a label"
    made = {"command": f"wbc study paper --only dataset --scale {options.scale:g}", "code": code_version()}
    table = stiffness_table(study, found, windows=3, made=made)
    target = options.folder / "dataset.csv"
    table.save(target)
    texts = [
        f"{summary.total} walks, {len(table)} rows in {target.name}",
        f"```text\n{label_table(found)}\n```",
    ]
    try:
        texts.append(comparison_table(compare(table, candidates()[:1], folds=2 if options.cells else 10)))
    except InputError as error:
        texts.append(f"no model: {error}")
    return "\n\n".join(texts)
