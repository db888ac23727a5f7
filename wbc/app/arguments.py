"""Between the words of a command line and the values of its options: files of options, and numbers that are whole."""

from __future__ import annotations

import json
import tomllib
import typing
from collections.abc import Mapping
from itertools import takewhile
from pathlib import Path
from typing import Any

from cyclopts import App, ArgumentCollection, Token
from cyclopts.config import Dict

from wbc.core.errors import InputError

Tables = dict[str, dict[str, Any]]
"""Tables of a file of options: options that are given as name=value, and their names and values."""


def complete(app: App, commands: tuple[str, ...], arguments: ArgumentCollection) -> None:
    """Take in the file named by --config, and refuse what the words cannot mean; cyclopts calls it for every command.

    Raises:
        InputError: A file that cannot be used, a fraction for a whole number, or options beside --spec, which says all.
    """
    _refuse_beside(arguments, "--spec", "the whole walk", ("--record",))
    path = _word(arguments, "--config")
    if path is not None:
        values, tables = read_options(Path(path))
        # What is given one by one comes first, and in a list of name=value each name for itself.
        for option, table in tables.items():
            _add(arguments, option, table, path)
        Dict(values, source=path, use_commands_as_keys=False)(app, commands, arguments)
    for argument in arguments:
        if int in (argument.hint, *typing.get_args(argument.hint)):
            for token in argument.tokens:
                _check_whole(argument.name, token.value)


def read_options(path: Path) -> tuple[dict[str, Any], Tables]:
    """Options out of a TOML file, or out of a JSON file of the same content.

    Returns:
        Options with a value, and tables.

    Raises:
        InputError: It cannot be read, or is not of that form.
    """
    try:
        text = path.read_text()
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise InputError(f"{path} is no text") from error
    toml = path.suffix.lower() == ".toml"
    try:
        data = tomllib.loads(text) if toml else json.loads(text)
    except ValueError as error:
        raise InputError(f"{path} is not {'TOML' if toml else 'JSON'}: {error}") from error
    if not isinstance(data, dict):
        raise InputError(f"{path} must hold options with their values, got {type(data).__name__}")
    tables = {name: value for name, value in data.items() if isinstance(value, dict)}
    return {name: _row(value) for name, value in data.items() if name not in tables}, tables


def _row(value: Any) -> Any:
    """A value; a list of tables, each as one text with commas between, as a push is given."""
    if isinstance(value, list):
        return [
            ",".join(f"{k}={_text(v)}" for k, v in each.items()) if isinstance(each, dict) else each
            for each in value
        ]
    return value


def _add(arguments: ArgumentCollection, option: str, table: Mapping[str, Any], source: str) -> None:
    """Append a table as name=value texts to an option that takes such."""
    name = f"--{option.replace('_', '-')}"
    argument = next((each for each in arguments if each.name == name), None)
    if argument is None or argument.hint != tuple[str, ...]:
        choices = ", ".join(each.name[2:] for each in arguments if each.hint == tuple[str, ...])
        raise InputError(f"{source}: [{option}] is no option of name=value; choices: {choices}")
    given = {_name(token.value) for token in argument.tokens}
    for key, value in table.items():
        if _name(key) not in given:
            text = f"{key}={_text(value)}"
            argument.append(
                Token(keyword=f"[{option}]", value=text, source=source, index=len(argument.tokens))
            )


def _name(text: str) -> str:
    return text.partition("=")[0].strip().replace("-", "_")


def _text(value: Any) -> str:
    """A value as one writes it after name=."""
    if isinstance(value, list):
        return ",".join(map(_text, value))
    if value is None or isinstance(value, bool):
        return str(value).lower()
    return str(value)


def _refuse_beside(arguments: ArgumentCollection, option: str, what: str, besides: tuple[str, ...]) -> None:
    """An option that says everything leaves nothing to its neighbours, not even what is their default anyway."""
    place = next((i for i, argument in enumerate(arguments) if argument.name == option), None)
    if place is None or not arguments[place].tokens:
        return
    # Options of one class stand together, behind an argument without keys that stands for the class.
    before = list(takewhile(lambda each: each.keys, reversed(arguments[:place])))
    after = list(takewhile(lambda each: each.keys, arguments[place + 1 :]))
    for argument in (*before, *after):
        if argument.tokens and argument.name not in besides:
            raise InputError(f"{option} says {what}; leave {argument.name} out")


def _word(arguments: ArgumentCollection, option: str) -> str | None:
    """What was given for an option; None when it was not."""
    for argument in arguments:
        if argument.name == option and argument.tokens:
            return str(argument.tokens[-1].value)
    return None


def _check_whole(option: str, text: str) -> None:
    try:
        number = float(text)
    except ValueError:
        return  # no number: the library says so
    if not number.is_integer():
        raise InputError(f"{option} must be a whole number, got {text}")
