"""Tables of the reference: names of a package, and attributes and methods of a class, as the code has them."""

from __future__ import annotations

import ast
import dataclasses
import enum
import functools
import inspect
import itertools
import re
import typing
from collections.abc import Collection, Iterator
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any

import docstring_parser

SETTINGS_PAGE = (Path(__file__).parent / "settings.md").read_text("utf-8")

WBC_PAGE = (Path(__file__).parent / "api" / "wbc.md").read_text("utf-8")

NAMES = re.compile(r"^<!-- names of ([\w.]+): ([\w, ]+) -->$", re.MULTILINE)
"""Mark of a table of some names of a package."""

MANY_ARGUMENTS = 7
"""Number of arguments of a class above which its row links to their table, where there is one."""

TOLD_ARGUMENTS = 6
"""Number of arguments of a class from which on a table below its members says what each of them means."""

LONG_DEFAULT = 60
"""Length of a default, characters, from which on the name of its class stands for it."""

UNIT = (
    r"(?:decades/s|1/s|m²/s|m/s²|m/s|rad/s²|rad/s|m/N|Nms/rad|Nm/rad|Nm|Ns/kg|N/m|"
    r"Ns/m|kg m²|kg|rad|mm|ms|m²|m|s|N|Hz)"
)

UNIT_TOLD = re.compile(rf", ({UNIT}(?: \(or {UNIT}\))?(?:(?:, | and | or ){UNIT})*)(?=[.,;:]|$)")
"""Unit of a value in its description, as in "Control period, s."."""

UNIT_ALONE = re.compile(rf"(?<![\w/'’]){UNIT}(?![\w/²-])")


def name_rows(package: str, some: str | None, page: str) -> Iterator[str]:
    """Public classes and functions of a package, or some of them: arguments, and first line of the docstring.

    A page whose tables have some of them has all of them.
    """
    yield from ("| Name | Arguments | What it is |", "|---|---|---|")
    module = import_module(package)
    every = [name for name in module.__all__ if callable(getattr(module, name))]
    if some is not None:
        told = [names.split(", ") for room, names in NAMES.findall(page) if room == package]
        left = {*every}.symmetric_difference(itertools.chain(*told))
        assert not left, f"{package}: {', '.join(sorted(left))} in no table, or unknown"
    for name in every if some is None else some.split(", "):
        thing = getattr(module, name)
        about = (inspect.getdoc(thing) or "").partition("\n")[0]
        arguments = _linked(thing, page) or escaped(f"{arguments_of(thing)}{_returned(thing)}")
        units = "" if arguments.startswith("[") else units_of(thing)
        yield f"| `{package}.{name}` | {arguments} | {escaped(about + units)} |"


def _returned(thing: Any) -> str:
    """Return an arrow and the type of what a function returns; empty for a class, and for nothing."""
    if inspect.isclass(thing):
        return ""
    result = short(inspect.signature(thing).return_annotation, thing.__module__)
    if "contextmanager" in inspect.getsource(inspect.unwrap(thing)).partition("def ")[0]:
        return f" → context manager of an `{result.removeprefix('Iterator[').removesuffix(']')}`"
    return "" if result in ("", "None") or result.startswith("Callable[[type[") else f" → `{result}`"


def _linked(thing: Any, page: str) -> str:
    """Return a link to the table of the arguments of a class that has many; empty where no table has them."""
    names = [*inspect.signature(thing).parameters]
    if not inspect.isclass(thing) or len(names) <= MANY_ARGUMENTS:
        return ""
    if f"### {thing.__name__}\n" in SETTINGS_PAGE:
        return f"[settings](../settings.md#{thing.__name__.lower()})"
    heads = re.findall(r"^<!-- members of [\w.]+\.(\w+)(?:: [\w, ]+)? -->$", page, re.MULTILINE)
    if thing.__name__ in heads and [*argument_rows(thing)]:
        return f"[arguments below](#{thing.__name__.lower()})"
    for base in thing.__mro__ if dataclasses.is_dataclass(thing) else (thing,):
        table = re.search(
            rf"^<!-- members of [\w.]+\.{base.__name__}(?:: ([\w, ]+))? -->$", page, re.MULTILINE
        )
        if table is None:
            continue
        own = [*inspect.signature(base).parameters]
        left = [name for name in names if name not in (table[1] or ", ".join(own)).split(", ")]
        if base is thing and not left:
            return f"[fields below](#{base.__name__.lower()})"
        if base is not thing and len(left) <= MANY_ARGUMENTS:
            others = f"and `{arguments_of(thing, only=left)[2:-2]}`"
            return f"[fields of `{base.__name__}`](#{base.__name__.lower()}) {others if left else ''}".strip()
    table = re.search(rf"^<!-- members of wbc\.{thing.__name__}: ([\w, ]+) -->$", WBC_PAGE, re.MULTILINE)
    if table is not None and {*names} <= {*table[1].split(", ")}:
        return f"[fields](wbc.md#{thing.__name__.lower()})"
    return ""


def member_rows(path: str, some: str | None) -> Iterator[str]:
    """Attributes and methods of a class, or some of them: arguments and type, and what each is."""
    module, _, kind_name = path.rpartition(".")
    kind = typing.cast(type, getattr(import_module(module), kind_name))
    told = {
        name: " ".join((each.description or "").split())
        for base in reversed(_bases(kind))
        for each in docstring_parser.parse(base.__dict__.get("__doc__") or "").params
        if each.args[0] == "attribute"
        for name in each.arg_name.split(", ")
    }
    made = {
        name: value
        for base in reversed(kind.__mro__)
        if base.__module__.startswith("wbc")
        for name, value in vars(base).items()
        if (inspect.isroutine(value) or isinstance(value, property | functools.cached_property | classmethod))
        and not name.startswith("_")
        and name not in (*told, "instead_of")
    }
    if dataclasses.is_dataclass(kind):  # in the order in which the constructor takes them
        order = [*inspect.signature(kind).parameters]
        told = dict(
            sorted(told.items(), key=lambda item: order.index(item[0]) if item[0] in order else len(order))
        )
    every = [*told, *sorted(made, key=lambda name: callable(getattr(kind, name)))]
    names = every if some is None else some.split(", ")
    assert not (unknown := {*names}.difference(every)), f"{path} has no {', '.join(sorted(unknown))}"
    yield from (f"### {kind.__name__}\n", f"| `{path}` | What it is |", "|---|---|")
    if issubclass(kind, enum.Enum):
        about = {
            each.arg_name: each.description or "" for each in docstring_parser.parse_from_object(kind).params
        }
        for each in kind:
            words = about.get(each.name) or f"{each.value[:1].upper()}{each.value[1:]}."
            yield f"| `{each.name}` | {escaped(words)} |"
    for name in names:
        member, about = (_attribute(kind, name), told[name]) if name in told else _made_member(kind, name)
        head, *units = about.split("\n")
        text = "".join((first_sentence(head), _when_none(head), *units))
        yield f"| {escaped(f'`{name}{member}`')} | {escaped(text)} |"
    yield from argument_rows(kind)


def argument_rows(kind: type) -> Iterator[str]:
    """Arguments of a class that has many, with their meanings; none for a data class, whose fields they are."""
    if dataclasses.is_dataclass(kind) or not arguments_of(kind):
        return
    given = inspect.signature(kind).parameters
    told = {
        each.arg_name.lstrip("*"): " ".join((each.description or "").split())
        for each in docstring_parser.parse(inspect.getdoc(kind.__init__) or "").params  # type: ignore[misc]
    }
    if len(given) < TOLD_ARGUMENTS or not {*given} <= {*told}:
        return
    yield from (f"\n| Argument of `{kind.__name__}` | Default | Meaning |", "|---|---|---|")
    for name, each in given.items():
        argument, _, default = arguments_of(kind, only=[name])[2:-2].partition("=")
        hint = short(each.annotation, kind.__module__)
        value = f"`{default}`" if default else "" if argument.startswith("*") else "must be given"
        yield f"| {escaped(f'`{argument}: {hint}`')} | {value} | {escaped(told[name])} |"


def _bases(kind: Any) -> tuple[type, ...]:
    """Return a class and those that it is derived from, also for a `TypedDict`, which does not inherit from others."""
    if not typing.is_typeddict(kind):
        return kind.__mro__[:-1]
    (written,) = ast.parse(inspect.getsource(kind)).body
    names = [each.id for each in typing.cast(ast.ClassDef, written).bases if isinstance(each, ast.Name)]
    bases = [vars(import_module(kind.__module__))[name] for name in names if name != "TypedDict"]
    return (kind, *(base for each in bases for base in _bases(each)))


def _attribute(kind: type, name: str) -> str:
    """Return a colon and the type of an attribute: its annotation, or that of the argument it is; empty without."""
    default = _field_default(kind, name)
    for base in _bases(kind):
        hint = base.__dict__.get("__annotations__", {}).get(name)
        if hint is None and "__init__" in vars(base):
            given = inspect.signature(base.__init__).parameters.get(name)
            hint = given.annotation if given is not None and "|" not in str(given.annotation) else None
        if hint not in (None, inspect.Parameter.empty):
            text = short(hint, base.__module__)
            return f": {text}{default.replace('()', '{}') if text == 'Mapping[str, Any]' else default}"
    return ""


def _field_default(kind: Any, name: str) -> str:
    """Return an equals sign and the default of a field of a data class with many; empty for other attributes."""
    if (
        not dataclasses.is_dataclass(kind)
        or len(parameters := inspect.signature(kind).parameters) <= MANY_ARGUMENTS
    ):
        return ""
    if name not in parameters or parameters[name].default is inspect.Parameter.empty:
        return ""
    return f" = {arguments_of(kind, only=[name])[2:-2].partition('=')[2]}"


def _made_member(kind: type, name: str) -> tuple[str, str]:
    """Return type or arguments of a property or a method, and its first paragraph with, in a line, units."""
    owners = [base for base in kind.__mro__ if name in vars(base)]
    docs = [inspect.getdoc(vars(base)[name]) or "" for base in owners]
    about = " ".join(
        next((doc for doc in docs if not doc.startswith("See `")), "").partition("\n\n")[0].split()
    )
    thing = vars(owners[0])[name]
    if isinstance(thing, property | functools.cached_property):
        function = thing.fget if isinstance(thing, property) else thing.func
        return f": {short(inspect.signature(function).return_annotation, owners[0].__module__)}", about
    call = getattr(kind, name)
    result = short(inspect.signature(call).return_annotation, owners[0].__module__)
    arguments = arguments_of(call, bound=not isinstance(thing, classmethod | staticmethod)).strip("`")
    return arguments + (f" → {result}" if result not in ("", "None") else ""), f"{about}\n{units_of(call)}"


def first_sentence(text: str) -> str:
    """Return the first sentence of a description."""
    return re.split(r"(?<=[.!])\s+(?=[A-Z`*])", text, maxsplit=1)[0]


def _when_none(text: str) -> str:
    """Return the sentence of a description, other than the first, that begins with the meaning of None; or nothing."""
    found = re.search(r"[.!] ((?:When |With )?None\b.*)", text)
    return f" {first_sentence(found[1])}" if found else ""


ANNOTATED = re.compile(r"Annotated\[([\w.]+(?:\[[^\[\]]*\])?)((?:, [^\[\]]*)*)\]")


def short(hint: Any, module: str) -> str:
    """Return a type as a reader says it: without its module, and with its unit in brackets behind it."""
    if hint in (inspect.Parameter.empty, None):
        return ""
    known = vars(import_module(module))

    def plain(found: re.Match[str]) -> str:
        named = known.get(found[0])
        if found[0] == "NamedValues":
            return "Mapping[str, Any]"
        if typing.get_origin(named) is not Annotated or "numpy" in str(named):
            return found[0]
        return typing.get_args(named)[0].__name__

    text = getattr(hint, "__forward_arg__", hint)
    text = text if isinstance(text, str) else getattr(text, "__name__", str(text))
    text = ANNOTATED.sub(lambda found: _with_unit(*found.groups()), text)
    text = re.sub(r"ClassVar\[(.*)\]$", r"\1", re.sub(r"\b(?:np|pin|mujoco|wbc[.\w]*)\.", "", text))
    return re.sub(r"\b[A-Z]\w+", plain, text)


def _with_unit(name: str, others: str) -> str:
    unit = re.search(r"""["']([^"']+)["']""", others)
    return f"{name} ({unit[1]})" if unit else name


def units_of(thing: Any) -> str:
    """Return the units of the arguments of a call, as sentences; empty where none has a unit, or has several."""
    bases = getattr(thing, "__mro__", (thing,))
    told: dict[str, str] = {}
    for maker in (*bases, *(vars(base).get("__init__") for base in bases if inspect.isclass(base))):
        for each in docstring_parser.parse(getattr(maker, "__doc__", None) or "").params:
            told.setdefault(each.arg_name, first_sentence(" ".join((each.description or "").split())))
    found: dict[str, list[str]] = {}
    first = first_sentence(inspect.getdoc(thing) or "")
    for name, each in inspect.signature(thing).parameters.items():
        about = told.get(name, "").partition(" with the compliance ")[0]  # whose unit is its own
        told_unit, alone = UNIT_TOLD.search(about), re.split(r"\([^()]* or [^()]*\)", about)
        if told_unit and {*UNIT_ALONE.findall("".join(alone))} <= {*UNIT_ALONE.findall(told_unit[1])}:
            unit = "" if re.search("str|Path|Phase", str(each.annotation)) else told_unit[1]
        else:
            unit = (
                ""
                if UNIT_TOLD.search(first) or name == "seconds"
                else _annotated_unit(thing, each.annotation)
            )
        if unit:
            found.setdefault(unit, []).append(f"`{name}`")
    return "".join(f" {', '.join(names)} in {unit}." for unit, names in found.items())


def _annotated_unit(thing: Any, annotation: Any) -> str:
    """Return the unit that an annotation, or the type that it names, has behind the type of a number; or nothing."""
    hint = vars(import_module(thing.__module__)).get(str(annotation), annotation)
    unit = re.search(rf"Annotated\[.*, ['\"]({UNIT})['\"]\]", str(hint))
    return unit[1] if unit else ""


def arguments_of(thing: Any, *, bound: bool = False, only: Collection[str] | None = None) -> str:
    """Return the arguments of a call with their defaults; empty for what no program calls by its name.

    Args:
        thing: Class or function.
        bound: True for a method of a class, whose first argument is the object.
        only: Names of the arguments to return; all when None.
    """
    if inspect.isclass(thing) and (
        issubclass(thing, BaseException | enum.Enum | dict) or getattr(thing, "_is_protocol", False)
    ):
        return ""
    signature = inspect.signature(thing)
    texts: list[str] = []
    fields = (
        {each.name: each.default_factory for each in dataclasses.fields(thing)}
        if dataclasses.is_dataclass(thing)
        else {}
    )
    for each in [*signature.parameters.values()][bound:]:
        if only is not None and each.name not in only:
            continue
        if (
            only is None
            and each.kind is each.KEYWORD_ONLY
            and not any(text.startswith("*") for text in texts)
        ):
            texts.append("*")
        stars = "*" if each.kind is each.VAR_POSITIONAL else "**" if each.kind is each.VAR_KEYWORD else ""
        factory = fields.get(each.name, dataclasses.MISSING)
        if factory is dataclasses.MISSING:
            default = "" if each.default is each.empty else f"={_default(each.default)}"
        elif inspect.isclass(factory) or factory.__name__ == "<lambda>":
            default = f"={_default(factory())}"
        else:
            default = f"={factory.__name__.lstrip('_')}()"
        texts.append(f"{stars}{each.name}{default}")
    return f"`({', '.join(texts)})`"


def _default(value: Any) -> str:
    """Return a default as a program writes it: a value, or a new object of a class for one that is long."""
    if isinstance(value, str) and not isinstance(value, enum.Enum):
        return f'"{value}"'
    if inspect.isclass(value) or inspect.isroutine(value):
        return value.__name__
    if isinstance(value, enum.Enum):
        return str(value)
    text = repr(value)
    if dataclasses.is_dataclass(value) and all(
        field.default is not dataclasses.MISSING and getattr(value, field.name) == field.default
        for field in dataclasses.fields(value)
    ):
        return f"{type(value).__name__}()"
    return f"{type(value).__name__}()" if text.startswith("<") or len(text) > LONG_DEFAULT else text


def escaped(text: str) -> str:
    """Return a text that a cell of a table can hold: in one line, with bars and, outside of code, stars escaped."""
    parts = " ".join(text.replace("|", r"\|").split()).split("`")
    return "`".join(part if i % 2 else part.replace("*", r"\*") for i, part in enumerate(parts))
