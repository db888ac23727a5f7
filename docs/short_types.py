"""Types of the reference as a reader says them: `float (rad, > 0)` for `Annotated[float, FieldInfo(…), 'rad']`."""

from __future__ import annotations

import re
import sys
from collections.abc import Mapping
from functools import cache
from typing import Annotated, get_origin

from docutils import nodes
from sphinx import addnodes
from sphinx.application import Sphinx
from sphinx.util.typing import stringify_annotation

OPENING = re.compile(r"~?(?:typing\.)?Annotated\[")

VALIDATOR = re.compile(r", ~?[\w.]*AfterValidator\(func=[^()]*\)")
"""Metadata that no reader needs, and of which some cannot be parsed."""

RULES = {
    "gt": "> {}",
    "above": "> {}",
    "ge": "≥ {}",
    "low": "≥ {}",
    "lt": "< {}",
    "le": "≤ {}",
    "high": "≤ {}",
}
"""Name of a bound → how it is said."""

BOUND = re.compile(rf"\b({'|'.join(RULES)})=([^,)\]]+)")

ALIAS = re.compile(r"(?<=[:|\[,>] )[A-Z]\w+(?=[ ,)\]|]|$)|(?<=\[)[A-Z]\w+(?=[,\]])")
"""Name of a type without arguments in a signature."""

SHORT = re.compile(r"(.*?) \((.*)\)")


ARRAY = re.compile(r"ndarray\[tuple\[Any, \.\.\.\], dtype\[(\w+)\]\]")
"""Array, as an annotation spells it out, with the type of its numbers."""

LETTERS = {sign: chr(0xA4D0 + number) for number, sign in enumerate(" (),>≥<≤./-+·*²³[]|'=~")}
"""Sign of a short type → a letter of another script, so that a type is one name for the parser of signatures."""

SIGNS = str.maketrans({letter: sign for sign, letter in LETTERS.items()})


def short_types(text: str, names: Mapping[str, str] | None = None) -> str:
    """Return a text with all annotated types in it made short, from the inside out.

    `names` has the short forms of types by their names, those of the library when None.
    """
    names = named() if names is None else names
    return _replaced(text, names, {})


def _replaced(text: str, names: Mapping[str, str], letters: Mapping[str, str]) -> str:
    """Return a text with short types, whose signs are written as letters."""
    text, table = VALIDATOR.sub("", text), str.maketrans(dict(letters))
    while found := list(OPENING.finditer(text)):
        start, inside = found[-1].start(), found[-1].end()
        end = _closing(text, inside)
        short = _short(_parts(text[inside:end].translate(SIGNS)), names)
        text = text[:start] + short.translate(table) + text[end + 1 :]
    return text


def _closing(text: str, start: int) -> int:
    """Return the place of the bracket that closes one before a place."""
    depth = 1
    for place in range(start, len(text)):
        depth += (text[place] in "[(") - (text[place] in "])")
        if depth == 0:
            return place
    raise ValueError(f"no bracket closes {text[start:]}")


def _parts(text: str) -> list[str]:
    """Return what commas outside of all brackets and quotes separate."""
    parts, depth, quoted = [""], 0, False
    for letter in text:
        quoted ^= letter == "'"
        depth += (letter in "[(") - (letter in "])")
        if letter == "," and depth == 0 and not quoted:
            parts.append("")
        else:
            parts[-1] += letter
    return [part.strip() for part in parts]


def _short(parts: list[str], names: Mapping[str, str]) -> str:
    kind = names.get(parts[0], parts[0])
    units, rules = [part[1:-1] for part in parts[1:] if part.startswith("'")], []
    if (inner := SHORT.fullmatch(kind)) is not None:
        kind, rules = inner[1], inner[2].split(", ")
    for part in parts[1:]:
        for name, value in BOUND.findall(part) if not part.startswith("'") else ():
            if "inf" not in value:
                rules.append(RULES[name].format(_number(value)))
        if shape := re.search(r"\bshape=(\d+|\([\d, ]+\))", part):
            rules.append(f"shape {shape[1]}")
    told = [*filter(None, units), *dict.fromkeys(rules)]
    return f"{kind} ({', '.join(told)})" if told else kind


def _number(text: str) -> str:
    try:
        return f"{float(text):.4g}"
    except ValueError:  # a name
        return text


@cache
def named() -> dict[str, str]:
    """Return the library's annotated types by name, such as Positive; those that mean two things are left out."""
    found: dict[str, set[str]] = {}
    for module in [module for name, module in sorted(sys.modules.items()) if name.startswith("wbc.")]:
        for name, value in vars(module).items():
            if get_origin(value) is Annotated:
                found.setdefault(name, set()).add(stringify_annotation(value, "smart"))
    return {name: short_types(texts.pop(), {}) for name, texts in found.items() if len(texts) == 1}


def as_names(signature: str) -> str:
    """Return a signature with each annotated type short, and as one name; `shorten` writes it out again."""
    text, table = _replaced(signature.replace("<factory>", "..."), named(), LETTERS), str.maketrans(LETTERS)
    return ALIAS.sub(lambda found: named().get(found[0], found[0]).translate(table), text)


def shorten(app: Sphinx, doctree: nodes.document) -> None:
    """Write out the types in all signatures of a page, and make those of attributes short."""
    del app
    for signature in doctree.findall(addnodes.desc_signature):
        for text in list(signature.findall(nodes.Text)):
            if text.translate(SIGNS) != text:
                text.parent.replace(text, nodes.Text(text.translate(SIGNS)))
    for node in list(doctree.findall(addnodes.desc_annotation)):
        text = node.astext()
        short = ARRAY.sub(
            lambda found: "Array" if found[1] == "float64" else f"NDArray[{found[1]}]", short_types(text)
        )
        if short != text:
            node.clear()
            node.append(nodes.Text(short))
