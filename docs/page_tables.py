"""Write the tables of the pages that are made from the code: `python docs/page_tables.py`.

A table stands between one of the comments of `MADE`, such as `<!-- settings of a.class as name -->` or
`<!-- commands -->`, and `<!-- end -->`. A test compares the pages with the code.
"""

from __future__ import annotations

import argparse
import dataclasses
import enum
import functools
import inspect
import itertools
import json
import operator
import re
import typing
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace
from typing import Annotated, Any, Literal

import docstring_parser
import numpy as np
import pinocchio as pin
from pydantic.fields import FieldInfo

import wbc.sim.terrain  # noqa: F401 - makes the families known
from wbc import load_robot
from wbc.app.arguments import attribute_docs
from wbc.app.cli import make_app
from wbc.app.commands import COMMANDS, summary
from wbc.app.commands.settings import SettingRow, settings_of
from wbc.core.estimation.inertial import InertialSettings
from wbc.policy import terms
from wbc.policy.description import NAMES
from wbc.policy.references import ClipFrame
from wbc.sim.terrain.families.base import terrain_families
from wbc.sim.walks.settings import WalkTrialSettings
from wbc.walking.plans.gait import BY_SPEED, SPEEDS, Gait
from wbc.walking.stepping.settings import RobotSize, SteppingSettings, in_si
from wbc.walking.steps import ON_POINTS

DOCS = Path(__file__).parent

STUDIES = DOCS.parent / "examples" / "studies"

PAGES = (*sorted(DOCS.rglob("*.md")), STUDIES / "README.md")
"""Pages that may have tables."""

SETTINGS_PAGE = (DOCS / "settings.md").read_text("utf-8")

MADE = re.compile(
    r"^<!-- (?P<what>(?:settings|fields|names|members) of (?P<kind>[\w.]+)(?: as (?P<path>\w+))?"
    r"(?:: (?P<some>[\w, ]+))?|answers of (?P<page>\w+)|index of settings|gait by speed|terms of policies|commands"
    r"|grounds|studies) -->\n"
    r".*?^<!-- end -->$",
    re.MULTILINE | re.DOTALL,
)
"""Marks of a table in a page, with the table between them."""

UNITS = {"1/ω": "s", "ω": "rad/s", "h": "m", "leg": "m", "hω": "m/s", "g": "m/s²"}
"""Units of a robot in settings of free steps → units of their values in SI."""

CALLS = {
    "FailurePolicy": "wbc.TorqueControl(controller, failure_policy=FailurePolicy(stop_after=0.2))",
    "OutsideSettings": "wbc.Observer(robot, ObserverSettings(outside=OutsideSettings(tare=0.0)))",
    "LoadSettings": "WalkingControlSettings(load=LoadSettings(largest=0.3))",
    "StiffnessActuator": "VariableStiffnessFoot(actuator=StiffnessActuator(rate_limit=20.0))",
    "RunSettings": "wbc.run(driver, control, settings=RunSettings(fade=2.0))",
}
"""Class of settings that no walk has by default → a call that takes its settings."""

EVERYWHERE = ("--json", "--verbose", "--help", "-h", "--version")
"""Options of every command, which the page names once."""

MANY = 6
"""Number of options that a command has in common with an earlier one from which on they are told there."""

MANY_ARGUMENTS = 12
"""Number of arguments from which on those of settings are left to the table of their class in the page of settings."""

LONG_DEFAULT = 60
"""Length of a default, characters, from which on the name of its class stands for it."""

UNIT = (
    r"(?:1/s|m²/s|m/s²|m/s|rad/s²|rad/s|m/N|Nms/rad|Nm/rad|Nm|Ns/kg|N/m|Ns/m|kg m²|kg|rad|mm|ms|m²|m|s|N|Hz)"
)

UNIT_TOLD = re.compile(rf", ({UNIT}(?: \(or {UNIT}\))?(?:(?:, | and | or ){UNIT})*)(?=[.,;:]|$)")
"""Unit of a value in its description, as in "Control period, s."."""

UNIT_ALONE = re.compile(rf"(?<![\w/'’]){UNIT}(?![\w/²-])")

LONG_MEANING = 200
"""Length of a meaning, characters, from which on a later command links to the first one that has it."""


def filled(text: str) -> str:
    """Return the text of a page with its tables as the code has them."""
    return MADE.sub(lambda match: f"<!-- {match['what']} -->\n\n{_made(match, text)}\n\n<!-- end -->", text)


def _made(match: re.Match[str], page: str) -> str:
    if match["what"] == "index of settings":
        rows = index_rows(page)
    elif match["page"] is not None:
        rows = answer_rows(match["page"])
    elif match["kind"] is None:
        rows = TABLES[match["what"]]()
    elif match["what"].startswith("names"):
        rows = name_rows(match["kind"], match["some"], page)
    elif match["what"].startswith("members"):
        rows = member_rows(match["kind"], match["some"])
    elif match["what"].startswith("fields"):
        rows = field_rows(_kind(match["kind"]))
    else:
        rows = settings_rows(_kind(match["kind"]), match["path"] or "")
    return "\n".join(rows).strip("\n")


def _kind(name: str) -> type:
    module, _, kind = name.rpartition(".")
    return typing.cast(type, getattr(import_module(module), kind))


def _settings(kind: type, path: str) -> Iterator[SettingRow]:
    """Settings of a class with the defaults that a walk has: those of a plan, and of free steps where they differ."""
    for each in settings_of(kind, path, Gait().full if kind is Gait else None):
        name, default = each.name.rpartition(".")[2], each.default
        if each.owner == InertialSettings.__name__ and f"{(own := getattr(ON_POINTS, name)):g}" != default:
            default += f"; in free steps {own:g}"
        alone = _alone(_kind(f"{each.module}.{each.owner}"))[name]
        if kind is not Gait and {*each.default.split(", ")} != {*alone.split(", ")}:
            default += f"; in the class {alone}"
        yield each._replace(default=default)


@functools.cache
def _alone(kind: type) -> dict[str, str]:
    """Return the defaults of the settings in a new object of their class."""
    return {each.name: each.default for each in settings_of(kind)}


def _of_g1(row: SettingRow) -> str:
    """Return the value of a setting of free steps for g1, with its unit; empty for one without a unit."""
    own, name = SteppingSettings(), row.name.rpartition(".")[2]
    size = RobotSize.of(load_robot("g1").robot(), own.bend)
    unit = next((part for part in typing.get_args(_hints(SteppingSettings)[name])[1:] if part in UNITS), None)
    return "" if unit is None else f"{getattr(in_si(own, size), name):.3g} {UNITS[unit]}"


def settings_rows(kind: type, path: str) -> Iterator[str]:
    """Tables of a tree of settings, one a class: names as `--set` takes them, defaults, ranges, meanings."""
    owner = ""
    for each in _settings(kind, path):
        if each.owner != owner:
            owner = each.owner
            of_g1 = owner == SteppingSettings.__name__
            yield from (
                f"\n### {owner}\n",
                *([f"Used as `{CALLS[owner]}`.\n"] if owner in CALLS else ()),
                f"| Setting | Default |{of_g1 * ' For `g1` |'} Range | Meaning |",
                f"|---|---|{of_g1 * '---|'}---|---|",
            )
        hint = _hints(_kind(f"{each.module}.{owner}"))[each.name.rpartition(".")[2]]
        si = f" {_of_g1(each)} |" if of_g1 else ""
        yield f"| `{each.name}` | {each.default} |{si} {range_of(hint)} | {escaped(each.about)} |"


def _package_of(module: str, name: str) -> str:
    """Return the highest of a module and the packages above it that have a class."""
    parts = module.split(".")
    packages = [".".join(parts[:cut]) for cut in range(1, len(parts) + 1)]
    return next(each for each in packages if hasattr(import_module(each), name))


def index_rows(page: str) -> Iterator[str]:
    """The tables of settings of a page, each with the names in it, and its class with what that is and its module."""
    yield from ("| Names | Class, with its table | What is set | Import from |", "|---|---|---|---|")
    for match in MADE.finditer(page):
        if match["what"].startswith("settings"):
            for owner, rows in itertools.groupby(
                _settings(_kind(match["kind"]), match["path"] or ""), lambda each: each.owner
            ):
                first, *others = rows
                path = first.name.rpartition(".")[0]
                names = f"`{path}.…`" if path else "in Python"
                if owner == WalkTrialSettings.__name__:
                    names = ", ".join(f"`{each.name}`" for each in (first, *others))
                about = (inspect.getdoc(_kind(f"{first.module}.{owner}")) or "").partition("\n")[0]
                package = _package_of(first.module, owner)
                yield f"| {names} | [{owner}](#{owner.lower()}) | {escaped(about)} | `{package}` |"


def gait_rows() -> Iterator[str]:
    """Values of the gait of planned steps by speed."""
    yield f"| Setting | {' | '.join(f'{speed:g} m/s' for speed in SPEEDS)} |"
    yield "|---|" + "---:|" * len(SPEEDS)
    for name, values in zip(BY_SPEED, zip(*SPEEDS.values(), strict=True), strict=True):
        yield f"| `gait.{name}` | {' | '.join(f'{value:g}' for value in values)} |"


def field_rows(kind: type) -> Iterator[str]:
    """Fields of a class with defaults, ranges and meanings."""
    yield from ("| Field | Default | Range | Meaning |", "|---|---|---|---|")
    about = attribute_docs(kind)
    for field in dataclasses.fields(kind):
        hint, default = _hints(kind)[field.name], field.default
        if field.default_factory is not dataclasses.MISSING:
            text = f"`{hint.__name__}()`"
        elif default is dataclasses.MISSING or isinstance(default, FieldInfo):
            text = "must be given"
        else:
            values = default if isinstance(default, tuple) else (default,)
            text = ", ".join("–" if value is None else f"{value:g}" for value in values)
        yield f"| `{field.name}` | {text} | {range_of(hint)} | {escaped(about[field.name])} |"


def name_rows(package: str, some: str | None, page: str) -> Iterator[str]:
    """Public classes and functions of a package, or some of them: arguments, and first line of the docstring.

    A page whose tables have some of them has all of them.
    """
    yield from ("| Name | Arguments | What it is |", "|---|---|---|")
    module = import_module(package)
    every = [name for name in module.__all__ if callable(getattr(module, name))]
    if some is not None:
        told = [m["some"].split(", ") for m in MADE.finditer(page) if m["kind"] == package]
        left = {*every}.symmetric_difference(itertools.chain(*told))
        assert not left, f"{package}: {', '.join(sorted(left))} in no table, or unknown"
    for name in every if some is None else some.split(", "):
        thing = getattr(module, name)
        about = (inspect.getdoc(thing) or "").partition("\n")[0]
        table = f"### {name}\n"
        many = len(inspect.signature(thing).parameters) > MANY_ARGUMENTS
        if many and table in SETTINGS_PAGE:
            arguments = f"[settings](../settings.md#{name.lower()})"
        elif many and f"<!-- members of {package}.{name} -->" in page:
            arguments = f"[fields below](#{name.lower()})"
        else:
            arguments = escaped(arguments_of(thing))
        yield f"| `{package}.{name}` | {arguments} | {escaped(about + units_of(thing))} |"


def member_rows(path: str, some: str | None) -> Iterator[str]:
    """Attributes and methods of a class, or some of them: arguments and type, and what each is."""
    kind = _kind(path)
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
    every = [*told, *sorted(made, key=lambda name: callable(getattr(kind, name)))]
    names = every if some is None else some.split(", ")
    assert not (unknown := {*names}.difference(every)), f"{path} has no {', '.join(sorted(unknown))}"
    yield from (f"### {kind.__name__}\n", f"| `{path}` | What it is |", "|---|---|")
    for name in names:
        member, about = (_attribute(kind, name), told[name]) if name in told else _made_member(kind, name)
        head, *units = about.split("\n")
        yield f"| {escaped(f'`{name}{member}`')} | {escaped(''.join((first_sentence(head), *units)))} |"


def _bases(kind: Any) -> tuple[type, ...]:
    """Return a class and those that it is derived from, also for a `TypedDict`, which does not inherit from others."""
    if not typing.is_typeddict(kind):
        return kind.__mro__[:-1]
    bases = [each for each in getattr(kind, "__orig_bases__", ()) if inspect.isclass(each)]
    return (kind, *(base for each in bases for base in _bases(each)))


def _attribute(kind: type, name: str) -> str:
    """Return a colon and the type of an attribute: its annotation, or that of the argument it is; empty without."""
    for base in _bases(kind):
        hint = base.__dict__.get("__annotations__", {}).get(name)
        if hint is None and "__init__" in vars(base):
            given = inspect.signature(base.__init__).parameters.get(name)
            hint = given.annotation if given is not None and "|" not in str(given.annotation) else None
        if hint not in (None, inspect.Parameter.empty):
            return f": {short(hint, base.__module__)}"
    return ""


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


ANNOTATED = re.compile(r"Annotated\[([\w.]+)((?:, [^\[\]]*)*)\]")


def short(hint: Any, module: str) -> str:
    """Return a type as a reader says it: without its module, and with its unit in brackets behind it."""
    if hint in (inspect.Parameter.empty, None):
        return ""
    known = vars(import_module(module))

    def plain(found: re.Match[str]) -> str:
        named = known.get(found[0])
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
    for name, each in inspect.signature(thing).parameters.items():
        about = told.get(name, "")
        if (unit := UNIT_TOLD.search(about)) and not re.search("str|Path|Phase", str(each.annotation)):
            others = UNIT_ALONE.findall("".join(re.split(r"\([^()]* or [^()]*\)", about)))
            if {*others} <= {*UNIT_ALONE.findall(unit[1])}:
                found.setdefault(unit[1], []).append(f"`{name}`")
    return "".join(f" {', '.join(names)} in {unit}." for unit, names in found.items())


def arguments_of(thing: Any, *, bound: bool = False) -> str:
    """Return the arguments of a call with their defaults; empty for what no program calls by its name.

    Args:
        thing: Class or function.
        bound: True for a method of a class, whose first argument is the object.
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
        if each.kind is each.KEYWORD_ONLY and not any(text.startswith("*") for text in texts):
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


def term_rows() -> Iterator[str]:
    """Terms of observations with the names that other projects give them, and their numbers of values."""
    yield from ("| Term | Also known as | Values | Meaning |", "|---|---|---|---|")
    meanings = {
        each.arg_name: each.description or "" for each in docstring_parser.parse(terms.__doc__ or "").params
    }
    for name, values in terms.TERMS.items():
        few, more = (values(_observed(count)).size for count in (2, 3))
        size = "1 a point" if few == 0 else f"{few}" if few == more else f"{more - few} a joint"
        others = ", ".join(f"`{other}`" for other, own in NAMES.items() if own == name)
        yield f"| `{name}` | {others} | {size} | {escaped(meanings.pop(name))} |"
    assert not meanings, f"no terms: {', '.join(meanings)}"


def _observed(joints: int) -> terms.Observed:
    """State of the run of a policy with a number of joints, over no ground."""
    state, numbers = SimpleNamespace(q=np.eye(7)[6], v=np.zeros(6)), np.zeros(joints)
    frame = SimpleNamespace(frame=ClipFrame(numbers, numbers, pin.SE3()), relative=pin.SE3.Identity())
    values: Any = (state, numbers, numbers, numbers, np.zeros(3), np.zeros(2), frame, lambda: np.zeros(0))
    return terms.Observed(*values)


@functools.cache
def _hints(kind: type) -> dict[str, Any]:
    return typing.get_type_hints(kind, include_extras=True)


def range_of(hint: Any) -> str:
    """Return the numbers or the choices that an annotation allows, in the words of a table; empty for all."""
    parts = typing.get_args(hint)
    if typing.get_origin(hint) is Literal:
        return ", ".join(f'"{part}"' for part in parts)
    if typing.get_origin(hint) is Annotated:
        marks = [mark for part in parts[1:] for mark in getattr(part, "metadata", ())]
        found = {
            n: v for n in ("gt", "ge", "lt", "le") for m in marks if (v := getattr(m, n, None)) is not None
        }
        if not found:
            return range_of(parts[0])
        if {*found} == {"ge", "le"}:
            return f"{_number(found['ge'])} to {_number(found['le'])}"
        signs = {"gt": ">", "ge": "≥", "lt": "<", "le": "≤"}
        return ", ".join(f"{signs[name]} {_number(value)}" for name, value in found.items())
    ranges = [range_of(part) for part in parts if part not in (type(None), ...)]
    if len({*ranges}) < 2:
        return ranges[0] if ranges else ""
    return "; ".join(each or "any" for each in ranges)


def _number(value: float) -> str:
    return f"{value:.4g}".replace("e+0", "e").replace("e-0", "e-").replace("-", "−")


def answer_rows(page: str) -> Iterator[str]:
    """Questions of a page of measurements, bold at the head of a paragraph, with the first sentence behind each.

    Behind a question may stand `*(older law, DATE)*`, which has a column of its own.
    """
    yield from ("| Question | Answer | Older law |", "|---|---|---|")
    heading = ""
    for line in (DOCS / f"{page}.md").read_text("utf-8").splitlines():
        if title := re.match(r"##+ (.*)", line):
            heading = title[1].lower().replace(" ", "-")
        elif found := re.match(r"\*\*(.+?\?)\*\* (?:\*\(older law, (.+?)\)\* )?(.+?\.)(?= [A-Z`]|$)", line):
            question, law, answer = (
                re.sub(r"\[([^]]+)\]\([^)]+\)", r"\1", text or "") for text in found.groups()
            )
            yield f"| [{question}]({page}.md#{heading}) | {answer} | {law} |"


def ground_rows() -> Iterator[str]:
    """Families of grounds with their first line."""
    yield from ("| Family | Ground |", "|---|---|")
    for name, kind in terrain_families().items():
        yield f"| `{name}` | {escaped((inspect.getdoc(kind) or '').partition(chr(10))[0])} |"


def study_rows() -> Iterator[str]:
    """Studies of the examples with what each is about."""
    yield from ("| Study | Subject |", "|---|---|")
    for file in sorted(STUDIES.glob("*.json")):
        yield f"| [`{file.stem}`]({file.name}) | {escaped(json.loads(file.read_text('utf-8'))['about'])} |"


def command_rows() -> Iterator[str]:
    """Every command with its words and options."""
    wbc = make_app(None)
    yield from ("| Command | What it does |", "|---|---|")
    yield from (f"| [`wbc {words}`](#{anchor(words)}) | {escaped(summary(words))} |" for words in COMMANDS)
    told: dict[tuple[str, ...], str] = {}
    for words in COMMANDS:
        app = functools.reduce(operator.getitem, words.split(), wbc)
        options = [each for each in app.assemble_argument_collection() if each.name not in EVERYWHERE]
        yield from (f"\n## `wbc {words}`\n", escaped(app.help), "")
        rows = [option_row(each) for each in options]
        firsts = [told.setdefault(row, words) for row in rows]
        # Options that an earlier command has are told there, where they are many.
        elsewhere = {other for other in firsts if other != words and firsts.count(other) >= MANY}
        if own := [row for row, first in zip(rows, firsts, strict=True) if first not in elsewhere]:
            yield from ("| Option | Default | Meaning |", "|---|---|---|")
        for names, default, text in own:
            long = len(text) > LONG_MEANING and (first := told[names, default, text]) != words
            yield f"| {names} | {default} | {f'See [`wbc {first}`](#{anchor(first)}).' if long else text} |"
        for other in dict.fromkeys(first for first in firsts if first in elsewhere):
            names = ", ".join(row[0] for row, first in zip(rows, firsts, strict=True) if first == other)
            yield from ("", f"As in [`wbc {other}`](#{anchor(other)}): {names}.")


def option_row(option: Any) -> tuple[str, str, str]:
    """Return names, default and meaning of an option of a command."""
    text, _, default = (option.parameter.help or "").partition(" [default: ")
    if choices := option.get_choices():
        text += f" Choices: {', '.join(choices)}."
    return (
        ", ".join(f"`{name}`" for name in option.names),
        default.rstrip("]") or _shown(option),
        escaped(text),
    )


def anchor(words: str) -> str:
    """Return the anchor of the heading of a command."""
    return f"wbc {words}".replace(" ", "-")


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


TABLES = {
    "commands": command_rows,
    "gait by speed": gait_rows,
    "grounds": ground_rows,
    "studies": study_rows,
    "terms of policies": term_rows,
}
"""Words of a comment → rows of the table behind it."""


def main() -> None:
    """Fill all pages."""
    argparse.ArgumentParser(description=__doc__).parse_args()
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        if (new := filled(text)) != text:
            page.write_text(new, encoding="utf-8")
            print(f"wrote {page.name}")


if __name__ == "__main__":
    main()
