"""`wbc stiffness`: from a table of grounds and their best stiffness to a model, and how good that is."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from cyclopts import Parameter

from wbc.app.files import check_target
from wbc.app.output import Flat, Output, OutputOptions, Report, reports
from wbc.core.errors import InputError
from wbc.feet.stiffness.analysis import amplitude_trends, learning_curve, principal_components
from wbc.feet.stiffness.comparison import candidates, compare, comparison_table
from wbc.feet.stiffness.dataset import StiffnessTable
from wbc.feet.stiffness.features import PAPER_FEATURES, WINDOW_FEATURES, select_features
from wbc.feet.stiffness.figures import PICTURES, draw_model
from wbc.feet.stiffness.model import DEFAULT_TABLE, Kind, ModelSettings, StiffnessModel
from wbc.feet.stiffness.validation import Candidate

TablePath = Annotated[
    Path,
    Parameter(
        help="Table that `wbc study dataset` has written; the one that comes with the library if not given."
    ),
]


@dataclass(frozen=True, kw_only=True)
class ModelOptions:
    """What kind of model.

    Attributes:
        features: What it looks at: paper (six powers of three parameters), window (chosen for what a foot sees), or
            select (chosen from the table).
        neighbours: Neighbours that have a say.
        kind: classification (a range of stiffness is chosen) or regression (a weighted mean).
    """

    features: str = "paper"
    neighbours: int = ModelSettings.neighbours
    kind: Kind = "classification"

    def settings(self, table: StiffnessTable) -> ModelSettings:
        """The settings of the model."""
        named = {"paper": PAPER_FEATURES, "window": WINDOW_FEATURES}
        if self.features not in (*named, "select"):
            raise InputError(f"features must be paper, window or select, got '{self.features}'")
        chosen = named.get(self.features) or select_features(table.values).kept
        return ModelSettings(features=chosen, neighbours=self.neighbours, kind=self.kind)


@reports
def train(
    table: TablePath = DEFAULT_TABLE,
    /,
    *,
    output_file: Annotated[Path, Parameter(name=("--output", "-o"), help="Model to write (.json).")],
    model: Flat[ModelOptions] = ModelOptions(),
    output: OutputOptions = Output(),
) -> Report:
    """Make a stiffness model of a table, and write it as plain numbers."""
    target = check_target("a stiffness model", output_file, (".json",))
    data = StiffnessTable.load(table)
    settings = model.settings(data)
    made = StiffnessModel.fit(data, settings)
    made.save(target)
    facts = {
        "model": str(target),
        "table": str(table),
        "rows": len(data),
        "features": list(settings.features),
        "neighbours": settings.neighbours,
        "kind": settings.kind,
        "reach": made.reach,
    }
    text = (
        f"{target}: {settings.neighbours} nearest of {len(data)} profiles by {', '.join(settings.features)} "
        f"({settings.kind})"
    )
    return output.report(facts, text)


@reports
def judge(
    table: TablePath = DEFAULT_TABLE,
    /,
    *,
    model: Flat[ModelOptions] = ModelOptions(),
    plot: Annotated[Path | None, Parameter(help="Picture to write.")] = None,
    folds: Annotated[int, Parameter(help="Folds of the cross-validations.")] = 10,
    output: OutputOptions = Output(),
) -> Report:
    """Judge models on grounds that they have not seen, and tell what the table says; about a minute.

    Cross-validations by ground, by ground and amplitude, shuffled, and in the paper's way; how accuracy grows with the
    number of grounds; how the best stiffness goes with the amplitude; which features the table itself would choose.
    """
    data = StiffnessTable.load(table)
    settings = model.settings(data)
    if plot is not None:
        check_target("a picture", plot, PICTURES)
    judged = candidates()
    if settings != ModelSettings():
        judged = (Candidate.of(settings, "the model asked for"), *judged)
    curve = learning_curve(data, settings)
    results = compare(data, judged, folds=folds)
    if plot is not None:
        draw_model(data, plot, settings)
    trends = amplitude_trends(data)
    components = principal_components(data, settings.features)
    selection = select_features(data.values)
    facts: dict[str, Any] = {
        "table": str(table),
        "rows": len(data),
        "clusters": np.unique(settings.clusters.of(data.stiffness), return_counts=True)[1].tolist(),
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
        "selection": asdict(selection),
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
        f"features that the table would choose: {', '.join(selection.kept)}",
    ]
    return output.report(facts, "\n\n".join(parts))
