"""Comparison of stiffness models by cross-validation."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from wbc.core.arguments import checked
from wbc.feet.stiffness.clusters import Clusters
from wbc.feet.stiffness.dataset import StiffnessTable
from wbc.feet.stiffness.features import WINDOW_FEATURES
from wbc.feet.stiffness.model import Kind, ModelSettings, knn_pipeline
from wbc.feet.stiffness.validation import Candidate, Protocol, Validation, cross_validate, fold_splitter


def candidates() -> tuple[Candidate, ...]:
    """Return the paper's model, variations of it, other kinds of model, and two baselines without features."""

    def knn(neighbours: int, kind: Kind) -> Callable[[], Any]:
        return lambda: knn_pipeline(ModelSettings(neighbours=neighbours, kind=kind))

    def support_vectors() -> Any:
        from sklearn.pipeline import make_pipeline  # noqa: PLC0415 - slow to import
        from sklearn.preprocessing import StandardScaler  # noqa: PLC0415
        from sklearn.svm import SVR  # noqa: PLC0415

        return make_pipeline(StandardScaler(), SVR(C=10.0, epsilon=1.0))

    def forest() -> Any:
        from sklearn.ensemble import RandomForestRegressor  # noqa: PLC0415 - slow to import

        return RandomForestRegressor(100, min_samples_leaf=3, random_state=0)

    def majority() -> Any:
        from sklearn.dummy import DummyClassifier  # noqa: PLC0415 - slow to import

        return DummyClassifier(strategy="most_frequent")

    def median() -> Any:
        from sklearn.dummy import DummyRegressor  # noqa: PLC0415 - slow to import

        return DummyRegressor(strategy="median")

    return (
        Candidate("KNN 10, paper's features (paper)", knn(10, "classification")),
        Candidate("KNN 30, paper's features", knn(30, "classification")),
        Candidate("KNN 10, window features", knn(10, "classification"), "classification", WINDOW_FEATURES),
        Candidate("KNN 30, window features", knn(30, "classification"), "classification", WINDOW_FEATURES),
        Candidate("KNN 10 regression, paper's features", knn(10, "regression"), "regression"),
        Candidate("KNN 30 regression, window features", knn(30, "regression"), "regression", WINDOW_FEATURES),
        Candidate("support vectors, window features", support_vectors, "regression", WINDOW_FEATURES),
        Candidate("random forest, window features", forest, "regression", WINDOW_FEATURES),
        Candidate("largest class", majority),
        Candidate("median stiffness", median, "regression"),
    )


@checked
def compare(
    table: StiffnessTable,
    models: Sequence[Candidate] | None = None,
    protocols: Sequence[Protocol] = ("grounds", "amplitudes", "layouts", "shuffled", "paper"),
    *,
    folds: int = 10,
    clusters: Clusters | None = None,
) -> list[Validation]:
    """Return the cross-validation of several models by several protocols; see `cross_validate`.

    Raises:
        InputError: As `cross_validate`, for any of the protocols, before the first model is trained.
        UnknownNameError: No such protocol.
    """
    labels = table.labels(ModelSettings().clusters if clusters is None else clusters)
    for protocol in protocols:
        fold_splitter(table, labels, protocol, folds)
    return [
        cross_validate(table, model, protocol, folds=folds, clusters=clusters)
        for protocol in protocols
        for model in (candidates() if models is None else models)
    ]


def comparison_table(results: Sequence[Validation]) -> str:
    """Return results as a Markdown table."""
    lines = [
        "| split | model | accuracy | mean error (Nm/rad) | within one cluster | nearly best |",
        "|---|---|---|---|---|---|",
    ]
    for r in results:
        nearly = "-" if r.in_range is None else f"{r.share_in_range:.2f}"
        lines.append(
            f"| {r.protocol} | {r.name} | {r.accuracy:.2f} ± {r.accuracy_std:.2f} | {r.mean_error:.1f} | "
            f"{r.within_one:.2f} | {nearly} |"
        )
    return "\n".join(lines)
