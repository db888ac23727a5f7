"""Builds the documentation with `sphinx-build -W docs build/docs`: Markdown pages, and a reference from docstrings."""

from __future__ import annotations

import functools
import html
import inspect
import re
import sys
import tomllib
from collections.abc import Iterator
from html.parser import HTMLParser
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any, is_typeddict
from urllib.parse import unquote, urlsplit

from docutils import nodes
from docutils.nodes import Element, SkipNode
from docutils.utils.math.latex2mathml import tex2mathml
from numpy.typing import ArrayLike
from sphinx.application import Sphinx
from sphinx.util import logging
from sphinx.util.typing import stringify_annotation

logger = logging.getLogger(__name__)

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "docs")]

from short_types import as_names, shorten  # noqa: E402

import wbc  # noqa: E402 - the path comes first
from wbc import __version__  # noqa: E402
from wbc.base.numbers import Array  # noqa: E402

project, author = "wbc", "The wbc developers"
copyright = f"2026, {author}"
version = release = __version__

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx_copybutton"]
copybutton_exclude = ".linenos, .gp, .go"
exclude_patterns = ["README.md"]
suppress_warnings = ["ref.python"]  # a type that two modules have

myst_enable_extensions = ["dollarmath", "deflist", "attrs_inline"]
myst_heading_anchors = 3

smartquotes_action = "qe"  # "--" of options stays

address = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]["urls"]["Repository"]
html_theme = "furo"
html_logo = html_favicon = "static/logo.svg"
html_theme_options = {"source_edit_link": f"{address}/edit/main/docs/{{filename}}"}
html_math_renderer = "mathml"
html_title = f"wbc {__version__}"
html_copy_source = html_show_sourcelink = False
html_static_path = ["static"]
html_css_files = ["wbc.css"]
pygments_style, pygments_dark_style = "tango", "monokai"

default_role = "py:obj"
toc_object_entries_show_parents = "hide"
autoclass_content = "both"
autodoc_default_options = {"members": True, "member-order": "bysource"}
autodoc_typehints_format = "short"
napoleon_numpy_docstring = False
napoleon_use_ivar = True
napoleon_preprocess_types = False

WBC_PAGE = (ROOT / "docs" / "api" / "wbc.md").read_text("utf-8")
"""Page of the names that programs use most, with tables of members to which other pages link."""

CLONE = re.compile(
    r"^> The tables give [^\n]*\n|^<!-- members of wbc\.(?!core\.qp\.options)[^\n]* -->\n.*?^<!-- end -->$",
    re.MULTILINE | re.DOTALL,
)
"""Lines of a page that only a reader of a clone needs, who has no docstrings: a sentence, and tables of members."""

LISTED = re.compile(r"^<!-- (names|members) of ([\w.]+)(?:: ([\w, ]+))? -->$", re.MULTILINE)
"""Comment in front of a table of the reference: a package with some of its names or all, or a class."""

MEMBERS_OF, INSIDE = (
    re.compile(r"^<!-- members of (\S*\.\w+)", re.MULTILINE),
    re.compile(r"\[([^]]+)\]\((?:wbc\.md)?#(\w+)\)"),
)
"""Class whose members have a table with a heading, and link to a heading of the same page or of that of `wbc`."""

OUTSIDE = re.compile(r"\]\((\.\./[\w/]+\.md)(?:#[\w-]+)?\)")
"""Links to Markdown outside of the documentation."""

COLON = chr(0xE000)
"""Colon of a sentence while Google sections are read."""

SECTION = re.compile(r"(Args|Attributes|Raises|Returns|Yields|Source):.*")


def change_source(app: Sphinx, docname: str, source: list[str]) -> None:
    """Leave out what is for readers in a clone, mark links out of the documentation, and add entries of names."""
    text = OUTSIDE.sub(r"](path:\1)", CLONE.sub("", source[0]))
    paths = {
        path.rpartition(".")[2].lower(): path
        for page in (WBC_PAGE, source[0])
        for path in MEMBERS_OF.findall(page)
    }
    kept = {name.lower() for name in re.findall(r"^### (\w+)$", text, re.MULTILINE)}

    def to_class(found: re.Match[str]) -> str:
        """Link to the entry of a class whose table of members is left out: on the page of its room, if that has it."""
        if found[2] not in paths or ("(wbc.md#" not in found[0] and found[2] in kept):
            return found[0]
        room, _, name = paths[found[2]].rpartition(".")
        thing = getattr(import_module(room), name)
        room = next((each.__name__ for each in rooms() if getattr(each, name, None) is thing), room)
        return f"{{py:obj}}`{found[1].replace('`', '')} <{room}.{name}>`"

    text = INSIDE.sub(to_class, text)
    if entries := list(_entries(source[0], docname)):
        text = text.replace("\n## Members\n", "\n## Reference\n")
        text += "\n".join(("\n```{eval-rst}", *entries, "```\n"))
    source[0] = text


def _entries(text: str, docname: str) -> Iterator[str]:
    """Directives for all names in the tables of a page, in their order; `wbc` leaves classes to their rooms' pages."""
    done: set[str] = set()
    for what, path, some in LISTED.findall(text) if docname.startswith("api/") else ():
        if what == "names":
            public = import_module(path).__all__
            if path not in done:
                done.add(path)
                yield f".. automodule:: {path}\n   :no-members:\n"
            paths = [f"{path}.{name}" for name in (some.split(", ") if some else public)]
        else:
            paths = [path]
        for each in paths:
            room, _, name = each.rpartition(".")
            thing = getattr(import_module(room), name)
            if each in done or is_typeddict(thing) or not callable(thing):
                continue
            done.add(each)
            if inspect.isclass(thing):
                if docname == "api/wbc" and any(
                    thing in map(vars(room).get, room.__all__) for room in rooms()
                ):
                    continue
                kind = "exception" if issubclass(thing, BaseException) else "class"
                yield f".. auto{kind}:: {each}\n   :inherited-members: {', '.join(_documented(thing))}\n"
            else:
                yield f".. autofunction:: {each}\n"


@functools.cache
def rooms() -> tuple[ModuleType, ...]:
    """Return the packages that have a page of the reference, without `wbc` itself."""
    pages = (page.stem for page in (ROOT / "docs" / "api").glob("*.md"))
    return tuple(import_module(f"wbc.{name}") for name in pages if name != "wbc")


def _documented(kind: type) -> Iterator[str]:
    """Names of the bases of a class whose members stand elsewhere: public ones, and those of other libraries."""
    for base in kind.__mro__[1:]:
        if public(base) or not base.__module__.startswith("wbc."):
            yield base.__name__


def public(kind: type) -> bool:
    """Return True for a class of the library that has an entry in the reference."""
    return any(kind is getattr(room, name, None) for room in (wbc, *rooms()) for name in room.__all__)


told: set[str] = set()
"""Names of classes whose bases have been told."""


def mark_blocks(app: Sphinx, what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    """Mark indented blocks as literal, before Google sections are read, and escape what is not reStructuredText."""
    if what in ("property", "attribute") and lines:
        lines[0] = lines[0].replace(
            ": ", COLON
        )  # Google sections would take what is in front of it for a type
    if any(line.startswith("Create new instance of") for line in lines):
        del lines[next(k for k, line in enumerate(lines) if line.startswith("Create new instance of")) :]
    if inspect.isclass(obj) and name not in told and (bases := [*filter(public, obj.__mro__[1:])]):
        told.add(name)  # the docstring of the constructor comes after that of the class
        lines += ["", f"It also has the members of {' and '.join(f'`{base.__name__}`' for base in bases)}."]
    out: list[str] = []
    section = block = False
    for before, line in zip(["", *lines], lines, strict=False):
        if line and not line.startswith(" "):
            section, block = bool(SECTION.fullmatch(line)), False
        elif line.startswith("    ") and not (before.strip() or section or block):
            out += ["::", ""]
            block = True
        literal = line.startswith(" ") and not section
        out.append(line if literal else re.sub(r"(?<![\w*`])\*(?=\w)|\|", r"\\\g<0>", line))
    lines[:] = out


def name_attributes(app: Sphinx, what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    """Write types of attributes by their own names, without their modules, after Google sections are read."""
    for k, line in enumerate(lines):
        lines[k] = line.replace(COLON, ": ")
        if line.startswith(":vartype "):
            short = re.sub(r"\b(?:\w+\.)+(?=[A-Z])", "", _short_arrays(line))
            lines[k] = re.sub(r"ClassVar\[(.*)\]$", r"\1", short)


class _Page(HTMLParser):
    """Links of a built page, and the names of its places."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.links: list[str] = []
        self.places: set[str] = set()
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = dict(attrs)
        self.places.add(given.get("id") or "")
        if link := given.get("href" if tag in ("a", "link") else "src"):
            self.links.append(link)


def check_links(app: Sphinx, failure: Exception | None) -> None:
    """Warn of each link in the built pages to a page, a file or a heading that does not exist.

    MyST checks the links in Markdown. This check also sees those that the theme, tables and docstrings make.
    """
    if failure is not None or app.builder.format != "html":
        return
    out = Path(app.outdir).resolve()
    pages = {path: _Page(path) for path in sorted(out.rglob("*.html"))}
    for path, page in pages.items():
        for link in dict.fromkeys(page.links):
            address = urlsplit(link)
            if address.scheme or address.netloc:
                continue
            target = (path.parent / unquote(address.path)).resolve() if address.path else path
            wrong = not target.exists() or (
                target in pages and unquote(address.fragment) not in ("", *pages[target].places)
            )
            if wrong:
                logger.warning("%s: the link to %s leads nowhere", path.relative_to(out), link, type="wbc")


def name_types(
    app: Sphinx, what: str, name: str, obj: Any, options: Any, signature: str | None, result: str | None
) -> tuple[str | None, str | None]:
    """Write types of arrays by their names in signatures, in place of the many types that they stand for."""
    return tuple(text and MADE.sub(r"\1()", as_names(_short_arrays(text))) for text in (signature, result))


MADE = re.compile(r"\b([A-Z]\w+)\(\w+=(?:[^()]|\([^()]*\))*\)")
"""Object as a default, whose values the entry of its class has."""

INDICES = re.compile(
    r"~?(?:numpy\.)?ndarray\[tuple\[~?(?:typing\.)?Any, \.\.\.\], ~?(?:numpy\.)?dtype\[~?(?:numpy\.)?(\w+)\]\]"
)
"""Array of other numbers than floats."""


def _short_arrays(text: str) -> str:
    for kind, short in ((ArrayLike, "ArrayLike"), (Array, "Array")):
        for mode in ("smart", "fully-qualified-except-typing"):
            text = text.replace(stringify_annotation(kind, mode, short_literals=False), short)
    return INDICES.sub(r"NDArray[\1]", text).replace("<built-in function iter>", "iter")


def skip_fields(app: Sphinx, what: str, name: str, obj: Any, skip: bool, options: Any) -> bool | None:
    """Leave out the fields of named tuples, which the docstring of their class describes."""
    return True if (inspect.getdoc(obj) or "").startswith("Alias for field number") else None


NAME = re.compile(r"(wbc(?:\.\w+)+|[A-Z]\w*[a-z]\w*(?:\.\w+)?)(?:\(.*\))?")
"""Name of the library in the text of a page, or of a class, perhaps with what it is called with."""


def link_names(app: Sphinx, doctree: nodes.document, docname: str) -> None:
    """Link each name of the library in a page to its entry in the reference, where just one entry has this name.

    `wbc.…` without an entry of its own leads to the page of its package. In the reference itself this holds for the
    names in tables alone.
    """
    parts = doctree.findall(nodes.table) if docname.startswith("api/") else [doctree]
    literals = [literal for part in parts for literal in part.findall(nodes.literal)]
    entries: dict[str, set[str]] = {}
    domain: Any = app.env.get_domain("py")
    for entry in domain.objects:
        words = entry.split(".")
        for k in range(len(words)):
            entries.setdefault(".".join(words[k:]), set()).add(entry)
    for literal in literals:
        if isinstance(literal.parent, nodes.reference) or not (found := NAME.fullmatch(literal.astext())):
            continue
        given = found[1]
        whole = given.startswith("wbc.")
        name = given.rpartition(".")[2] if whole and given not in domain.objects else given
        places = [domain.objects[entry] for entry in entries.get(name, ())]
        if whole:  # a name of the library is that of no method; a module leads to the page of its package
            places = [place for place in places if place.objtype not in ("method", "attribute", "property")]
            words = given.split(".")
            packages = [".".join(words[:k]) for k in range(len(words) - 1, 0, -1)]
            places = places or [
                domain.objects[next(package for package in packages if package in domain.objects)]
            ]
        same = {(place.docname, place.node_id) for place in places}
        if len(same) == 1:
            page, place = same.pop()
            address = app.builder.get_relative_uri(docname, page)
            link = nodes.reference("", "", internal=True, refuri=f"{address}#{place}")
            literal.replace_self(link)
            link += literal


def name_columns(
    app: Sphinx, pagename: str, templatename: str, context: dict[str, Any], doctree: Any
) -> None:
    """Give each cell of a table the head of its column, which a phone shows in front of the cell."""
    if "body" in context:
        context["body"] = TABLE.sub(_named, context["body"])


TABLE = re.compile(r"<table.*?</table>", re.DOTALL)
DOTTED = re.compile(r'(<span class="pre">)(wbc(?:\.\w+)+)(?=</span>)')
"""Name in a table, which a line may break behind its dots."""

ROW, CELL = re.compile(r"<tr.*?</tr>", re.DOTALL), re.compile(r"<td\b")


def _named(table: re.Match[str]) -> str:
    heads = [
        html.escape(html.unescape(re.sub(r"<[^>]+>", "", head)).strip())
        for head in re.findall(r"<th\b[^>]*>(.*?)</th>", table[0], re.DOTALL)
    ]

    def row(match: re.Match[str]) -> str:
        columns = iter(heads)
        return CELL.sub(lambda _: f'<td data-head="{next(columns, "")}"', match[0])

    broken = DOTTED.sub(lambda name: f"{name[1]}{name[2].replace('.', '.<wbr>')}", table[0])
    return ROW.sub(row, broken)


ACCENTED = re.compile(
    r"<munderover>\s*(<mi>[^<]*</mi>)\s*(.*?)\s*(<mo[^>]*>[˙¨ˉˆ˜]</mo>)\s*</munderover>", re.DOTALL
)
"""Letter, subscript and accent, which docutils takes for the limits of a sum."""


def mathml(formula: str, *, block: bool = False) -> str:
    """Return a formula in LaTeX as MathML."""
    accented = r"<msub><mover accent='true'>\1\3</mover>\2</msub>"
    return ACCENTED.sub(accented, str(tex2mathml(formula, as_block=block)))


def write_formula(translator: Any, node: Element) -> None:
    """Write a formula as MathML, which browsers show without a script."""
    translator.body.append(mathml(node.astext()))
    raise SkipNode


def write_equation(translator: Any, node: Element) -> None:
    """Write a displayed equation as MathML."""
    translator.body.append(f'<div class="math">{mathml(node.astext(), block=True)}</div>')
    raise SkipNode


def setup(app: Sphinx) -> dict[str, Any]:
    """Connect everything."""
    app.add_html_math_renderer("mathml", (write_formula, None), (write_equation, None))
    app.connect("source-read", change_source)
    app.connect("autodoc-process-docstring", mark_blocks, priority=400)
    app.connect("autodoc-process-docstring", name_attributes, priority=600)
    app.connect("autodoc-process-signature", name_types)
    app.connect("doctree-read", shorten)
    app.connect("doctree-resolved", link_names)
    app.connect("html-page-context", name_columns)
    app.connect("autodoc-skip-member", skip_fields)
    app.connect("build-finished", check_links)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
