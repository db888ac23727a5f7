"""Write docs/measured.md from docs/measured.toml: versions of the walk, and tables with the code of each.

    python docs/measured.py

A table of walks names the version of the walk. It is stale when that is not the last one, unless it is said to hold
on a flat floor, where the versions since do not differ.
"""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

DOCS = Path(__file__).resolve().parent


def page(data: dict[str, Any]) -> str:
    """Return the page."""
    versions, tables = data["version"], data["table"]
    now = versions[-1]["walk"]
    last = versions[-1]
    errors = ", ".join(f"{e:.2f}" for e in last["errors"])
    version = (
        f"Walk {now}, since `{last['commit']}`, {last['date']}: {last['change']}.\n"
        f"Errors of ZMP, CoM and DCM in the reference walk: {errors} mm."
    )
    parts = [data["intro"], "## Versions of the walk", data["versions"], version]
    parts += [data["reference"], "## Results", data["results"]]
    for table in tables:
        parts += section(table, now)
    return "\n\n".join(part.strip("\n") for part in parts) + "\n"


def section(table: dict[str, Any], now: int) -> list[str]:
    """Return the paragraphs of a table; `now` is the version of the walk."""
    parts = [f"### {table['title']}"] if "title" in table else []
    if "about" in table:
        parts.append(table["about"])
    if "rows" in table:
        parts.append(markdown(table["columns"], table["align"], table["rows"]))
    if "commit" in table:
        parts.append(caption(table, now))
    if "notes" in table:
        parts.append(table["notes"])
    return parts


def caption(table: dict[str, Any], now: int) -> str:
    """Return the line that says with which code a table was measured, and whether it is stale."""
    text = f"*Measured at `{table['commit']}`, {table['date']}"
    walk = table.get("walk")
    if walk is None:
        return text + ".*"
    if walk == now:
        return f"{text}, walk {walk}.*"
    if table.get("flat", False):
        return f"{text}, walk {walk}, as {now} on a flat floor.*"
    return f"{text}, walk {walk}; **stale**: the walk is {now} now.*"


def markdown(columns: list[str], align: str, rows: list[list[str]]) -> str:
    """Return a table; `align` has a letter of l and r for each column."""
    rule = "|" + "|".join("---:" if letter == "r" else "---" for letter in align) + "|"
    lines = ["| " + " | ".join(cells) + " |" for cells in (columns, *rows)]
    return "\n".join([lines[0], rule, *lines[1:]])


def read(folder: Path = DOCS) -> dict[str, Any]:
    """Return what is in the file."""
    return tomllib.loads((folder / "measured.toml").read_text(encoding="utf-8"))


if __name__ == "__main__":
    (DOCS / "measured.md").write_text(page(read()), encoding="utf-8")
