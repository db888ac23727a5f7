"""Changes of nested settings by name: `gains.dcm_p`, or `dcm_p` alone where that is unique.

Every field of nested frozen dataclasses can be changed, so that a new setting is open to the command line, files and
studies without being written down again.
"""

from __future__ import annotations

import dataclasses
import typing
from collections.abc import Iterable, Iterator, Mapping
from functools import reduce
from typing import Any, TypeVar

from wbc.base.errors import InputError, shown, unknown_name
from wbc.base.settings import hashable, may_be_none, nested_settings

T = TypeVar("T")

Scalar = bool | int | float | str | None
Value = Scalar | tuple[Scalar, ...]
Changes = tuple[tuple[str, Value], ...]
"""Names and values in alphabetical order: hashable, and independent of the order in which they were given."""


def as_changes(values: Mapping[str, Any] | Iterable[tuple[str, Any]]) -> Changes:
    """Return names and values in their normal form, lists as tuples; `InputError` for what has none."""
    pairs = list(values.items() if isinstance(values, Mapping) else values)
    for pair in pairs:
        if not isinstance(pair, (tuple, list)) or len(pair) != 2:
            raise InputError(f"settings are given as names with values, got {shown(pair)}")
    names = [pair[0] for pair in pairs]
    for name in names:
        if not isinstance(name, str):
            raise InputError(f"the name of a setting must be text, got {shown(name)}")
        if names.count(name) > 1:
            raise InputError(f"setting '{name}' is given twice")
    return tuple(sorted((name, _plain(name, value)) for name, value in pairs))


def _plain(name: str, value: Any) -> Value:
    value = hashable(value)
    if not all(map(_is_scalar, value if isinstance(value, tuple) else (value,))):
        raise InputError(
            f"setting '{name}' must be a number, a truth value, text, null or a list of these, got {shown(value)}"
        )
    return typing.cast(Value, value)


def _is_scalar(value: Any) -> bool:
    return value is None or isinstance(value, (bool, int, float, str))


def read_changes(texts: Iterable[str]) -> dict[str, Value]:
    """Return the names and values of name=value texts, or raise an `InputError`.

    Values are numbers, true, false, none, text, or several of them with commas between.
    """
    changes: dict[str, Value] = {}
    for text in texts:
        name, separator, value = text.partition("=")
        name = name.strip().replace("-", "_")
        if not separator or not name or not value.strip():
            raise InputError(f"a setting is given as name=value, got '{text}'")
        if name in changes:
            raise InputError(f"setting '{name}' is given twice")
        parts = [_read(part.strip()) for part in value.split(",")]
        changes[name] = parts[0] if len(parts) == 1 else tuple(parts)
    return changes


def _read(text: str) -> Scalar:
    words: dict[str, Scalar] = {"true": True, "false": False, "none": None, "null": None}
    if text.lower() in words:
        return words[text.lower()]
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text


def setting_names(settings: Any) -> tuple[str, ...]:
    """Return the full names of all settings of a dataclass and of the dataclasses nested in it."""
    return tuple(path for path, _ in _leaves(settings))


def _leaves(settings: Any, prefix: str = "") -> Iterator[tuple[str, Any]]:
    for field in dataclasses.fields(settings):
        value = getattr(settings, field.name)
        if dataclasses.is_dataclass(value):
            if may_be_none(type(settings), field.name):
                yield prefix + field.name, value
            yield from _leaves(value, f"{prefix}{field.name}.")
        else:
            yield prefix + field.name, value


def full_name(names: tuple[str, ...], name: str) -> str:
    """Return the full name of a setting, gains.dcm_p, of which the last part, or the last parts, are given."""
    if name in names:
        return name
    matches = [path for path in names if path.endswith("." + name)]
    if len(matches) == 1:
        return matches[0]
    if matches:
        raise InputError(f"setting '{name}' could be {' or '.join(matches)}; give more of its name")
    unknown_name("setting", name, {*names, *(path.rpartition(".")[2] for path in names)})


def changed(settings: T, changes: Mapping[str, Any] | Changes) -> T:
    """Return settings, a frozen dataclass with nested ones, with some values replaced.

    Names are full or as far as they are unique. Settings that can be switched off take None, and True while they are
    off. Values that change together are checked together, whatever their order; an integer may be 8.0.
    """
    return _changed(settings, changes)[0]


def normal_changes(settings: Any, changes: Mapping[str, Any] | Changes) -> Changes:
    """Return changes with full names, in alphabetical order, and with the values that the changed settings have.

    Equivalent changes are then equal, hash and are written equally: `dcm_p` of 5 is `gains.dcm_p` of (5.0, 5.0). A
    setting that is changed under two names is an `InputError`.
    """
    new, pairs = _changed(settings, changes)
    values = (
        (path, reduce(lambda part, name: getattr(part, name, None), path.split("."), new), given)
        for path, given in pairs
    )
    return as_changes(
        (path, given if dataclasses.is_dataclass(value) else value) for path, value, given in values
    )


def _changed(settings: T, changes: Mapping[str, Any] | Changes) -> tuple[T, list[tuple[str, Any]]]:
    """Settings with changes, and full names and values: what is switched on first, what is switched off last."""
    pairs = list(changes.items() if isinstance(changes, Mapping) else changes)
    pairs.sort(key=lambda pair: (pair[1] is None) - (pair[1] is True))
    named: list[tuple[str, Any]] = []
    new: dict[str, Any] = {}
    for name, value in pairs:
        path = full_name(setting_names(settings), name)
        named.append((path, value))
        *parents, last = path.split(".")
        owner = reduce(getattr, parents, settings)
        nested, old = nested_settings(type(owner), last), getattr(owner, last)
        if nested is not None and value is True:
            if old is None:
                settings = _replaced(settings, {path: nested()})  # its own settings can be changed now
        elif nested is not None and value is not None:
            raise InputError(f"setting '{path}' has settings of its own; change those, or give true or none")
        else:
            whole = type(old) is int and isinstance(value, float) and value.is_integer()
            new[path] = int(value) if whole else value
    return _replaced(settings, new), named


def _replaced(settings: Any, values: Mapping[str, Any]) -> Any:
    """Settings with all values, by their full names, replaced at once; the settings check them."""
    own = {name: value for name, value in values.items() if "." not in name}
    for name in {path.partition(".")[0] for path in values} - {*own}:
        inside = {
            path.partition(".")[2]: value for path, value in values.items() if path.startswith(f"{name}.")
        }
        own[name] = _replaced(getattr(settings, name), inside)
    return dataclasses.replace(settings, **own) if own else settings
