"""Options of commands: fields of settings and specs as parameters that cyclopts reads.

cyclopts converts the words of an option by the type of its field; the settings check the values.
"""

from __future__ import annotations

import functools
import inspect
import typing
from collections.abc import Callable, Mapping
from dataclasses import MISSING, dataclass, field, fields, is_dataclass
from typing import Annotated, Any

import docstring_parser
from cyclopts import App, ArgumentCollection, Parameter

from wbc.base.errors import InputError
from wbc.base.settings import nested_settings, read_changes


def prepare(app: App, commands: tuple[str, ...], arguments: ArgumentCollection) -> None:
    """Check whole numbers before they are converted; cyclopts calls it for every command."""
    del app, commands
    for argument in arguments:
        for token in argument.tokens if int in (argument.hint, *typing.get_args(argument.hint)) else ():
            try:
                whole = float(token.value).is_integer()
            except ValueError:  # cyclopts refuses what is no number
                continue
            if not whole:
                raise InputError(f"{argument.name} must be a whole number, got {token.value}")


@dataclass(frozen=True, eq=False)
class Fields:
    """Annotation of a parameter of a command: fields of a spec as options, of which it gets those that are given.

    Types, choices and help are the spec's. Names and values, and settings of several values, are written name=value.

    Attributes:
        spec: Class of the spec.
        fields: Fields, with spaces between; option=field where they differ, plan.distance of a field that is settings.
            All when empty.
        defaults: Field → value shown as its default, where the command has another one than the spec.
        help: Option → help in place of the spec's.
    """

    spec: type
    fields: str = ""
    defaults: Mapping[str, Any] = field(default_factory=dict)
    help: Mapping[str, str] = field(default_factory=dict)

    @functools.cached_property
    def options(self) -> dict[str, str]:
        """Option → field."""
        pairs = (word.rpartition("=") for word in (self.fields or " ".join(_paths(self.spec))).split())
        return {option or name.replace("_", "-"): name for option, _, name in pairs}

    def parameters(self) -> list[inspect.Parameter]:
        """Return a parameter for each option; of a whole spec, without a default where it has none."""
        return [self._parameter(option, *_owner(self.spec, path)) for option, path in self.options.items()]

    def take(self, words: dict[str, Any]) -> dict[str, Any]:
        """Take the options out of the parameters of a call; return what was given, fields of a field in a mapping."""
        values: dict[str, Any] = {}
        for option, path in self.options.items():
            value = words.pop(_identifier(option), None)
            if value is None or value == ():
                continue
            inside = _item(_hint(*_owner(self.spec, path)))
            if is_dataclass(inside):
                value = [read_changes(text.split(",")) for text in value]
            elif typing.get_origin(inside) is tuple:
                value = read_changes(value)
            *group, name = path.split(".")
            (values.setdefault(group[0], {}) if group else values)[name] = value
        return values

    def _parameter(self, option: str, kind: type, name: str) -> inspect.Parameter:
        own = next(each for each in fields(kind) if each.name == name)
        about, hint = self.help.get(option) or attribute_docs(kind)[name], _hint(kind, name)
        default = self.defaults.get(name, own.default)
        if default is not MISSING and default is not None and default is not False and default != ():
            shown = ", ".join(map(str, default)) if isinstance(default, tuple) else default
            about += f" [default: {shown}]"
        item = _item(hint)
        if is_dataclass(item) or typing.get_origin(item) is tuple:
            hint = tuple[str, ...]
        marks = getattr(_hint(kind, name, extras=True), "__metadata__", ())
        missing = own.default is MISSING and own.default_factory is MISSING and not self.fields
        return inspect.Parameter(
            _identifier(option),
            inspect.Parameter.KEYWORD_ONLY,
            default=inspect.Parameter.empty if missing else None if item is None else (),
            annotation=Annotated[
                hint if item is not None else hint | None,
                Parameter(name=f"--{option}", help=about, show_default=False),
                *(mark for mark in marks if isinstance(mark, Parameter)),
            ],
        )


def with_options(command: Callable[..., None], **more: type) -> Callable[..., None]:
    """Return a command of which each parameter that is settings, or `Fields` of a spec, is as many options.

    More parameters that are settings are given by name.
    """
    hints = typing.get_type_hints(command, include_extras=True) | more
    added = {name: inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY) for name in more}
    parameters, groups = [], {}
    for name, parameter in {**inspect.signature(command).parameters, **added}.items():
        chosen = next(
            (mark for mark in getattr(hints[name], "__metadata__", ()) if isinstance(mark, Fields)), None
        )
        if chosen is None and is_dataclass(hints[name]):
            chosen = Fields(hints[name])
        if chosen is None:
            parameters.append(parameter.replace(annotation=hints[name]))
        else:
            groups[name] = chosen
            parameters += chosen.parameters()

    @functools.wraps(command)
    def run(*words: Any, **values: Any) -> None:
        given = {name: chosen.take(values) for name, chosen in groups.items()}
        made = {
            name: made_of(hints[name], part) if is_dataclass(hints[name]) else part
            for name, part in given.items()
        }
        command(*words, **values, **made)

    run.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    run.__dict__["__signature__"] = inspect.Signature(parameters)
    del run.__dict__["__wrapped__"]
    return run


def made_of(kind: Any, given: Mapping[str, Any]) -> Any:
    """Return settings of a class with the values that are given."""
    parts = {
        name: made_of(nested_settings(kind, name), value)
        for name, value in given.items()
        if type(value) is dict
    }
    return kind(**{**given, **parts})


def attribute_docs(kind: type) -> dict[str, str]:
    """Return the documentation of each field of a dataclass, from it and the classes it derives from."""
    found: dict[str, str] = {}
    for cls in reversed(kind.__mro__):
        if not is_dataclass(cls):
            continue
        found |= {each.name: found.get(each.name, "") for each in fields(cls)}
        for each in docstring_parser.parse(cls.__doc__ or "").params:
            found[each.arg_name] = " ".join((each.description or "").split())
    return found


def _paths(kind: type) -> list[str]:
    """Return all fields of settings; of fields that are settings, theirs."""
    paths = []
    for each in fields(kind):
        inner = nested_settings(kind, each.name)
        paths += [f"{each.name}.{path}" for path in _paths(inner)] if inner else [each.name]
    return paths


def _owner(kind: type, path: str) -> tuple[type, str]:
    """Return the settings of which a path of a spec is a field, and its name there."""
    group, _, name = path.rpartition(".")
    return (nested_settings(kind, group), name) if group else (kind, name)


@functools.cache
def _hints(kind: type, extras: bool) -> dict[str, Any]:
    return typing.get_type_hints(kind, include_extras=extras)


def _hint(kind: type, name: str, extras: bool = False) -> Any:
    """Return the type of a field, without ranges and units unless they are asked for."""
    return _hints(kind, extras)[name]


def _item(hint: Any) -> Any:
    """Return the type of the values of a field that takes any number of them; None for one that does not."""
    inside = typing.get_args(hint)
    return inside[0] if typing.get_origin(hint) is tuple and inside[-1] is ... else None


def _identifier(option: str) -> str:
    return option.replace("-", "_").replace(".", "_")
