"""Builds the documentation with `sphinx-build -W docs build/docs`: Markdown pages, and a reference from docstrings."""

from __future__ import annotations

import dataclasses
import inspect
import re
import sys
from importlib import import_module
from pathlib import Path
from typing import Any

import docstring_parser
from sphinx.application import Sphinx

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from wbc import __version__  # noqa: E402 - the path comes first

project, author = "wbc", "The wbc developers"
copyright = f"2026, {author}"
version = release = __version__

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx.ext.mathjax"]
exclude_patterns = ["README.md"]
suppress_warnings = ["ref.python"]  # a type that two modules have

myst_enable_extensions = ["dollarmath", "deflist", "attrs_inline"]
myst_heading_anchors = 3

html_theme = "furo"
html_title = f"wbc {__version__}"
html_copy_source = html_show_sourcelink = False
html_static_path = ["static"]
html_css_files = ["wbc.css"]
pygments_style, pygments_dark_style = "tango", "monokai"

default_role = "py:obj"
toc_object_entries_show_parents = "hide"
autoclass_content = "both"
autodoc_default_options = {"members": True, "imported-members": True, "member-order": "bysource"}
autodoc_typehints_format = "short"
napoleon_numpy_docstring = False
napoleon_use_ivar = True
napoleon_preprocess_types = False

TABLES = re.compile(r"^<!-- (settings of ([\w.]+)|commands|studies) -->$", re.MULTILINE)
"""Comments in whose place a table is put: of a settings class, of all commands, of all studies."""

PAPER = re.compile(r"\]\((\.\./examples/paper/README\.md)(?:#[\w-]+)?\)")


def fill_tables(app: Sphinx, docname: str, source: list[str]) -> None:
    """Put tables in the place of comments, made from the code, so that nothing is written twice."""
    text = TABLES.sub(lambda match: _table(match[1], match[2]), source[0])
    source[0] = PAPER.sub(r"](path:\1)", text)  # which is no page of these


def _table(what: str, settings: str | None) -> str:
    if settings is not None:
        return _settings_table(settings)
    if what == "studies":
        from wbc.app.commands.study.show import study_facts  # noqa: PLC0415 - few pages need it
        from wbc.sim.studies.catalog import STUDIES  # noqa: PLC0415

        facts = [(each["name"], each["trials"] or "", each["about"]) for each in map(study_facts, STUDIES)]
        rows = [f"| `{name}` | {trials} | {about} |" for name, trials, about in facts]
        return "\n".join(["| Study | Walks | Question |", "|---|---:|---|", *rows])
    from wbc.app.cli import make_app  # noqa: PLC0415

    text = make_app(None).generate_docs(heading_level=2, flatten_commands=True)
    found = re.search(r"^## wbc \w+$", text, re.MULTILINE)  # before it: a list that the margin has, too
    assert found is not None
    return str(text[found.start() :])


def _settings_table(name: str) -> str:
    module, _, kind = name.rpartition(".")
    settings = getattr(import_module(module), kind)
    about = {
        each.arg_name: each.description for each in docstring_parser.parse(inspect.getdoc(settings)).params
    }
    lines = [f"| `{kind}` | Default | |", "|---|---|---|"]
    for field in dataclasses.fields(settings):
        if field.name in about:  # others are inherited, and described there
            text = " ".join((about[field.name] or "").split()).replace("|", "\\|").replace("*", "\\*")
            made = field.default_factory is not dataclasses.MISSING
            default = type(field.default_factory()).__name__ if made else _shown(field.default)
            lines.append(f"| `{field.name}` | {default} | {text} |")
    return "\n".join(lines)


def _shown(default: Any) -> str:
    if isinstance(default, tuple):
        return ", ".join(map(_shown, default))
    if isinstance(default, float):
        return f"{default:g}"
    return "–" if default is None else str(default)


def mark_blocks(app: Sphinx, what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    """Mark indented blocks as literal, before Google sections are read, and escape what is not reStructuredText."""
    out: list[str] = []
    section = False
    for i, line in enumerate(lines):
        fresh = i == 0 or not lines[i - 1].strip()
        if line and not line.startswith(" "):
            section = bool(re.fullmatch(r"(Args|Attributes|Raises|Returns|Yields|Source):.*", line))
        if line.startswith("    ") and fresh and not section and not (out and _in_block(out)):
            out += ["::", ""]
        literal = line.startswith(" ") and not section
        out.append(line if literal else re.sub(r"(?<![\w*`])\*(?=\w)|\|", r"\\\g<0>", line))
    lines[:] = out


def _in_block(lines: list[str]) -> bool:
    """Return True if the last line that is not blank belongs to an indented block."""
    return next((line.startswith("    ") for line in reversed(lines) if line.strip()), False)


def escape_types(app: Sphinx, what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    """Keep types such as `np.str_`, which Google sections have been given, from being references."""
    lines[:] = [re.sub(r"_(?=\W|$)", r"\\_", line) if line.startswith(":vartype") else line for line in lines]


def skip_described(app: Sphinx, what: str, name: str, obj: Any, skip: bool, options: Any) -> bool | None:
    """Leave to the pages of the rooms what `wbc` hands on from them."""
    here = app.env.docname == "api/wbc" and what == "module"
    return True if here and not getattr(obj, "__module__", "").startswith("wbc.core") else None


def setup(app: Sphinx) -> dict[str, Any]:
    """Connect everything."""
    app.connect("source-read", fill_tables)
    app.connect("autodoc-process-docstring", mark_blocks, priority=400)
    app.connect("autodoc-process-docstring", escape_types, priority=600)
    app.connect("autodoc-skip-member", skip_described)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
