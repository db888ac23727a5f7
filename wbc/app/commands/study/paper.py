"""`wbc study paper`: all experiments of the paper and the questions beside them, with their report, by one command."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated

from pydantic import Field

from wbc.app.commands.study.optimize import run_optimisations, save_figures
from wbc.app.commands.study.run import RunOptions, run_trials
from wbc.app.output import Flat, Output, OutputOptions, Report, reports
from wbc.app.plot.experiments import differences_figure, steps_figure
from wbc.core.errors import InputError, choose
from wbc.core.files import save_figure, write_text
from wbc.core.settings import Count, Positive, settings
from wbc.feet.stiffness.authors import RECIPE, TRAJECTORIES, write_authors
from wbc.sim.studies.best_stiffness import label_table, labels, stiffness_table
from wbc.sim.studies.catalog import study_by_name
from wbc.sim.studies.journal import Entry, read_journal
from wbc.sim.studies.paper.choice import choice
from wbc.sim.studies.paper.experiments import optimisation, table_four
from wbc.sim.studies.paper.optimization import FIRST_DESIGN, check_journal
from wbc.sim.studies.paper.optimum import TABLE_II, table_two
from wbc.sim.studies.provenance import code_version
from wbc.sim.studies.stiffness_studies import DatasetSize, dataset, dataset_accuracy, spread
from wbc.sim.studies.study import Study, merged
from wbc.sim.studies.study_table import study_table
from wbc.sim.studies.sweep import SweepSummary

PARTS = (
    "authority",
    "damping",
    "oracle",
    "tuned_fixed",
    "table4",
    "fig5",
    "optimize",
    "dataset",
    "table4_frizza",
    "fig5_frizza",
    "optimize_frizza",
)
"""All parts, those that tell most first: studies, optimisations (wide bounds on eleven grounds, the paper's bounds and
law on four), data set."""

JOURNALS = {"damping": "authority"}
"""Part → part whose journal it shares, and with it walks."""

PAPER_GROUNDS = ("flat", "stones", "cylinder_obstacles", "roof_tiles")
"""Grounds of the optimisation with the paper's law and bounds."""

BUDGET, VALIDATIONS = 400, 20
"""Walks of an optimisation on one ground, and seeds of its validation, at full scale."""

EVALUATIONS = 50
"""Stiffnesses of the data set at full scale; a smaller scale walks some of them, spread over the range."""

WINDOWS = 3
"""Windows of each ground of the data set."""

MARGIN = 0.5
"""Difference that counts as none in the tables, steps."""


@settings(kw_only=True)
class PaperOptions:
    """Size of the experiments.

    Attributes:
        folder: Folder for journals, tables, figures and the report.
        scale: Share of the walks, of each experiment at least one seed; 0.05 is 1,793 walks, two hours on two
            cores.
        only: Only these parts: authority, damping, oracle, tuned_fixed, table4, fig5, optimize, dataset, table4_frizza,
            fig5_frizza, optimize_frizza.
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

    def journal(self, part: str) -> Path:
        """Return the journal of a part."""
        return self.folder / f"{JOURNALS.get(part, part)}.jsonl"

    def run(self, part: str) -> RunOptions:
        """Return the options of the sweep of a part."""
        return RunOptions(journal=self.journal(part), workers=self.workers, cluster=self.cluster)

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
    parts = [part for part in PARTS if part in (options.only or PARTS)]
    for part in parts:
        entries = read_journal(options.journal(part))
        check_journal(entries, lambda spec: True, part, any_code=options.any_code)
    options.folder.mkdir(parents=True, exist_ok=True)
    texts = []
    for part in parts:
        if part == "dataset":
            text = _dataset(options)
        elif part.startswith("optimize"):
            text = _optimisation(part, options)
        else:
            text = _study(part, options)
        write_text(options.folder / f"{part}.md", text + "\n")
        texts.append(f"## {part}\n\n{text}")
    title = f"# Experiments of the paper, scale {options.scale:g}, code `{code_version()}`"
    report = options.folder / "report.md"
    write_text(report, "\n\n".join([title, *texts]) + "\n")
    return output.report({"report": str(report), "parts": parts}, str(report))


def _study(part: str, options: PaperOptions) -> str:
    whole = study_by_name(part)
    study = options.sized(whole)
    summary = run_trials(study, options.run(part), any_code=options.any_code)
    entries = read_journal(options.journal(part))
    table = study_table(study, entries, margin=MARGIN, any_code=options.any_code)
    texts = [f"{study.about}; {_share(summary, whole.size)}", *_choice(part, study, entries, options)]
    if part.startswith("table4"):
        texts.append(table_four(table))
    texts.append(table.markdown())
    figures = {"steps": steps_figure(table), "differences": differences_figure(table)}
    for name, figure in figures.items():
        picture = options.folder / f"{part}_{name}.png"
        save_figure(figure, picture, dpi=110.0)
        texts.append(f"![{name.capitalize()} of the arms.]({picture.name})")
    return "\n\n".join(texts)


def _share(summary: SweepSummary, whole: int) -> str:
    """Return how many walks there are, and of how many at full scale."""
    done = summary.counts.get("done", 0)
    return f"{done:,} walks" if done == whole else f"{done:,} of the {whole:,} walks of the full scale"


def _choice(part: str, study: Study, entries: Mapping[str, Entry], options: PaperOptions) -> list[str]:
    """Return the text on which stiffness is best where; nothing before there are two layouts."""
    if part != "authority":
        return []
    try:
        return [choice(study, entries, margin=MARGIN, any_code=options.any_code).markdown()]
    except InputError as error:
        return [str(error)]


def _optimisation(part: str, options: PaperOptions) -> str:
    law = "frizza" if part == "optimize_frizza" else "default"
    grounds = (PAPER_GROUNDS if law == "frizza" else tuple(TABLE_II))[: options.cells]
    length = options.distance or 3.0
    specs = [optimisation(ground, law, distance=length, batch=options.workers) for ground in grounds]
    budget = max(round(options.scale * BUDGET), FIRST_DESIGN + 1)
    found, walked, judged = run_optimisations(
        specs,
        options.run(part),
        budget=budget,
        validate=max(round(options.scale * VALIDATIONS), 1),
        any_code=options.any_code,
    )
    walks = f"{budget} walks on each of {len(grounds)} grounds; {BUDGET} at full scale"
    tables = (f"{name}\n\n{table.markdown()}" for name, table in judged.items())
    pictures = save_figures(options.folder, part, walked, found)
    figures = (f"![{picture.stem.replace('_', ' ').capitalize()}.]({picture.name})" for picture in pictures)
    return "\n\n".join([walks, table_two(found), *figures, *tables])


def _dataset(options: PaperOptions) -> str:
    """Run the walks of the data set, write its tables, and judge the paper's model on them by all folds."""
    size = DatasetSize(seeds=2, amplitudes=5, evaluations=EVALUATIONS, distance=options.distance or 3.0)
    full = dataset(size)
    whole, arms = full.size, list(full.arms)
    tried = [arms[i] for i in spread(max(round(options.scale * EVALUATIONS), 4), EVALUATIONS)]
    study = full.narrowed([cell.name for cell in full.cells[: options.cells]], tried)
    summary = run_trials(study, options.run("dataset"), any_code=options.any_code)
    found = labels(study, read_journal(options.journal("dataset")), any_code=options.any_code)
    if not found:
        return f"{_share(summary, whole)}, too few for a label"
    made = {"command": f"wbc study paper --only dataset --scale {options.scale:g}", "code": code_version()}
    tables = {
        "dataset.csv": stiffness_table(study, found, windows=WINDOWS, made=made),
        "dataset_tracks.csv": stiffness_table(
            study, found, windows=TRAJECTORIES // size.seeds, recipe=RECIPE, made=made
        ),
    }
    texts = [_share(summary, whole), f"```text\n{label_table(found)}\n```"]
    for name, table in tables.items():
        table.save(options.folder / name)
        texts.append(f"{len(table)} rows in {name}")
        try:
            texts.append(dataset_accuracy(table, folds=2 if options.cells else 10))
        except InputError as error:
            texts.append(f"no model: {error}")
    if options.cells is None:
        write_authors(tables["dataset_tracks.csv"], options.folder / "dataset_authors.csv")
        texts.append("The tracks in the columns of the authors' file: dataset_authors.csv")
    return "\n\n".join(texts)
