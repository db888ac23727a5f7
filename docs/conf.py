"""Builds the documentation with `sphinx-build -W docs build/docs`: Markdown pages and an API reference from docstrings.

Nothing in the built pages comes from another host: equations are MathML, which browsers draw themselves.
"""

from __future__ import annotations

import dataclasses
import inspect
import pkgutil
import re
import sys
from importlib import import_module
from pathlib import Path
from typing import Any

from docutils import nodes
from docutils.utils.math import MathError
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.application import Sphinx
from sphinx.domains.python import PyObject
from sphinx.util import logging
from sphinx.util.inspect import TypeAliasForwardRef

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from wbc import __version__  # noqa: E402 - the path comes first

logger = logging.getLogger(__name__)

project = "wbc"
author = "The wbc developers"
copyright = f"2026, {author}"
version = release = __version__

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
exclude_patterns = ["README.md", "journals"]
suppress_warnings = ["ref.python"]  # a type that two modules have, such as SoleContact

myst_enable_extensions = ["dollarmath", "deflist", "attrs_inline"]
myst_heading_anchors = 3

html_theme = "furo"
html_title = f"wbc {__version__}"
html_copy_source = html_show_sourcelink = False
html_static_path = ["static"]
html_css_files = ["wbc.css"]
html_math_renderer = "mathml"
pygments_style, pygments_dark_style = "tango", "monokai"

default_role = "py:obj"
toc_object_entries_show_parents = "hide"
autoclass_content = "both"
autodoc_member_order = "bysource"
autodoc_typehints_format = "short"
autodoc_preserve_defaults = False  # options of `spelled_out` have no defaults in the source
autodoc_type_aliases = {
    name: name for name in ("Array", "ArrayLike", "Index", "Rectangle", "SoleSizes", "Changes")
}
napoleon_numpy_docstring = False
napoleon_use_ivar = True
napoleon_preprocess_types = False


# API pages: one for each package and room, written before the pages are read, so that none can go stale

PACKAGES = {
    "core": "Core",
    "robots": "Robots",
    "feet": "Feet",
    "tasks": "Tasks",
    "walking": "Walking",
    "motion": "Motions",
    "machine": "Machines",
    "sim": "Simulation",
    "app": "Application",
}
ACRONYMS = {"qp": "QP"}
LEFT_OUT = ("wbc.app.commands",)
"""Rooms whose modules have a page of their own: that of the commands."""

API = Path(__file__).parent / "api"


def write_api_pages(app: Sphinx) -> None:
    """Write `api/*.md`: the names that a package exports, and the docstrings of all modules of a room."""
    pages = {"wbc": _api_page("wbc", "First names", [])}
    for package, title in PACKAGES.items():
        top = import_module(f"wbc.{package}")
        rooms = [module.name for module in pkgutil.iter_modules(top.__path__) if module.ispkg]
        rooms = [room for room in rooms if f"wbc.{package}.{room}" not in LEFT_OUT]
        pages[package] = _api_page(f"wbc.{package}", title, rooms)
        for room in rooms:
            inner = import_module(f"wbc.{package}.{room}")
            deeper = [module.name for module in pkgutil.iter_modules(inner.__path__) if module.ispkg]
            heading = ACRONYMS.get(room, room.replace("_", " ").capitalize())
            pages[f"{package}.{room}"] = _api_page(f"wbc.{package}.{room}", heading, deeper)
            for name in deeper:
                pages[f"{package}.{room}.{name}"] = _api_page(
                    f"wbc.{package}.{room}.{name}", name.replace("_", " ").capitalize(), []
                )
    API.mkdir(exist_ok=True)
    for stale in API.glob("*.md"):
        if stale.stem not in pages:
            stale.unlink()
    for name, text in pages.items():
        page = API / f"{name}.md"
        if not page.exists() or page.read_text(encoding="utf-8") != text:
            page.write_text(text, encoding="utf-8")


def _api_page(package: str, title: str, rooms: list[str]) -> str:
    """Return the page of a package: its docstring, its exported names, its rooms and its modules."""
    module = import_module(package)
    lines = [f"# {title} ({package})", "", "```{eval-rst}", f".. automodule:: {package}", "```", ""]
    exported = [name for name in getattr(module, "__all__", ()) if not name.startswith("__")]
    if exported:
        lines += [
            "## Exported names",
            "",
            "```{eval-rst}",
            *(_export(module, name) for name in exported),
            "```",
            "",
        ]
    if rooms:
        inside = package.partition(".")[2]
        lines += ["```{toctree}", ":hidden:", "", *(f"{inside}.{room}" for room in rooms), "```", ""]
    if package == "wbc":
        return "\n".join(lines)
    for part in pkgutil.iter_modules(module.__path__):
        name = f"{package}.{part.name}"
        if part.ispkg or part.name.startswith("_"):
            continue
        lines += [f"## {name}", "", "```{eval-rst}", f".. automodule:: {name}"]
        lines += ["   :members:", "   :ignore-module-all:", "```", ""]
    return "\n".join(lines)


def _export(module: Any, name: str) -> str:
    """Return a line about a name that a package exports, with a link to where it is defined."""
    thing = getattr(module, name)
    home, qualified = getattr(thing, "__module__", None), getattr(thing, "__qualname__", None)
    if not (isinstance(home, str) and home.startswith("wbc.") and qualified):
        return f"* ``{name}``"
    about = (inspect.getdoc(thing) or "").partition("\n\n")[0].replace("\n", " ")
    return f"* :py:obj:`{name} <{home}.{qualified}>`: {_escaped(about)}"


# Settings: tables made from the classes themselves, so that defaults are written once

SETTINGS = re.compile(r"^<!-- settings of ([\w.]+) -->$", re.MULTILINE)
ITEM = re.compile(r"^ {4}(\w+): (.*)$")


def list_settings(app: Sphinx, docname: str, source: list[str]) -> None:
    """Put a table of its fields in the place of `<!-- settings of a dataclass -->`."""
    source[0] = SETTINGS.sub(lambda match: "\n".join(_settings_table(match[1])), source[0])


def _settings_table(name: str) -> list[str]:
    module, _, kind = name.rpartition(".")
    settings = getattr(import_module(module), kind)
    about = _attributes(settings)
    lines = [f"| `{kind}` | Default | |", "|---|---|---|"]
    for field in dataclasses.fields(settings):
        if field.name not in about:
            continue  # inherited, and described there
        made = field.default_factory is not dataclasses.MISSING
        default = type(field.default_factory()).__name__ if made else _shown(field.default)
        lines.append(f"| `{field.name}` | {default} | {about[field.name]} |")
    return lines


def _shown(default: Any) -> str:
    if isinstance(default, tuple):
        return ", ".join(map(_shown, default))
    if isinstance(default, float):
        return f"{default:g}"
    return "–" if default is None else str(default)


def _attributes(kind: type) -> dict[str, str]:
    """Return attribute → its text in a docstring, on one line and fit for a cell of a table."""
    found: dict[str, str] = {}
    name = None
    _, _, text = (inspect.getdoc(kind) or "").partition("Attributes:\n")
    for line in text.splitlines():
        item = ITEM.match(line)
        if item:
            name = item[1]
            found[name] = item[2]
        elif name is not None and line.startswith("        "):
            found[name] += f" {line.strip()}"
        else:
            name = None
    return {key: value.replace("|", "\\|").replace("*", "\\*") for key, value in found.items()}


# What the commands say of themselves, and which studies there are

COMMANDS, STUDIES = "<!-- commands -->", "<!-- studies -->"


def list_commands(app: Sphinx, docname: str, source: list[str]) -> None:
    """Put the help of all commands, or a table of the studies, in the place of these comments."""
    if COMMANDS in source[0]:
        from wbc.app.cli import make_app  # noqa: PLC0415 - few pages need them

        text = make_app(None).generate_docs(heading_level=2, flatten_commands=True)
        found = re.search(r"^## wbc \w+$", text, re.MULTILINE)  # before it: a list that the margin has, too
        assert found is not None
        source[0] = source[0].replace(COMMANDS, text[found.start() :])
    if STUDIES in source[0]:
        from wbc.app.commands.study.show import study_facts  # noqa: PLC0415
        from wbc.sim.studies.catalog import STUDIES as NAMES  # noqa: PLC0415

        lines = ["| Study | Walks | Question |", "|---|---:|---|"]
        for fact in map(study_facts, NAMES):
            walks = "" if fact["trials"] is None else f"{fact['trials']:,}"
            lines.append(f"| `{fact['name']}` | {walks} | {fact['about']} |")
        source[0] = source[0].replace(STUDIES, "\n".join(lines))


# Docstrings are plain text with Google sections: indented blocks are equations or programs, backticks are code

SECTION = re.compile(r"(Args|Attributes|Example|Raises|Returns|Yields):\s*$")
RETURNS = re.compile(r"Returns:\s*$")
CODE = re.compile(r"(``?)([^`]+)\1")
NAME = re.compile(r"[A-Za-z_][\w.]*(\(\))?$")
CLASS = re.compile(r"[A-Z]+[a-z]")
TABLE = re.compile(r"=+( +=+)+$")
COLUMNS = re.compile(r"\S {3,}\S")
INDENT = "    "


def docstring_to_rest(app: Sphinx, what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    """Turn a docstring into reStructuredText, before its Google sections are read."""
    out: list[str] = []
    section = False
    for paragraph in _paragraphs(lines):
        first = paragraph[0]
        if not first.startswith(" "):
            section = bool(SECTION.match(first))
        if RETURNS.match(first):  # what stands before a colon would be taken for a type
            out += [":returns:", *(_escaped(line) for line in paragraph[1:])]
        elif section or TABLE.match(first):
            out += [line if SECTION.match(line) else _escaped(line) for line in paragraph]
        elif first.startswith(">>>"):
            out += paragraph
        elif _is_drawn(paragraph):
            text = next((line for line in reversed(out) if line), "")
            out += [] if text.endswith("::") else ["::", ""]
            out += [INDENT + line for line in paragraph]
        else:
            out += [_escaped(line) for line in paragraph]
        out.append("")
    if what == "class" and lines and (obj.__doc__ or "").lstrip().startswith(lines[0]):
        out = [*_bases(obj), *out]
    if what in ("data", "attribute", "property"):
        out = ["..", "", *out]  # else what stands before a colon in the first line is taken for its type
    lines[:] = out


def _paragraphs(lines: list[str]) -> list[list[str]]:
    """Lines between blank ones; indented blocks that only blank lines part stay together."""
    paragraphs: list[list[str]] = []
    fresh = True
    for line in lines:
        if not line.strip():
            fresh = True
        elif fresh and not (paragraphs and line.startswith(" ") and paragraphs[-1][0].startswith(" ")):
            paragraphs.append([line])
            fresh = False
        else:
            paragraphs[-1] += ["", line] if fresh else [line]
            fresh = False
    return paragraphs


def _is_drawn(paragraph: list[str]) -> bool:
    """Return True if spaces matter: an indented block, or columns of text."""
    return any(line.startswith(" ") or COLUMNS.search(line) for line in paragraph)


def _escaped(line: str) -> str:
    """A line whose code is code, and whose other characters mean nothing to reStructuredText."""
    parts, at = [], 0
    for match in CODE.finditer(line):
        quotes, code = match.groups()
        parts.append(_plain(line[at : match.start()]))
        if not NAME.match(code) or quotes != "`":
            parts.append(f"``{code}``")
        else:  # classes are found wherever they are, other names in their own module
            parts.append(f":py:obj:`{'.' if CLASS.match(code) else ''}{code}`")
        at = match.end()
    return "".join([*parts, _plain(line[at:])])


def _plain(text: str) -> str:
    text = re.sub(r"(?<!\*)\*(?!\*)", r"\\*", text).replace("|", r"\|").replace("`", r"\`")
    return re.sub(r"_(?=\W|$)", r"\\_", text)


def _bases(kind: type) -> list[str]:
    """A line with the classes of this library that a class derives from."""
    known = [
        base
        for base in getattr(kind, "__bases__", ())
        if base.__module__.startswith("wbc.") and base.__name__[0] != "_"
    ]
    if not known:
        return []
    return [
        "Derives from "
        + ", ".join(f":py:obj:`{b.__name__} <{b.__module__}.{b.__name__}>`" for b in known)
        + ".",
        "",
    ]


def escape_types(app: Sphinx, what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    """Keep types such as `np.str_`, which Google sections have been given, from being references."""
    lines[:] = [_plain(line) if line.startswith(":vartype") else line for line in lines]


def skip_strangers(app: Sphinx, what: str, name: str, obj: Any, skip: bool, options: Any) -> bool | None:
    """Leave out what a module has only imported."""
    module = getattr(obj, "__module__", None)
    return True if isinstance(module, str) and not module.startswith("wbc") and callable(obj) else None


# Equations as MathML


def visit_math(self: Any, node: nodes.math) -> None:
    """Write an equation in a line."""
    self.body.append(_mathml(node, block=False))
    raise nodes.SkipNode


def visit_math_block(self: Any, node: nodes.math_block) -> None:
    """Write an equation of its own."""
    self.body.append(f'<div class="equation">{_mathml(node, block=True)}</div>')
    raise nodes.SkipNode


def _mathml(node: nodes.Element, *, block: bool) -> str:
    try:
        # As accents, browsers without a font for equations put dots into the letter instead of over it.
        return str(tex2mathml(node.astext(), as_block=block)).replace(' accent="true"', "")
    except MathError as error:
        logger.warning("equation cannot be read: %s", error, location=node)
        return ""


# Nothing from other hosts

RESOURCE = re.compile(
    r"<(?:script|img|iframe|source)[^>]*\ssrc=\"(?:https?:)?//[^\"]*\"|<link[^>]*\shref=\"(?:https?:)?//[^\"]*\""
)


def check_hosts(app: Sphinx, exception: Exception | None) -> None:
    """Warn of pages that load something from another host."""
    if exception is None:
        for page in Path(app.outdir).rglob("*.html"):
            for found in RESOURCE.findall(page.read_text(encoding="utf-8")):
                logger.warning("%s loads something from another host: %s", page.name, found)


def setup(app: Sphinx) -> dict[str, Any]:
    """Connect everything."""
    TypeAliasForwardRef.__repr__ = lambda alias: alias.name  # within unions and containers, too
    app.add_html_math_renderer("mathml", (visit_math, None), (visit_math_block, None))
    app.connect("builder-inited", write_api_pages)
    app.connect("source-read", list_settings)
    app.connect("source-read", list_commands)
    app.connect("autodoc-process-docstring", docstring_to_rest, priority=400)
    app.connect("autodoc-process-docstring", escape_types, priority=600)
    app.connect("autodoc-skip-member", skip_strangers)
    app.connect("build-finished", check_hosts)
    for field in PyObject.doc_field_types:
        if field.name == "variable":
            field.label = "Attributes"
    return {"parallel_read_safe": True, "parallel_write_safe": True}
