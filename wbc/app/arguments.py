"""Options of commands, between the words of a command line and settings or specs."""

from __future__ import annotations

import functools
import inspect
import types
import typing
from collections.abc import Callable, Mapping
from dataclasses import MISSING, Field, dataclass, field, fields, is_dataclass, make_dataclass
from pathlib import Path
from typing import Annotated, Any

import docstring_parser
from cyclopts import App, ArgumentCollection, Parameter

from wbc.core.changes import read_changes
from wbc.core.errors import InputError
from wbc.core.settings import nested_settings, usable_path

UNIONS = (typing.Union, types.UnionType)

NONE_GIVEN: Mapping[str, Any] = types.MappingProxyType({})
"""Default of a parameter of a command that is annotated with `Fields`."""


def prepare(app: App, commands: tuple[str, ...], arguments: ArgumentCollection) -> None:
    """Check words before they are converted, names of files and whole numbers; cyclopts calls it for every command."""
    del app, commands
    for argument in arguments:
        kinds = (argument.hint, *typing.get_args(argument.hint))
        for token in argument.tokens:
            if Path in kinds:
                usable_path(Path(token.value))
            if int in kinds:
                _check_whole(argument.name, token.value)


def _check_whole(option: str, text: str) -> None:
    try:
        number = float(text)
    except ValueError:
        return  # cyclopts refuses what is no number
    if not number.is_integer():
        raise InputError(f"{option} must be a whole number, got {text}")


@dataclass(frozen=True, eq=False)
class Fields:
    """Annotation of a parameter of a command: fields of a spec as options, of which it gets those that are given.

    Types, choices and help are the spec's. Names and values, and settings of several values, are written name=value.

    Attributes:
        spec: Class of the spec.
        fields: Fields, with spaces between; option=field where they differ, plan.distance of a field that is settings.
        defaults: Field → value shown as its default, where the command has another one than the spec.
        help: Option → help in place of the spec's.
    """

    spec: type
    fields: str
    defaults: Mapping[str, Any] = field(default_factory=dict)
    help: Mapping[str, str] = field(default_factory=dict)

    @functools.cached_property
    def options(self) -> dict[str, str]:
        """Option → field."""
        pairs = (word.rpartition("=") for word in self.fields.split())
        return {option or field.replace("_", "-"): field for option, _, field in pairs}

    def made(self) -> type:
        """Return a dataclass with a field for each option; what is not given is None, or empty."""
        made = [
            (option.replace("-", "_"), self._hint(option), field(default=() if self._texts(option) else None))
            for option in self.options
        ]
        return make_dataclass(
            "Given", made, kw_only=True, namespace={"__fields_of__": self, "__module__": __name__}
        )

    def given(self, made: Any) -> dict[str, Any]:
        """Return what was given as plain values by field, fields of a field in an object of their own."""
        values: dict[str, Any] = {}
        for option, path in self.options.items():
            value = getattr(made, option.replace("-", "_"))
            if value is None or value == ():
                continue
            kind = self._texts(option)
            if kind == "pairs":
                value = read_changes(value)
            elif kind == "settings":
                value = [read_changes(text.split(",")) for text in value]
            *group, name = path.split(".")
            (values.setdefault(group[0], {}) if group else values)[name] = value
        return values

    def _field(self, option: str) -> tuple[type, str]:
        kind, name = self.spec, self.options[option]
        if "." in name:
            group, _, name = name.partition(".")
            kind = nested_settings(kind, group)
        return kind, name

    def _bare(self, option: str) -> Any:
        kind, name = self._field(option)
        return _plain(typing.get_type_hints(kind, include_extras=True)[name])

    def _texts(self, option: str) -> str:
        """Return what texts of an option hold: pairs of name and value, settings, or themselves; empty for no texts."""
        bare = self._bare(option)
        inside = typing.get_args(bare)
        if typing.get_origin(bare) is not tuple or inside[-1] is not ...:
            return ""
        if is_dataclass(inside[0]):
            return "settings"
        return "pairs" if typing.get_origin(inside[0]) is tuple else "texts"

    def _hint(self, option: str) -> Any:
        kind, name = self._field(option)
        about = self.help.get(option) or attribute_docs(kind)[name]
        default = self.defaults.get(name, next(each.default for each in fields(kind) if each.name == name))
        if isinstance(default, (str, int, float)) and not isinstance(default, bool):
            about += f" [default: {default}]"
        hint = tuple[str, ...] if self._texts(option) else self._bare(option) | None
        return Annotated[hint, Parameter(help=about, show_default=False)]


def attribute_docs(kind: type) -> dict[str, str]:
    """Return the documentation of each field of a dataclass, from it and the classes it derives from."""
    found: dict[str, str] = {}
    for cls in reversed(kind.__mro__):
        if not is_dataclass(cls):
            continue
        for each in docstring_parser.parse(cls.__doc__ or "").params:
            found[each.arg_name] = " ".join((each.description or "").split())
    return found


def plain_options(command: Callable[..., None]) -> Callable[..., None]:
    """Return a command whose settings classes cyclopts reads as plain dataclasses, without their checks.

    cyclopts passes words to a Pydantic dataclass unconverted, and words the errors of its fields itself. Here it
    converts the words, and the settings, made from the plain dataclass, check the values.
    """

    @functools.wraps(command)
    def run(*args: Any, **values: Any) -> None:
        command(*map(_settings, args), **{name: _settings(value) for name, value in values.items()})

    hints = typing.get_type_hints(command, include_extras=True)
    parameters = []
    for name, parameter in inspect.signature(command).parameters.items():
        chosen = next(
            (item for item in getattr(hints[name], "__metadata__", ()) if isinstance(item, Fields)), None
        )
        hint, default = _plain(hints[name]), _twin_of(parameter.default)
        if chosen is not None:
            kind = chosen.made()
            hint, default = Annotated[kind, Parameter(name="*")], kind()
        parameters.append(parameter.replace(annotation=hint, default=default))
    run.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    run.__dict__["__signature__"] = inspect.Signature(parameters)
    del run.__dict__["__wrapped__"]
    return run


def _plain(hint: Any) -> Any:
    """Return an annotation without ranges and units, and with plain dataclasses for settings."""
    inside = typing.get_args(hint)
    if typing.get_origin(hint) is Annotated:
        kept = [item for item in inside[1:] if isinstance(item, Parameter)]
        return Annotated[(_plain(inside[0]), *kept)] if kept else _plain(inside[0])
    if typing.get_origin(hint) in UNIONS:
        return typing.Union[tuple(map(_plain, inside))]  # noqa: UP007 - of a tuple of types
    if typing.get_origin(hint) is tuple:
        return tuple[tuple(item if item is ... else _plain(item) for item in inside)]  # type: ignore[misc]
    return _twin(hint) if isinstance(hint, type) and is_dataclass(hint) else hint


@functools.cache
def _twin(kind: type) -> type:
    """Return a dataclass of the same fields, defaults and documentation, without checks."""
    hints = typing.get_type_hints(kind, include_extras=True)
    own = [(each.name, _plain(hints[each.name]), _default(each)) for each in fields(kind)]
    bases = tuple(_twin(base) for base in kind.__bases__ if is_dataclass(base))
    namespace = {"__doc__": kind.__doc__, "__module__": kind.__module__, "__settings__": kind}
    return make_dataclass(kind.__name__, own, bases=bases, namespace=namespace)


def _default(of: Field[Any]) -> Any:
    made = of.default if of.default_factory is MISSING else of.default_factory()
    if is_dataclass(made):
        return field(default_factory=lambda: _twin_of(made), kw_only=of.kw_only)
    return field(default=made, kw_only=of.kw_only)


def _twin_of(value: Any) -> Any:
    """Return settings as their plain dataclass; anything else as it is."""
    if not is_dataclass(value) or isinstance(value, type):
        return value
    return _twin(type(value))(**{each.name: _twin_of(getattr(value, each.name)) for each in fields(value)})


def _settings(value: Any) -> Any:
    """Return the settings of a plain dataclass, or the fields of a spec that were given; anything else as it is."""
    chosen = getattr(type(value), "__fields_of__", None)
    if chosen is not None:
        return chosen.given(value)
    kind = getattr(type(value), "__settings__", None)
    if kind is None:
        return value
    return kind(**{each.name: _settings(getattr(value, each.name)) for each in fields(value)})
