"""Cross-validation of stiffness models on grounds that they were not trained on."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from wbc.core.arguments import checked
from wbc.core.errors import Array, InputError, choose, whole_number
from wbc.feet.stiffness.clusters import Clusters
from wbc.feet.stiffness.dataset import StiffnessTable
from wbc.feet.stiffness.features import PAPER_FEATURES, FeatureSet
from wbc.feet.stiffness.model import Kind, ModelSettings, knn_pipeline

Protocol = Literal["paper", "shuffled", "layouts", "amplitudes", "grounds"]

PROTOCOLS: Mapping[Protocol, str] = {
    "paper": "stratified folds in the order of the rows: profiles of one ground are on both sides",
    "shuffled": "stratified folds of shuffled rows: the same, independent of the order",
    "layouts": "a layout of a ground is on one side; other layouts of the same ground are on the other",
    "amplitudes": "a ground at one amplitude is on one side",
    "grounds": "a ground is on one side, with all its amplitudes",
}
"""Ways to split a table into training and test rows; "grounds" compares to a walk on unknown ground."""

_GROUPS: Mapping[Protocol, tuple[str, ...]] = {
    "layouts": ("ground", "seed"),
    "amplitudes": ("ground", "amplitude"),
    "grounds": ("ground",),
}


@dataclass(frozen=True)
class Candidate:
    """A model to validate.

    Attributes:
        name: Its name in tables.
        estimator: Function that returns a scikit-learn estimator, not fitted.
        kind: "classification" if it predicts cluster numbers, "regression" if stiffness.
        features: Names of its features.
    """

    name: str
    estimator: Callable[[], Any]
    kind: Kind = "classification"
    features: tuple[str, ...] = PAPER_FEATURES

    @classmethod
    def of(cls, settings: ModelSettings, name: str = "model") -> Candidate:
        """Return the nearest-neighbour model with these settings."""
        return cls(name, lambda: knn_pipeline(settings), settings.kind, settings.features)


@dataclass(frozen=True, eq=False)
class Validation:
    """Predictions for every row of a table, each by a model that was not trained on the row's fold.

    Attributes:
        name: Name of the candidate.
        protocol: Way the table was split.
        clusters: Ranges of stiffness.
        truth: Best stiffness of each row, Nm/rad.
        command: Stiffness that the model commands, Nm/rad.
        fold: Number of the fold of each row.
        in_range: True where the command is in the range of nearly best stiffness; None if no range is known.
    """

    name: str
    protocol: Protocol
    clusters: Clusters
    truth: Array
    command: Array
    fold: NDArray[np.intp]
    in_range: NDArray[np.bool_] | None = field(repr=False)

    @property
    def true_cluster(self) -> NDArray[np.intp]:
        """Cluster of the best stiffness of each row."""
        return self.clusters.of(self.truth)

    @property
    def cluster(self) -> NDArray[np.intp]:
        """Cluster of the command of each row."""
        return clipped_cluster(self.clusters, self.command)

    @property
    def accuracy_per_fold(self) -> Array:
        """Share of rows in the right cluster, by fold."""
        right = self.cluster == self.true_cluster
        return np.array([right[self.fold == f].mean() for f in np.unique(self.fold)])

    @property
    def accuracy(self) -> float:
        """Mean over the folds of the share of rows in the right cluster."""
        return float(self.accuracy_per_fold.mean())

    @property
    def accuracy_std(self) -> float:
        """Standard deviation over the folds of the share of rows in the right cluster."""
        return float(self.accuracy_per_fold.std())

    @property
    def mean_error(self) -> float:
        """Mean distance of the command from the best stiffness, Nm/rad."""
        return float(np.abs(self.command - self.truth).mean())

    @property
    def within_one(self) -> float:
        """Share of rows in the right cluster or one beside it."""
        return float((np.abs(self.cluster - self.true_cluster) <= 1).mean())

    @property
    def share_in_range(self) -> float:
        """Share of rows whose command is nearly best; NaN if no range is known."""
        return float("nan") if self.in_range is None else float(self.in_range.mean())

    def confusion(self) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Return the clusters that occur, (c,), and numbers of rows by true (first axis) and predicted one, (c, c)."""
        true, predicted = self.true_cluster, self.cluster
        names = np.unique(np.concatenate([true, predicted]))
        counts = np.zeros((names.size, names.size), dtype=np.intp)
        np.add.at(counts, (np.searchsorted(names, true), np.searchsorted(names, predicted)), 1)
        return names, counts


@checked
def cross_validate(
    table: StiffnessTable,
    candidate: Candidate | ModelSettings | None = None,
    protocol: Protocol = "grounds",
    *,
    folds: int = 10,
    clusters: Clusters | None = None,
) -> Validation:
    """Return predictions for every row, each by a model that was trained without the row's fold.

    Args:
        table: Profiles with their best stiffness.
        candidate: Model to validate; the paper's when None.
        protocol: Way to split the table, one of `PROTOCOLS`.
        folds: Number of folds; the number of groups if that is smaller and the protocol has groups.
        clusters: Ranges of stiffness; those of the settings, or the paper's.

    Raises:
        InputError: A single class, fewer than two folds or groups, or more folds than rows of any class.
        UnknownNameError: No such protocol.
    """
    settings = candidate if isinstance(candidate, ModelSettings) else ModelSettings()
    model = candidate if isinstance(candidate, Candidate) else Candidate.of(settings)
    ranges = settings.clusters if clusters is None else clusters
    labels = table.labels(ranges)
    splitter, groups = fold_splitter(table, labels, protocol, folds)
    features = FeatureSet(model.features)(table.values)
    command, fold = np.empty(len(table)), np.empty(len(table), dtype=np.intp)
    with warnings.catch_warnings():
        # Classes of fewer rows than folds, as in the paper's data.
        warnings.filterwarnings("ignore", message="The least populated class", category=UserWarning)
        splits = list(splitter.split(features, labels, groups))
    for i, (train, test) in enumerate(splits):
        target = labels if model.kind == "classification" else table.stiffness
        command[test] = train_and_command(model, features[train], target[train], features[test], ranges)
        fold[test] = i
    known = np.isfinite(table.stiffness_low) & np.isfinite(table.stiffness_high)
    inside = (command >= table.stiffness_low) & (command <= table.stiffness_high) if known.all() else None
    return Validation(model.name, protocol, ranges, table.stiffness, command, fold, inside)


def fold_splitter(
    table: StiffnessTable, labels: NDArray[np.intp], protocol: Protocol, folds: int
) -> tuple[Any, NDArray[np.intp] | None]:
    """Return scikit-learn's splitter of a protocol, and the groups of the rows if the protocol has groups.

    Labels are the cluster of each row, shape (n,). There are as many folds as groups if these are fewer. Raises
    `UnknownNameError` for no such protocol, `InputError` for fewer than two folds or groups, or more folds than rows of
    any class.
    """
    from sklearn.model_selection import GroupKFold, StratifiedKFold  # noqa: PLC0415 - only studies need it

    choose("protocol of the cross-validation", protocol, PROTOCOLS)
    whole_number("folds", folds, low=2)
    if protocol in _GROUPS:
        groups = table.groups(_GROUPS[protocol])
        count = min(folds, int(groups.max()) + 1)
        if count < 2:
            raise InputError(f"protocol '{protocol}' needs at least two groups, the table has one")
        return GroupKFold(count), groups
    most = int(np.bincount(labels).max())
    if most < folds:
        raise InputError(f"{folds} stratified folds need a class of as many rows, the largest has {most}")
    shuffled = protocol == "shuffled"
    return StratifiedKFold(folds, shuffle=shuffled, random_state=0 if shuffled else None), None


def train_and_command(
    model: Candidate, features: Array, target: NDArray[Any], query: Array, clusters: Clusters
) -> Array:
    """Return the stiffness that a model commands for queried rows, shape (m, f), after training, shape (m,), Nm/rad.

    It is trained on features of rows, shape (n, f), and their cluster numbers or stiffness, shape (n,). `InputError`:
    the estimator refuses these rows; the message has its reason.
    """
    try:
        predicted = np.asarray(model.estimator().fit(features, target).predict(query))
    except ValueError as error:
        raise InputError(f"'{model.name}' cannot be fitted to {len(target)} rows: {error}") from error
    if model.kind == "classification":
        return np.asarray(clusters.centres[predicted.astype(np.intp) - 1])
    return predicted


def clipped_cluster(clusters: Clusters, command: Array) -> NDArray[np.intp]:
    """Return the cluster of each command; a command beyond all clusters counts as the nearest."""
    return clusters.of(np.clip(command, clusters.edges[0], clusters.edges[-1]))
