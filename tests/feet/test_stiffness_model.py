"""The stiffness model: same answers as scikit-learn, exact files, honest cross-validation, clear refusals."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from wbc.app import cli
from wbc.core.errors import InputError, UnknownNameError
from wbc.feet.sensing.scan import PROFILE_STEP
from wbc.feet.stiffness.analysis import amplitude_trends, learning_curve, principal_components
from wbc.feet.stiffness.authors import is_authors_file, load_table, read_authors
from wbc.feet.stiffness.clusters import Clusters
from wbc.feet.stiffness.comparison import candidates, compare, comparison_table
from wbc.feet.stiffness.dataset import REQUIRED, ProfileRecipe, StiffnessTable
from wbc.feet.stiffness.features import PAPER_FEATURES, WINDOW_FEATURES, FeatureSet, select_features
from wbc.feet.stiffness.model import ModelSettings, StiffnessModel, knn_pipeline
from wbc.feet.stiffness.roughness import PARAMETERS, RoughnessSettings, roughness
from wbc.feet.stiffness.validation import PROTOCOLS, Candidate, cross_validate

PLAIN = ("Sz", "sqrt(P)", "Sku")


def make_columns(grounds: int = 12, windows: int = 6, noise: float = 0.15) -> dict[str, list[object]]:
    """Profiles of made-up grounds: waves of a ground's own length, five amplitudes; stiffness falls with the amplitude.

    As in the paper's data, the windows of one ground and amplitude look alike and share one label.
    """
    rng = np.random.default_rng(1)
    columns: dict[str, list[object]] = {name: [] for name in (*REQUIRED, "J")}
    x = PROFILE_STEP * np.arange(41)
    for g in range(grounds):
        length, base = 0.04 * 1.2**g, rng.uniform(15.0, 60.0)
        for amplitude in (0.01, 0.015, 0.02, 0.03, 0.04):
            shape = amplitude / 2 * np.sin(2 * np.pi * x / length + rng.uniform(0, 2 * np.pi, (windows, 1)))
            values = roughness(x, shape + noise * amplitude * rng.normal(size=shape.shape)).values
            for w, row in enumerate(values):
                best = float(np.clip(base * (0.01 / amplitude), 0.5, 79.0))
                named = dict(zip(PARAMETERS, row.tolist(), strict=True)) | {
                    "ground": f"waves of {length:.3f} m",
                    "family": "waves",
                    "amplitude": amplitude,
                    "seed": g,
                    "window": w,
                    "stiffness": best,
                    "J": -float(g),
                }
                for name, entries in columns.items():
                    entries.append(named[name])
    return columns


@pytest.fixture(scope="module")
def table() -> StiffnessTable:
    return StiffnessTable.from_columns(make_columns(), made={"how": "waves", "seed": 1})


@pytest.fixture(scope="module")
def model(table: StiffnessTable) -> StiffnessModel:
    return StiffnessModel.fit(table)


def queries(table: StiffnessTable, count: int = 200, spread: float = 0.3) -> np.ndarray:
    """Profiles near those of a table but not among them."""
    rng = np.random.default_rng(5)
    rows = table.values[rng.integers(0, len(table), count)]
    return rows * np.exp(spread * rng.normal(size=rows.shape))


# --- clusters ---------------------------------------------------------------------------------------------------------


def test_the_papers_clusters() -> None:
    """20 ranges of 4 Nm/rad; cluster n commands 4n − 2."""
    clusters = Clusters.linear()
    assert len(clusters) == 20 and clusters.edges[-1] == 80.0
    np.testing.assert_array_equal(clusters.centres, 4.0 * np.arange(1, 21) - 2.0)
    np.testing.assert_array_equal(clusters.of([0.0, 3.99, 4.0, 41.0, 79.9, 80.0]), [1, 1, 2, 11, 20, 20])
    np.testing.assert_array_equal(clusters.of(clusters.centres), np.arange(1, 21))


def test_logarithmic_clusters_resolve_soft_soles() -> None:
    clusters = Clusters.logarithmic(1.0, 81.0, 4)
    np.testing.assert_allclose(clusters.edges, [0.0, *np.geomspace(1, 81, 4)])
    assert clusters.of(0.5) == 1 and clusters.of(81.0) == 4


@pytest.mark.parametrize("edges", [(0.0, 4.0), (0.0, 4.0, 4.0), (-1.0, 0.0, 1.0), (0.0, float("nan"), 3.0)])
def test_edges_that_do_not_ascend_are_refused(edges: tuple[float, ...]) -> None:
    with pytest.raises(InputError, match="edges"):
        Clusters(edges)


def test_stiffness_outside_the_clusters_is_refused() -> None:
    with pytest.raises(InputError, match=r"\[0, 80\] Nm/rad, got 81 to 81"):
        Clusters.linear().of(81.0)
    with pytest.raises(InputError, match="at least 2"):
        Clusters.linear(count=1)
    with pytest.raises(InputError, match="highest boundary"):
        Clusters.logarithmic(5.0, 4.0)


# --- predictions ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("kind", "neighbours", "features"),
    [("classification", 10, ModelSettings().features), ("regression", 1, WINDOW_FEATURES)],
)
def test_predictions_are_those_of_scikit_learn(
    table: StiffnessTable, kind: str, neighbours: int, features: tuple[str, ...]
) -> None:
    """Also for profiles of the training set itself, whose distance is zero."""
    settings = ModelSettings(features, neighbours, kind=kind)  # type: ignore[arg-type]
    fast = StiffnessModel.fit(table, settings)
    values = np.concatenate([queries(table), table.values[::7]])
    known = fast.labels if kind == "classification" else fast.stiffness
    theirs = knn_pipeline(settings).fit(fast.features, known).predict(FeatureSet(features)(values))
    ours = [fast.predict(v) for v in values]
    if kind == "classification":
        np.testing.assert_array_equal([p.cluster for p in ours], theirs)
        np.testing.assert_allclose([p.stiffness for p in ours], fast.settings.clusters.centres[theirs - 1])
    else:
        np.testing.assert_allclose([p.stiffness for p in ours], theirs, rtol=1e-9)
    assert len(np.unique(theirs)) > 5


def test_all_rows_that_are_equally_near_have_a_say() -> None:
    """Thirty level profiles with two labels: the majority decides, not the order of the rows."""
    rng = np.random.default_rng(2)
    names = {name: rng.random(60) for name in PARAMETERS}
    for entries in names.values():
        entries[:30] = 0.0
    for first, second in ((10.0, 50.0), (50.0, 10.0)):
        order = np.r_[rng.permutation(np.r_[np.full(11, first), np.full(19, second)]), np.full(30, 70.0)]
        columns = names | {"ground": ["a"] * 60, "family": ["a"] * 60, "amplitude": [0.01] * 60}
        columns |= {"seed": [0] * 60, "window": list(range(60)), "stiffness": order}
        fitted = StiffnessModel.fit(StiffnessTable.from_columns(columns))
        assert fitted.predict(np.zeros(10)).cluster == fitted.settings.clusters.of(second)


def test_far_profiles_are_unfamiliar(model: StiffnessModel, table: StiffnessTable) -> None:
    assert all(model.predict(v).familiar for v in table.values)
    assert np.mean([model.predict(v).familiar for v in queries(table, spread=0.05)]) > 0.95
    strange = table.values[0] * 50.0
    p = model.predict(strange)
    assert not p.familiar and p.distance > model.reach
    # The distance is that of the scaled features to the nearest row.
    scaled = (p.features - model.features.mean(axis=0)) / model.features.std(axis=0)
    rows = (model.features - model.features.mean(axis=0)) / model.features.std(axis=0)
    assert p.distance == pytest.approx(np.linalg.norm(rows - scaled, axis=1).min())


def test_the_reach_leaves_out_the_own_ground(table: StiffnessTable) -> None:
    """Twins of the same ground must not make every new ground look strange: the reach grows when they are left out."""
    alone = StiffnessModel.fit(table, ModelSettings(familiar_share=0.9))
    samples = (alone.features - alone.mean) / alone.scale
    groups = table.groups(("ground", "amplitude"))
    nearest = [np.linalg.norm(samples[groups != groups[i]] - s, axis=1).min() for i, s in enumerate(samples)]
    assert alone.reach == pytest.approx(np.quantile(nearest, 0.9))
    twins = [np.linalg.norm(np.delete(samples, i, 0) - s, axis=1).min() for i, s in enumerate(samples)]
    assert alone.reach > np.quantile(twins, 0.9)


def test_predictions_need_one_finite_profile(model: StiffnessModel, table: StiffnessTable) -> None:
    with pytest.raises(InputError, match="one profile"):
        model.predict(table.values[:2])
    with pytest.raises(InputError, match="finite"):
        model.predict(np.full(10, np.nan))
    with pytest.raises(InputError, match="shape"):
        model.predict(np.zeros(9))


# --- files ------------------------------------------------------------------------------------------------------------


def test_a_saved_model_is_the_same_model(
    model: StiffnessModel, table: StiffnessTable, tmp_path: Path
) -> None:
    path = tmp_path / "model.json"
    model.save(path)
    again = StiffnessModel.load(path)
    assert again.settings == model.settings and again.recipe == model.recipe and again.made == model.made
    for v in queries(table, 50):
        a, b = model.predict(v), again.predict(v)
        assert (a.stiffness, a.cluster, a.distance, a.familiar) == (
            b.stiffness,
            b.cluster,
            b.distance,
            b.familiar,
        )
    again.save(tmp_path / "twice.json")
    assert (tmp_path / "twice.json").read_bytes() == path.read_bytes()
    assert json.loads(path.read_text())["made"]["table_made"] == {"how": "waves", "seed": 1}
    assert again.made["table"] == table.fingerprint()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"version": 2}, "version 2 of a wbc stiffness model cannot be read, this wbc reads version 1"),
        ({"format": "something"}, "is not a wbc stiffness model but a something"),
        ({"mean": [0.0]}, "mean"),
        ({"scale": [0.0] * 6}, "scale and reach"),
        ({"rows": [[1.0, 2.0]]}, "rows must have shape"),
        ({"settings": {"neighbours": 10}}, "ModelSettings must be complete, .*, got {'neighbours': 10}"),
        ({"recipe": {"step": 0.007}}, "ProfileRecipe must be complete, .*, got {'step': 0.007}"),
        ({"reach": -1.0}, "scale and reach"),
        ({"made": 5}, "made must be an object with the provenance, got 5"),
    ],
)
def test_models_that_do_not_fit_are_refused(
    model: StiffnessModel, tmp_path: Path, change: dict[str, object], message: str
) -> None:
    path = tmp_path / "model.json"
    model.save(path)
    path.write_text(json.dumps(json.loads(path.read_text()) | change))
    with pytest.raises(InputError, match=message):
        StiffnessModel.load(path)


def test_files_that_are_no_models_are_refused(tmp_path: Path, model: StiffnessModel) -> None:
    with pytest.raises(InputError, match="no stiffness model"):
        StiffnessModel.load(tmp_path / "none.json")
    torn = tmp_path / "torn.json"
    model.save(torn)
    torn.write_text(torn.read_text()[:500])
    with pytest.raises(InputError, match="is not a wbc stiffness model"):
        StiffnessModel.load(torn)


def test_a_saved_table_is_the_same_table(table: StiffnessTable, tmp_path: Path) -> None:
    """With its recipe, and all digits of its seeds."""
    path, columns, seed = tmp_path / "table.csv", table.columns(), 2**62 + 1
    recipe = ProfileRecipe(0.005, None, RoughnessSettings.authors(0.005))
    large = StiffnessTable.from_columns(columns | {"seed": [seed] * len(table)})
    other = StiffnessTable.from_columns(columns, recipe=recipe)
    for saved in (table, large, other):
        saved.save(path)
        again = StiffnessTable.load(path)
        assert again.columns() == saved.columns()
        assert again.recipe == saved.recipe and again.made == saved.made
        assert again.fingerprint() == saved.fingerprint()
    assert large.seed.tolist() == [seed] * len(table)
    assert StiffnessModel.fit(again).recipe == recipe
    part = table.rows(slice(1, None))
    assert len({each.fingerprint() for each in (table, large, other, part)}) == 4
    assert np.isnan(table.stiffness_low).all() and (table.J <= 0.0).all()


def test_tables_that_cannot_be_used_are_refused(table: StiffnessTable, tmp_path: Path) -> None:
    columns = table.columns()
    for drop in ("Sku", "stiffness", "ground"):
        with pytest.raises(InputError, match=f"missing columns {drop}; there are "):
            StiffnessTable.from_columns({k: v for k, v in columns.items() if k != drop})
    for change, message in (
        ({"Sp": ["x"] * len(table)}, "column Sp must be numbers"),
        ({"Sp": [float("nan")] * len(table)}, "column Sp must be finite"),
        ({"seed": [0.5] * len(table)}, "seed must hold whole numbers"),
        ({"seed": [2**63] * len(table)}, r"seed must be below 2\*\*63, got 9223372036854775808"),
        ({"amplitude": [-0.01] * len(table)}, "amplitude must not be negative"),
        ({"stiffness_low": [75.0] * len(table)}, "between stiffness_low and stiffness_high"),
        ({"Sp": [1.0]}, "same number of rows"),
        ({"stifness_low": [0.0] * len(table)}, "did you mean 'stiffness_low'"),
    ):
        with pytest.raises(InputError, match=message):
            StiffnessTable.from_columns(columns | change)
    path = tmp_path / "t.csv"
    table.save(path)
    lines = path.read_text().splitlines()
    for text, message in (
        ("\n".join([lines[0].replace('"version": 1', '"version": 7'), *lines[1:]]), "version 7"),
        ("\n".join(lines[1:]), "is not a wbc stiffness table"),
        ("\n".join([*lines[:3], lines[3][: len(lines[3]) // 2]]), "row 2 has"),
        ("\n".join([lines[0], lines[1].replace("Sku", "Skew"), *lines[2:]]), "missing columns Sku"),
        (lines[0], "no columns"),
        (
            "\n".join([lines[0].replace('"made": {', '"made": [{')[:-1] + "]}", *lines[1:]]),
            "made must be an object",
        ),
    ):
        path.write_text(text)
        with pytest.raises(InputError, match=message):
            StiffnessTable.load(path)
    with pytest.raises(InputError, match="no stiffness table"):
        StiffnessTable.load(tmp_path / "none.csv")
    with pytest.raises(UnknownNameError, match="column to group by 'grounds'"):
        table.groups(("grounds",))


def test_one_class_teaches_nothing(table: StiffnessTable) -> None:
    columns = table.columns() | {"stiffness": [5.0] * len(table)}
    single = StiffnessTable.from_columns(columns)
    with pytest.raises(InputError, match="single class: the best stiffness of all 360 rows is in cluster 2"):
        StiffnessModel.fit(single)
    with pytest.raises(InputError, match="single class"):
        cross_validate(single)
    with pytest.raises(InputError, match="single class"):
        learning_curve(single)
    with pytest.raises(InputError, match="10 neighbours need as many rows"):
        StiffnessModel.fit(table.rows(slice(0, 9)))


# --- validation -------------------------------------------------------------------------------------------------------


class Spy:
    """Estimator that only takes down what it was shown."""

    shown: list[tuple[set[float], set[float]]] = []

    def fit(self, features: np.ndarray, target: np.ndarray) -> Spy:
        self.train = set(features[:, 0].tolist())
        self.answer = target[0]
        return self

    def predict(self, features: np.ndarray) -> np.ndarray:
        Spy.shown.append((self.train, set(features[:, 0].tolist())))
        return np.full(len(features), self.answer)


@pytest.mark.parametrize("protocol", list(PROTOCOLS))
def test_folds_are_kept_apart(table: StiffnessTable, protocol: str) -> None:
    """No row is on both sides; with grouping no ground (and amplitude) is, which the paper's split does not mind."""
    Spy.shown = []
    result = cross_validate(table, Candidate("spy", Spy, features=("Sq",)), protocol)  # type: ignore[arg-type]
    owner = dict(
        zip(
            table.values[:, PARAMETERS.index("Sq")].tolist(),
            zip(table.ground, table.amplitude, strict=True),
            strict=True,
        )
    )
    assert len(owner) == len(table)
    tested: set[float] = set()
    shared_blocks = shared_grounds = 0
    for train, test in Spy.shown:
        assert not train & test and not tested & test
        assert train | test == set(owner)
        tested |= test
        shared_blocks += len({owner[t] for t in train} & {owner[t] for t in test})
        shared_grounds += len({owner[t][0] for t in train} & {owner[t][0] for t in test})
    assert tested == set(owner)
    # A ground of this table has one layout.
    assert (shared_blocks == 0) == (protocol in ("amplitudes", "layouts", "grounds"))
    assert (shared_grounds == 0) == (protocol in ("layouts", "grounds"))
    assert len(np.unique(result.fold)) == len(Spy.shown) == 10


def test_the_scores_count_what_they_say(table: StiffnessTable) -> None:
    result = cross_validate(table, ModelSettings(PLAIN), "paper", folds=5)
    assert result.confusion()[1].sum() == len(table)
    middles = 0.5 * (np.array(result.clusters.edges[1:]) + result.clusters.edges[:-1])
    true, found = np.array([2, 2, 3, 4, 5]), np.array([2, 3, 3, 2, 4])
    made = replace(result, truth=middles[true], command=middles[found] + 0.01, fold=np.array([0, 0, 1, 1, 1]))
    first = made.cluster[0] - 2  # of the numbers of the clusters
    assert made.accuracy_per_fold == pytest.approx([0.5, 1.0 / 3.0])
    assert made.accuracy == pytest.approx(2.5 / 6.0) and made.accuracy_std == pytest.approx(0.5 / 6.0)
    assert made.within_one == pytest.approx(0.8)
    assert made.mean_error == pytest.approx(np.abs(middles[found] + 0.01 - middles[true]).mean())
    names, counts = made.confusion()
    assert (names - first).tolist() == [2, 3, 4, 5]
    assert counts.tolist() == [[1, 1, 0, 0], [0, 1, 0, 0], [1, 0, 0, 0], [0, 0, 1, 0]]
    assert np.isnan(result.share_in_range)
    ranges = table.columns() | {"stiffness_low": [0.0] * len(table), "stiffness_high": [80.0] * len(table)}
    assert cross_validate(StiffnessTable.from_columns(ranges)).share_in_range == 1.0


def test_models_are_compared_on_the_same_folds(table: StiffnessTable) -> None:
    chosen = [c for c in candidates() if "forest" not in c.name]
    results = compare(table, chosen, ("grounds",))
    assert len(results) == len(chosen) >= 8
    for r in results:
        np.testing.assert_array_equal(r.fold, results[0].fold)
    lines = comparison_table(results).splitlines()
    assert len(lines) == len(chosen) + 2 and "KNN 10" in lines[2] and "| - |" in lines[2]


@pytest.mark.slow
def test_every_candidate_can_be_trained(table: StiffnessTable) -> None:
    assert len(compare(table)) == len(PROTOCOLS) * len(candidates())


def test_more_grounds_teach_more(table: StiffnessTable) -> None:
    """Accuracy grows with the grounds if the stiffness follows from the profile, here from its height."""
    height = table.values[:, PARAMETERS.index("Sz")]
    follows = StiffnessTable.from_columns(table.columns() | {"stiffness": 70.0 * height / height.max()})
    curve = learning_curve(follows, ModelSettings(("Sz",)), points=4, repetitions=6)
    assert curve.grounds[0] == 2 and curve.grounds[-1] == 45 and curve.accuracy.shape == (4, 6)
    assert curve.mean_error[-1].mean() < 0.5 * curve.mean_error[0].mean()
    assert curve.accuracy[-1].mean() > curve.accuracy[0].mean()
    with pytest.raises(InputError, match="a learning curve needs more than"):
        learning_curve(table.rows(slice(0, 18)))
    with pytest.raises(InputError, match="points of a learning curve must be at most 1000"):
        learning_curve(table, points=10**9)
    with pytest.raises(InputError, match="repetitions must be an integer of at least 1"):
        learning_curve(table, repetitions=-1)


def test_a_learning_curve_tests_on_other_grounds(table: StiffnessTable) -> None:
    Spy.shown = []
    curve = learning_curve(table, Candidate("spy", Spy, features=("Sq",)), points=3, repetitions=2)
    groups = table.groups(("ground", "amplitude"))
    owner = dict(zip(table.values[:, PARAMETERS.index("Sq")].tolist(), groups.tolist(), strict=True))
    trained = [len({owner[t] for t in train}) for train, _ in Spy.shown]
    assert trained == [*curve.grounds, *curve.grounds]
    for train, test in Spy.shown:
        assert (
            not {owner[t] for t in train} & {owner[t] for t in test} and len({owner[t] for t in test}) == 15
        )


def test_principal_components_explain_everything(table: StiffnessTable) -> None:
    parts = principal_components(table)
    assert parts.explained.sum() == pytest.approx(1.0) and (np.diff(parts.explained) <= 0).all()
    assert parts.scores.shape == (len(table), 2)
    variance = parts.scores.var(axis=0)
    assert variance[0] / variance[1] == pytest.approx(parts.explained[0] / parts.explained[1])


def test_trends_find_that_stiffness_falls_with_amplitude(table: StiffnessTable) -> None:
    trends = amplitude_trends(table)
    assert len(trends) == 12 and all(t == pytest.approx(-1.0) for t in trends.values())
    columns = table.columns()
    columns["stiffness"] = [1000.0 * a for a in columns["amplitude"]]
    assert all(
        t == pytest.approx(1.0) for t in amplitude_trends(StiffnessTable.from_columns(columns)).values()
    )
    level = StiffnessTable.from_columns(columns | {"stiffness": [5.0] * len(table)})
    assert all(np.isnan(t) for t in amplitude_trends(level).values())


def test_bad_splits_are_refused(table: StiffnessTable) -> None:
    with pytest.raises(UnknownNameError, match="did you mean 'grounds'"):
        cross_validate(table, protocol="ground")  # type: ignore[arg-type]
    with pytest.raises(InputError, match="folds"):
        cross_validate(table, folds=1)
    with pytest.raises(InputError, match="999 stratified folds"):
        compare(table, [Candidate("is not trained", lambda: pytest.fail("trained"))], folds=999)
    one_ground = table.rows(table.ground == table.ground[0])
    with pytest.raises(InputError, match="at least two groups"):
        cross_validate(one_ground)
    with pytest.raises(InputError, match="the largest has 6"):
        cross_validate(one_ground, protocol="paper")
    with pytest.raises(InputError, match=r"'model' cannot be fitted to \d+ rows|neighbors"):
        cross_validate(table.rows(slice(0, 12)), ModelSettings(neighbours=11), "amplitudes", folds=2)


def test_the_command_judges_a_table(
    table: StiffnessTable, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "table.csv"
    table.save(path)
    options = f"--features select --neighbours 3 --folds 2 --plot {tmp_path}/judged.png --json"
    assert cli.main(["stiffness", "judge", str(path), *options.split()]) == 0
    assert (tmp_path / "judged.png").stat().st_size > 20_000
    told = json.loads(capfd.readouterr().out)
    asked = [row for row in told["validation"] if row["model"] == "the model asked for"]
    assert {row["split"] for row in asked} == set(PROTOCOLS)
    chosen = select_features(table.values).kept
    same = cross_validate(table, ModelSettings(tuple(chosen), neighbours=3), "grounds", folds=2)
    assert next(row["accuracy"] for row in asked if row["split"] == "grounds") == pytest.approx(same.accuracy)
    assert told["rows"] == len(table) and set(told["amplitude_trends"]) == set(table.ground.tolist())
    assert sum(told["explained_variance"]) == pytest.approx(1.0)


# --- the authors' file ------------------------------------------------------------------------------------------------


def made_up_authors(grounds: int = 2) -> str:
    """A file as the authors': six trajectories of five amplitudes; the stiffness falls with the amplitude."""
    rng = np.random.default_rng(3)
    lines = []
    for _ in range(grounds):
        shapes = rng.uniform(0.8, 1.2, (6, 3))
        for step in range(5):
            for shape in shapes:
                sp, p, sku = shape * np.array([0.01 * (1 + 0.2 * step), 0.012 * (1 + 0.2 * step) ** 2, 3.2])
                values = (sp, p, p**2, sku**3, p**3, sp**3)
                lines.append(",".join([*(f"{value:.5g}" for value in values), str(9 - 2 * step)]))
    return "\n".join(lines) + "\n"


def test_the_authors_file_is_read_and_judged(tmp_path: Path) -> None:
    path = tmp_path / "tot.csv"
    path.write_text(made_up_authors())
    read = load_table(path)
    assert len(read) == 60 and np.unique(read.ground).size == 2
    assert read.stiffness[:30:6].tolist() == [34.0, 26.0, 18.0, 10.0, 2.0]
    first = [float(word) for word in path.read_text().splitlines()[0].split(",")]
    np.testing.assert_allclose(FeatureSet(PAPER_FEATURES)(read.values)[0], first[:6], rtol=1e-4)
    # A trajectory has one layout at all amplitudes: folds by layout keep it on one side.
    judged = cross_validate(read, protocol="layouts", folds=4)
    for ground, seed in ((g, s) for g in np.unique(read.ground) for s in range(6)):
        assert np.unique(judged.fold[(read.ground == ground) & (read.seed == seed)]).size == 1


def test_files_that_are_not_the_authors_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "tot.csv"
    text = made_up_authors(1)
    for wrong, message in (
        (text.replace(",9\n", ",21\n", 1), "from 1 to 20"),
        (text[: text.rindex("\n", 0, -1) + 1], "30 rows for each ground"),
        (text.replace("0.", "x", 1) if not text.startswith("0.") else text[:20] + "\n" + text, "no file of"),
    ):
        path.write_text(wrong)
        with pytest.raises(InputError, match=message):
            read_authors(path)
    assert not is_authors_file(tmp_path) and not is_authors_file(tmp_path / "none.csv")
