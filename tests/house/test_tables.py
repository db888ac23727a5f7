"""Tables of the pages are those of their journals."""

from __future__ import annotations

import lzma
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

DOCS = Path(__file__).resolve().parents[2] / "docs"
sys.path[:0] = [str(DOCS), str(DOCS.parent / "tests" / "benchmarks")]

import own_loop  # noqa: E402 - of the benchmarks
import tables  # noqa: E402 - of docs


@pytest.mark.slow
def test_every_table_from_a_journal_is_what_the_journal_gives() -> None:
    assert tables.main(["--check"]) == 0


def test_the_table_of_own_loops_is_what_their_journal_gives() -> None:
    rows = own_loop.journal(DOCS / "journals" / "own_loop.jsonl.xz")
    assert f"\n{own_loop.table(rows)}\n" in (DOCS / "measured.md").read_text()


def test_a_page_is_rebuilt_checked_and_known_to_be_stale(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "journals").mkdir()
    lines = []
    for trial in study_by_name("table4").narrowed(["stones, 55 mm"], seeds=2).trials():
        result = {"steps_done": 22 if trial.arm == "variable" else 11, "outcome": "completed"}
        version = {**provenance(), "code": "0123456789ab"}
        lines.append(Entry(trial.spec.to_json(), "done", result, None, None, version).line())
    (tmp_path / "journals" / "table4.jsonl.xz").write_bytes(lzma.compress(b"".join(lines)))
    page = tmp_path / "page.md"
    mark = "<!-- table table4 from table4.jsonl.xz --seeds 2 --margin 0.5 -->\n<!-- end of table -->\n"
    page.write_text(f"before\n\n{mark}\nafter\n")
    assert tables.main(["--check"], tmp_path) == 1
    assert tables.main([], tmp_path) == 0
    text = page.read_text()
    assert text.startswith("before\n\n<!-- table table4") and text.endswith(
        "<!-- end of table -->\n\nafter\n"
    )
    assert "| stones, 55 mm | 11 (2) |" in text and "with the code `0123456789ab`" in text
    assert tables.main(["--check"], tmp_path) == 0
    assert tables.main(["--stale"], tmp_path) == 1
    assert "page.md: table4 from table4.jsonl.xz --seeds 2 --margin 0.5 is stale" in capsys.readouterr().out
    page.write_text(text.replace("11 (2)", "12 (2)", 1))
    assert tables.main(["--check"], tmp_path) == 1
    page.write_text(mark.replace("table4.jsonl.xz", "nothing.jsonl"))
    with pytest.raises(SystemExit, match="no journal"):
        tables.main([], tmp_path)


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


def test_journals_are_packed_and_partial_tables_and_figures_say_so(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
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
    assert sorted(path.name for path in (tmp_path / "journals").iterdir()) == [
        "authority.jsonl.xz",
        "optimize.jsonl.xz",
    ]
    (tmp_path / "images").mkdir()
    page = tmp_path / "page.md"
    end = "<!-- end of table -->\n"
    page.write_text(
        f"<!-- table authority from authority.jsonl.xz --as choice --arm 5 --arm 80 -->\n{end}\n"
        f"<!-- table stones from optimize.jsonl.xz --as optimum -->\n{end}\n"
        "<!-- figure authority from authority.jsonl.xz --as differences --arm 5 --arm 80 --to images/a.svg -->\n"
        "<!-- figure stones from optimize.jsonl.xz --as optimum --to images/optima.svg -->\n"
    )
    assert tables.main([], tmp_path) == 0
    text = page.read_text()
    assert "| boards, 50 mm (5) |" in text and "over 5: 1 [1, 1]" in text.lower()
    assert "*Partial: 20 of 1,360 walks of `authority`" in text
    assert "*Partial: 14 on `stones` of 400 walks a ground" in text and "| `stones` |" in text
    assert tables.main(["--check"], tmp_path) == 0 and tables.main(["--stale"], tmp_path) == 0
    capsys.readouterr()
    assert tables.main(["--figures"], tmp_path) == 0
    assert (tmp_path / "images" / "a.svg").stat().st_size > 5000
    assert "<!-- stones -->" in (tmp_path / "images" / "optima.svg").read_text()
    assert tables.main(["--held-out", str(source)], tmp_path) == 0
    study = Study.from_json(read_json(source / "optimize_held_out.json"))
    assert [cell.name for cell in study.cells] == ["stones"] and len(study.seeds) == tables.VALIDATIONS
    arms, result = list(study.arms), {"outcome": "fell"}
    walked = [
        Entry(
            trial.spec.to_json(), "done", result | {"J": -float(trial.seed)}, None, None, provenance()
        ).line()
        for trial in study.narrowed(arms=[arms[0], arms[-1]]).trials()
    ]
    (source / "optimize.jsonl").write_bytes(b"".join([*lines, *walked]))
    assert tables.main(["--pack", str(source)], tmp_path) == 0
    page.write_text(
        f"<!-- table authority from authority.jsonl.xz --as short --arm 5 --arm 80 --from 102 -->\n{end}\n"
        f'<!-- table stones from optimize.jsonl.xz --as held-out --from 110 --arm best --arm "{arms[-1]}" -->\n{end}'
    )
    assert tables.main([], tmp_path) == 0
    text = page.read_text()
    assert "*Partial: 12 of 1,360 walks of `authority`" in text and "(3) |" in text
    assert "-114 [" in text and "(10) |" in text and "*20 walks, with the code" in text
    page.write_text(f"<!-- table authority from authority.jsonl.xz --as pie -->\n{end}")
    with pytest.raises(SystemExit, match="no kind of table pie"):
        tables.main([], tmp_path)
