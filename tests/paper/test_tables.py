"""The main results of the paper's README, computed anew from its journals."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from choice import choice
from tables import NONE, PAPER_TABLE_IV, PARTS, SOLES, TABLES, WHOLE, main, parts
from walks import STUDIES, by_sole, corrected, falls, gain, shown, walks

from wbc.sim.studies import Study

pytestmark = pytest.mark.slow  # 20,000 walks are read


def arrived(journal: str, arm: str) -> int:
    table = walks(journal)
    return int(table.loc[table["sole"] == arm, "arrived"].sum())


@pytest.mark.parametrize(
    ("journal", "steps", "arrivals"),
    [
        ("table4", (336, 432, 440, 436), (237, 368, 395, 387)),
        ("table4_frizza", (165, 229, 227, 222), (31, 59, 60, 60)),
    ],
)
def test_table_four(journal: str, steps: tuple[int, ...], arrivals: tuple[int, ...]) -> None:
    arms = ["flat", "rigid", "soft, 5", "variable"]
    means = walks(journal).pivot_table("steps", ["terrain", "amplitude"], "sole")[arms]
    assert tuple(means.sum().round().astype(int)) == steps
    assert tuple(arrived(journal, arm) for arm in arms) == arrivals
    paper = np.array([row for rows in PAPER_TABLE_IV.values() for row in rows]).sum(axis=0)
    assert paper.tolist() == [386, 254, 140]


def test_a_stiffness_that_is_scheduled_as_the_paper_does_gains_nothing() -> None:
    for journal, expected in (("table4", "−0.2 [−0.4, −0.1]"), ("table4_frizza", "−0.3 [−0.7, 0.1]")):
        assert shown(gain(by_sole(walks(journal)), "variable", "soft, 5")[0]) == expected


def test_softness_trades_sideways_falls_for_forward_ones() -> None:
    table = walks("hypotheses")
    rates = {c: [round(falls(table, arm, c)[0], 1) for arm in SOLES] for c in ("sideways", "forward")}
    assert rates["sideways"] == [13.0, 4.9, 6.0, 6.5, 7.8, 11.2, 12.6]
    assert rates["forward"] == [0.9, 5.1, 2.6, 3.9, 2.1, 1.6, 0.6]
    assert [arrived("hypotheses", arm) for arm in SOLES] == [238, 269, 278, 266, 268, 247, 241]
    values = 100.0 * by_sole(table, "arrived")
    found = {arm: gain(values, arm, "rigid", "terrain") for arm in SOLES[1:]}
    assert shown(found["soft, 5"][0], 0) == "12 [4, 21]"
    assert min(corrected({arm: p for arm, (_, p) in found.items()}).values()) == pytest.approx(
        0.12, abs=0.005
    )


def test_an_arch_under_the_toe_takes_the_forward_falls_away() -> None:
    table = walks("hypotheses")
    assert falls(table, "long arch, 5", "forward")[2] < falls(table, "soft, 5", "forward")[1]
    assert falls(table, "long arch, 5", "sideways")[2] < falls(table, "rigid", "sideways")[1]
    assert (
        shown(gain(100.0 * by_sole(table, "arrived"), "long arch, 5", "rigid", "terrain")[0], 0)
        == "17 [9, 26]"
    )
    assert [arrived("hypotheses", f"long arch, {k}") for k in (1, 5, 20, 80)] == [275, 295, 292, 261]
    values = 100.0 * by_sole(table, "arrived")
    arches = [arm for arm in values.columns if "arch" in arm]
    found = corrected({arm: gain(values, arm, "rigid", "terrain")[1] for arm in arches})
    readme = (STUDIES.parents[2] / "README.md").read_text(encoding="utf-8")
    assert any("17 [9, 26]" in line and "(p = 0.04)" in line for line in readme.splitlines())
    assert len(arches) == 8 and found["long arch, 5"] == pytest.approx(0.018, abs=0.002)
    every = corrected(
        {arm: gain(values, arm, "rigid", "terrain")[1] for arm in values.columns if arm != "rigid"}
    )
    assert len(every) == 18
    assert every["long arch, 5"] == pytest.approx(0.044, abs=0.002)
    assert every["soft, 5"] == pytest.approx(0.25, abs=0.005)


def test_neither_phase_nor_ground_nor_a_scan_has_a_gain() -> None:
    steps = by_sole(walks("hypotheses"))
    for arm in [arm for arm in steps.columns if arm.startswith(("phase", "edge"))]:
        assert gain(steps, arm, "soft, 80", "terrain")[0].mean <= 0.05
    known = choice(steps[list(SOLES[1:])], chosen_by=10)
    assert shown(known.over["soft, 80"], 2) == "0.18 [−0.04, 0.45]"
    scanned = steps.join(by_sole(walks("learnt_ramp")), how="inner")
    for arm, expected in (("ramp_model", "−0.5 [−1.2, 0.0]"), ("ramp_model_regression", "−0.4 [−1.3, 0.1]")):
        assert shown(gain(scanned, arm, "soft, 80", "terrain")[0]) == expected


def test_which_part_of_the_law_closes_the_gap() -> None:
    sure = {}
    for study, level in (("attribution", 0.003), ("indispensable", 0.002)):
        steps = by_sole(parts(study), name="part")
        found = {part: gain(steps, part, NONE) for part in steps.columns if part != NONE}
        p = corrected({part: value for part, (_, value) in found.items()})
        sure[study] = {part for part, value in p.items() if value is not None and value <= level}
        if study == "attribution":
            assert shown(found[WHOLE][0]) == "12.3 [10.8, 13.6]"
    assert sure["attribution"] == {PARTS["gains.cop_admittance"], "lean", WHOLE}
    needed = ("gains.dcm_p", "gains.cop_admittance", "gains.support_height_leak")
    assert sure["indispensable"] == {PARTS[key] for key in needed}


def test_the_stepping_walk_gains_nothing_by_softness() -> None:
    arms = ("rigid", "soft, 5", "soft, 80", "long arch, 5")
    assert [arrived("stepping_soles", arm) for arm in arms] == [256, 225, 248, 200]


@pytest.mark.parametrize("name", TABLES)
def test_every_table_takes_the_walks_of_the_journal_that_is_given(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    empty = tmp_path / "own.jsonl"
    empty.touch()
    monkeypatch.setattr("sys.argv", ["tables.py", name, "--journal", str(empty)])
    with pytest.raises(SystemExit, match=f"{re.escape(str(empty))} has no walks"):
        main()


ALL = sorted([*STUDIES.glob("*.json"), *(STUDIES.parents[1] / "studies").glob("*.json")])


@pytest.mark.parametrize("path", ALL, ids=lambda path: path.stem)
def test_studies_can_be_run(path) -> None:  # type: ignore[no-untyped-def]
    import policies  # noqa: F401, PLC0415 - registers those of two studies

    study = Study.from_json(json.loads(path.read_text()))
    part = study.narrowed([study.cells[0].name], seeds=1)
    specs = [json.dumps(trial.spec.to_json()) for trial in part.trials()]
    assert len(set(specs)) == len(specs) == part.size
