"""Analysis of stiffness data: learning curve, principal components, trend of the best stiffness with amplitude."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wbc.core.errors import Array, InputError, whole_number
from wbc.feet.stiffness.dataset import StiffnessTable
from wbc.feet.stiffness.features import PAPER_FEATURES, FeatureSet
from wbc.feet.stiffness.model import ModelSettings
from wbc.feet.stiffness.validation import Candidate, clipped_cluster, train_and_command

TESTED = 0.25
"""Ratio of the grounds that a learning curve tests on."""

MOST = 1000
"""Most points and most repetitions of a learning curve."""


@dataclass(frozen=True, eq=False)
class LearningCurve:
    """Quality on unseen grounds against the number of grounds that were trained on.

    Attributes:
        grounds: Numbers of training grounds, shape (k,).
        accuracy: Share in the right cluster, by number and repetition, shape (k, repetitions).
        mean_error: Mean distance from the best stiffness, Nm/rad, shape (k, repetitions).
    """

    grounds: NDArray[np.intp]
    accuracy: Array
    mean_error: Array


def learning_curve(
    table: StiffnessTable,
    candidate: Candidate | ModelSettings | None = None,
    *,
    points: int = 6,
    repetitions: int = 10,
) -> LearningCurve:
    """Return accuracy and error on test grounds, after training on more and more of the others.

    Args:
        table: Profiles with their best stiffness.
        candidate: Model to train; the paper's when None.
        points: Number of points of the curve.
        repetitions: Number of random splits.

    Raises:
        InputError: A single class, too few grounds, or a number of points or repetitions outside 1 to 1000.
    """
    for name, number in (("points", points), ("repetitions", repetitions)):
        if whole_number(name, number, low=1) > MOST:
            raise InputError(f"{name} of a learning curve must be at most {MOST}, got {number}")
    settings = candidate if isinstance(candidate, ModelSettings) else ModelSettings()
    model = candidate if isinstance(candidate, Candidate) else Candidate.of(settings)
    labels = table.labels(settings.clusters)
    features = FeatureSet(model.features)(table.values)
    target = labels if model.kind == "classification" else table.stiffness
    groups = table.groups(("ground", "amplitude"))
    number = int(groups.max()) + 1
    tested = max(1, round(TESTED * number))
    # The smallest number of grounds that have enough rows for the neighbours, whichever are drawn.
    fewest = int(np.searchsorted(np.cumsum(np.sort(np.bincount(groups))), settings.neighbours)) + 1
    if number - tested <= fewest:
        raise InputError(
            f"a learning curve needs more than {fewest + tested} grounds, the table has {number}"
        )
    sizes = np.unique(np.geomspace(fewest, number - tested, points).round().astype(np.intp))
    accuracy, error = np.empty((sizes.size, repetitions)), np.empty((sizes.size, repetitions))
    rng = np.random.default_rng(0)
    for j in range(repetitions):
        order = rng.permutation(number)
        test = np.isin(groups, order[:tested])
        for i, size in enumerate(sizes):
            train = np.isin(groups, order[tested : tested + size])
            command = train_and_command(
                model, features[train], target[train], features[test], settings.clusters
            )
            accuracy[i, j] = (clipped_cluster(settings.clusters, command) == labels[test]).mean()
            error[i, j] = np.abs(command - table.stiffness[test]).mean()
    return LearningCurve(sizes, accuracy, error)


@dataclass(frozen=True, eq=False)
class PrincipalComponents:
    """Principal components of the scaled features.

    Attributes:
        explained: Share of the variance in each component, descending, shape (f,).
        scores: Rows in the first two components, shape (n, 2).
    """

    explained: Array
    scores: Array


def principal_components(
    table: StiffnessTable, features: Sequence[str] = PAPER_FEATURES
) -> PrincipalComponents:
    """Return the principal components of the scaled features; in the paper two explain more than 87 %."""
    from sklearn.decomposition import PCA  # noqa: PLC0415 - slow to import
    from sklearn.preprocessing import StandardScaler  # noqa: PLC0415

    scaled = StandardScaler().fit_transform(FeatureSet(tuple(features))(table.values))
    pca = PCA().fit(scaled)
    return PrincipalComponents(
        np.asarray(pca.explained_variance_ratio_), np.asarray(pca.transform(scaled))[:, :2]
    )


def stiffness_by_amplitude(table: StiffnessTable) -> dict[str, tuple[Array, Array]]:
    """Return for each ground its amplitudes, m, and the mean best stiffness at each, Nm/rad."""
    curves = {}
    for ground in dict.fromkeys(table.ground.tolist()):
        rows = table.ground == ground
        amplitudes = np.unique(table.amplitude[rows])
        best = np.array([table.stiffness[rows & (table.amplitude == a)].mean() for a in amplitudes])
        curves[ground] = amplitudes, best
    return curves


def amplitude_trends(table: StiffnessTable) -> dict[str, float]:
    """Return Spearman's rank correlation between amplitude and mean best stiffness on each ground.

    It is −1 if the stiffness always falls, +1 if it always rises, NaN if it does not change or there are fewer than
    three amplitudes. In the data of the paper's authors the stiffness falls on every ground.
    """
    from scipy.stats import spearmanr  # noqa: PLC0415 - slow to import

    trends = {}
    for ground, (amplitudes, best) in stiffness_by_amplitude(table).items():
        constant = amplitudes.size < 3 or np.ptp(best) == 0.0
        trends[ground] = float("nan") if constant else float(spearmanr(amplitudes, best).statistic)
    return trends
