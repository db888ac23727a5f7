"""Write the tables of the pages that are made from the code: `python docs/page_tables.py`.

A table stands between one of the comments of `MADE`, such as `<!-- settings of a.class as name -->` or
`<!-- commands -->`, and `<!-- end -->`. A test compares the pages with the code.
"""

from __future__ import annotations

import argparse
import dataclasses
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
from member_tables import escaped, member_rows, name_rows
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
from wbc.walking.assembly import ON_POINTS
from wbc.walking.plans.gait import BY_SPEED, SPEEDS, Gait
from wbc.walking.stepping.settings import RobotSize, SteppingSettings, multiplied_out

DOCS = Path(__file__).parent

STUDIES = DOCS.parent / "examples" / "studies"

PAGES = (*sorted(DOCS.rglob("*.md")), STUDIES / "README.md")
"""Pages that may have tables."""

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
    return "" if unit is None else f"{getattr(multiplied_out(own, size), name):.3g} {UNITS[unit]}"


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
    for name, values in BY_SPEED.items():
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
