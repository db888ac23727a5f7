"""Tables and figures of the journals."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from wbc.core.files import read_json
from wbc.sim.studies.catalog import study_by_name
from wbc.sim.studies.journal import Entry, read_journal
from wbc.sim.studies.paper.optimization import BOUNDS, OPTIMISATION_SEED, OptimisationSpec
from wbc.sim.studies.provenance import provenance
from wbc.sim.studies.study import Study
from wbc.sim.studies.study_table import study_table

DOCS = Path(__file__).resolve().parents[2] / "docs"
sys.path[:0] = [str(DOCS)]

import tables  # noqa: E402 - of docs


def made_up(name: str, arms: tuple[str, ...], seeds: int) -> bytes:
    """Journal of two grounds of a study, with steps by arm and seed."""
    lines = []
    part = study_by_name(name)
    cells = [cell.name for cell in part.cells[:2]]
    for trial in part.narrowed(cells, arms, seeds).trials():
        steps = 10 + arms.index(trial.arm) + trial.seed % 3
        result = {"steps_done": steps, "outcome": "fell"}
        lines.append(Entry(trial.spec.to_json(), "done", result, {"wall_s": 1.0}, None, provenance()).line())
    return b"".join(lines)


def test_our_table_stands_beside_the_papers() -> None:
    study = study_by_name("table4").narrowed(["stones, 55 mm"], seeds=2)
    entries = {}
    for trial in study.trials():
        result = {"steps_done": {"flat": 5, "soft 5": 20}.get(trial.arm, 22), "outcome": "fell"}
        entry = Entry(trial.spec.to_json(), "done", result, None, None, provenance())
        entries[entry.key] = entry
    text = tables.table_four(study_table(study, entries))
    assert text.splitlines()[-1].startswith("| stones, 55 mm | 5 | 22 | 20 |")
    assert text.endswith("20, 6, 6 |")


def test_packed_journals_keep_what_was_decided_and_not_what_was_scanned(tmp_path: Path) -> None:
    swing = {"wanted_nm_per_rad": 41.0, "features": {"Sz": 0.1}, "profile_error_m": {"mean": 0.1, "p95": 0.2}}
    spec = next(iter(study_by_name("authority").trials())).spec.to_json()
    entry = Entry(spec, "done", {"steps_done": 22, "stiffness": [swing]}, {"wall_s": 1.0}, None, provenance())
    (tmp_path / "j.jsonl").write_bytes(entry.line())
    (packed,) = read_journal(tables.pack(tmp_path, tmp_path)[0]).values()
    assert packed.key == entry.key and packed.clock is None and packed.result is not None
    assert packed.result["steps_done"] == 22
    (kept,) = packed.result["stiffness"]
    assert kept["wanted_nm_per_rad"] == 41.0 and kept["features"] is kept["profile_error_m"] is None


@pytest.mark.slow
def test_journals_are_packed_and_partial_tables_and_figures_say_so(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    source = tmp_path / "results"
    source.mkdir()
    (source / "authority.jsonl").write_bytes(made_up("authority", ("5", "80"), 5))
    spec = OptimisationSpec(ground="stones", amplitude=0.055, bounds=BOUNDS["wide"])
    rng = np.random.default_rng(0)
    lines = []
    for i in range(14):
        walk = spec.walk(spec.bounds.values(rng.random(3)), OPTIMISATION_SEED + i).to_json()
        lines.append(Entry(walk, "done", {"J": -float(rng.random())}, None, None, provenance()).line())
    (source / "optimize.jsonl").write_bytes(b"".join(lines))
    assert tables.main(["--pack", str(source)], tmp_path) == 0
    names = sorted(path.name for path in (tmp_path / "journals").iterdir())
    assert names == ["authority.jsonl.xz", "optimize.jsonl.xz"]
    (tmp_path / "images").mkdir()
    own = (
        ("authority", "authority.jsonl.xz", "--as choice --arm 5 --arm 80"),
        ("authority", "authority.jsonl.xz", "--arm 5 --arm 80 --from 102"),
        ("stones", "optimize.jsonl.xz", "--as optimum"),
    )
    monkeypatch.setattr(tables, "TABLES", own)
    assert tables.main([], tmp_path) == 0
    text = (tmp_path / "journals" / "tables.md").read_text()
    assert "| boards, 50 mm (5) |" in text and "over 5: 1 [1, 1]" in text.lower()
    assert "*Partial: 20 of 1,360 walks of `authority`" in text and "*Partial: 12 of 1,360 walks" in text
    assert "*Partial: 14 on `stones` of 400 walks a ground" in text and "| `stones` |" in text
    figures = (
        ("authority", "authority.jsonl.xz", "--as differences --arm 5 --arm 80", "images/a.svg"),
        ("authority", "authority.jsonl.xz", "--as risks --arm 5 --arm 80", "images/r.svg"),
        ("stones", "optimize.jsonl.xz", "--as optimum", "images/optima.svg"),
    )
    monkeypatch.setattr(tables, "FIGURES", figures)
    capsys.readouterr()
    assert tables.main(["--figures"], tmp_path) == 0
    assert (tmp_path / "images" / "a.svg").stat().st_size > 5000
    assert "falls per 1,000 steps" in (tmp_path / "images" / "r.svg").read_text()
    assert "<!-- stones -->" in (tmp_path / "images" / "optima.svg").read_text()
    assert tables.main(["--held-out", str(source)], tmp_path) == 0
    study = Study.from_json(read_json(source / "optimize_held_out.json"))
    assert [cell.name for cell in study.cells] == ["stones"] and len(study.seeds) == tables.VALIDATIONS
    for words in ("--as pie", "--of pie"):
        monkeypatch.setattr(tables, "TABLES", ((*own[0][:2], words),))
        with pytest.raises(SystemExit, match="no kind of table pie|no option --of"):
            tables.main([], tmp_path)


@pytest.mark.slow
def test_stored_walks_are_those_of_studies_with_a_sharp_edge() -> None:
    mark = tables.Mark("table4", "table4.jsonl.xz", "--seeds 1 --arm rigid", DOCS / "journals")
    assert mark.ramp == {"ramp": 0.0} and len(mark.study.cells) == 20
    assert mark.code(list(mark.entries.values())) == "da5fd04521c0"
