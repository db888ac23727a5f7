"""Validated settings: frozen dataclasses whose annotations state type, range, unit and choices.

    @settings
    class Push:
        impulse: Annotated[NonNegative, "Ns/kg"] = 0.1
        duration: Annotated[Positive, "s"] = 0.1
        side: Literal["left", "right"] = "left"

Pydantic checks every field when a value is made; what it refuses is raised as an `InputError` that names field, unit,
rule and value. A rule about several fields is a check in `__post_init__`. A text in `Annotated` is the unit.
"""

from __future__ import annotations

import dataclasses
import functools
import json
import math
import types
import typing
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, NoReturn, TypeVar, dataclass_transform, overload

import numpy as np
from numpy.typing import ArrayLike
from pydantic import AfterValidator, ConfigDict, Field, TypeAdapter, ValidationError, field_validator
from pydantic.dataclasses import dataclass as pydantic_dataclass
from pydantic.fields import FieldInfo

from wbc.core.errors import InputError, shown, unknown_name

T = TypeVar("T")

SMALLEST = 1e-12
"""Smallest number above zero that a setting takes whose annotation asks for one above zero."""


def _not_tiny(value: float) -> float:
    if value < SMALLEST:
        raise ValueError(f"must be a finite number above 0, at least {SMALLEST:g}, got {value:g}")
    return value


Positive = Annotated[float, Field(gt=0.0), AfterValidator(_not_tiny)]
"""A finite number above zero."""

NonNegative = Annotated[float, Field(ge=0.0)]
"""A finite number, zero or above."""

Share = Annotated[float, Field(ge=0.0, le=1.0)]
"""A number from zero to one."""

Ratio = Annotated[float, Field(gt=0.0, le=1.0)]
"""A number above zero, up to one."""

MOST = 10_000_000
"""Largest count: what is counted is made or done."""

Count = Annotated[int, Field(ge=1, le=MOST)]
"""An integer of at least one, up to ten million."""

Seed = Annotated[int, Field(ge=0)]
"""Seed of a random generator: an integer, zero or above."""

LARGEST = 1e12
"""Largest finite number that a setting takes; no quantity of a robot comes near."""

WIDEST = 2**63 - 1
"""Largest integer that a setting takes: what 64 bits hold."""

DEEPEST = 20
"""Deepest nesting of values in settings."""

CONFIG = ConfigDict(strict=True, extra="forbid", allow_inf_nan=False, arbitrary_types_allowed=True)


@overload
def settings(kind: type[T], /) -> type[T]: ...
@overload
def settings(*, kw_only: bool = False) -> Callable[[type[T]], type[T]]: ...
@dataclass_transform(frozen_default=True, field_specifiers=(dataclasses.field, Field))
def settings(kind: type[T] | None = None, /, *, kw_only: bool = False) -> Any:
    """Make a class a frozen, hashable dataclass whose fields are checked against their annotations.

    Numbers are finite; a field of type `float` takes integers, one of type `int` takes no fraction, and neither takes
    text or truth values. Lists and NumPy arrays become tuples. Annotations are resolved at once: their names must be
    imported at run time, not only for type checkers.

    Args:
        kind: The class.
        kw_only: Take all fields by keyword.

    Returns:
        The dataclass. Making a value raises `InputError` for a value that breaks a rule, `UnknownNameError` for a field
        or choice that does not exist.
    """
    if kind is None:
        return functools.partial(settings, kw_only=kw_only)
    setattr(kind, "_usable", field_validator("*")(staticmethod(_usable)))  # noqa: B010 - unknown to type checkers
    made: Any = pydantic_dataclass(kind, frozen=True, kw_only=kw_only, config=CONFIG)
    checked = made.__init__

    @functools.wraps(checked)
    def init(self: Any, *args: Any, **values: Any) -> None:
        try:
            checked(
                self, *map(plain_value, args), **{name: plain_value(value) for name, value in values.items()}
            )
        except ValidationError as error:
            _refuse(type(self), error)

    made.__init__ = init
    return typing.cast(type[T], made)


def _usable(value: Any) -> Any:
    reason = unusable(value)
    if reason:
        raise ValueError(f"must be {reason}, got {shown(value)}")
    return value


def unusable(value: Any) -> str:
    """Return what an argument of the right kind that cannot be used must be; empty for one that can be used."""
    if type(value) in (tuple, list):
        return next(filter(None, map(unusable, value)), "")
    if isinstance(value, float):
        return f"a number within ±{LARGEST:g}" if LARGEST < abs(value) < math.inf else ""
    if isinstance(value, int):
        return f"an integer within ±{WIDEST}" if abs(value) > WIDEST else ""
    if isinstance(value, Path):
        usable_path(value)
    if not isinstance(value, str):
        return ""
    try:
        return "text without NUL" if b"\0" in value.encode() else ""
    except UnicodeEncodeError:  # half of a surrogate pair
        return "text of whole characters"


def usable_path(path: Path) -> Path:
    """Return a path that can name a file: not too long, of printable characters; else an `InputError`."""
    name = str(path)
    if not name.isprintable() or len(name) > 4000 or any(len(part.encode()) > 255 for part in path.parts):
        raise InputError(f"{shown(name)} cannot be the name of a file")
    return path


def plain_value(value: Any, depth: int = 0) -> Any:
    """Return lists and arrays as tuples, and NumPy numbers as Python's; `InputError` for more than `DEEPEST` levels."""
    if isinstance(value, np.ndarray):
        value = value.tolist()
    if type(value) in (list, tuple):
        if depth > DEEPEST:
            raise InputError(f"values may be nested {DEEPEST} deep, got {shown(value)}")
        return tuple(plain_value(item, depth + 1) for item in value)
    return value.item() if isinstance(value, np.generic) else value


_PLAIN = frozenset((str, float, int, bool, type(None)))


@functools.cache
def _field_names(kind: Any) -> tuple[str, ...]:
    return tuple(field.name for field in dataclasses.fields(kind))


def to_json(value: Any) -> Any:
    """Return settings, or a tuple, list or mapping of them, as plain values for JSON."""
    if type(value) in _PLAIN:
        return value
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {name: to_json(getattr(value, name)) for name in _field_names(type(value))}
    if isinstance(value, (list, tuple)):
        return [to_json(item) for item in value]
    if isinstance(value, Mapping):
        return {key: to_json(item) for key, item in value.items()}
    return value


def from_json(kind: type[T], data: Any) -> T:
    """Return the settings that `to_json` wrote, or shorter ones: what is left out has its default.

    Raises `UnknownNameError` for a name that the settings do not have, `InputError` for a value that breaks a rule,
    with its place.
    """
    try:
        # As JSON, because there alone strict checks take an object for settings and a list for a tuple.
        return typing.cast(T, _adapter(typing.cast(Any, kind)).validate_json(json.dumps(data)))
    except ValidationError as error:
        _refuse(kind, error)
    except (RecursionError, TypeError, ValueError) as error:  # values that JSON cannot hold
        if isinstance(error, InputError):
            raise
        raise InputError(f"{kind.__name__} cannot be read from {shown(data)}: {error}") from None


@functools.cache
def _adapter(kind: Any) -> TypeAdapter[Any]:
    return TypeAdapter(kind)


def _refuse(kind: Any, error: ValidationError) -> NoReturn:
    """Raise a name that does not exist, else the first value that was refused, as an error of this library."""
    errors = error.errors(include_url=False)
    # A wrong name comes before what it leaves missing.
    first = next((e for e in errors if e["type"].startswith("unexpected")), errors[0])
    cause = first.get("ctx", {}).get("error")
    if isinstance(cause, InputError):
        raise cause from None
    loc, value = first["loc"], first["input"]
    short = first["type"] == "missing" and isinstance(loc[-1], int)
    if short:
        loc = loc[:-1]  # too few values: the rule is that of the whole list
    whole = _class_of(kind)
    if whole is not None and loc and isinstance(loc[0], int):  # a value given without its name
        names = [field.name for field in dataclasses.fields(whole)]
        if loc[0] >= len(names):
            raise InputError(
                f"{whole.__name__} takes {len(names)} values ({', '.join(names)}), got more"
            ) from None
        if first["type"] == "unexpected_positional_argument":
            raise InputError(
                f"{whole.__name__} takes its values by name: {names[loc[0]]}={shown(value)}"
            ) from None
        loc = (names[loc[0]], *loc[1:])
    unknown = first["type"].startswith("unexpected")
    path, hint, unit = _locate(kind, loc[:-1] if unknown else loc)
    if unknown:
        owner, name = _class_of(hint), loc[-1]
        inside = {part: _class_of(_hints(owner)[part]) for part in _field_names(owner)}
        deeper = [f"{part}.{name}" for part, inner in inside.items() if inner and name in _field_names(inner)]
        unknown_name(f"setting of {path or owner.__name__}", name, deeper or inside)
    what = f"{path} ({unit})" if unit else path or getattr(kind, "__name__", str(kind))
    if first["type"] == "missing" and not short:
        raise InputError(f"{what} is missing: {rule_of(hint)}") from None
    if cause is not None:
        raise InputError(f"{what} {cause}") from None
    choices = choices_of(hint)
    if choices and isinstance(value, str):
        unknown_name(what, value, choices)
    raise InputError(f"{what} must be {rule_of(hint)}, got {shown(value)}") from None


def _locate(kind: Any, loc: Sequence[str | int]) -> tuple[str, Any, str]:
    """Path of a value in its settings, its annotation and its unit."""
    path, hint, unit = "", kind, ""
    for part in loc:
        inside = _class_of(hint)
        if isinstance(part, int):
            path += f"[{part}]"
            tuples = (typing.get_args(h) for h in _alternatives(hint) if typing.get_origin(h) is tuple)
            items = [item for item in next(tuples, ()) if item is not ...]
            hint = items[min(part, len(items) - 1)] if items else Any
            unit = unit_of(hint) or unit
        elif inside is not None and part in (hints := _hints(inside)):
            path += f".{part}" if path else part
            hint, unit = hints[part], unit_of(hints[part])
        elif (inner := _values_of(hint)) is not None:
            path += f".{part}"
            hint = inner
        # What is left are Pydantic's own labels of the alternatives of a union.
    return path, hint, unit


@functools.cache
def _hints(kind: type) -> dict[str, Any]:
    return typing.get_type_hints(kind, include_extras=True)


def _class_of(hint: Any) -> Any:
    """The settings class of an annotation; None if it has none."""
    return next((h for h in _alternatives(hint) if isinstance(h, type) and dataclasses.is_dataclass(h)), None)


def _values_of(hint: Any) -> Any:
    """The annotation of the values of a mapping; None if it has none."""
    kinds = [kind for kind in _alternatives(hint) if kind is not types.NoneType]
    only = kinds[0] if len(kinds) == 1 else None
    return typing.get_args(only)[1] if typing.get_origin(only) is dict else None


def _alternatives(hint: Any) -> list[Any]:
    """The members of a union without their metadata; the annotation itself if it is no union."""
    hint, _ = _split(hint)
    if typing.get_origin(hint) in (typing.Union, types.UnionType):
        return [bare for arg in typing.get_args(hint) for bare in _alternatives(arg)]
    return [hint]


def _split(hint: Any) -> tuple[Any, tuple[Any, ...]]:
    """An annotation without `Annotated`, and its metadata."""
    if typing.get_origin(hint) is Annotated:
        inner, *metadata = typing.get_args(hint)
        return inner, tuple(metadata)
    return hint, ()


def unit_of(hint: Any) -> str:
    """Return the unit in an annotation or in the first member of a union that has one."""
    inner, metadata = _split(hint)
    own = next((item for item in metadata if isinstance(item, str)), "")
    if own or typing.get_origin(inner) not in (typing.Union, types.UnionType):
        return own
    return next(filter(None, map(unit_of, typing.get_args(inner))), "")


def choices_of(hint: Any) -> list[str]:
    """Return the texts that an annotation gives to choose from; empty without any."""
    return [
        choice
        for h in _alternatives(hint)
        if typing.get_origin(h) is Literal
        for choice in typing.get_args(h)
        if isinstance(choice, str)
    ]


NAMES = {float: "a finite number", int: "an integer", bool: "true or false", str: "text", type(None): "none"}
BOUNDS = (("gt", "above {:g}"), ("ge", "of at least {:g}"), ("lt", "below {:g}"), ("le", "of at most {:g}"))


def rule_of(hint: Any) -> str:
    """Return the rule that an annotation, such as `Annotated[Positive, "m"] | None`, states, in words."""
    inner, metadata = _split(hint)
    origin, args = typing.get_origin(inner), typing.get_args(inner)
    if inner == ArrayLike or origin is np.ndarray:
        return "finite numbers"
    if origin in (typing.Union, types.UnionType):
        text = " or ".join(rule_of(arg) for arg in args)
    elif origin is Literal:
        text = " or ".join(repr(arg) for arg in args)
    elif origin is Callable:
        text = "a function"
    elif origin in (Mapping, dict):
        text = f"a mapping of {rule_of(args[0])} to {rule_of(args[1])}"
    elif origin in (Sequence, list) or (origin is tuple and len(args) == 2 and args[1] is ...):
        text = f"a list, each item {rule_of(args[0])}"
    elif origin is tuple:
        same = len(set(map(rule_of, args))) == 1
        text = (
            f"{len(args)} values, each {rule_of(args[0])}" if same else f"({', '.join(map(rule_of, args))})"
        )
    else:
        text = NAMES.get(inner, getattr(inner, "__name__", str(inner)))
    parts = _constraints(metadata)
    if any(getattr(part, "allow_inf_nan", False) for part in parts):
        text = text.replace("a finite number", "a number")
    limits = {name: bound for part in parts for name, bound in _bounds(part) if bound != MOST}
    words = [words.format(limits[name]) for name, words in BOUNDS if name in limits]
    return f"{text} {' and '.join(words)}" if words else text


def _constraints(metadata: Sequence[Any]) -> list[Any]:
    """The constraints in the metadata of an annotation."""
    return [part for item in metadata for part in (item.metadata if isinstance(item, FieldInfo) else [item])]


def _bounds(constraint: Any) -> list[tuple[str, float]]:
    return [(name, getattr(constraint, name)) for name, _ in BOUNDS if hasattr(constraint, name)]


def nested_settings(kind: type, name: str) -> Any:
    """Return the settings class of a field; None if it has none."""
    return _class_of(_hints(kind)[name])


def may_be_none(kind: type, name: str) -> bool:
    """Return True for a field that can be switched off."""
    return type(None) in _alternatives(_hints(kind)[name])


def unit_and_choices(kind: type, name: str) -> tuple[str, list[str]]:
    """Return the unit of a field, empty without one, and its choices, empty without any."""
    hint = _hints(kind)[name]
    return unit_of(hint), choices_of(hint)
