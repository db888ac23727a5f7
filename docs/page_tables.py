"""Write the tables of the pages that are made from the code: `python docs/page_tables.py`.

A table stands between `<!-- settings of a.class as name -->`, `<!-- commands -->`, `<!-- grounds -->` or
`<!-- studies -->` and `<!-- end -->`. A test compares the pages with the code.
"""

from __future__ import annotations

import dataclasses
import functools
import inspect
import json
import operator
import re
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

import wbc.sim.terrain  # noqa: F401 - makes the families known
from wbc.app.cli import make_app
from wbc.app.commands import COMMANDS
from wbc.app.commands.settings import settings_of
from wbc.sim.terrain.families.base import terrain_families

DOCS = Path(__file__).parent

MADE = re.compile(
    r"^<!-- (?P<what>settings of (?P<kind>[\w.]+)(?: as (?P<path>\w+))?|commands|grounds|studies) -->\n"
    r".*?^<!-- end -->$",
    re.MULTILINE | re.DOTALL,
)
"""Marks of a table in a page, with the table between them."""

EVERYWHERE = ("--json", "--verbose", "--help", "-h", "--version")
"""Options of every command, which the page names once."""


def filled(text: str) -> str:
    """Return the text of a page with its tables as the code has them."""
    return MADE.sub(lambda match: f"<!-- {match['what']} -->\n\n{_made(match)}\n\n<!-- end -->", text)


def _made(match: re.Match[str]) -> str:
    if match["kind"] is not None:
        module, _, name = match["kind"].rpartition(".")
        rows = settings_rows(getattr(import_module(module), name), match["path"] or "")
    else:
        rows = {"commands": command_rows, "grounds": ground_rows, "studies": study_rows}[match["what"]]()
    return "\n".join(rows).strip("\n")


def settings_rows(kind: type, path: str) -> Iterator[str]:
    """Tables of a tree of settings, one a class: names as `--set` takes them, defaults, meanings."""
    owner = ""
    for each in settings_of(kind, path):
        if each.owner != owner:
            owner = each.owner
            yield from (
                f"\n### {owner}\n",
                f"`{each.module}`\n",
                "| Setting | Default | Meaning |",
                "|---|---|---|",
            )
        yield f"| `{each.name}` | {each.default} | {escaped(each.about)} |"


def ground_rows() -> Iterator[str]:
    """Families of grounds with their first line."""
    yield from ("| Family | Ground |", "|---|---|")
    for name, kind in terrain_families().items():
        yield f"| `{name}` | {escaped((inspect.getdoc(kind) or '').partition(chr(10))[0])} |"


def study_rows() -> Iterator[str]:
    """Studies of the examples with what each is about."""
    yield from ("| Study | Question |", "|---|---|")
    for file in sorted((DOCS.parent / "examples" / "studies").glob("*.json")):
        yield f"| `{file.stem}` | {escaped(json.loads(file.read_text('utf-8'))['about'])} |"


def command_rows() -> Iterator[str]:
    """Every command with its words and options."""
    wbc = make_app(None)
    for words in COMMANDS:
        app = functools.reduce(operator.getitem, words.split(), wbc)
        options = [each for each in app.assemble_argument_collection() if each.name not in EVERYWHERE]
        yield from (f"\n## `wbc {words}`\n", escaped(app.help), "")
        if options:
            yield from ("| Option | Default | Meaning |", "|---|---|---|")
        for each in options:
            names = ", ".join(f"`{other}`" for other in each.names)
            text, _, default = (each.parameter.help or "").partition(" [default: ")
            default = default.rstrip("]") or _shown(each)
            if choices := each.get_choices():
                text += f" Choices: {', '.join(choices)}."
            yield f"| {names} | {default} | {escaped(text)} |"


def _shown(option: Any) -> str:
    default = option.field_info.default
    if option.required:
        return "must be given"
    if default in (None, dataclasses.MISSING, inspect.Parameter.empty, (), False) or option.hint is bool:
        return ""
    return option.parameter.show_default(default) if callable(option.parameter.show_default) else str(default)


def escaped(text: str) -> str:
    """Return a text that a cell of a table can hold: in one line, with bars and, outside of code, stars escaped."""
    parts = " ".join(text.replace("|", r"\|").split()).split("`")
    return "`".join(part if i % 2 else part.replace("*", r"\*") for i, part in enumerate(parts))


def main() -> None:
    """Fill all pages."""
    for page in sorted(DOCS.glob("*.md")):
        text = page.read_text(encoding="utf-8")
        if (new := filled(text)) != text:
            page.write_text(new, encoding="utf-8")
            print(f"wrote {page.name}")


if __name__ == "__main__":
    main()
