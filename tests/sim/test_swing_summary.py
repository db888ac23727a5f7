"""Summaries of the swings of many walks on soles of variable stiffness."""

from __future__ import annotations

from typing import Any

import pytest

from wbc.sim.studies.journal import Entry
from wbc.sim.studies.provenance import provenance
from wbc.sim.studies.study import Cell, Study
from wbc.sim.studies.swing_summary import swing_summaries


def swing(reached: bool = True, commanded: float = 50.0, **values: Any) -> dict[str, Any]:
    return {
        "reached": reached,
        "commanded_nm_per_rad": commanded,
        "wanted_nm_per_rad": 50.0,
        "fallback": None,
        "seconds_before_landing": 0.2,
        "profile_error_m": {"mean": 0.001, "p95": 0.003},
        "profile_error_as_believed_m": None,
    } | values


def test_swings_are_summed_up_by_cell() -> None:
    study = Study(
        name="small",
        base={"plan": {"distance": 0.1}, "foot": "variable", "policy": "fixed"},
        cells=(
            Cell("low", {"terrain": "stones", "amplitude": 0.01}),
            Cell("high", {"terrain": "stones", "amplitude": 0.02}),
        ),
        arms={"variable": {}},
        seeds=(1, 2, 3),
    )
    good, short = (
        swing(),
        swing(
            fallback="scan too short: 0.1 m",
            commanded=30.0,
            profile_error_m=None,
            seconds_before_landing=None,
        ),
    )
    walks = {
        ("low", 1): [good, good],
        ("low", 2): [good, short],
        ("high", 1): [swing(reached=False, commanded=46.0), swing(commanded=48.0)],  # 8 and 4 %,
    }
    entries = {}
    for trial in study.trials():
        swings = walks.get((trial.cell, trial.seed))
        clock = {"decision_us": {"median": 400.0 + trial.seed, "max": 1000.0 * trial.seed}}
        if swings is not None:
            entry = Entry(trial.spec.to_json(), "done", {"stiffness": swings}, clock, None, provenance())
            entries[entry.key] = entry

    found = swing_summaries(study, entries)
    assert list(found) == ["low", "high", "all"]
    low, everything = found["low"], found["all"]
    assert (low.walks, low.swings, low.reached, low.decided) == (2, 4, 1.0, 0.75)
    assert low.fallbacks == {"scan too short": 1} and low.as_wanted == 1.0
    assert low.profile_error == pytest.approx((0.001, 0.003))
    assert low.decision_us == (401.5, 2000.0)
    assert (everything.walks, everything.swings) == (3, 6)
    assert everything.reached == pytest.approx(5 / 6) and everything.as_wanted == pytest.approx(4 / 5)
    assert everything.stiffness == pytest.approx((38.0, 49.0, 50.0)) and everything.ahead == pytest.approx(
        [0.2] * 3
    )
    assert swing_summaries(study, {}) == {}
