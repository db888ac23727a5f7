"""Options of commands, between the words of a command line and settings: files of options, whole numbers, checks."""

from __future__ import annotations

import functools
import inspect
import tomllib
import types
import typing
from collections.abc import Callable, Iterable, Mapping
from dataclasses import MISSING, Field, field, fields, is_dataclass, make_dataclass
from itertools import takewhile
from pathlib import Path
from typing import Annotated, Any

from cyclopts import App, Argument, ArgumentCollection, Parameter, Token
from cyclopts.config import Dict

from wbc.app.files import unique
from wbc.core.errors import InputError
from wbc.core.files import read_json, read_text
from wbc.core.settings import usable_path

CONFIG, SPEC, PRESET = "--config", "--spec", "--preset"

UNIONS = (typing.Union, types.UnionType)

BESIDE_SPEC = ("--record",)
"""Options of `wbc walk` that are no part of the spec."""

JOINED = ("push",)
"""Options whose value is several name=value with commas between: a table in a file is one value."""


def prepare(app: App, commands: tuple[str, ...], arguments: ArgumentCollection) -> None:
    """Add the options of --config and --preset, and check words; cyclopts calls it for every command.

    Raises:
        InputError: A file that cannot be used or named, a fraction for a whole number, or options beside --spec.
    """
    path = _given(arguments, CONFIG)
    if path is not None:
        _add_options(app, commands, arguments, read_options(Path(path)), path)
    preset = _given(arguments, PRESET)
    if preset is not None:
        _add_options(app, commands, arguments, preset_options(preset), f"preset '{preset}'")
    _refuse_beside_spec(arguments)
    for argument in arguments:
        if Path in (argument.hint, *typing.get_args(argument.hint)):
            for token in argument.tokens:
                usable_path(Path(token.value))
        if int in (argument.hint, *typing.get_args(argument.hint)):
            for token in argument.tokens:
                _check_whole(argument.name, token.value)


def read_options(path: Path) -> dict[str, Any]:
    """Return the options in a TOML file, or in a JSON file of the same content.

    Raises:
        InputError: The file cannot be read, or is not of that form.
    """
    kind = path.suffix.lower().removeprefix(".")
    if kind not in ("toml", "json"):
        raise InputError(f"the name of a file of options must end in .toml or .json, got '{path.name}'")
    if kind == "json":
        data = read_json(path, object_pairs_hook=unique)
    else:
        try:
            data = tomllib.loads(read_text(path))
        except (tomllib.TOMLDecodeError, RecursionError) as error:
            raise InputError(f"{path} is not TOML: {error}") from error
    if not isinstance(data, dict):
        raise InputError(f"{path} must hold options with their values, got {type(data).__name__}")
    return data


def preset_options(name: str) -> dict[str, Any]:
    """Return a preset of walks as options of `wbc walk`.

    Raises:
        UnknownNameError: No such preset.
    """
    from wbc.sim.walks.presets import WALK_PRESETS  # noqa: PLC0415 - imports the simulator

    parts = dict(WALK_PRESETS[name])
    return {**parts.pop("gait"), **parts.pop("plan"), "set": parts.pop("changes"), **parts}


def _add_options(
    app: App, commands: tuple[str, ...], arguments: ArgumentCollection, options: dict[str, Any], path: str
) -> None:
    """Add options of a file or preset that the command line does not give; names and values name by name."""
    by_name = {argument.name: argument for argument in arguments}
    others: dict[str, Any] = {}
    for option, value in options.items():
        name = f"--{option.replace('_', '-')}"
        if name == CONFIG:
            raise InputError(f"{path}: a file of options cannot name another one")
        argument = by_name.get(name)
        if argument is not None and argument.hint == tuple[str, ...] and option not in JOINED:
            _add_names(argument, option, value, path)
        elif option in JOINED:
            rows = value if isinstance(value, list) else [value]
            others[option] = [_joined(row) if isinstance(row, dict) else row for row in rows]
        elif isinstance(value, dict):
            choices = [each for each, known in by_name.items() if known.hint == tuple[str, ...]]
            raise InputError(
                f"{path}: [{option}] takes no names and values; choices: {', '.join(each[2:] for each in choices)}"
            )
        else:
            others[option] = value
    Dict(others, source=path, use_commands_as_keys=False)(app, commands, arguments)


def _add_names(argument: Argument, option: str, value: Any, source: str) -> None:
    """Append names and values of a file, a table or a list of name=value, to those of the command line."""
    texts = [f"{name}={_text(each)}" for name, each in _flat(value)] if isinstance(value, dict) else value
    if not isinstance(texts, list) or not all(isinstance(text, str) for text in texts):
        raise InputError(f"{source}: {option} must be a table of names and values, got {value!r}")
    given = [_name(token.value) for token in argument.tokens]
    for text in texts:
        if not any(_same(_name(text), other) for other in given):
            argument.append(
                Token(keyword=f"[{option}]", value=text, source=source, index=len(argument.tokens))
            )


def _flat(table: Mapping[str, Any], before: str = "") -> Iterable[tuple[str, Any]]:
    """Yield names with dots and values; TOML makes tables of names with dots."""
    for name, value in table.items():
        if isinstance(value, dict):
            yield from _flat(value, f"{before}{name}.")
        else:
            yield before + name, value


def _joined(table: Mapping[str, Any]) -> str:
    return ",".join(f"{name}={_text(value)}" for name, value in table.items())


def _name(text: str) -> str:
    return text.partition("=")[0].strip().replace("-", "_")


def _same(one: str, other: str) -> bool:
    """Return True for two names of one setting: dcm_p is gains.dcm_p."""
    return one == other or one.endswith(f".{other}") or other.endswith(f".{one}")


def _text(value: Any) -> str:
    """Return a value as it is written after name=."""
    if isinstance(value, list):
        return ",".join(map(_text, value))
    if value is None or isinstance(value, bool):
        return str(value).lower()
    return str(value)


def _refuse_beside_spec(arguments: ArgumentCollection) -> None:
    """Refuse options of the walk beside --spec, which replaces all of them."""
    place = next((i for i, argument in enumerate(arguments) if argument.name == SPEC), None)
    if place is None or not arguments[place].tokens:
        return
    # Options of one class stand together, behind an argument without keys that stands for the class.
    before = list(takewhile(lambda each: each.keys, reversed(arguments[:place])))
    after = list(takewhile(lambda each: each.keys, arguments[place + 1 :]))
    for argument in (*before, *after):
        if argument.tokens and argument.name not in BESIDE_SPEC:
            raise InputError(f"{SPEC} is the whole walk; leave {argument.name} out")


def _given(arguments: ArgumentCollection, option: str) -> str | None:
    """Return the last value given for an option; None without one."""
    for argument in arguments:
        if argument.name == option and argument.tokens:
            return str(argument.tokens[-1].value)
    return None


def _check_whole(option: str, text: str) -> None:
    try:
        number = float(text)
    except ValueError:
        return  # cyclopts refuses what is no number
    if not number.is_integer():
        raise InputError(f"{option} must be a whole number, got {text}")


def plain_options(command: Callable[..., None]) -> Callable[..., None]:
    """Return a command whose settings classes cyclopts reads as plain dataclasses, without their checks.

    cyclopts passes words to a Pydantic dataclass unconverted, and words the errors of its fields itself. Here it
    converts the words, and the settings, made from the plain dataclass, check the values.

    Args:
        command: A command with annotated parameters, some of them settings.
    """

    @functools.wraps(command)
    def run(*args: Any, **values: Any) -> None:
        command(*map(_settings, args), **{name: _settings(value) for name, value in values.items()})

    hints = typing.get_type_hints(command, include_extras=True)
    parameters = [
        parameter.replace(annotation=_plain(hints[name]), default=_twin_of(parameter.default))
        for name, parameter in inspect.signature(command).parameters.items()
    ]
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
    """Return the settings of a plain dataclass; anything else as it is."""
    kind = getattr(type(value), "__settings__", None)
    if kind is None:
        return value
    return kind(**{each.name: _settings(getattr(value, each.name)) for each in fields(value)})
