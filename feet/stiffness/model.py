"""`StiffnessModel`: stiffness from roughness, by nearest neighbours among grounds of known best stiffness."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache, cached_property
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import Field

from wbc._version import __version__
from wbc.base.checked import checked
from wbc.base.errors import InputError, choose, shown
from wbc.base.files import naming, parsing, read_text, write_text
from wbc.base.numbers import Array, finite_array, finite_scalar
from wbc.base.settings import Count, NonNegative, Positive, from_json, settings, to_json
from wbc.feet.sensing.roughness import PARAMETERS, RoughnessSettings
from wbc.feet.sensing.scan import PROFILE_STEP

FORMAT, VERSION = "wbc stiffness model", 1

DEFAULT_MODEL = Path(__file__).parent / "data" / "stiffness_model.json"
"""The default model, part of the library."""

PAPER_FEATURES = ("Sp", "P", "P^2", "Sku^3", "P^3", "Sp^3")
"""Features of the paper, section IV-B."""


COMPLIANCE = "compliance"
"""Feature of the ground that is felt, not seen: depth of a foot over its load in the last steps, m/N."""


def feature_values(values: ArrayLike, names: tuple[str, ...]) -> Array:
    """Return features, shape (…, n), of roughness parameters in the order of `PARAMETERS`, shape (…, 10) or (…, 11).

    A feature is a parameter ("Sp"), one of its powers ("Sp^3"), its square root ("sqrt(P)") or "lines": 1 / (1 − K),
    the effective number of lines in the spectrum, 2 for one wave, the number of samples for white noise. The feature
    "compliance" is an eleventh value, m/N, by which a foot sinks over its load; it is 0 where it is left out.
    """
    given = finite_array("roughness parameters", values)
    if given.ndim < 1 or given.shape[-1] not in (len(PARAMETERS), len(PARAMETERS) + 1):
        raise InputError(
            f"roughness parameters must have shape (…, {len(PARAMETERS)}), or one more with the compliance, got "
            f"{given.shape}"
        )
    base, power = _parsed(names)
    seen, felt = np.split(given, [len(PARAMETERS)], axis=-1)
    if not felt.size:
        felt = np.zeros_like(seen[..., :1])
    # K of a real profile is below 1 − 1 / samples; the floor is for values of K that no profile has.
    lines = 1.0 / np.maximum(1.0 - seen[..., -1:], 1e-6)
    return np.asarray(np.concatenate([seen, lines, felt], axis=-1)[..., base] ** power)


@cache
def _parsed(names: tuple[str, ...]) -> tuple[NDArray[np.intp], Array]:
    """Return the index of each feature's parameter, those of "lines" and compliance the last, and its power."""
    base, power = [], []
    for name in names:
        found = re.fullmatch(r"sqrt\((?P<root>\w+)\)|(?P<base>\w+)(\^(?P<power>[2-9]))?", name)
        if found is None or found["root"] == "Ssk":  # which can be negative
            raise InputError(
                f"feature '{name}' must be a parameter, a power such as 'Sp^3' or a root such as 'sqrt(P)'"
            )
        known = (*PARAMETERS, "lines", COMPLIANCE)
        base.append(known.index(choose("roughness parameter", found["root"] or found["base"], known)))
        power.append(0.5 if found["root"] else float(found["power"] or 1.0))
    return np.array(base, np.intp), np.array(power)


@settings
class ProfileRecipe:
    """Settings that the roughness which a model takes is computed with.

    Attributes:
        step: Distance of the samples of a profile, m.
        window: Length of a profile, m; None for whole tracks. By default the length scanned in a step of 0.145 m when
            the stiffness is decided (`wbc.tasks.scheduling.stiffness.StiffnessTiming`).
        roughness: Filter.
    """

    step: Annotated[Positive, "m"] = PROFILE_STEP
    window: Annotated[Positive, "m"] | None = 0.182
    roughness: RoughnessSettings = field(default_factory=RoughnessSettings)


@settings
class Clusters:
    """Neighbouring ranges of stiffness, the classes of a classification, numbered from 1.

    Attributes:
        edges: Boundaries, ascending from 0 or above, Nm/rad; a stiffness on a boundary belongs to the range above it,
            the last boundary to the last range. By default 20 of 4 Nm/rad (the paper, section IV-B).
    """

    edges: Annotated[tuple[float, ...], "Nm/rad"] = tuple(4.0 * i for i in range(21))

    def __post_init__(self) -> None:
        if len(self.edges) < 3 or self.edges[0] < 0.0 or (np.diff(self.edges) <= 0.0).any():
            raise InputError(f"edges of clusters must ascend from 0 Nm/rad or above, got {self.edges}")

    @cached_property
    def centres(self) -> Array:
        """Middle of each range, its command, Nm/rad: the geometric mean of boundaries of one ratio."""
        low, high = np.array(self.edges[:-1]), np.array(self.edges[1:])
        linear = (low == 0.0) | np.allclose(high - low, high[0] - low[0])
        centres: Array = np.where(linear, (low + high) / 2.0, np.sqrt(low * high))
        centres.setflags(write=False)
        return centres

    def of(self, stiffness: ArrayLike) -> NDArray[np.intp]:
        """Return the number of the range of each stiffness (Nm/rad), from 1; `InputError` outside all ranges."""
        k = finite_array("stiffness (Nm/rad)", stiffness)
        if k.size and (k.min() < self.edges[0] or k.max() > self.edges[-1]):
            raise InputError(
                f"stiffness must lie in the clusters' [{self.edges[0]:g}, {self.edges[-1]:g}] Nm/rad, got {k.min():g} "
                f"to {k.max():g}"
            )
        return np.minimum(np.searchsorted(self.edges, k, side="right"), len(self.edges) - 1).astype(np.intp)


@settings
class ModelSettings:
    """Settings of a nearest-neighbour model.

    Attributes:
        features: Names of the features, see `feature_values`.
        neighbours: Number of neighbours, each weighted by the inverse of its distance.
        clusters: Classes of a classification, ranges of stiffness.
        kind: "classification" commands the middle of the most likely cluster, "regression" the weighted mean of the
            neighbours' best stiffness.
        familiar_share: Quantile of the training profiles' distances to their nearest neighbour of another group,
            beyond which a profile counts as unfamiliar.

    Source: features, neighbours and clusters from the paper, section IV-B.
    """

    features: Annotated[tuple[str, ...], Field(min_length=1)] = PAPER_FEATURES
    neighbours: Count = 10
    clusters: Clusters = field(default_factory=Clusters)
    kind: Literal["classification", "regression"] = "classification"
    familiar_share: Annotated[float, Field(ge=0.5, le=1.0)] = 0.99

    def __post_init__(self) -> None:
        _parsed(self.features)


@dataclass(frozen=True)
class StiffnessDecision:
    """Answer of a model, or of a stiffness policy.

    Attributes:
        stiffness: Stiffness to set, Nm/rad.
        cluster: Cluster of the ground, from 1; None without clusters.
        familiar: False if the ground is unlike all grounds that the model knows: the sole then keeps its stiffness.
        distance: Distance to the nearest known ground, in standard deviations of the features; None if unknown.
        features: Features that the decision is based on, name → value.
    """

    stiffness: float
    cluster: int | None = None
    familiar: bool = True
    distance: float | None = None
    features: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        finite_scalar("stiffness that a policy wants (Nm/rad)", self.stiffness)


@checked
@dataclass(frozen=True, eq=False)
class StiffnessModel:
    """Model of the best stiffness for a profile of the ground: scaled features, and the nearest training profiles.

    `predict` computes the same as scikit-learn's scaler and nearest neighbours, but in plain NumPy: a control decides
    within a tick, and this takes some 50 µs where scikit-learn takes 700 µs. There is one difference: several rows can
    be at the distance of the last neighbour, for example all level profiles. Here all of them are neighbours;
    scikit-learn takes only the first ones.

    Attributes:
        settings: Settings of the model.
        recipe: Settings of the roughness that the model takes.
        features: Features of the training profiles, not scaled, shape (n, f).
        stiffness: Best stiffness of each, Nm/rad, shape (n,).
        mean: Mean of each feature, shape (f,).
        scale: Standard deviation of each feature, shape (f,); 1 for a feature that does not vary.
        reach: Largest distance to the nearest neighbour at which a profile counts as familiar, in scaled features.
        made: Provenance of the training profiles, as plain values.
    """

    settings: ModelSettings
    recipe: ProfileRecipe
    features: Array
    stiffness: Array
    mean: Array
    scale: Array
    reach: NonNegative
    made: Mapping[str, Any]

    def __post_init__(self) -> None:
        rows, count = len(self.stiffness), len(self.settings.features)
        shapes = {"features": (rows, count), "stiffness": (rows,), "mean": (count,), "scale": (count,)}
        for name, shape in shapes.items():
            values = finite_array(name, getattr(self, name), shape)
            values.setflags(write=False)  # many policies share a model
            object.__setattr__(self, name, values)
        if rows < self.settings.neighbours or (self.scale <= 0.0).any():
            raise InputError(
                f"a model needs {self.settings.neighbours} rows or more, as many as neighbours, and scales above 0, "
                f"got {rows} rows and {self.scale}"
            )
        self.settings.clusters.of(self.stiffness)

    @classmethod
    @checked
    def fit(
        cls,
        values: ArrayLike,
        stiffness: ArrayLike,
        groups: ArrayLike | None = None,
        settings: ModelSettings | None = None,
        *,
        recipe: ProfileRecipe | None = None,
        made: Mapping[str, Any] | None = None,
    ) -> StiffnessModel:
        """Return a model fitted to profiles and their best stiffness.

        Args:
            values: Roughness parameters of the profiles, computed by `recipe`, shape (n, 10), or with the compliance
                that the feet have felt there, m/N, shape (n, 11); see `feature_values`.
            stiffness: Best stiffness of each, Nm/rad, shape (n,).
            groups: Ground of each profile, shape (n,); profiles of the same ground are not used to determine `reach`.
            settings: Settings of the model; the paper's when None.
            recipe: Settings of the roughness.
            made: Provenance of the profiles.
        """
        given = settings or ModelSettings()
        features = feature_values(values, given.features)
        if features.ndim != 2:
            raise InputError(f"a model needs roughness of shape (n, 10) or (n, 11), got {np.shape(values)}")
        best = finite_array("best stiffness (Nm/rad)", stiffness, features.shape[:1])
        mean, scale = features.mean(axis=0), features.std(axis=0)
        scale[scale <= 1e-12 * np.abs(mean)] = 1.0
        samples = features / scale  # distances do not depend on the mean
        which = np.arange(len(best)) if groups is None else np.asarray(groups)
        if which.shape != best.shape or len(np.unique(which)) < 2:
            raise InputError(
                f"groups must name two grounds or more, one a profile, shape {best.shape}, got {shown(groups)} of "
                f"shape {which.shape}"
            )
        nearest = [
            np.sqrt(((samples[which != own] - row) ** 2).sum(axis=1).min())
            for row, own in zip(samples, which, strict=True)
        ]
        reach = float(np.quantile(nearest, given.familiar_share))
        facts = {"wbc": __version__, "rows": len(best), **(made or {})}
        return cls(given, recipe or ProfileRecipe(), features, best, mean, scale, reach, facts)

    @cached_property
    def _samples(self) -> Array:
        """Scaled features of the training profiles, shape (n, f)."""
        return np.asarray((self.features - self.mean) / self.scale)

    @cached_property
    def labels(self) -> NDArray[np.intp]:
        """Cluster of each training profile, from 1, shape (n,)."""
        return self.settings.clusters.of(self.stiffness)

    def predict(self, values: ArrayLike) -> StiffnessDecision:
        """Return the prediction for one profile of some roughness parameters, shape (10,) or (11,) with compliance."""
        features = feature_values(values, self.settings.features)
        if features.ndim != 1:
            raise InputError(f"predict is for one profile, got values of shape {np.shape(values)}")
        difference = self._samples - (features - self.mean) / self.scale
        squared = (difference * difference).sum(axis=1)
        count, clusters = self.settings.neighbours, self.settings.clusters
        nearest = np.flatnonzero(squared <= np.partition(squared, count - 1)[count - 1])
        distance = np.sqrt(squared[nearest])
        closest = float(distance.min())
        # A profile of the training set has no other neighbours, as in scikit-learn.
        weight = 1.0 / distance if closest > 0.0 else (distance == 0.0).astype(np.float64)
        if self.settings.kind == "classification":
            cluster = int(np.argmax(np.bincount(self.labels[nearest], weight, len(clusters.edges))))
            stiffness = float(clusters.centres[cluster - 1])
        else:
            best = self.stiffness[nearest]
            stiffness = float(np.clip(weight @ best / weight.sum(), best.min(), best.max()))  # it is rounded
            cluster = int(clusters.of(stiffness))
        seen = dict(zip(self.settings.features, features.tolist(), strict=True))
        return StiffnessDecision(stiffness, cluster, closest <= self.reach, closest, seen)

    @checked
    def save(self, path: str | Path) -> None:
        """Write the model as JSON, with one training profile in each line and exact numbers."""
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
        rows = [json.dumps([*f, k]) for f, k in zip(self.features.tolist(), self.stiffness, strict=True)]
        lines = [f"  {json.dumps(key)}: {json.dumps(value)}" for key, value in head.items()]
        lines.append('  "rows": [\n    ' + ",\n    ".join(rows) + "\n  ]")
        write_text(path, "{\n" + ",\n".join(lines) + "\n}\n")

    @classmethod
    @checked
    def load(cls, path: str | Path) -> StiffnessModel:
        """Return the model that `save` wrote; raise an `InputError` for any other or inconsistent file."""
        target = Path(path)
        if not target.is_file():
            raise InputError(f"no stiffness model '{target}'")
        with parsing(target, FORMAT):
            given = json.loads(read_text(target, FORMAT))
        if not isinstance(given, dict) or given.get("format") != FORMAT or given.get("version") != VERSION:
            raise InputError(f"{target} is not a {FORMAT} of version {VERSION}")
        with naming(target, FORMAT):
            chosen = from_json(ModelSettings, given["settings"])
            rows = finite_array("rows", given["rows"], (len(given["rows"]), len(chosen.features) + 1))
            numbers = {name: given[name] for name in ("mean", "scale", "reach")}
            recipe = from_json(ProfileRecipe, given["recipe"])
            return cls(chosen, recipe, rows[:, :-1], rows[:, -1], made=dict(given["made"]), **numbers)


@cache
def default_model() -> StiffnessModel:
    """Return the default model, trained on walks in the simulator."""
    return StiffnessModel.load(DEFAULT_MODEL)
