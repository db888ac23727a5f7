"""`wbc settings`: every setting of a walk, with its default and its meaning."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from typing import Annotated, Any, NamedTuple

from cyclopts import Parameter

from wbc.app.arguments import attribute_docs
from wbc.app.output import Report, reports
from wbc.base.errors import InputError
from wbc.sim.simulation.machine import Machine
from wbc.sim.walks.settings import DERIVED, WalkTrialSettings
from wbc.walking.plans.gait import Gait


class SettingRow(NamedTuple):
    """A setting: its class with its module, its name as `--set` takes it, its default, also as text, and meaning."""

    owner: str
    module: str
    name: str
    value: Any
    default: str
    about: str


@reports
def settings(
    part: Annotated[str, Parameter(help="Part of the names that are listed; all when left out.")] = "",
    /,
) -> Report:
    """List the settings of a walk, which `wbc walk --set NAME=VALUE` changes."""
    trees = ((WalkTrialSettings, "", None), (Gait, "gait", Gait().full), (Machine, "machine", None))
    found = [each for tree in trees for each in settings_of(*tree) if part in each.name]
    if not found:
        raise InputError(f"no setting has '{part}' in its name; `wbc settings` lists all")
    facts = {each.name: {"default": each.default, "about": each.about} for each in found}
    return Report(
        {"settings": facts}, "\n".join(f"{each.name} = {each.default}\n    {each.about}" for each in found)
    )


def settings_of(kind: type, path: str = "", given: Any = None) -> Iterator[SettingRow]:
    """Yield the settings of a class, and then those of the classes inside, by their full names behind a path.

    What follows from an option of the walk (`DERIVED`) is left out.
    Defaults are those of the class, or the values of a given object of it.
    """
    about = attribute_docs(kind)
    trees = []
    for field in dataclasses.fields(kind):
        if given is not None:
            default = getattr(given, field.name)
        elif field.default_factory is not dataclasses.MISSING:
            default = field.default_factory()
        else:
            default = field.default
        name = f"{path}.{field.name}".lstrip(".")
        if dataclasses.is_dataclass(default):
            trees.append((default, name))
        elif about.get(field.name) and name not in DERIVED:
            shown = _shown(default)
            yield SettingRow(kind.__name__, kind.__module__, name, default, shown, about[field.name])
    for each, name in trees:
        yield from settings_of(type(each), name, each)


def _shown(default: Any) -> str:
    if isinstance(default, tuple):
        return ", ".join(map(_shown, default))
    if isinstance(default, float):
        return f"{default:g}"
    return "–" if default in (None, dataclasses.MISSING) else str(default)
