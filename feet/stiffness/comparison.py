"""Stiffness models side by side, and what the data itself says."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wbc.core.errors import Array, InputError
from wbc.feet.stiffness.clusters import Clusters
from wbc.feet.stiffness.dataset import StiffnessTable
from wbc.feet.stiffness.features import PAPER_FEATURES, WINDOW_FEATURES, FeatureSet
from wbc.feet.stiffness.model import Kind, ModelSettings, knn_pipeline
from wbc.feet.stiffness.validation import (
    Candidate,
    Protocol,
    Validation,
    clipped_cluster,
    cross_validate,
    several_classes,
    train_and_command,
)


def candidates() -> tuple[Candidate, ...]:
    """The paper's model, variations of it, other kinds of model, and two that look at nothing."""

    def knn(neighbours: int, kind: Kind) -> Callable[[], Any]:
        return lambda: knn_pipeline(ModelSettings(neighbours=neighbours, kind=kind))

    def support_vectors() -> Any:
        from sklearn.pipeline import make_pipeline  # noqa: PLC0415 - as above
        from sklearn.preprocessing import StandardScaler  # noqa: PLC0415
        from sklearn.svm import SVR  # noqa: PLC0415

        return make_pipeline(StandardScaler(), SVR(C=10.0, epsilon=1.0))

    def forest() -> Any:
        from sklearn.ensemble import RandomForestRegressor  # noqa: PLC0415 - as above

        return RandomForestRegressor(100, min_samples_leaf=3, random_state=0)

    def majority() -> Any:
        from sklearn.dummy import DummyClassifier  # noqa: PLC0415 - as above

        return DummyClassifier(strategy="most_frequent")

    def median() -> Any:
        from sklearn.dummy import DummyRegressor  # noqa: PLC0415 - as above

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


def compare(
    table: StiffnessTable,
    models: Sequence[Candidate] | None = None,
    protocols: Sequence[Protocol] = ("grounds", "amplitudes", "shuffled", "paper"),
    *,
    folds: int = 10,
    clusters: Clusters | None = None,
) -> list[Validation]:
    """Cross-validate several models in several ways; see `cross_validate`."""
    return [
        cross_validate(table, model, protocol, folds=folds, clusters=clusters)
        for protocol in protocols
        for model in (candidates() if models is None else models)
    ]


def comparison_table(results: Sequence[Validation]) -> str:
    """Results as a Markdown table."""
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


@dataclass(frozen=True, eq=False)
class LearningCurve:
    """Quality on unseen grounds against the number of grounds that were trained on.

    Attributes:
        grounds: Numbers of training grounds, shape (k,).
        accuracy: Share in the right cluster, by number and repetition, shape (k, repetitions).
        mean_error: Nm/rad, shape (k, repetitions).
    """

    grounds: NDArray[np.intp]
    accuracy: Array
    mean_error: Array


def learning_curve(
    table: StiffnessTable,
    candidate: Candidate | ModelSettings | None = None,
    *,
    by: Sequence[str] = ("ground", "amplitude"),
    test_share: float = 0.25,
    points: int = 6,
    repetitions: int = 10,
    seed: int = 0,
) -> LearningCurve:
    """Train on more and more grounds, test on a share of the grounds that is kept apart.

    Args:
        table: Profiles with their best stiffness.
        candidate: What to judge; the paper's model when None.
        by: Columns that make a ground.
        test_share: Share of the grounds to test on.
        points: How many numbers of training grounds.
        repetitions: How many random splits.
        seed: Of the splits.

    Raises:
        InputError: A single class, or too few grounds.
    """
    settings = candidate if isinstance(candidate, ModelSettings) else ModelSettings()
    model = candidate if isinstance(candidate, Candidate) else Candidate.of(settings)
    labels = several_classes(table, settings.clusters)
    features = FeatureSet(model.features)(table.values)
    target = labels if model.kind == "classification" else table.stiffness
    groups = table.groups(by)
    number = int(groups.max()) + 1
    kept = max(1, round(test_share * number))
    # The fewest grounds whose rows are enough for the neighbours, whichever are drawn.
    fewest = int(np.searchsorted(np.cumsum(np.sort(np.bincount(groups))), settings.neighbours)) + 1
    if number - kept <= fewest:
        raise InputError(f"a learning curve needs more than {fewest + kept} grounds, the table has {number}")
    sizes = np.unique(np.geomspace(fewest, number - kept, points).round().astype(np.intp))
    accuracy, error = np.empty((sizes.size, repetitions)), np.empty((sizes.size, repetitions))
    rng = np.random.default_rng(seed)
    for j in range(repetitions):
        order = rng.permutation(number)
        test = np.isin(groups, order[:kept])
        for i, size in enumerate(sizes):
            train = np.isin(groups, order[kept : kept + size])
            command = train_and_command(
                model, features[train], target[train], features[test], settings.clusters
            )
            accuracy[i, j] = (clipped_cluster(settings.clusters, command) == labels[test]).mean()
            error[i, j] = np.abs(command - table.stiffness[test]).mean()
    return LearningCurve(sizes, accuracy, error)


@dataclass(frozen=True, eq=False)
class Components:
    """Principal components of the scaled features.

    Attributes:
        explained: Share of the variance in each component, descending, shape (f,).
        scores: Rows in the first two components, shape (n, 2).
    """

    explained: Array
    scores: Array


def principal_components(table: StiffnessTable, features: Sequence[str] = PAPER_FEATURES) -> Components:
    """Principal components of the scaled features; two of them explain more than 87 % in the paper."""
    from sklearn.decomposition import PCA  # noqa: PLC0415 - as above
    from sklearn.preprocessing import StandardScaler  # noqa: PLC0415

    scaled = StandardScaler().fit_transform(FeatureSet(tuple(features))(table.values))
    pca = PCA().fit(scaled)
    return Components(np.asarray(pca.explained_variance_ratio_), np.asarray(pca.transform(scaled))[:, :2])


def amplitude_trends(table: StiffnessTable) -> dict[str, float]:
    """How the best stiffness goes with the amplitude on each ground: Spearman's rank correlation.

    −1 if it always falls, +1 if it always rises, NaN if it does not change or there are fewer than three amplitudes. In
    the data that the paper's authors published it falls on every ground.

    Args:
        table: Profiles with their best stiffness; the mean over the rows of one ground and amplitude is taken.
    """
    from scipy.stats import spearmanr  # noqa: PLC0415 - takes half a second to import

    trends = {}
    for ground in dict.fromkeys(table.ground.tolist()):
        mine = table.ground == ground
        amplitudes = np.unique(table.amplitude[mine])
        best = np.array([table.stiffness[mine & (table.amplitude == a)].mean() for a in amplitudes])
        constant = amplitudes.size < 3 or np.ptp(best) == 0.0
        trends[ground] = float("nan") if constant else float(spearmanr(amplitudes, best).statistic)
    return trends
