"""The paper's experiments: their grounds and arms, their scale, and one command that runs all of them."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from wbc.app import cli
from wbc.core.errors import InputError
from wbc.feet.stiffness.dataset import StiffnessTable
from wbc.sim.studies.catalog import study_by_name
from wbc.sim.studies.journal import Entry, Journal
from wbc.sim.studies.paper.choice import choice
from wbc.sim.studies.paper.experiments import (
    FIRST_FAMILIES,
    authority,
    damping,
    fig5,
    oracle,
    table4,
)
from wbc.sim.studies.provenance import provenance
from wbc.sim.studies.study import Study
from wbc.sim.studies.study_table import layout_of
from wbc.sim.terrain.families.patchwork import stretches
from wbc.sim.terrain.spec import terrain
from wbc.sim.walks.spec import WalkSpec
from wbc.sim.walks.stiffness_policy import make_policy
from wbc.tasks.scheduling.policies import GroundPolicy


def test_experiments_have_the_papers_grounds_and_independent_layouts() -> None:
    study = fig5()
    assert len(study.cells) == 28 and len(study.seeds) >= 10
    layouts = {layout_of(trial.spec.to_json()) for trial in study.narrowed(arms=["soft 5"]).trials()}
    assert len(layouts) == 280
    four = table4()
    assert len(four.cells) == 20 and len(four.seeds) >= 20
    at_once = next(trial.spec for trial in four.trials() if trial.arm == "variable, 75 % at once")
    assert isinstance(at_once, WalkSpec) and at_once.settings().stiffness.decide_at == 0.75
    paper = next(iter(study_by_name("table4_frizza").trials())).spec
    assert isinstance(paper, WalkSpec) and paper.gains == "frizza"


def test_the_oracle_knows_every_family_of_its_patchwork() -> None:
    trials = list(oracle(seeds=1).trials())
    assert {trial.arm for trial in trials} >= {"oracle", "model", "5", "2000"}
    known = next(dict(trial.spec.policy_params) for trial in trials if trial.arm == "oracle")
    assert tuple(known) == FIRST_FAMILIES
    ground = terrain("patchwork", 0.04, 3, families="boards stones roof_tiles", length=3.0)
    values = {"boards": 60.0, "stones": 7.0, "roof_tiles": 20.0}
    policy = make_policy("oracle", values, ground)
    assert isinstance(policy, GroundPolicy)
    parts = stretches(ground)
    for name, begin, end in parts:
        assert [policy.function(x, 0.3) for x in (begin + 1e-6, end - 1e-6)] == [values[name]] * 2
    assert policy.function(ground.start - 1.0, 0.0) == values[parts[0][0]], "before the first"
    assert policy.function(ground.stop + 1.0, 0.0) == values[parts[-1][0]], "behind the last"


def made_up(study: Study, steps: Callable[[str, str, int], float]) -> dict[str, Entry]:
    """Entries of all trials of a study with steps by cell, arm and seed."""
    entries = {}
    for trial in study.trials():
        result = {"steps_done": steps(trial.cell, trial.arm, trial.seed), "outcome": "fell"}
        entry = Entry(dict(trial.plain), "done", result, None, None, provenance())
        entries[entry.key] = entry
    return entries


def test_choosing_by_the_ground_is_worth_what_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("wbc.sim.studies.intervals.RESAMPLES", 999)
    study = authority(seeds=10).narrowed(["boards", "stones"], ["rigid", "5", "80", "400"])
    rng = np.random.default_rng(2)

    def two_sided(cell: str, arm: str, seed: int) -> float:
        best = "5" if cell.startswith("stones") else "400"
        return 15.0 + 4.0 * (arm == best) + 0.1 * rng.normal()

    found = choice(study, made_up(study, two_sided))
    assert [ground.best for ground in found.grounds] == ["400", "5"]
    assert all(ground.same == (ground.best,) for ground in found.grounds)
    assert found.gain.mean == pytest.approx(2.0, abs=0.1) and found.gain.n == 20
    assert found.over["80"].mean == pytest.approx(4.0, abs=0.1) and not found.equivalence.equivalent
    assert "rigid" not in found.arms and "| 400 | 400 |" in found.markdown()
    few = choice(study, made_up(study.narrowed(seeds=2), two_sided))
    assert few.gain.mean is None and not few.equivalence.equivalent
    assert "needs 5 layouts" in few.markdown() and few.grounds[0].same == few.arms
    with pytest.raises(InputError, match="two layouts"):
        choice(study, {})
    with pytest.raises(InputError, match="two arms"):
        choice(study, {}, ["5"])


def test_the_first_layouts_choose_and_the_others_judge() -> None:
    """On the first six layouts 5 looks best by chance; on the others it is worth nothing, and 80 does better."""
    study = authority(seeds=10).narrowed(["boards", "stones"])

    def lucky(cell: str, arm: str, seed: int) -> float:
        early = seed in study.seeds[:6]
        return 15.0 + (3.0 if arm == "5" and early and cell.startswith("boards") else 2.0 * (arm == "80"))

    found = choice(study, made_up(study, lucky), chosen_by=6)
    boards, stones = found.grounds
    assert (boards.best, stones.best, found.single, boards.layouts) == ("5", "80", "80", 4)
    assert boards.means["5"].mean == 15.0 and boards.means["80"].mean == 17.0
    assert found.gain.mean == pytest.approx(-1.0) and found.gain.n == 8
    assert found.over["400"].mean == pytest.approx(1.0)
    label = found.labels(study)[stones.row]
    same = sorted(float(arm) for arm in {*stones.same, "80"})
    assert (label.stiffness, label.nearly_low, label.nearly_high) == (80.0, same[0], same[-1])
    assert label.walks == 4 * len(found.arms)
    assert "| best of the first 6 layouts |" in found.markdown() and "on 8 others" in found.markdown()
    with pytest.raises(
        InputError, match="chosen_by must leave two .* got 10; of 'boards, 50 mm' that is 10 and 0"
    ):
        choice(study, made_up(study, lucky), chosen_by=10)
    with pytest.raises(InputError, match="got 1; "):
        choice(study, made_up(study, lucky), chosen_by=1)


def test_grounds_that_share_their_layouts_are_judged_by_these() -> None:
    """Three stiffnesses of the sole on the same layouts of a family: values of one layout go up and down together."""
    study = damping(seeds=10).narrowed(["boards"])
    luck = dict(zip(study.seeds, np.random.default_rng(0).normal(size=10), strict=True))

    def together(cell: str, arm: str, seed: int) -> float:
        del cell
        return 15.0 + (luck[seed] if arm == "b = 2" else 0.0)

    found = choice(study, made_up(study, together), list(study.arms))
    assert len(found.grounds) == 3 and found.gain.n == 30 and found.gain.layouts == 10
    alone = study.narrowed(["boards, k = 5"])
    once = choice(alone, made_up(alone, together), list(study.arms))
    for arm in study.arms:
        assert found.over[arm].mean == pytest.approx(once.over[arm].mean)
        assert (found.over[arm].low, found.over[arm].high) == pytest.approx(
            (once.over[arm].low, once.over[arm].high)
        )


def test_layouts_without_a_value_are_left_out_of_a_choice_and_texts_are_no_metric() -> None:
    study = authority(seeds=6).narrowed(["boards", "stones"])
    entries = {}
    for trial in study.trials():
        unknown = (trial.cell.split(",")[0], trial.arm, trial.seed) == (
            "boards",
            "5",
            100,
        )  # such as after a fall
        result = {"outcome": "fell", "zmp_error": {"mean": None if unknown else 0.01, "std": 0.0}}
        entry = Entry(dict(trial.plain), "done", result, None, None, provenance())
        entries[entry.key] = entry
    found = choice(study, entries, metric="zmp_error.mean")
    assert [ground.layouts for ground in found.grounds] == [5, 6] and found.missing == 1
    with pytest.raises(InputError, match="'outcome' of a result is no number but 'fell'"):
        choice(study, entries, metric="outcome")


@pytest.mark.slow
def test_a_choice_from_the_command_line(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    study = authority(seeds=5).narrowed(["boards", "stones"])
    with Journal(tmp_path / "authority.jsonl") as journal:
        for entry in made_up(study, lambda cell, arm, seed: 5.0 + len(arm)).values():
            journal.add(entry)
    words = ["study", "table", "authority", "--of", "choice", "--json"]
    words += ["--journal", str(tmp_path / "authority.jsonl")]
    assert cli.main(words) == cli.RAN
    told = json.loads(capfd.readouterr().out)
    assert told["single"] == "2000" and told["gain"]["mean"] == 0.0 and len(told["grounds"]) == 2
    assert cli.main([*words, "--chosen-by", "3"]) == cli.RAN
    assert json.loads(capfd.readouterr().out)["gain"]["n"] == 4
    assert cli.main([*words, "--arm", "5"]) == cli.BAD_INPUT
    table = tmp_path / "table.csv"
    assert cli.main([*words, "--seeds", "5", "--cell", "stones,", "--table", str(table)]) == cli.RAN
    rows = StiffnessTable.load(table)
    assert set(rows.stiffness) == {2000.0} and set(rows.family) == {"stones"} and len(rows) == 5 * 6
    assert cli.main([*words, "--arm", "5", "--arm", "rigid", "--table", str(table)]) == cli.BAD_INPUT
    assert "a table needs arms with a stiffness; rigid" in capfd.readouterr().err


def test_dampers_share_walks_with_authority() -> None:
    plain = {json.dumps(dict(t.plain), sort_keys=True) for t in authority(seeds=20).trials()}
    shared = [t for t in damping().trials() if json.dumps(dict(t.plain), sort_keys=True) in plain]
    assert {trial.arm for trial in shared} == {"b = 2"} and len(shared) == damping().size // 2
