"""Best stiffness, models and optimisation of the paper on made-up walks whose answers are known."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from labels import NEARLY, best_stiffness, ground_offsets, labels, pooled_curve, seen_roughness
from models import CLUSTERS, DEFAULT_TABLE, Candidate, judge, read_table, select_features, splitter, train
from optimize import BOUNDS, FIRST_DESIGN, Bounds, ask, fitted, optimum
from sklearn.dummy import DummyClassifier
from sklearn.pipeline import make_pipeline

from wbc.feet import roughness
from wbc.feet.sensing.roughness import PARAMETERS
from wbc.feet.stiffness.model import ModelSettings, ProfileRecipe, default_model
from wbc.sim import make_terrain

GRID = np.geomspace(1.0, 2000.0, 16)
RNG = np.random.default_rng(3)


@pytest.mark.parametrize("best", [2.0, 40.0])
def test_the_top_of_a_parabola_is_found_and_its_near_side_is_what_the_parabola_says(best: float) -> None:
    k, ground = np.tile(GRID, 2), np.repeat([0, 1], GRID.size)
    label = best_stiffness(k, -60.0 * np.log10(k / best) ** 2 - 30.0 * ground, ground)
    reach = 10.0 ** np.sqrt(NEARLY / 60.0)
    assert label.stiffness == pytest.approx(best, rel=0.05)
    assert label.stiffness_low == pytest.approx(max(best / reach, 1.0), rel=0.06)
    assert label.stiffness_high == pytest.approx(min(best * reach, 2000.0), rel=0.06)
    assert label.best_low <= label.stiffness <= label.best_high and pytest.approx(-15.0, abs=1.0) == label.J


def test_noise_alone_makes_everything_nearly_best() -> None:
    k, ground = np.tile(GRID, 2), np.repeat([0, 1], GRID.size)
    label = best_stiffness(k, -0.3 + RNG.normal(0.0, 0.01, k.size), ground)
    assert (label.stiffness_low, label.stiffness_high) == pytest.approx((1.0, 2000.0))
    assert label.best_high / label.best_low > 5.0


def test_missing_walks_do_not_move_the_offsets_of_grounds() -> None:
    """One ground has lost its stiffest walks, three have only those: their means are of different stiffnesses."""
    parts = (GRID[:14], GRID[-4:], GRID[-4:], GRID[-4:])
    k, ground = np.concatenate(parts), np.repeat(np.arange(4), [len(part) for part in parts])
    J = 40.0 * np.log10(k) - 30.0 * ground
    offsets = ground_offsets(k, J, ground)
    assert offsets - offsets[0] == pytest.approx(-30.0 * np.arange(4), abs=1e-9)
    assert np.ptp(pooled_curve(k, J, ground)(np.log10(GRID))) == pytest.approx(
        40.0 * np.log10(2000.0), rel=0.02
    )


def test_the_prior_of_a_ground_is_made_without_it() -> None:
    rows = [
        (name, 0.01, 0.0, k, best) for name, best in (("a", 40.0), ("b", 4.0), ("c", 4.0)) for k in GRID[::2]
    ]
    table = pd.DataFrame(rows, columns=["terrain", "amplitude", "cutoff", "stiffness", "best"])
    noise = RNG.normal(0.0, 1.0, len(table))
    table = table.assign(seed=0, J=-60.0 * np.log10(table["stiffness"] / table["best"]) ** 2 + noise)
    found = labels(table)["stiffness"]
    assert found.to_numpy() == pytest.approx([40.0, 4.0, 4.0], rel=0.25)


def test_windows_are_what_the_toes_see() -> None:
    seen = seen_roughness("cylinder_obstacles", 0.0, 0.02, 0.5, 0, 4, distance=2.0)
    ground, recipe = make_terrain("cylinder_obstacles", amplitude=0.02, seed=0, ramp=0.5), ProfileRecipe()
    x = recipe.step * np.arange(27)
    z = ground.height(ground.start + x, np.full(27, 0.0885))
    assert seen.shape == (4, 10)
    np.testing.assert_allclose(seen[0], roughness(x, z, recipe.roughness).values, rtol=0.5, atol=1e-3)


def test_features_are_selected_whatever_units_and_order() -> None:
    common = RNG.normal(size=300)
    values = common[:, None] + 1e-3 * RNG.normal(size=(300, 10))
    values[:, 6] = RNG.normal(size=300)
    assert "Sz" in select_features(values, powers=(1,), bound=10.0).kept, "the one column of its own"
    values = read_table(DEFAULT_TABLE)[list(PARAMETERS)].to_numpy()
    chosen = select_features(values)
    in_mm = select_features(values * [1e3, 1e3, 1, 1, 1e3, 1e3, 1e3, 1e6, 1, 1])
    assert chosen.kept == in_mm.kept == select_features(values[RNG.permutation(len(values))]).kept
    assert chosen.condition < 5.0 and len(chosen.kept) > 1
    assert {"M", "Sq^2"} in map(set, chosen.twins)


def test_the_built_in_model_is_that_of_its_table() -> None:
    table = read_table(DEFAULT_TABLE)
    made, built_in = train(table, ModelSettings(), {}), default_model()
    np.testing.assert_allclose(made.features, built_in.features, rtol=1e-9)
    np.testing.assert_array_equal(made.stiffness, built_in.stiffness)
    assert made.reach == pytest.approx(built_in.reach)


def test_folds_keep_grounds_apart_and_a_baseline_has_the_share_of_the_largest_class() -> None:
    table = read_table(DEFAULT_TABLE)
    split, groups = splitter(table, "grounds", 4)
    for training, test in split.split(table, groups=groups):
        assert not set(table["ground"].iloc[training]) & set(table["ground"].iloc[test])
    largest = Candidate("largest", make_pipeline(DummyClassifier(strategy="most_frequent")))
    share = np.bincount(CLUSTERS["paper"].of(table["stiffness"].to_numpy())).max() / len(table)
    assert judge(table, largest, "shuffled", CLUSTERS["paper"])["accuracy"] == pytest.approx(share, abs=0.01)


def test_the_file_of_the_papers_authors_is_read(tmp_path: Path) -> None:
    rows = [[0.01 * i, 1.0, 1.0, 8.0, 1.0, 1.0, 1 + i % 20] for i in range(60)]
    np.savetxt(tmp_path / "tot.csv", rows, delimiter=",")
    table = read_table(tmp_path / "tot.csv")
    assert (table["ground"].nunique(), table["amplitude"].nunique(), table["seed"].nunique()) == (2, 5, 6)
    assert table["stiffness"].iloc[1] == 6.0 and table["Sku"].iloc[0] == 2.0


def hill(points: np.ndarray) -> np.ndarray:
    """Objective of made-up walks: a parabola over the logarithm of k and over kP, best at 20 Nm/rad and 3 1/s."""
    values = [BOUNDS["wide"].values(point) for point in points]
    return np.array([-40.0 * np.log10(v["k"] / 20.0) ** 2 - 4.0 * (v["kP"] - 3.0) ** 2 - 1.0 for v in values])


@pytest.mark.slow
def test_an_optimisation_finds_the_top_of_a_noisy_hill_and_asks_the_same_again() -> None:
    rng = np.random.default_rng(0)
    X: list[tuple[float, ...]] = []
    y: list[float] = []
    while len(X) < 36:
        (point,) = ask(X, y, 1, 0)
        assert ask(X, y, 1, 0) == [point]
        X.append(point)
        y.append(float(hill(np.array([point]))[0] + 3.0 * rng.normal()))
    found = optimum(np.array(X), np.array(y), BOUNDS["wide"])
    assert 8.0 < found.best["k"] < 50.0 and 2.0 < found.best["kP"] < 4.0
    assert abs(found.J[0] + 1.0) < 2.5 and 1.5 < found.noise < 6.0
    near = [abs(np.log10(BOUNDS["wide"].values(point)["k"] / 20.0)) < 0.5 for point in X]
    assert np.mean(near[FIRST_DESIGN:]) > 0.5 > np.mean(near[:FIRST_DESIGN])


def test_expected_values_are_those_of_the_textbook() -> None:
    """Rasmussen and Williams, "Gaussian Processes", eqs. 2.23, 2.24, with the kernel that was fitted."""
    rng = np.random.default_rng(7)
    X = rng.random((24, 3))
    y = -6.0 - 30.0 * (X[:, 0] - 0.6) ** 2 + rng.normal(size=24)
    found, kernel = optimum(X, y, BOUNDS["wide"]), fitted(X, y).kernel_
    best = X[[BOUNDS["wide"].values(point) == found.best for point in X]]
    line = np.column_stack([np.linspace(0.0, 1.0, 201), *np.tile(best[0, 1:, None], 201)])
    weights = kernel.k1(line, X) @ np.linalg.inv(kernel.k1(X) + kernel.k2.noise_level * np.eye(24))
    k, mean, std = found.slices["k"]
    np.testing.assert_allclose(mean, y.mean() + weights @ (y - y.mean()), atol=1e-6)
    cov = y.var() * (kernel.k1(line) - weights @ kernel.k1(X, line))
    np.testing.assert_allclose(std, np.sqrt(np.diag(cov)), atol=1e-5)
    assert (k[0], k[100]) == pytest.approx((1.0, np.sqrt(2000.0)), rel=1e-4)


def test_where_nothing_matters_every_stiffness_is_as_good() -> None:
    found = optimum(RNG.random((20, 3)), np.full(20, -1.0), BOUNDS["wide"])
    assert found.same == ((1.0, 2000.0),)
    with pytest.raises(SystemExit, match="12"):
        optimum(RNG.random((5, 3)), np.zeros(5), BOUNDS["wide"])


def test_bounds_are_the_papers_or_wide() -> None:
    assert BOUNDS["paper"].values((0.0, 0.0, 1.0)) == {"k": 0.0, "kP": 0.1, "kD": 5.0}
    assert BOUNDS["wide"].values((0.5, 0.5, 0.5))["k"] == pytest.approx(np.sqrt(2000.0), rel=1e-5)
    point = (0.123, 0.456, 0.789)
    for bounds in (*BOUNDS.values(), Bounds((10.0, 1000.0))):
        assert bounds.unit(bounds.values(point)) == pytest.approx(point, abs=1e-5)
