"""Rebuild the tables of the pages from the journals in docs/journals: `python docs/tables.py [--check | --stale]`.

A page marks the place of a table, and this program writes what stands between the two comments:

    <!-- table fig5 from fig5.jsonl.xz --by amplitude --margin 0.5 -->
    <!-- end of table -->

The words are the name of a study, its journal (JSON lines, plain or compressed by xz) and options of `wbc study table`.
Under each table stands the hash of the code that walked it; `--stale` names the tables of another code than today's.
"""

from __future__ import annotations

import re
import shlex
import sys
from collections.abc import Iterator
from pathlib import Path

from wbc.sim.studies.catalog import study_by_name
from wbc.sim.studies.journal import read_journal
from wbc.sim.studies.provenance import code_version
from wbc.sim.studies.study import study_entries
from wbc.sim.studies.study_table import study_table

DOCS = Path(__file__).parent
PLACE = re.compile(r"<!-- table (.+?) -->\n(.*?)<!-- end of table -->\n", re.DOTALL)
CODE = re.compile(r"with the code `(\w+)`")


def made(words: str, journals: Path) -> str:
    """Return the table of a mark, with its caption."""
    name, _, file, *rest = shlex.split(words)
    options = dict(zip(rest[::2], rest[1::2], strict=True))
    unknown = set(options) - {"--metric", "--by", "--margin", "--seeds"}
    if unknown:
        raise SystemExit(f"table {words}: no option {', '.join(unknown)}")
    seeds = options.get("--seeds")
    study = study_by_name(name).narrowed(seeds=None if seeds is None else int(seeds))
    path = journals / file
    if not path.is_file():
        raise SystemExit(f"table {words}: no journal {path}")
    entries = read_journal(path)
    used = [entry for _, entry in study_entries(study, entries, any_code=True) if entry is not None]
    codes = sorted({entry.version["code"] for entry in used})
    if len(codes) != 1:
        raise SystemExit(f"table {words}: its walks must be of one code, got {codes or 'none'}")
    table = study_table(
        study,
        entries,
        metric=options.get("--metric"),
        by=[options["--by"]] if "--by" in options else [],
        margin=float(options["--margin"]) if "--margin" in options else None,
        any_code=True,
    )
    caption = f"*{len(used)} trials of `{name}`, with the code `{codes[0]}`. (`python docs/tables.py`)*"
    return f"\n{table.markdown()}\n\n{caption}\n\n"


def rebuilt(text: str, journals: Path) -> str:
    """Return a page with its tables made again."""
    return PLACE.sub(
        lambda mark: f"<!-- table {mark[1]} -->\n{made(mark[1], journals)}<!-- end of table -->\n", text
    )


def stale(text: str) -> list[str]:
    """Return the tables of a page that another code than today's has walked."""
    marks = ((mark[1], CODE.search(mark[2])) for mark in PLACE.finditer(text))
    return [words for words, code in marks if code is None or code[1] != code_version()]


def pages(folder: Path = DOCS) -> Iterator[Path]:
    """Yield the pages that have tables from journals."""
    yield from (
        page for page in sorted(folder.glob("*.md")) if PLACE.search(page.read_text(encoding="utf-8"))
    )


def main(words: list[str], folder: Path = DOCS) -> int:
    """Rebuild, check or list; return 1 if a page differs from its journals or a table is stale."""
    bad = 0
    for page in pages(folder):
        text = page.read_text(encoding="utf-8")
        if "--stale" in words:
            for table in stale(text):
                print(f"{page.name}: {table} is stale")
                bad = 1
            continue
        new = rebuilt(text, folder / "journals")
        if new != text and "--check" in words:
            print(f"{page.name} differs from its journals: python docs/tables.py")
            bad = 1
        elif new != text:
            page.write_text(new, encoding="utf-8")
            print(f"{page.name} rebuilt")
    return bad


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
