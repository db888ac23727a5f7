"""`StiffnessModel`: stiffness from roughness, by nearest neighbours among grounds of known best stiffness."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache, cached_property
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import Field

from wbc._version import __version__
from wbc.core.errors import Array, InputError, finite_array
from wbc.core.files import decoding, read_text, write_text
from wbc.core.settings import Count, settings, to_json
from wbc.feet.stiffness.clusters import Clusters
from wbc.feet.stiffness.dataset import ProfileRecipe, StiffnessTable, complete_settings, parse_head
from wbc.feet.stiffness.features import PAPER_FEATURES, FeatureSet

FORMAT = "wbc stiffness model"
VERSION = 1

Kind = Literal["classification", "regression"]


@settings
class ModelSettings:
    """Settings of a nearest-neighbour model.

    Attributes:
        features: Names of the features, see `FeatureSet`.
        neighbours: Number of neighbours, each weighted by the inverse of its distance.
        clusters: Classes of a classification, ranges of stiffness.
        kind: "classification" commands the mean of the most likely cluster, "regression" the weighted mean of the
            neighbours' best stiffness.
        familiar_share: Quantile of the training profiles' distances to their nearest neighbour on another ground or
            amplitude, beyond which a profile counts as unfamiliar.

    Source: features, neighbours and clusters from the paper, section IV-B.
    """

    features: tuple[str, ...] = PAPER_FEATURES
    neighbours: Count = 10
    clusters: Clusters = field(default_factory=Clusters.linear)
    kind: Kind = "classification"
    familiar_share: Annotated[float, Field(ge=0.5, le=1.0)] = 0.99

    def __post_init__(self) -> None:
        FeatureSet(self.features)


@dataclass(frozen=True, slots=True)
class Prediction:
    """Prediction of a model for one profile.

    Attributes:
        stiffness: Stiffness to command, Nm/rad.
        cluster: Number of its cluster, from 1.
        distance: Distance to the nearest training profile, in standard deviations of the features.
        familiar: False if that distance exceeds the reach of the model.
        features: Values of the features, shape (number of features,).
    """

    stiffness: float
    cluster: int
    distance: float
    familiar: bool
    features: Array


@dataclass(frozen=True, eq=False)
class StiffnessModel:
    """A fitted nearest-neighbour model on scaled features.

    `predict` is a few lines of NumPy with the results of scikit-learn (`knn_pipeline`), many times as fast. All rows at
    the distance of the last neighbour are neighbours, as with level ground among level ground; scikit-learn takes the
    first of them.

    Attributes:
        settings: Settings of the model.
        recipe: Settings of the roughness that the model takes.
        features: Features of the training profiles, not scaled, shape (n, f).
        stiffness: Best stiffness of each, Nm/rad, shape (n,).
        mean: Mean of each feature, shape (f,).
        scale: Standard deviation of each feature, 1 where it does not vary, shape (f,).
        reach: Largest distance of a familiar profile from its nearest neighbour.
        made: Provenance: versions, hash and provenance of the table.
    """

    settings: ModelSettings
    recipe: ProfileRecipe
    features: Array
    stiffness: Array
    mean: Array
    scale: Array
    reach: float
    made: Mapping[str, Any]

    @classmethod
    def fit(cls, table: StiffnessTable, settings: ModelSettings | None = None) -> StiffnessModel:
        """Return a model fitted to a table.

        Args:
            table: Profiles with their best stiffness.
            settings: Settings of the model; the paper's when None.

        Raises:
            InputError: Fewer rows than neighbours, a stiffness outside the clusters, or all of one cluster.
        """
        import sklearn  # noqa: PLC0415 - a prediction does not need it
        from sklearn.preprocessing import StandardScaler  # noqa: PLC0415

        given = ModelSettings() if settings is None else settings
        if len(table) < given.neighbours:
            raise InputError(f"{given.neighbours} neighbours need as many rows, the table has {len(table)}")
        table.labels(given.clusters)  # raises for a single class
        features = FeatureSet(given.features)(table.values)
        scaler = StandardScaler().fit(features)
        model = cls(
            settings=given,
            recipe=table.recipe,
            features=features,
            stiffness=table.stiffness.copy(),
            mean=np.asarray(scaler.mean_),
            scale=np.asarray(scaler.scale_),
            reach=np.inf,
            made={
                "wbc": __version__,
                "scikit-learn": str(sklearn.__version__),
                "table": table.fingerprint(),
                "rows": len(table),
                "table_made": dict(table.made),
            },
        )
        nearest = _distance_to_others(model._samples, table.groups(("ground", "amplitude")))
        object.__setattr__(model, "reach", float(np.quantile(nearest, given.familiar_share)))
        return model

    @cached_property
    def _feature_set(self) -> FeatureSet:
        return FeatureSet(self.settings.features)

    @cached_property
    def _samples(self) -> Array:
        """Scaled features of the training profiles, shape (n, f)."""
        return np.asarray((self.features - self.mean) / self.scale)

    @cached_property
    def labels(self) -> NDArray[np.intp]:
        """Cluster of each training profile, from 1, shape (n,)."""
        return self.settings.clusters.of(self.stiffness)

    @cached_property
    def _centres(self) -> Array:
        return self.settings.clusters.centres

    def predict(self, values: ArrayLike) -> Prediction:
        """Return the prediction for one profile.

        Args:
            values: Its roughness parameters, computed with the settings in `recipe`, shape (10,).

        Raises:
            InputError: Wrong shape, NaN or infinite.
        """
        features = self._feature_set(values)
        if features.ndim != 1:
            raise InputError(f"predict is for one profile, got values of shape {np.shape(values)}")
        query = (features - self.mean) / self.scale
        difference = self._samples - query
        squared = (difference * difference).sum(axis=1)
        nearest = _nearest(squared, self.settings.neighbours)
        distance = np.sqrt(squared[nearest])
        closest = float(distance.min())
        # A profile of the training set has no other neighbours, as in scikit-learn.
        weight = 1.0 / distance if closest > 0.0 else (distance == 0.0).astype(np.float64)
        if self.settings.kind == "classification":
            votes = np.bincount(self.labels[nearest], weight, len(self._centres) + 1)
            cluster = int(np.argmax(votes))
            stiffness = float(self._centres[cluster - 1])
        else:
            stiffness = float(weight @ self.stiffness[nearest] / weight.sum())
            cluster = int(self.settings.clusters.of(stiffness))
        return Prediction(stiffness, cluster, closest, closest <= self.reach, features)

    def save(self, path: str | Path) -> None:
        """Write the model as JSON, one training profile per line; numbers are exact.

        Raises:
            FileError: The file cannot be written; an old one is unchanged.
        """
        head = {
            "format": FORMAT,
            "version": VERSION,
            "settings": to_json(self.settings),
            "recipe": to_json(self.recipe),
            "mean": self.mean.tolist(),
            "scale": self.scale.tolist(),
            "reach": self.reach,
            "made": dict(self.made),
        }
        rows = [[*f, k] for f, k in zip(self.features.tolist(), self.stiffness.tolist(), strict=True)]
        lines = [f"  {json.dumps(key)}: {json.dumps(value)}" for key, value in head.items()]
        lines.append('  "rows": [\n' + ",\n".join("    " + json.dumps(row) for row in rows) + "\n  ]")
        write_text(path, "{\n" + ",\n".join(lines) + "\n}\n")

    @classmethod
    def load(cls, path: str | Path) -> StiffnessModel:
        """Return the model that `save` wrote.

        Raises:
            InputError: No such file, another format or version, or contents that do not fit together.
        """
        target = Path(path)
        if not target.is_file():
            raise InputError(f"no stiffness model '{target}'")
        given = parse_head(read_text(target, FORMAT), FORMAT, VERSION, target)
        with decoding(target, FORMAT):
            model_settings = complete_settings(ModelSettings, given["settings"])
            rows = finite_array(f"{target}: rows", given["rows"])
            count, neighbours = len(model_settings.features), model_settings.neighbours
            if rows.ndim != 2 or rows.shape[1] != count + 1 or rows.shape[0] < neighbours:
                raise InputError(
                    f"{target}: rows must have shape ({neighbours} or more, {count + 1}), got {rows.shape}"
                )
            model = cls(
                settings=model_settings,
                recipe=complete_settings(ProfileRecipe, given["recipe"]),
                features=rows[:, :-1],
                stiffness=rows[:, -1],
                mean=finite_array(f"{target}: mean", given["mean"], (count,)),
                scale=finite_array(f"{target}: scale", given["scale"], (count,)),
                reach=float(given["reach"]),
                made=given["made"],
            )
            if (model.scale <= 0.0).any() or not model.reach >= 0.0:
                raise InputError(
                    f"{target}: scale and reach must be positive, got {model.scale} and {model.reach}"
                )
            model_settings.clusters.of(model.stiffness)
        return model


DEFAULT_MODEL = Path(__file__).parent / "data" / "stiffness_model.json"
"""The default model, part of the library."""

DEFAULT_TABLE = DEFAULT_MODEL.with_name("stiffness_table.csv")
"""Training data of the default model."""


@cache
def default_model() -> StiffnessModel:
    """Return the default model, trained on walks in the simulator."""
    return StiffnessModel.load(DEFAULT_MODEL)


def knn_pipeline(settings: ModelSettings) -> Any:
    """Return the paper's scikit-learn model, not fitted: scaling, k-d tree, Euclidean, inverse distances."""
    from sklearn.neighbors import KNeighborsClassifier, KNeighborsRegressor  # noqa: PLC0415 - a prediction does not need it
    from sklearn.pipeline import make_pipeline  # noqa: PLC0415
    from sklearn.preprocessing import StandardScaler  # noqa: PLC0415

    kind = KNeighborsClassifier if settings.kind == "classification" else KNeighborsRegressor
    neighbours = kind(settings.neighbours, weights="distance", algorithm="kd_tree", metric="euclidean")
    return make_pipeline(StandardScaler(), neighbours)


def _nearest(squared: Array, count: int) -> NDArray[np.intp]:
    """Return the indices of the smallest entries, and of all that are equal to the last of them."""
    return np.flatnonzero(squared <= np.partition(squared, count - 1)[count - 1])


def _distance_to_others(samples: Array, groups: NDArray[np.intp]) -> Array:
    """Return the distance of each sample to the nearest of another group; to any other one if there is one group."""
    nearest = np.empty(len(samples))
    single = np.unique(groups).size == 1
    for i, sample in enumerate(samples):
        other = np.arange(len(samples)) != i if single else groups != groups[i]
        nearest[i] = np.sqrt(((samples[other] - sample) ** 2).sum(axis=1).min())
    return nearest
