"""Commands: those that the pages name are understood by the command line, and each answers `--help`."""

from __future__ import annotations

import functools
import re
import shlex
from collections.abc import Iterator
from pathlib import Path

import pytest
from cyclopts import App

from wbc.app.cli import make_app
from wbc.app.commands import GROUPS

ROOT = Path(__file__).resolve().parents[2]
PAGES = [
    ROOT / "README.md",
    ROOT / "CONTRIBUTING.md",
    *sorted((ROOT / "docs").glob("*.md")),
    ROOT / "examples" / "README.md",
]

FENCE = re.compile(r"^```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
INLINE = re.compile(r"`(wbc [a-z][^`]*)`")


def lines_of(page: Path) -> list[list[str]]:
    """Words of every `wbc` command in the shell blocks of a page, without `wbc`."""
    blocks = [text for kind, text in FENCE.findall(page.read_text(encoding="utf-8")) if kind == "bash"]
    found = []
    for line in "".join(blocks).replace("\\\n", " ").splitlines():
        for command in line.split("&&"):
            words = shlex.split(re.split(r" [|>] ", command)[0], comments=True)
            while words and re.match(r"[A-Z_]+=", words[0]):
                del words[0]
            if words and Path(words[0]).name == "wbc":
                found.append(words[1:])
    return found


made_app = functools.cache(make_app)


def app_of(words: list[str]) -> App:
    """Return the application with the command that the words begin with."""
    return made_app(tuple(words[: 2 if words[0] in GROUPS else 1]))


def understood(words: list[str]) -> bool:
    command, bound, _ = app_of(words).parse_args(words, exit_on_error=False, print_error=False)
    return callable(command) and bound is not None


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_commands_of_a_page_are_understood(page: Path) -> None:
    for words in lines_of(page):
        assert understood(words), f"{page.name}: wbc {shlex.join(words)}"


def named_in_text(page: Path) -> Iterator[str]:
    yield from INLINE.findall(FENCE.sub("", page.read_text(encoding="utf-8")))


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_commands_in_the_text_exist_with_their_options(page: Path) -> None:
    """In the text, values may be placeholders such as J."""
    for line in named_in_text(page):
        words = line.split()[1:]
        app = app_of(words)
        assert words[0] in app, f"{page.name}: `{line}`"
        app = app[words[0]]
        if words[0] in GROUPS and len(words) > 1 and not words[1].startswith("-"):
            assert words[1] in app, f"{page.name}: `{line}`"
            app = app[words[1]]
        options = {word for word in words if word.startswith("--")} - {"--help"}
        if options:
            known = {name for argument in app.assemble_argument_collection() for name in argument.names}
            assert options <= known, f"{page.name}: `{line}`"
