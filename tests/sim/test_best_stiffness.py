"""From walks to the best stiffness of a ground, and to the table that a model learns from."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from wbc.app import cli
from wbc.core.errors import InputError
from wbc.feet.stiffness.dataset import ProfileRecipe, StiffnessTable
from wbc.feet.stiffness.model import StiffnessModel
from wbc.feet.stiffness.roughness import PARAMETERS, roughness
from wbc.sim.studies.best_stiffness import (
    NEARLY,
    Label,
    best_stiffness,
    ground_offsets,
    labels,
    pooled_curve,
    seen_roughness,
    stiffness_table,
)
from wbc.sim.studies.journal import Entry, Journal, read_journal
from wbc.sim.studies.provenance import provenance
from wbc.sim.studies.stiffness_studies import (
    DatasetSize,
    dataset,
    half_heights,
    halfway,
    stiffness_grid,
    training_grounds,
)
from wbc.sim.walks.plans import WalkPlan
from wbc.sim.walks.result import Spread, objective
from wbc.sim.walks.spec import WalkSpec

GRID = np.array(stiffness_grid(16))


def curve(best: float, noise: float, seed: int = 0, seeds: int = 2) -> Label:
    """Label of grounds whose cost is a parabola over the logarithm, each ground harder than the one before."""
    rng = np.random.default_rng(seed)
    k, ground = np.tile(GRID, seeds), np.repeat(np.arange(seeds), GRID.size)
    J = -60.0 * np.log10(k / best) ** 2 - 30.0 * ground + rng.normal(0.0, noise, k.size)
    return best_stiffness(k, J, ground)


@pytest.mark.parametrize("best", [2.0, 8.0, 40.0])
def test_the_top_of_a_parabola_is_found_and_its_near_side_is_what_the_parabola_says(best: float) -> None:
    label = curve(best, noise=0.01)
    assert label.stiffness == pytest.approx(best, rel=0.05)
    reach = 10.0 ** np.sqrt(NEARLY / 60.0)
    assert label.nearly_low == pytest.approx(max(best / reach, 1.0), rel=0.06)
    assert label.nearly_high == pytest.approx(min(best * reach, 2000.0), rel=0.06)
    assert label.best_low <= label.stiffness <= label.best_high
    worst = max(np.log10(best / 1.0), np.log10(2000.0 / best))
    assert label.gain == pytest.approx(60.0 * worst**2, rel=0.05)
    assert abs(label.J + 15.0) < 1.0 and label.walks == 32


def test_the_best_stiffness_of_noisy_walks_is_within_what_the_label_says() -> None:
    inside, errors = 0, []
    for seed in range(20):
        label = curve(8.0, noise=15.0, seed=seed)
        inside += label.best_low <= 8.0 <= label.best_high
        errors.append(abs(np.log10(label.stiffness / 8.0)))
    assert inside >= 13  # 80 % are meant: fewer than 13 of 20 would have a probability of 3 %
    assert np.median(errors) < 0.1


def test_noise_alone_makes_the_best_stiffness_unsure_and_everything_nearly_best() -> None:
    rng = np.random.default_rng(3)
    k, ground = np.tile(GRID, 2), np.repeat([0, 1], GRID.size)
    label = best_stiffness(k, -0.3 + rng.normal(0.0, 0.01, k.size), ground)
    assert (label.nearly_low, label.nearly_high) == pytest.approx((1.0, 2000.0))
    assert label.best_high / label.best_low > 5.0
    same = best_stiffness(k, np.full(k.size, -0.3), ground)
    assert same.gain == 0.0 and (same.nearly_low, same.nearly_high) == pytest.approx((1.0, 2000.0))


def test_what_few_walks_leave_open_is_what_is_best_elsewhere() -> None:
    rng = np.random.default_rng(5)
    k, ground = np.tile(GRID, 40), np.repeat(np.arange(40), GRID.size)
    prior = pooled_curve(k, -20.0 * np.log10(k / 6.0) ** 2 + rng.normal(0.0, 30.0, k.size), ground)
    at = np.log10(GRID)
    assert GRID[np.argmax(prior(at))] == pytest.approx(6.0, rel=0.5)
    assert abs(prior(at).mean()) < 2.0
    k, ground = np.tile(GRID, 2), np.repeat([0, 1], GRID.size)
    # A ground that says nothing: the prior decides. One that says clearly otherwise: it decides itself.
    nothing = [
        best_stiffness(k, rng.normal(0.0, 30.0, k.size) + prior(np.log10(k)), ground, prior=prior)
        for _ in range(9)
    ]
    assert np.median([label.stiffness for label in nothing]) == pytest.approx(6.0, rel=0.5)
    alone = [best_stiffness(k, rng.normal(0.0, 30.0, k.size), ground) for _ in range(9)]
    spread = [np.log10([label.stiffness for label in group]).std() for group in (nothing, alone)]
    assert spread[0] < 0.7 * spread[1]
    clear = best_stiffness(k, -60.0 * np.log10(k / 40.0) ** 2, ground, prior=prior)
    assert clear.stiffness == pytest.approx(40.0, rel=0.1)


def test_missing_walks_do_not_move_the_best_stiffness() -> None:
    """One ground has lost its stiffest walks, three have only those: their means are of different stiffnesses."""
    k, ground = [], []
    for place, mine in enumerate((GRID[:14], GRID[-4:], GRID[-4:], GRID[-4:])):
        k += mine.tolist()
        ground += [place] * len(mine)
    values = 40.0 * np.log10(k) - 30.0 * np.array(ground)
    label = best_stiffness(np.array(k), values, np.array(ground))
    assert label.stiffness == pytest.approx(2000.0, rel=0.02)
    curve = pooled_curve(np.array(k), values, np.array(ground))
    assert np.ptp(curve(np.log10(GRID))) == pytest.approx(40.0 * np.log10(2000.0), rel=0.02)
    assert ground_offsets(np.array(k), values, np.array(ground)) == pytest.approx(
        ground_offsets(np.array(k), values, np.array(ground))[0] - 30.0 * np.arange(4), abs=1e-9
    )


def test_the_prior_of_a_ground_is_made_without_it() -> None:
    rng = np.random.default_rng(1)
    study = dataset(DatasetSize(seeds=1, amplitudes=1, evaluations=8)).narrowed(
        ["ellipsoids", "cobble", "floor"]
    )
    entries = {}
    for trial in study.trials():
        spec = trial.spec.to_json()
        best = 40.0 if spec["terrain"] == "ellipsoids" else 4.0
        J = -60.0 * float(np.log10(spec["stiffness"] / best)) ** 2 + rng.normal(0.0, 1.0)
        entry = Entry(spec, "done", {"J": J}, {"wall_s": 1.0}, None, provenance())
        entries[entry.key] = entry
    found = labels(study, entries)
    assert found["ellipsoids, 10 mm"].stiffness == pytest.approx(40.0, rel=0.25)
    assert found["cobble_stones, 10 mm"].stiffness == pytest.approx(4.0, rel=0.25)


def test_grounds_of_a_prior_keep_their_offsets_whatever_their_seeds(monkeypatch: pytest.MonkeyPatch) -> None:
    """The hard one has only soft walks, the easy one only stiff ones: the soft are not worse for that."""
    monkeypatch.setattr("wbc.sim.studies.best_stiffness.best_stiffness", lambda *walks, prior: prior)
    size = DatasetSize(seeds=2, amplitudes=1, evaluations=8)
    study, entries = dataset(size).narrowed(["ellipsoids", "cobble", "floor"]), {}
    for trial in study.trials():
        spec = trial.spec.to_json()
        k, hard = spec["stiffness"], spec["terrain"] == "floor_tiles"
        if k < 30.0 if hard else k > 3.0:
            J = -60.0 * float(np.log10(k / 4.0)) ** 2 - 300.0 * hard
            entry = Entry(spec, "done", {"J": J}, {"wall_s": 1.0}, None, provenance())
            entries[entry.key] = entry
    prior: Any = labels(study, entries)["ellipsoids, 10 mm"]
    assert GRID[np.argmax(prior(np.log10(GRID)))] == pytest.approx(4.0, rel=0.3)


def test_labels_need_different_stiffnesses_above_zero() -> None:
    with pytest.raises(InputError, match="4 different"):
        best_stiffness(np.array([1.0, 2.0, 3.0]), np.zeros(3), np.zeros(3))
    with pytest.raises(InputError, match="same shape"):
        best_stiffness(GRID, np.zeros(3), np.zeros(GRID.size))
    with pytest.raises(InputError, match="J"):
        pooled_curve(GRID, np.full(GRID.size, np.nan), np.zeros(GRID.size))
    with pytest.raises(InputError, match="above 0"):
        best_stiffness(np.array([0.0, 1.0, 2.0, 3.0]), np.arange(4.0), np.zeros(4))


def test_the_objective_counts_steps_first() -> None:
    nothing = Spread(None, None)
    assert objective(3, nothing, nothing) == -30.0
    zmp, com = Spread(0.02, 0.01), Spread(0.005, 0.002)
    assert objective(0, zmp, com) == pytest.approx(-(0.06 + 0.09 + 0.015 + 0.018))
    assert objective(1, nothing, nothing) < objective(0, Spread(0.5, 0.5), com)


def test_the_dataset_is_the_papers_grounds_and_as_large_as_one_likes() -> None:
    assert len(training_grounds()) == 12
    study = dataset()
    assert study.size == 12 * 5 * 16 * 2
    amplitudes = sorted({dict(cell.values)["amplitude"] for cell in study.cells})
    assert amplitudes[0] == 0.01 and amplitudes[-1] == 0.04
    assert dataset(DatasetSize(seeds=2, evaluations=50)).size == 6000
    higher = {dict(cell.values)["amplitude"] for cell in dataset(DatasetSize(height=1.5)).cells}
    assert max(higher) == pytest.approx(0.06)


def test_windows_are_what_the_toes_see() -> None:
    """Profiles as long as a scan from the begin of the rough part to where the walk ends, left and right in turn."""
    spec = WalkSpec(foot="soft", terrain="cylinder_obstacles", amplitude=0.02, plan=WalkPlan(distance=2.0))
    spec = replace(spec, start=(0.1, 0.0, 0.0))
    seen, ground, robot = seen_roughness(spec, 4), spec.ground(), spec.prepare().robot()
    recipe = ProfileRecipe()
    assert recipe.window is not None
    last = 2.1 + 0.5 * robot.soles[0].length - recipe.window
    for i, x in enumerate(np.linspace(ground.start, last, 4)):
        toe = float(robot.placement(robot.soles[i % 2].frame).translation[1])
        places, heights = ground.profile(x, x + recipe.window, y=toe, step=recipe.step)
        np.testing.assert_allclose(
            seen[i], roughness(places, heights, recipe.roughness).values, rtol=1e-6, atol=1e-12
        )
    height = seen[:, PARAMETERS.index("Sz")]
    assert seen.shape == (4, len(PARAMETERS)) and 0.002 < height.max() < 0.02


def journal_of(path: Path, best: float) -> None:
    """Results as if walks had been best at one stiffness."""
    study = small()
    with Journal(path) as journal:
        for trial in study.trials():
            spec = trial.spec.to_json()
            J = -60.0 * float(np.log10(spec["stiffness"] / best)) ** 2 - 10.0 * spec["amplitude"]
            journal.add(Entry(spec, "done", {"J": J}, {"wall_s": 1.0}, None, provenance()))


def small():  # type: ignore[no-untyped-def]
    return dataset(DatasetSize(seeds=1, amplitudes=1, evaluations=6))


def test_a_journal_becomes_a_table_and_the_table_a_model(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    journal, table, model = (str(tmp_path / name) for name in ("walks.jsonl", "table.csv", "model.json"))
    journal_of(Path(journal), 9.0)
    size = ["--set", "seeds=1", "--set", "amplitudes=1", "--set", "evaluations=6"]
    size += ["--cell", "ellips", "--cell", "cobble"]
    assert cli.main(["study", "run", "dataset", "--journal", journal, *size, "--json"]) == 0
    assert json.loads(capfd.readouterr().out)["run"] == 0
    learn = ["--of", "best", "--table", table, "--windows", "6"]
    assert cli.main(["study", "table", "dataset", "--journal", journal, *size, *learn]) == 0
    capfd.readouterr()
    made = StiffnessTable.load(table)
    assert len(made) == 12 and set(made.ground) == {"ellipsoids", "cobble_stones"}
    assert made.stiffness == pytest.approx(9.0, rel=0.1)
    assert (made.stiffness_low < made.stiffness).all() and (made.stiffness < made.stiffness_high).all()
    assert [version["code"] for version in made.made["versions"]] == [provenance()["code"]]
    assert made.made["trials"] == {"done": 2 * 6} and len(made.made["labels"]) == 2
    # All in one range: nothing to be learnt, which is said.
    assert cli.main(["stiffness", "train", table, "--out", model]) == 2
    assert "single class" in capfd.readouterr().err


def test_labels_leave_out_what_did_not_end_and_what_others_have_run(tmp_path: Path) -> None:
    study, path = small().narrowed(["cobble", "floor"]), tmp_path / "walks.jsonl"
    journal_of(path, 9.0)
    entries = read_journal(path)
    found = labels(study, entries)
    assert set(found) == {cell.name for cell in study.cells} and {
        label.walks for label in found.values()
    } == {6}
    with Journal(tmp_path / "other.jsonl") as journal:
        for entry in entries.values():
            journal.add(replace(entry, version={"wbc": "0"}))
    assert labels(study, read_journal(journal.path)) == {}
    assert labels(study, read_journal(journal.path, any_code=True)) == found
    with pytest.raises(InputError, match="run the study first"):
        stiffness_table(study, {})
    with pytest.raises(InputError, match="windows"):
        stiffness_table(study, found, windows=1)


def test_half_of_the_walks_fall_halfway(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    names = ("boards", "sticks", "stones,")
    study = halfway(seeds=2).narrowed(names)
    path = tmp_path / "walks.jsonl"
    with Journal(path) as journal:
        for trial in study.trials():
            spec = trial.spec.to_json()
            high = {"boards": 0.0, "stones": 1.0}.get(spec["terrain"], 0.045)
            done = spec["amplitude"] < high or (spec["amplitude"] == high and spec["seed"] == 0)
            result = {"outcome": "completed" if done else "fell"}
            journal.add(Entry(spec, "done", result, {"wall_s": 1.0}, None, provenance()))
    words = ["study", "table", "halfway", "--of", "heights", "--journal", str(path), "--json"]
    assert cli.main([*words, *(word for name in names for word in ("--cell", name))]) == 0
    found = json.loads(capfd.readouterr().out)["heights_m"]
    assert found == half_heights(study, read_journal(path))
    # Of four walks at each height: half of them fall over a range of heights.
    shares = {0.02: 4, 0.03: 2, 0.045: 2, 0.065: 2, 0.09: 0}
    flat = halfway(seeds=4)
    plateau = {}
    for trial in flat.narrowed(["stones"]).trials():
        spec = trial.spec.to_json()
        done = spec["seed"] < shares[spec["amplitude"]]
        entry = Entry(
            spec, "done", {"outcome": "completed" if done else "fell"}, {"wall_s": 1.0}, None, provenance()
        )
        plateau[entry.key] = entry
    assert half_heights(flat, plateau)["stones"] == pytest.approx(0.0475)
    with pytest.raises(InputError, match="single arm"):
        half_heights(dataset(), {})
    assert found["boards"] == 0.02 and found["stones"] == 0.09 and found["sticks"] == 0.045
    assert len(found) == 3


def test_the_model_of_the_library_is_the_model_of_its_table(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    model = tmp_path / "model.json"
    assert cli.main(["stiffness", "train", "--out", str(model), "--json"]) == 0
    told = json.loads(capfd.readouterr().out)
    from wbc.feet.stiffness.model import DEFAULT_MODEL  # noqa: PLC0415

    shipped, again = StiffnessModel.load(DEFAULT_MODEL), StiffnessModel.load(model)
    assert told["rows"] == len(again.stiffness)
    assert np.array_equal(shipped.features, again.features) and np.array_equal(
        shipped.stiffness, again.stiffness
    )
    assert shipped.settings == again.settings and shipped.made["table"] == again.made["table"]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["stiffness", "train", "nowhere.csv", "--out", "m.json"], "no stiffness table"),
        (["stiffness", "train", "--out", "m.txt"], ".json"),
        (["study", "table", "dataset", "--journal", "j.jsonl", "--of", "best", "--table", "t.txt"], ".csv"),
    ],
)
def test_bad_input(words: list[str], message: str, capfd: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    assert cli.main(words) == 2
    assert message in capfd.readouterr().err
