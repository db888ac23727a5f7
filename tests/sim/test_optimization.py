"""Bayesian optimisation of stiffness and gains: what is asked, what is found, and what is refused."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
from properties import by_default
from scipy.stats import norm

from wbc.app import cli
from wbc.app.commands.study.optimize import OptimizeOptions
from wbc.core.errors import InputError
from wbc.sim.studies.journal import Entry, Journal, trial_key
from wbc.sim.studies.paper.experiments import authority, authority_heights
from wbc.sim.studies.paper.optimization import (
    BOUNDS,
    FIRST_DESIGN,
    OPTIMISATION_SEED,
    PAPER_CHANGES,
    Bounds,
    OptimisationSpec,
    Walked,
    check_journal,
    fitted,
    optimise,
    parameters,
    within,
)
from wbc.sim.studies.paper.optimum import TABLE_II, USUAL, optimum, table_two, validation, walked_points
from wbc.sim.studies.provenance import provenance
from wbc.sim.walks.spec import WalkSpec

pytest.importorskip("bayes_opt", reason="needs the extra 'studies'")

SPEC = OptimisationSpec(ground="stones", bounds=BOUNDS["wide"], distance=0.3)


class MadeUpWalks:
    """Runs walks that are a parabola over the logarithm of k and over the gains, with noise by the seed."""

    def __init__(self, best: float = 20.0, noise: float = 3.0) -> None:
        self.best, self.noise = best, noise
        self.entries: dict[str, Entry] = {}
        self.run = 0

    def __call__(self, specs: list[WalkSpec]) -> Mapping[str, Entry]:
        for spec in specs:
            plain = spec.to_json()
            key = trial_key(plain)
            if key in self.entries:
                continue
            self.run += 1
            p = parameters(plain)
            J = -40.0 * math.log10(p["k"] / self.best) ** 2 - 4.0 * (p["kP"] - 3.0) ** 2
            J += self.noise * float(np.random.default_rng(spec.seed).normal()) - 1.0
            self.entries[key] = Entry(plain, "done", {"J": J}, None, None, provenance())
        return self.entries


@pytest.mark.slow
def test_finds_the_top_of_a_noisy_hill_and_the_range_that_is_as_good() -> None:
    walks = MadeUpWalks()
    found = optimum(optimise(SPEC, 36, walks), SPEC.bounds)
    assert found.walks == 36
    assert 8.0 < found.best["k"] < 50.0 and 2.0 < found.best["kP"] < 4.0
    ((low, high),) = found.same
    assert 1.0 < low < 20.0 < high < 400.0 and not found.whole
    assert abs(found.J + 1.0) < 2.5 and 1.5 < found.noise < 6.0
    # The model looks where it is good: most walks after the first design are near the top.
    near = [abs(math.log10(parameters(e.spec)["k"] / 20.0)) < 0.5 for e in walks.entries.values()]
    assert np.mean(near[FIRST_DESIGN:]) > 0.5 > np.mean(near[:FIRST_DESIGN])


def test_where_nothing_matters_every_stiffness_is_as_good() -> None:
    rng = np.random.default_rng(0)
    walked = [Walked(tuple(rng.random(3)), -1.0, {}) for _ in range(20)]
    assert optimum(walked, SPEC.bounds).whole
    with pytest.raises(InputError, match="at least 12 walks with a result, got 5"):
        optimum(walked[:5], SPEC.bounds)


def test_the_optimum_is_a_point_that_was_walked() -> None:
    """J rises towards a corner that nobody has walked: the model expects more there, the optimum does not go there."""
    rng = np.random.default_rng(2)
    points = [tuple(0.7 * rng.random(3)) for _ in range(40)]
    walked = [Walked(p, 10.0 * sum(p) - 40.0 + rng.normal(), {}) for p in points]
    found = optimum(walked, SPEC.bounds)
    assert found.best in [SPEC.bounds.values(p) for p in points]
    assert max(10.0 * sum(p) - 40.0 for p in points) - 2.0 < found.J
    _, mean, _ = found.slices["kD"]
    assert mean[-1] > found.J + 1.0


def test_expected_values_are_those_of_the_textbook_and_as_good_is_not_told_apart_at_95_percent() -> None:
    """Rasmussen and Williams, "Gaussian Processes", eqs. 2.23, 2.24, with the kernel that was fitted."""
    rng = np.random.default_rng(7)
    points = rng.random((24, 3))
    walked = [Walked(tuple(p), -6.0 - 30.0 * (p[0] - 0.6) ** 2 + rng.normal(), {}) for p in points]
    found, y = optimum(walked, SPEC.bounds), np.array([each.J for each in walked])
    kernel = fitted(points, y).kernel_
    best = points[[SPEC.bounds.values(p) == found.best for p in points]]
    line = np.column_stack([np.linspace(0.0, 1.0, 201), *np.tile(best[0, 1:, None], 201)])
    line = np.vstack([line, best])
    gain = kernel.k1(line, points) @ np.linalg.inv(kernel.k1(points) + kernel.k2.noise_level * np.eye(24))
    mean = y.mean() + gain @ (y - y.mean())
    cov = y.var() * (kernel.k1(line) - gain @ kernel.k1(points, line))
    np.testing.assert_allclose(found.mean, mean[:-1], atol=1e-6)
    np.testing.assert_allclose(found.std, np.sqrt(np.diag(cov))[:-1], atol=1e-5)
    assert (found.J, found.J_std) == pytest.approx((mean[-1], math.sqrt(cov[-1, -1])), abs=1e-5)
    assert found.noise == pytest.approx(y.std() * math.sqrt(kernel.k2.noise_level)) and found.walks == 24
    spread = np.sqrt(np.diag(cov) + cov[-1, -1] - 2.0 * cov[-1])[:-1]
    same = mean[-1] - mean[:-1] <= norm.ppf(0.95) * spread + 1e-4
    ((low, high),) = found.same
    assert (low, high) == pytest.approx((found.k[same][0], found.k[same][-1])) and 0 < same.sum() < 201
    assert (found.k[0], found.k[100]) == pytest.approx((1.0, math.sqrt(2000.0)), rel=1e-4)


@pytest.mark.parametrize("batch", by_default([1, 2], 2))
def test_killed_anywhere_it_goes_on_with_the_same_walks(batch: int) -> None:
    """Whatever the journal has is found again: nothing is walked twice, and the end is the same."""
    spec = OptimisationSpec(ground="stones", bounds=BOUNDS["wide"], distance=0.3, batch=batch)
    whole, cut = MadeUpWalks(), MadeUpWalks()
    first = optimise(spec, 14, whole)

    class KilledError(Exception):
        pass

    def killed(specs: list[WalkSpec]) -> Mapping[str, Entry]:
        if cut.run >= 12:
            raise KilledError
        return cut(specs)

    with pytest.raises(KilledError):
        optimise(spec, 14, killed)
    again = optimise(spec, 14, cut)
    assert [w.unit for w in again] == [w.unit for w in first] and cut.run == 14
    seeds = [e.spec["seed"] for e in cut.entries.values()]
    assert sorted(seeds) == list(range(OPTIMISATION_SEED, OPTIMISATION_SEED + 14))


def test_walks_without_a_result_are_left_out() -> None:
    walks = MadeUpWalks()

    def some_diverge(specs: list[WalkSpec]) -> Mapping[str, Entry]:
        for key, entry in walks(specs).items():
            if entry.spec["seed"] % 5 == 0 and entry.status == "done":
                walks.entries[key] = Entry(entry.spec, "diverged", None, None, "…", entry.version)
        return walks.entries

    assert len(optimise(SPEC, 12, some_diverge)) == 9


def test_bounds_are_the_papers_or_wide() -> None:
    paper, wide = BOUNDS["paper"], BOUNDS["wide"]
    assert paper.values((0.0, 0.0, 1.0)) == {"k": 0.0, "kP": 0.1, "kD": 5.0}
    assert paper.values((0.5, 0.5, 0.5))["k"] == 40.0
    assert wide.values((0.5, 0.5, 0.5))["k"] == pytest.approx(math.sqrt(2000.0), rel=1e-5)
    point = (0.123, 0.456, 0.789)
    for bounds in (paper, wide, Bounds(k=(10.0, 1000.0))):
        assert bounds.unit(bounds.values(point)) == pytest.approx(point, abs=1e-5)
        corner = {name: getattr(bounds, name)[1] for name in ("k", "kP", "kD")}
        assert within(bounds, corner) and within(bounds, bounds.values((0.0, 0.0, 0.0)))
        for name, highest in corner.items():
            for outside in (1.01 * highest, getattr(bounds, name)[0] - 0.01):
                assert not within(bounds, corner | {name: outside})
    assert Bounds(k=(10.0, 1000.0)).values((0.25, 0.0, 0.0))["k"] == pytest.approx(31.6228)
    with pytest.raises(InputError, match="bounds of k must be two numbers, the lower one first .* got 80 1"):
        Bounds(k=(80.0, 1.0))
    with pytest.raises(InputError, match="no logarithm"):
        Bounds(k=(0.0, 80.0))


def test_a_journal_of_something_else_or_of_other_code_is_refused() -> None:
    walks = MadeUpWalks()
    optimise(SPEC, 3, walks)
    check_journal(walks.entries, [SPEC], any_code=False)
    for other in (
        OptimisationSpec(ground="boards", bounds=BOUNDS["wide"], distance=0.3),
        OptimisationSpec(ground="stones", bounds=BOUNDS["wide"], distance=0.3, law="no_bias"),
        OptimisationSpec(ground="stones", bounds=Bounds(k=(1900.0, 2000.0)), distance=0.3),
    ):
        with pytest.raises(InputError, match="not of this optimisation: it has a walk with .*stones"):
            check_journal(walks.entries, [other], any_code=False)
    old = {
        key: Entry(e.spec, e.status, e.result, None, None, {**e.version, "code": "0123456789ab"})
        for key, e in walks.entries.items()
    }
    with pytest.raises(InputError, match="another version of the code .* --any-code takes them"):
        check_journal(old, [SPEC], any_code=False)
    check_journal(old, [SPEC], any_code=True)


def test_a_journal_gives_the_points_in_the_order_of_asking() -> None:
    walks = MadeUpWalks()
    known = optimise(SPEC, 12, walks)
    other = OptimisationSpec(ground="boards", bounds=BOUNDS["wide"], distance=0.3)
    optimise(other, 3, walks)
    again = walked_points(SPEC, dict(reversed(walks.entries.items())))
    assert [each.J for each in again] == [each.J for each in known]
    np.testing.assert_allclose([w.unit for w in again], [w.unit for w in known], atol=1e-5)
    assert len(walked_points(other, walks.entries)) == 3


def test_the_optimum_is_judged_on_seeds_it_has_not_seen_and_printed_beside_the_papers() -> None:
    found = optimum(optimise(SPEC, 12, MadeUpWalks()), SPEC.bounds)
    boards = OptimisationSpec(ground="boards", bounds=BOUNDS["wide"], distance=0.3)
    study = validation({SPEC: found, boards: found}, 20)
    assert set(study.seeds) == set(range(100, 120))
    assert list(study.arms) == ["best", "k 5", "k 80", "k 2000", "usual gains, k 80"]
    specs = {trial.cell: trial.spec for trial in study.trials()}
    assert all(
        (spec.ground == cell) == spec.owns(walk.to_json())
        for spec in (SPEC, boards)
        for cell, walk in specs.items()
    )
    text = table_two({"stones": found})
    assert "| 4 | 1.3 | 2.8 – 16.1 |" in text and len(TABLE_II) == 11


def test_nothing_is_optimised_in_the_walks_beside_the_optimum() -> None:
    """With the default law they are walks of the study 'authority', with the paper's law they have its gains."""
    rng = np.random.default_rng(0)
    usual = {}
    for law in ("default", "no_bias"):
        options = OptimizeOptions(journal=Path("j"), law=law, bounds="wide" if law == "default" else "paper")
        (spec,) = [each for each in options.specs(("table2",)) if each.ground == "stones"]
        assert spec.amplitude == (authority_heights()["stones"] if law == "default" else None)
        found = optimum([Walked(tuple(rng.random(3)), -1.0, {}) for _ in range(12)], spec.bounds)
        trials = validation({spec: found}, 20).trials()
        usual[law] = [trial.spec for trial in trials if trial.arm == USUAL]
    same = {trial.spec for trial in authority(20).narrowed(["stones,"], ["80"]).trials()}
    assert set(usual["default"]) == same and len(same) == 20
    assert {spec.changes for spec in usual["no_bias"]} == {
        WalkSpec(changes=PAPER_CHANGES, gains="no_bias").changes
    }


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["stone"], "did you mean 'stones'"),
        (["stones", "--budget", "11"], "budget"),  # before they are walked: no model is made of so few
        (["stones", "--k", "80", "1"], "the lower one first"),
        (["stones", "stones"], "different grounds"),
        (["stones", "--law", "legal"], "legal"),
        (["stones", "--figures", "nowhere"], "no folder nowhere"),
    ],
)
def test_bad_input(words: list[str], message: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    journal = str(tmp_path / "journal.jsonl")
    assert cli.main(["study", "optimize", *words, "--journal", journal]) == cli.BAD_INPUT
    assert message in capfd.readouterr().err
    assert not Path(journal).exists()


@pytest.mark.slow
def test_the_command_walks_and_resumes(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    journal = tmp_path / "journal.jsonl"
    words = ["study", "optimize", "stones", "--journal", str(journal), "--distance", "0.15", "--budget", "13"]
    words += ["--validate", "1", "--workers", "2", "--figures", str(tmp_path), "--json"]
    assert cli.main(words) == cli.RAN
    first = capfd.readouterr().out
    lines = journal.read_bytes().splitlines(keepends=True)
    journal.write_bytes(b"".join(lines[:7]) + lines[7][:40])  # killed in the middle of a line
    assert cli.main(words) == cli.RAN
    assert capfd.readouterr().out == first
    assert len(Journal(journal)) == len(lines)
    assert (tmp_path / "optimize_stones.png").stat().st_size > 10_000
