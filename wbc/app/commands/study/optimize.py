"""`wbc study optimize`: the best stiffness and gains of grounds, by Bayesian optimisation."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter
from pydantic import Field

from wbc.app.commands.study.run import RunOptions, progress_bar
from wbc.app.output import Flat, Output, OutputOptions, Report, reports
from wbc.core.errors import InputError, choose
from wbc.core.files import save_figure
from wbc.core.settings import Count, Positive, Seed, settings, to_json
from wbc.sim.studies.journal import Entry, Journal, read_journal
from wbc.sim.studies.paper.experiments import authority_heights
from wbc.sim.studies.paper.optimization import (
    BOUNDS,
    FIRST_DESIGN,
    OptimisationSpec,
    Walked,
    check_journal,
    optimise,
)
from wbc.sim.studies.paper.optimum import TABLE_II, Optimum, optimum, table_two, validation
from wbc.sim.studies.study_table import StudyTable, study_table
from wbc.sim.studies.sweep import cluster_executor, local_executor, sweep
from wbc.sim.terrain.families.base import terrain_families
from wbc.sim.walks.spec import WalkSpec

Grounds = Annotated[
    tuple[str, ...],
    Parameter(help="Families of grounds, or 'table2' for the eleven of the paper's Table II."),
]


@settings(kw_only=True)
class OptimizeOptions(RunOptions):
    """An optimisation, and where its walks are run.

    Attributes:
        budget: Walks on each ground.
        bounds: Bounds of stiffness and gains: wide (1 to 2,000 Nm/rad in the logarithm) or paper (its Table I).
        k: Other bounds of the stiffness, Nm/rad: the lowest and the highest.
        kp: Other bounds of the proportional gain, 1/s.
        kd: Other bounds of the derivative gain.
        law: Preset of the stabilizer's settings, default, frizza or no_bias.
        amplitude: Highest minus lowest point of the grounds, m; when not given the family's own, or of 'table2', unless
            with a law of the paper, that of the study 'authority'.
        distance: Length of a walk, m.
        seed: Seed of the points that are asked for.
        batch: Points asked for at a time; as many as workers when not given. Another number asks for other points.
        validate: Held-out seeds on which the optimum is walked beside other stiffnesses; 0 for none.
        figures: Folder for a figure of each ground, and one of J over the stiffness on all of them.
        any_code: Take walks of other versions of the code, too.
    """

    budget: Annotated[int, Field(ge=FIRST_DESIGN, le=100_000)] = 400
    bounds: Literal["wide", "paper"] = "wide"
    k: tuple[float, float] | None = None
    kp: tuple[float, float] | None = None
    kd: tuple[float, float] | None = None
    law: Literal["default", "frizza", "no_bias"] = "default"
    amplitude: Annotated[Positive, "m"] | None = None
    distance: Annotated[Positive, "m"] = 3.0
    seed: Seed = 0
    batch: Count | None = None
    validate: Annotated[int, Field(ge=0, le=1000)] = 20
    figures: Path | None = None
    any_code: bool = False

    def specs(self, grounds: tuple[str, ...]) -> list[OptimisationSpec]:
        """Return the optimisations of different families of grounds; "table2" stands for the paper's Table II."""
        names, heights = grounds, {}
        if grounds == ("table2",):
            names, heights = tuple(TABLE_II), authority_heights() if self.law == "default" else {}
        for name in names:
            choose("terrain", name, terrain_families())
        if len(set(names)) < len(names) or not names:
            raise InputError(f"an optimisation needs different grounds, got {' '.join(names) or 'none'}")
        preset = BOUNDS[self.bounds]
        bounds = replace(preset, k=self.k or preset.k, kP=self.kp or preset.kP, kD=self.kd or preset.kD)
        return [
            OptimisationSpec(
                ground=name,
                amplitude=None if name == "flat" else self.amplitude or heights.get(name),
                law=self.law,
                bounds=bounds,
                distance=self.distance,
                seed=self.seed,
                batch=self.batch or self.workers,
            )
            for name in names
        ]


@reports
def optimize(
    grounds: Grounds, /, *, options: Flat[OptimizeOptions], output: OutputOptions = Output()
) -> Report:
    """Find the best stiffness and gains of grounds (the paper's section III), and which stiffnesses are as good.

    The objective is the paper's eq. (6), at most 0: ten for a missed step, and the errors of ZMP and CoM in m. The run
    can be stopped, also killed, and continues from its journal.
    """
    specs = options.specs(grounds)
    if options.figures is not None and not options.figures.is_dir():
        raise InputError(f"no folder {options.figures} to write figures into")
    check_journal(read_journal(options.journal), specs, any_code=options.any_code)
    found: dict[str, Optimum] = {}
    walked: dict[str, list[Walked]] = {}
    judged: dict[str, StudyTable] = {}
    total = (options.budget + 5 * options.validate) * len(specs)
    with open_runner(options, total) as run:
        for spec in specs:
            known = walked[spec.ground] = optimise(spec, options.budget, run)
            found[spec.ground] = optimum(known, spec.bounds, seed=spec.seed)
            if options.validate:
                study = validation({spec: found[spec.ground]}, options.validate)
                entries = run([trial.spec for trial in study.trials()])  # type: ignore[misc]
                judged[spec.ground] = study_table(study, entries)
    figures = [] if options.figures is None else save_figures(options.figures, walked, found)
    data = {
        "grounds": {
            name: {
                **{k: v for k, v in to_json(each).items() if k not in ("k", "mean", "std", "slices")},
                "validation": judged[name].to_json() if name in judged else None,
            }
            for name, each in found.items()
        },
        "figures": figures,
    }
    return output.report(data, "\n\n".join([table_two(found), *_texts(found, judged), *figures]))


def _texts(found: Mapping[str, Optimum], judged: Mapping[str, StudyTable]) -> list[str]:
    lines = []
    for name, each in found.items():
        best = ", ".join(f"{parameter} {value:.3g}" for parameter, value in each.best.items())
        lines.append(
            f"{name}: best at {best}; expected J {each.J:.3g} ± {each.J_std:.2g}, a walk ± {each.noise:.2g}, "
            f"{each.walks} walks"
        )
        if name in judged:
            lines.append(f"{judged[name].study.name}, {name}\n\n{judged[name].markdown()}")
    return lines


def save_figures(folder: Path, walked: Mapping[str, list[Walked]], found: Mapping[str, Optimum]) -> list[str]:
    """Save a figure of each ground and one of J over the stiffness on all of them; return their files."""
    from wbc.app.plot.optimization import optimum_figure, stiffness_figure  # noqa: PLC0415 - slow to import

    figures = {name: optimum_figure(name, walked[name], each) for name, each in found.items()}
    if len(found) > 1:
        figures = {"stiffness": stiffness_figure(walked, found), **figures}
    for name, figure in figures.items():
        save_figure(figure, folder / f"optimize_{name}.png", dpi=110.0)
    return [str(folder / f"optimize_{name}.png") for name in figures]


@contextmanager
def open_runner(
    options: OptimizeOptions, total: int
) -> Iterator[Callable[[list[WalkSpec]], Mapping[str, Entry]]]:
    """Open journal and workers once for many small sweeps; yield the function that runs the walks of one."""
    with ExitStack() as stack:
        journal = stack.enter_context(Journal(options.journal, any_code=options.any_code))
        if options.cluster is not None:
            executor = stack.enter_context(cluster_executor(options.cluster, workers=options.workers))
        else:
            executor = stack.enter_context(local_executor(options.workers))
        bar = stack.enter_context(progress_bar())
        task = bar.add_task("optimize", total=total, rate="")

        def run(specs: list[WalkSpec]) -> Mapping[str, Entry]:
            sweep(
                specs,
                journal,
                executor=executor,
                timeout=options.timeout,
                retry=options.retry,
            )
            bar.advance(task, len(specs))
            return journal.entries

        yield run
