"""From roughness to stiffness: nearest neighbours among the grounds that the best stiffness is known of."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from functools import cache, cached_property
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wbc._version import __version__
from wbc.core.errors import Array, InputError, choose, finite_array, finite_scalar
from wbc.core.files import read_text
from wbc.feet.stiffness.clusters import Clusters
from wbc.feet.stiffness.dataset import ProfileRecipe, StiffnessTable, parse_head
from wbc.feet.stiffness.features import PAPER_FEATURES, FeatureSet

FORMAT = "wbc stiffness model"
VERSION = 1

Kind = Literal["classification", "regression"]


@dataclass(frozen=True)
class ModelSettings:
    """What kind of model, and of what.

    Attributes:
        features: Names of the features, see `FeatureSet`.
        neighbours: Number of neighbours that have a say, each weighted by the inverse of its distance.
        clusters: Ranges of stiffness that are chosen between.
        kind: "classification" commands the mean of the most likely cluster, "regression" the weighted mean of the
            neighbours' best stiffness.
        familiar_share: A profile is unlike anything known if its nearest neighbour is further away than that of this
            share of the training profiles, each measured without its own ground and amplitude.

    Source: features, neighbours and clusters from the paper, section IV-B.
    """

    features: tuple[str, ...] = PAPER_FEATURES
    neighbours: int = 10
    clusters: Clusters = field(default_factory=Clusters.linear)
    kind: Kind = "classification"
    familiar_share: float = 0.99

    def __post_init__(self) -> None:
        FeatureSet(self.features)
        if (
            isinstance(self.neighbours, bool)
            or int(self.neighbours) != self.neighbours
            or self.neighbours < 1
        ):
            raise InputError(f"neighbours must be a whole number of at least 1, got {self.neighbours!r}")
        choose("kind of stiffness model", self.kind, get_args(Kind))
        finite_scalar("share of familiar profiles", self.familiar_share, low=0.5, high=1.0)


@dataclass(frozen=True, slots=True)
class Prediction:
    """What a model says about one profile.

    Attributes:
        stiffness: To command, Nm/rad.
        cluster: Range that it lies in, from 1.
        distance: To the nearest training profile, in deviations of the features.
        familiar: False if that is further than the model vouches for.
        features: Values of the features, shape (number of features,).
    """

    stiffness: float
    cluster: int
    distance: float
    familiar: bool
    features: Array


@dataclass(frozen=True, eq=False)
class StiffnessModel:
    """Nearest neighbours on scaled features: all that a prediction needs, as plain numbers.

    `predict` is a few lines of NumPy and gives what `pipeline().predict` gives, many times as fast. Where rows are
    exactly as far as the last neighbour, as with level ground among level ground, all of them have a say; scikit-learn
    takes whichever it comes across first.

    Attributes:
        settings: What kind of model.
        recipe: How a profile has to be cut, filtered and measured before it is asked about.
        features: Features of the training profiles, not scaled, shape (n, f).
        stiffness: Best stiffness of each, Nm/rad, shape (n,).
        mean: Mean of each feature, shape (f,).
        scale: Deviation of each feature, 1 where it does not vary, shape (f,).
        reach: Greatest distance of a familiar profile from its nearest neighbour.
        made: Where it comes from: versions, the table's hash and what the table says of itself.
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
        """Learn from a table.

        Args:
            table: Profiles with their best stiffness.
            settings: What kind of model; the paper's when None.

        Raises:
            InputError: Fewer rows than neighbours, a stiffness outside the clusters, or all of one cluster.
        """
        import sklearn  # noqa: PLC0415 - a prediction does not need it
        from sklearn.preprocessing import StandardScaler  # noqa: PLC0415

        given = ModelSettings() if settings is None else settings
        if len(table) < given.neighbours:
            raise InputError(f"{given.neighbours} neighbours need as many rows, the table has {len(table)}")
        labels = given.clusters.of(table.stiffness)
        if np.unique(labels).size < 2:
            raise InputError(
                f"the table has a single class: the best stiffness of all {len(table)} rows is in cluster {labels[0]}; "
                "at least two are needed to learn anything"
            )
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
        """Ask about one profile.

        Args:
            values: Its roughness parameters, computed as `recipe` says, shape (10,).

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
        # A profile that is in the training set is decided by what is known of it alone, as in scikit-learn.
        weight = 1.0 / distance if closest > 0.0 else (distance == 0.0).astype(np.float64)
        if self.settings.kind == "classification":
            votes = np.bincount(self.labels[nearest], weight, len(self._centres) + 1)
            cluster = int(np.argmax(votes))
            stiffness = float(self._centres[cluster - 1])
        else:
            stiffness = float(weight @ self.stiffness[nearest] / weight.sum())
            cluster = int(self.settings.clusters.of(stiffness))
        return Prediction(stiffness, cluster, closest, closest <= self.reach, features)

    def pipeline(self) -> Any:
        """The same model as a fitted scikit-learn pipeline on features that are not scaled.

        It predicts cluster numbers, or stiffness in Nm/rad for a regression.
        """
        pipeline = knn_pipeline(self.settings)
        return pipeline.fit(
            self.features, self.labels if self.settings.kind == "classification" else self.stiffness
        )

    def save(self, path: str | Path) -> None:
        """Write the model as JSON, one training profile per line; numbers are exact."""
        head = {
            "format": FORMAT,
            "version": VERSION,
            "settings": asdict(self.settings),
            "recipe": asdict(self.recipe),
            "mean": self.mean.tolist(),
            "scale": self.scale.tolist(),
            "reach": self.reach,
            "made": dict(self.made),
        }
        rows = [[*f, k] for f, k in zip(self.features.tolist(), self.stiffness.tolist(), strict=True)]
        lines = [f"  {json.dumps(key)}: {json.dumps(value)}" for key, value in head.items()]
        lines.append('  "rows": [\n' + ",\n".join("    " + json.dumps(row) for row in rows) + "\n  ]")
        Path(path).write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")

    @classmethod
    def load(cls, path: str | Path) -> StiffnessModel:
        """Read what `save` wrote.

        Raises:
            InputError: No such file, another format or version, or contents that do not fit together.
        """
        target = Path(path)
        if not target.is_file():
            raise InputError(f"no stiffness model '{target}'")
        given = parse_head(read_text(target, FORMAT), FORMAT, VERSION, target)
        try:
            settings = dict(given["settings"])
            clusters = Clusters(tuple(settings.pop("clusters")["edges"]))
            features = tuple(settings.pop("features"))
            model_settings = ModelSettings(features=features, clusters=clusters, **settings)
            rows = finite_array(f"{target}: rows", given["rows"])
            count = len(features)
            if rows.ndim != 2 or rows.shape[1] != count + 1 or rows.shape[0] < model_settings.neighbours:
                least = model_settings.neighbours
                raise InputError(
                    f"{target}: rows must have shape ({least} or more, {count + 1}), got {rows.shape}"
                )
            model = cls(
                settings=model_settings,
                recipe=ProfileRecipe.from_dict(given["recipe"]),
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
            clusters.of(model.stiffness)
        except (KeyError, TypeError, ValueError) as error:
            if isinstance(error, InputError):
                raise
            raise InputError(f"{target} is not a whole {FORMAT}: {type(error).__name__} {error}") from error
        return model


DEFAULT_MODEL = Path(__file__).parent / "data" / "stiffness_model.json"
"""The model that comes with the library; its table lies beside it."""

DEFAULT_TABLE = DEFAULT_MODEL.with_name("stiffness_table.csv")
"""What it was trained on."""


@cache
def default_model() -> StiffnessModel:
    """The model that comes with the library, trained on walks in the simulator."""
    return StiffnessModel.load(DEFAULT_MODEL)


def knn_pipeline(settings: ModelSettings) -> Any:
    """Scaling and nearest neighbours of scikit-learn, not fitted: k-d tree, Euclidean, inverse distances (paper)."""
    from sklearn.neighbors import KNeighborsClassifier, KNeighborsRegressor  # noqa: PLC0415 - as above
    from sklearn.pipeline import make_pipeline  # noqa: PLC0415
    from sklearn.preprocessing import StandardScaler  # noqa: PLC0415

    kind = KNeighborsClassifier if settings.kind == "classification" else KNeighborsRegressor
    neighbours = kind(settings.neighbours, weights="distance", algorithm="kd_tree", metric="euclidean")
    return make_pipeline(StandardScaler(), neighbours)


def _nearest(squared: Array, count: int) -> NDArray[np.intp]:
    """Places of the smallest entries, and of all that are equal to the last of them."""
    return np.flatnonzero(squared <= np.partition(squared, count - 1)[count - 1])


def _distance_to_others(samples: Array, groups: NDArray[np.intp]) -> Array:
    """Distance of each sample to the nearest one of another group; of any other one if there is a single group."""
    nearest = np.empty(len(samples))
    single = np.unique(groups).size == 1
    for i, sample in enumerate(samples):
        other = np.arange(len(samples)) != i if single else groups != groups[i]
        nearest[i] = np.sqrt(((samples[other] - sample) ** 2).sum(axis=1).min())
    return nearest
