"""Tables of the pages are those of their journals."""

from __future__ import annotations

import lzma
import sys
from pathlib import Path

import pytest

from wbc.sim.studies.catalog import study_by_name
from wbc.sim.studies.journal import Entry
from wbc.sim.studies.provenance import provenance

DOCS = Path(__file__).resolve().parents[2] / "docs"
sys.path.insert(0, str(DOCS))

import tables  # noqa: E402 - of docs


def test_every_table_from_a_journal_is_what_the_journal_gives() -> None:
    assert tables.main(["--check"]) == 0


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
    assert "| stones, 55 mm | 11 [11, 11] (2) |" in text and "with the code `0123456789ab`" in text
    assert tables.main(["--check"], tmp_path) == 0
    assert tables.main(["--stale"], tmp_path) == 1
    assert "page.md: table4 from table4.jsonl.xz --seeds 2 --margin 0.5 is stale" in capsys.readouterr().out
    page.write_text(text.replace("11 [11, 11] (2)", "12 [11, 11] (2)", 1))
    assert tables.main(["--check"], tmp_path) == 1
    page.write_text(mark.replace("table4.jsonl.xz", "nothing.jsonl"))
    with pytest.raises(SystemExit, match="no journal"):
        tables.main([], tmp_path)
