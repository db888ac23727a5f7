"""`wbc stiffness`: a stiffness model from a table of grounds and their best stiffness, and its validation."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from cyclopts import Parameter
from pydantic import Field

from wbc.app.files import check_picture, check_target
from wbc.app.output import Flat, Output, OutputOptions, Report, reports
from wbc.core.errors import InputError
from wbc.core.files import save_figure
from wbc.core.settings import Count, settings, to_json
from wbc.feet.stiffness.analysis import amplitude_trends, learning_curve, principal_components
from wbc.feet.stiffness.authors import is_authors_file, load_table
from wbc.feet.stiffness.clusters import Clusters
from wbc.feet.stiffness.comparison import candidates, compare, comparison_table
from wbc.feet.stiffness.dataset import StiffnessTable
from wbc.feet.stiffness.features import PAPER_FEATURES, WINDOW_FEATURES, select_features
from wbc.feet.stiffness.figures import model_figure
from wbc.feet.stiffness.model import DEFAULT_TABLE, Kind, ModelSettings, StiffnessModel
from wbc.feet.stiffness.validation import Candidate

TablePath = Annotated[
    Path,
    Parameter(
        help="Table that `wbc study table --table` has written, or a file in the columns of the paper's authors; the "
        "library's if not given.",
        show_default=False,
    ),
]


@settings(kw_only=True)
class ModelOptions:
    """Settings of a stiffness model, and what is written of it.

    Attributes:
        features: Features: six powers of three parameters (paper), those chosen for the scan of a foot (window), or
            those chosen from the table (select).
        neighbours: Number of neighbours.
        kind: A class of stiffnesses is chosen (classification), or their weighted mean (regression).
        clusters: Classes of stiffnesses: twenty of 4 Nm/rad up to 80 (paper), or nine of one ratio up to 2,000 (log).
        out: Model that train writes (.json).
        plot: Picture that judge writes.
        folds: Folds of the cross-validations of judge.
    """

    features: Literal["paper", "window", "select"] = "paper"
    neighbours: Count = ModelSettings.neighbours
    kind: Kind = "classification"
    clusters: Literal["paper", "log"] = "paper"
    out: Annotated[Path | None, Parameter(alias="-o")] = None
    plot: Path | None = None
    folds: Annotated[int, Field(ge=2)] = 10

    def settings(self, table: StiffnessTable) -> ModelSettings:
        """Return the settings of the model of a table."""
        if self.features == "select":
            features = select_features(table.values).kept
        else:
            features = {"paper": PAPER_FEATURES, "window": WINDOW_FEATURES}[self.features]
        clusters = Clusters.logarithmic() if self.clusters == "log" else Clusters.linear()
        return ModelSettings(features=features, neighbours=self.neighbours, kind=self.kind, clusters=clusters)


@reports
def stiffness(
    do: Annotated[Literal["train", "judge"], Parameter(help="What is done with the table.")],
    table: TablePath = DEFAULT_TABLE,
    /,
    *,
    options: Flat[ModelOptions] = ModelOptions(),
    output: OutputOptions = Output(),
) -> Report:
    """Make a stiffness model of a table, or validate models on grounds that they were not trained on.

    Train writes the model as plain numbers. Judge takes about a minute: cross-validations by ground, by ground and
    amplitude, by layout, shuffled, and as in the paper; accuracy over the number of grounds; correlation of the best
    stiffness with the amplitude; features that the table itself would choose. Of a file in the authors' columns only
    models of the paper's features are judged: it has no others.
    """
    for name, whose in (("out", "train"), ("plot", "judge")):
        if do != whose and getattr(options, name) is not None:
            raise InputError(f"--{name} is no option of 'stiffness {do}'")
    return _train(table, options, output) if do == "train" else _judge(table, options, output)


def _train(table: Path, options: ModelOptions, output: Output) -> Report:
    if options.out is None:
        raise InputError("give the model to write, .json: --out or -o")
    target = check_target("a stiffness model", options.out, (".json",), [table])
    data = load_table(table)
    chosen = options.settings(data)
    made = StiffnessModel.fit(data, chosen)
    made.save(target)
    facts = {
        "model": str(target),
        "table": str(table),
        "rows": len(data),
        "features": list(chosen.features),
        "neighbours": chosen.neighbours,
        "kind": chosen.kind,
        "reach": made.reach,
    }
    text = (
        f"{target}: {chosen.neighbours} nearest of {len(data)} profiles by {', '.join(chosen.features)} "
        f"({chosen.kind})"
    )
    return output.report(facts, text)


def _judge(table: Path, options: ModelOptions, output: Output) -> Report:
    data, theirs = load_table(table), is_authors_file(table)
    chosen = options.settings(data)
    plot = check_picture(options.plot, [table])
    judged = tuple(each for each in candidates() if not theirs or each.features == PAPER_FEATURES)
    if chosen != ModelSettings():
        judged = (Candidate.of(chosen, "the model asked for"), *judged)
    results = compare(data, judged, folds=options.folds, clusters=chosen.clusters)
    curve = learning_curve(data, chosen)
    if plot is not None:
        save_figure(model_figure(data, chosen, curve), plot, dpi=130)
    trends = amplitude_trends(data)
    components = principal_components(data, chosen.features)
    selection = None if theirs else select_features(data.values)
    facts: dict[str, Any] = {
        "table": str(table),
        "rows": len(data),
        "clusters": np.unique(chosen.clusters.of(data.stiffness), return_counts=True)[1].tolist(),
        "validation": [
            {
                "split": r.protocol,
                "model": r.name,
                "accuracy": r.accuracy,
                "accuracy_std": r.accuracy_std,
                "mean_error": r.mean_error,
                "within_one": r.within_one,
                "nearly_best": r.share_in_range,
            }
            for r in results
        ],
        "learning_curve": {
            "grounds": curve.grounds.tolist(),
            "accuracy": curve.accuracy.mean(axis=1).tolist(),
            "mean_error": curve.mean_error.mean(axis=1).tolist(),
        },
        "amplitude_trends": trends,
        "explained_variance": components.explained.tolist(),
        "selection": None if selection is None else to_json(selection),
    }
    parts = [
        comparison_table(results),
        "grounds trained on, accuracy, mean error (Nm/rad): "
        + "; ".join(
            f"{n} {a:.2f} {e:.1f}"
            for n, a, e in zip(
                curve.grounds, curve.accuracy.mean(axis=1), curve.mean_error.mean(axis=1), strict=True
            )
        ),
        "rank correlation of best stiffness and amplitude: "
        + ", ".join(f"{ground} {rank:+.2f}" for ground, rank in trends.items()),
        f"two principal components hold {100.0 * components.explained[:2].sum():.0f} % of the variance",
    ]
    if selection is not None:
        parts.append(f"features that the table would choose: {', '.join(selection.kept)}")
    return output.report(facts, "\n\n".join(parts))
