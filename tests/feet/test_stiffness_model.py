"""The stiffness model: features, the answers of scikit-learn, exact files, refusals."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from sklearn.neighbors import KNeighborsClassifier, KNeighborsRegressor
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from wbc.base.errors import InputError
from wbc.feet import StiffnessModel, roughness
from wbc.feet.sensing.roughness import PARAMETERS
from wbc.feet.sensing.scan import PROFILE_STEP, Profile
from wbc.feet.stiffness.model import (
    DEFAULT_MODEL,
    PAPER_FEATURES,
    Clusters,
    ModelSettings,
    default_model,
    feature_values,
)
from wbc.tasks.scheduling.policies import ModelPolicy, SwingScan

LOGARITHMIC = Clusters((0.0, *np.geomspace(1.0, 81.0, 5).tolist()))


def made_up() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Roughness (n, 10), best stiffness and ground of waves of twelve lengths and five heights; softer where higher."""
    rng = np.random.default_rng(1)
    x, rows, best, ground = PROFILE_STEP * np.arange(41), [], [], []
    for g in range(12):
        for amplitude in (0.01, 0.015, 0.02, 0.03, 0.04):
            phase = rng.uniform(0.0, 2.0 * np.pi, (6, 1))
            waves = amplitude / 2 * np.sin(2.0 * np.pi * x / (0.04 * 1.2**g) + phase)
            rows.append(roughness(x, waves + 0.15 * amplitude * rng.normal(size=waves.shape)).values)
            best += [float(np.clip(rng.uniform(15.0, 60.0) * 0.01 / amplitude, 0.5, 79.0))] * 6
            ground += [len(rows)] * 6
    return np.concatenate(rows), np.array(best), np.array(ground)


VALUES, BEST, GROUND = made_up()


@pytest.fixture(scope="module")
def model() -> StiffnessModel:
    return StiffnessModel.fit(VALUES, BEST, GROUND, made={"how": "waves"})


def queries(count: int = 200, spread: float = 0.3) -> np.ndarray:
    """Profiles near those of the training set but not among them."""
    rng = np.random.default_rng(5)
    rows = VALUES[rng.integers(0, len(VALUES), count)]
    return rows * np.exp(spread * rng.normal(size=rows.shape))


def test_features_are_what_their_names_say() -> None:
    names = ("Sp", "Sp^3", "sqrt(P)", "lines", "Ssk^3")
    f = dict(zip(names, feature_values(VALUES, names).T, strict=True))
    p = dict(zip(PARAMETERS, VALUES.T, strict=True))
    np.testing.assert_allclose(f["Sp^3"], p["Sp"] ** 3)
    np.testing.assert_allclose(f["sqrt(P)"] ** 2, p["P"])
    np.testing.assert_allclose(f["lines"], 1.0 / (1.0 - p["K"]))
    np.testing.assert_allclose(f["Ssk^3"], p["Ssk"] ** 3)
    np.testing.assert_array_equal(feature_values(VALUES[3], names), feature_values(VALUES, names)[3])


def test_a_compliance_that_is_left_out_is_none_and_changes_no_other_feature() -> None:
    names = ("Sp", "compliance", "compliance^2", "sqrt(compliance)", "lines")
    felt = 4e-6 * np.arange(len(VALUES))[:, None]
    with_it = feature_values(np.hstack([VALUES, felt]), names)
    np.testing.assert_allclose(with_it[:, 1:4], np.hstack([felt, felt**2, np.sqrt(felt)]))
    without = feature_values(VALUES, names)
    assert not without[:, 1:4].any()
    np.testing.assert_array_equal(without[:, [0, 4]], with_it[:, [0, 4]])
    with pytest.raises(InputError, match="compliance"):
        feature_values(np.zeros((3, 12)), names)


def test_a_model_can_tell_grounds_apart_by_their_compliance_alone(tmp_path: Path) -> None:
    """Level ground that gives, softer to harder: the sole is stiff where the ground is soft."""
    felt = np.repeat(np.array([0.0, 1e-5, 3e-5]), 20)
    values = np.hstack([np.zeros((60, 10)), felt[:, None]])
    best = np.repeat([5.0, 30.0, 70.0], 20)
    made = StiffnessModel.fit(values, best, settings=ModelSettings(features=("Sp", "compliance")))
    made.save(tmp_path / "model.json")
    policy = ModelPolicy.load(tmp_path / "model.json")
    x = PROFILE_STEP * np.arange(41)
    level = Profile(x, 0.0 * x, 0.0 * x, np.full(41, True), np.array([1.0, 0.0]), PROFILE_STEP)
    found = []
    for compliance in (0.0, 1.1e-5, 2.9e-5):
        swing = SwingScan("left", 3, 1.0, 0.3, np.zeros(3), np.zeros(3), 5.0, level, compliance)
        decision = policy.decide(swing)
        assert decision is not None and decision.features["compliance"] == compliance
        found.append(decision.stiffness)
    assert found == [6.0, 30.0, 70.0]  # the middles of the clusters of 4 Nm/rad
    default = ModelPolicy(default_model())
    soft, hard = (
        default.decide(SwingScan("left", 3, 1.0, 0.3, np.zeros(3), np.zeros(3), 5.0, level, compliance))
        for compliance in (0.0, 3e-5)
    )
    assert soft == hard, "a model without this feature does not mind it"


def test_the_papers_clusters() -> None:
    """20 ranges of 4 Nm/rad; cluster n commands 4n − 2. Of one ratio, the geometric mean."""
    clusters = Clusters()
    np.testing.assert_array_equal(clusters.centres, 4.0 * np.arange(1, 21) - 2.0)
    np.testing.assert_array_equal(clusters.of([0.0, 3.99, 4.0, 41.0, 79.9, 80.0]), [1, 1, 2, 11, 20, 20])
    np.testing.assert_allclose(LOGARITHMIC.centres, [0.5, *np.sqrt([3.0, 27.0, 243.0, 2187.0])])


def test_clusters_ascend_from_zero_or_above_and_hold_what_lies_between_their_ends() -> None:
    for edges in ((0.0, 4.0, 8.0), (1.0, 4.0, 9.0)):
        clusters = Clusters(edges)
        np.testing.assert_array_equal(clusters.of(edges), [1, 2, 2])
        for outside in (edges[0] - 1e-6, edges[-1] + 1e-6, [5.0, edges[-1] + 1.0]):
            with pytest.raises(InputError):
                clusters.of(outside)
        assert clusters.of([]).size == 0
    np.testing.assert_allclose(Clusters((1.0, 4.0, 9.0)).centres, [2.0, 6.0])
    np.testing.assert_allclose(Clusters((1.0, 4.0, 7.0)).centres, [2.5, 5.5])  # of one width
    for edges in ((0.0, 4.0), (-1.0, 4.0, 8.0), (0.0, 4.0, 4.0), (0.0, 4.0, 3.0)):
        with pytest.raises(InputError):
            Clusters(edges)


def test_a_mean_of_neighbours_lies_between_them() -> None:
    """At the last boundary of the clusters a mean of equal numbers must not be rounded out of all of them."""
    model = StiffnessModel.fit(VALUES, np.full(len(VALUES), 80.0), settings=ModelSettings(kind="regression"))
    assert {model.predict(each).stiffness for each in queries(300)} == {80.0}


def test_a_model_needs_as_many_rows_as_neighbours_and_one_stiffness_a_row() -> None:
    values, best = VALUES[:10], BEST[:10]
    StiffnessModel.fit(values, best)
    for rows, given_best in (
        (values[:9], best[:9]),
        (values, best[:9]),
        (values[0], best[:1]),
        (values, best + 80.0),
    ):
        with pytest.raises(InputError):
            StiffnessModel.fit(rows, given_best)
    for groups in (np.zeros(10), np.arange(9)):
        with pytest.raises(InputError, match="two grounds or more, one a profile"):
            StiffnessModel.fit(values, best, groups)
    model = StiffnessModel.fit(values, best)
    for wrong in ({"scale": 0.0 * model.scale}, {"mean": model.mean[1:]}, {"stiffness": best + 80.0}):
        with pytest.raises(InputError, match=next(iter(wrong))):
            replace(model, **wrong)
    with pytest.raises(InputError):
        StiffnessModel.fit(values, best).predict(values)
    with pytest.raises(InputError):
        feature_values(values[:, :9], ("Sp",))
    for name in ("sqrt(Ssk)", "Sp^1", "Sp^10", "Sp*2"):
        with pytest.raises(InputError):
            ModelSettings((name,))
    sixth = dict(zip(PARAMETERS, VALUES[5], strict=True))["Sp"] ** 6
    assert feature_values(VALUES[5], ("Sp^6",))[0] == pytest.approx(sixth)


def test_a_feature_that_does_not_vary_counts_nothing() -> None:
    values = VALUES[:40].copy()
    values[:, PARAMETERS.index("Sp")] = 0.0123
    with_it = StiffnessModel.fit(values, BEST[:40], settings=ModelSettings(("Sp", "Sq"), 3))
    without = StiffnessModel.fit(values, BEST[:40], settings=ModelSettings(("Sq",), 3))
    assert with_it.scale[0] == 1.0
    for v in values[::5]:
        assert with_it.predict(v).stiffness == without.predict(v).stiffness


def test_nobody_changes_a_model_that_others_use() -> None:
    shared = default_model()
    for values in (shared.features, shared.stiffness, shared.scale, shared.settings.clusters.centres):
        with pytest.raises(ValueError, match="read-only"):
            values[0] = 1.0


def test_the_default_model_has_the_papers_shape() -> None:
    """Trained on 1,920 walks over twelve grounds; ten neighbours, 20 clusters of 4 Nm/rad (docs/feet.md)."""
    made = default_model()
    table = made.made["table_made"]
    assert table["trials"] == {"done": 1920}
    assert len({name.split(",")[0] for name in table["labels"]}) == 12
    assert made.settings.neighbours == 10 and len(made.settings.clusters.edges) == 21
    assert made.features.shape == (len(made.stiffness), len(made.settings.features))
    assert made.recipe.step == PROFILE_STEP and made.reach > 0.0


@pytest.mark.parametrize(
    ("kind", "neighbours", "features"),
    [("classification", 10, PAPER_FEATURES), ("regression", 1, ("Sz", "sqrt(P)", "Sku", "lines"))],
)
def test_predictions_are_those_of_scikit_learn(kind: str, neighbours: int, features: tuple[str, ...]) -> None:
    """Also for profiles of the training set itself, whose distance is zero."""
    settings = ModelSettings(features, neighbours, kind=kind)  # type: ignore[arg-type]
    fast = StiffnessModel.fit(VALUES, BEST, GROUND, settings)
    values = np.concatenate([queries(), VALUES[::7]])
    ours = [fast.predict(v) for v in values]
    classifies = kind == "classification"
    knn = (KNeighborsClassifier if classifies else KNeighborsRegressor)(neighbours, weights="distance")
    known, asked = (feature_values(v, features) for v in (VALUES, values))
    theirs = (
        make_pipeline(StandardScaler(), knn).fit(known, fast.labels if classifies else BEST).predict(asked)
    )
    if classifies:
        np.testing.assert_array_equal([p.cluster for p in ours], theirs)
        theirs = settings.clusters.centres[theirs - 1]
    np.testing.assert_allclose([p.stiffness for p in ours], theirs, rtol=1e-9)
    assert len(np.unique(theirs)) > 5


def test_all_rows_that_are_equally_near_have_a_say() -> None:
    """Thirty level profiles with two labels: the majority decides, not the order of the rows."""
    rng = np.random.default_rng(2)
    values = np.concatenate([np.zeros((30, 10)), rng.random((30, 10))])
    for first, second in ((10.0, 50.0), (50.0, 10.0)):
        level = rng.permutation(np.r_[np.full(11, first), np.full(19, second)])
        fitted = StiffnessModel.fit(values, np.r_[level, np.full(30, 70.0)])
        assert fitted.predict(np.zeros(10)).cluster == Clusters().of(second)


def test_far_profiles_are_unfamiliar_and_the_own_ground_does_not_count(model: StiffnessModel) -> None:
    samples = (model.features - model.features.mean(axis=0)) / model.features.std(axis=0)
    nearest = [np.linalg.norm(samples[GROUND[i] != GROUND] - s, axis=1).min() for i, s in enumerate(samples)]
    assert model.reach == pytest.approx(np.quantile(nearest, 0.99))
    assert all(model.predict(v).familiar for v in VALUES)
    strange = model.predict(VALUES[0] * 50.0)
    assert not strange.familiar and strange.distance > model.reach


def test_a_saved_model_is_the_same_model(model: StiffnessModel, tmp_path: Path) -> None:
    model.save(tmp_path / "model.json")
    again = StiffnessModel.load(tmp_path / "model.json")
    assert (again.settings, again.recipe, again.made) == (model.settings, model.recipe, model.made)
    for v in queries(50):
        a, b = model.predict(v), again.predict(v)
        assert (a.stiffness, a.cluster, a.distance, a.familiar) == (
            b.stiffness,
            b.cluster,
            b.distance,
            b.familiar,
        )
    again.save(tmp_path / "twice.json")
    assert (tmp_path / "twice.json").read_bytes() == (tmp_path / "model.json").read_bytes()
    StiffnessModel.load(DEFAULT_MODEL).save(tmp_path / "default.json")
    assert (tmp_path / "default.json").read_bytes() == DEFAULT_MODEL.read_bytes()


BAD_FILES = (
    ({"version": 2}, "version"),
    ({"format": "something"}, "stiffness model"),
    ({"mean": [0.0]}, "mean"),
    ({"scale": [0.0] * 6}, "scale"),
    ({"rows": [[1.0, 2.0]]}, "rows"),
    ({"settings": {"neighbors": 10}}, "neighbors"),
    ({"reach": -1.0}, "reach"),
    ({"made": 5}, "model"),
)


@pytest.mark.parametrize(("change", "name"), BAD_FILES)
def test_files_that_do_not_fit_are_refused(
    model: StiffnessModel, tmp_path: Path, change: dict[str, object], name: str
) -> None:
    path = tmp_path / "model.json"
    model.save(path)
    path.write_text(json.dumps(json.loads(path.read_text()) | change))
    with pytest.raises(InputError, match=name):
        StiffnessModel.load(path)
    path.write_text(path.read_text()[:500])
    for file in (path, tmp_path / "none.json"):
        with pytest.raises(InputError, match="stiffness model"):
            StiffnessModel.load(file)
