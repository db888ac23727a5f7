"""Validated settings: frozen dataclasses whose annotations state type, range, unit and choices.

    @settings
    class Push:
        impulse: Annotated[NonNegative, "Ns/kg"] = 0.1
        duration: Annotated[Positive, "s"] = 0.1
        side: Literal["left", "right"] = "left"

Pydantic checks every field when a value is made; the first that it refuses is raised as an `InputError` of one line:
field, unit, Pydantic's rule, value. A rule about several fields is a check in `__post_init__`. A text in `Annotated` is
the unit.

Every field of nested settings can be changed by name, `gains.dcm_p`, or `dcm_p` alone where that is unique: a new
setting is open to the command line, files and studies without being written down again.
"""

from __future__ import annotations

import dataclasses
import functools
import inspect
import json
import math
import re
import types
import typing
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import reduce
from typing import Annotated, Any, Literal, NoReturn, TypeVar, dataclass_transform, overload

import numpy as np
from numpy.typing import ArrayLike
from pydantic import AfterValidator, ConfigDict, Field, TypeAdapter, ValidationError
from pydantic.dataclasses import dataclass as pydantic_dataclass
from pydantic_core import CoreSchema, to_jsonable_python
from pydantic_core.core_schema import no_info_plain_validator_function

from wbc.base.errors import InputError, shown, unknown_name
from wbc.base.numbers import Array, finite_array, in_range, plain

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

Ordinal = Annotated[int, Field(ge=0)]
"""An integer, zero or above: a place in an order, such as a tick of a log or a level of priority."""

Number = Annotated[float, Field(allow_inf_nan=False)]
"""A finite number of any sign and size: a place, or a speed that a check of the whole bounds."""

SHORTEST_PERIOD, LONGEST_PERIOD = 1e-6, 1.0
"""Shortest and longest control period, s: numbers above are in milliseconds, or are frequencies."""

Period = Annotated[float, Field(ge=SHORTEST_PERIOD, le=LONGEST_PERIOD), "s"]
"""A control period, from a microsecond up to a second: a greater number is in milliseconds, or a frequency."""

Angle = Annotated[float, Field(ge=-math.tau, le=math.tau), "rad"]
"""An angle, up to a full turn to either side: a greater number is in degrees."""


@dataclasses.dataclass(frozen=True)
class Numbers:
    """Range and shape of the finite numbers of an array, for `Annotated[ArrayLike, Numbers(...)]`.

    Attributes:
        low: Least number.
        above: Number that every one exceeds.
        high: Greatest number.
        shape: Shape; any when None.
    """

    low: float = -math.inf
    above: float = -math.inf
    high: float = math.inf
    shape: tuple[int, ...] | None = None

    def checked(self, value: Any) -> Array:
        """Return a copy as a float64 array; what is outside is a `ValueError` that says the rule."""
        try:
            return in_range("", finite_array("", value, self.shape), self.low, self.above, self.high)
        except InputError as error:
            raise ValueError(str(error).strip()) from None

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> CoreSchema:
        """Return Pydantic's schema: this check alone, whatever is annotated."""
        return no_info_plain_validator_function(self.checked)


PositiveNumbers = Annotated[ArrayLike, Numbers(above=0.0)]
"""Finite numbers above zero: one for all, or an array."""

NonNegativeNumbers = Annotated[ArrayLike, Numbers(low=0.0)]
"""Finite numbers, zero or above: one for all, or an array."""

Triple = Annotated[ArrayLike, Numbers(shape=(3,))]
"""Three finite numbers: a point, a direction, a force."""

UNIONS = (typing.Union, types.UnionType)
"""Origins of annotations of a union."""

CONFIG = ConfigDict(
    strict=True,
    extra="forbid",
    allow_inf_nan=False,
    arbitrary_types_allowed=True,
    ser_json_inf_nan="constants",
    ser_json_bytes="base64",
)


@overload
def settings(kind: type[T], /) -> type[T]: ...
@overload
def settings(*, kw_only: bool = False, eq: bool = True) -> Callable[[type[T]], type[T]]: ...
@dataclass_transform(frozen_default=True, field_specifiers=(dataclasses.field, Field))
def settings(kind: type[T] | None = None, /, *, kw_only: bool = False, eq: bool = True) -> Any:
    """Make a class a frozen, hashable dataclass whose fields are checked against their annotations.

    Numbers are finite; a field of type `float` takes integers, one of type `int` takes no fraction, and neither takes
    text or truth values. Lists and NumPy arrays become tuples. Annotations are resolved at once: their names must be
    imported at run time, not only for type checkers.

    Args:
        kind: The class.
        kw_only: Take all fields by keyword.
        eq: Compare and hash values by their fields; with False as the class itself says.

    Returns:
        The dataclass. Making a value raises `InputError` for a value that breaks a rule, `UnknownNameError` for a field
        or choice that does not exist.
    """
    if kind is None:
        return functools.partial(settings, kw_only=kw_only, eq=eq)
    _refuse_without_effect(kind, inspect.get_annotations(kind))
    made: Any = pydantic_dataclass(kind, frozen=True, kw_only=kw_only, eq=eq, config=CONFIG)
    check = made.__init__

    @functools.wraps(check)
    def init(self: Any, *args: Any, **values: Any) -> None:
        if type(self) is not made:
            _refuse_without_effect(type(self), {})
        try:
            check(self, *map(hashable, args), **{name: hashable(value) for name, value in values.items()})
        except ValidationError as error:
            refuse(error, values, type(self))

    made.__init__ = init
    return typing.cast(type[T], made)


def _refuse_without_effect(kind: type, annotated: Mapping[str, Any]) -> None:
    """Refuse a class that gives settings it derives from other defaults, but not in fields of its own."""
    for base in filter(dataclasses.is_dataclass, kind.__mro__[1:]):
        for name in (each.name for each in dataclasses.fields(base)):
            if name in vars(kind) and name not in annotated:
                raise InputError(
                    f"default of {name} in class {kind.__name__} has no effect: annotate it, and add @settings"
                )


def hashable(value: Any) -> Any:
    """Return lists and arrays as tuples, also inside mappings, and NumPy numbers as Python's."""
    if isinstance(value, (np.ndarray, np.generic)):
        value = value.tolist()
    if isinstance(value, Mapping):
        return {hashable(key): hashable(each) for key, each in value.items()}
    return tuple(map(hashable, value)) if isinstance(value, (list, tuple)) else value


def to_json(value: Any) -> Any:
    """Return settings, or a tuple, list or mapping of them, as plain values; bytes become base64, infinity stays."""
    return to_jsonable_python(value, fallback=_parts_of, serialize_as_any=True)


def _parts_of(value: Any) -> Any:
    """Return what Pydantic does not know: a mapping of another kind, numbers of NumPy."""
    return dict(value) if isinstance(value, Mapping) else plain(value)


def json_object(kind: str, data: Any) -> dict[str, Any]:
    """Return the names and values of a JSON object as a new dictionary; `InputError` for anything else."""
    if not isinstance(data, Mapping):
        raise InputError(f"{kind} must be an object of names and values, got {shown(data)}")
    return dict(data)


def from_json(kind: type[T], data: Any) -> T:
    """Return the settings that `to_json` wrote, or shorter ones: what is left out has its default.

    Raises `UnknownNameError` for a name that the settings do not have, `InputError` for a value that breaks a rule,
    with its place.
    """
    try:
        # As JSON, because there alone strict checks take an object for settings and a list for a tuple.
        return typing.cast(T, _adapter(typing.cast(Any, kind)).validate_json(json.dumps(data, default=plain)))
    except ValidationError as error:
        refuse(error, data, kind)
    except (RecursionError, TypeError, ValueError) as error:  # values that JSON cannot hold
        if isinstance(error, InputError):
            raise
        raise InputError(f"{kind.__name__} cannot be read from {shown(data)}: {error}") from None


@functools.cache
def _adapter(kind: Any) -> TypeAdapter[Any]:
    return TypeAdapter(kind)


def refuse(error: ValidationError, value: Any, hint: Any, named: Callable[[str], str] = str) -> NoReturn:
    """Raise the error of a value that its annotation refuses: where it is wrong, unit, the rules there, what is there.

    A name that does not exist comes before what it leaves missing. The annotation is a class of settings, or those of
    arguments by their names; `named` returns the place of an argument with what it is an argument of.
    """
    errors = error.errors(include_url=False)
    near = (each for each in errors if each["loc"][:1] == errors[0]["loc"][:1])
    unknown = (each for each in errors if each["type"].startswith("unexpected"))
    first = next(unknown, None) or max(
        near, key=lambda each: len(each["loc"])
    )  # of a union, the closest member
    if isinstance(cause := first.get("ctx", {}).get("error"), InputError):
        raise cause from None
    place, unit, owner = _place_in(value, hint, first["loc"])
    if first["type"] == "unexpected_keyword_argument":
        unknown_name(f"setting of {owner.__name__}", first["loc"][-1], _fields(owner))
    rules = [_rule(each) for each in errors if _place_in(value, hint, each["loc"])[0] == place]
    rule = " or ".join(dict.fromkeys([rules[0], *(each.removeprefix("must be ") for each in rules[1:])]))
    name = named(place.removeprefix(".")) or getattr(hint, "__name__", str(hint))
    unit = f" ({unit})" if unit else ""
    told = first["type"].startswith("missing") or ", got " in rule
    given = "" if told else f", got {shown(first['input'])}"
    raise InputError(f"{name}{unit}{'' if rule.startswith('must') else ':'} {rule}{given}") from None


def _fields(owner: Any) -> Mapping[str, Any]:
    """Return the annotations of the fields of settings, or those of arguments; none of anything else."""
    if isinstance(owner, dict):
        return owner
    return _hints(owner) if isinstance(owner, type) and dataclasses.is_dataclass(owner) else {}


def _place_in(value: Any, hint: Any, loc: Sequence[int | str]) -> tuple[str, str, Any]:
    """Return a place in a value, such as ".pushes[1].time" or "['knee']", its unit, and the settings that it is in.

    Names of members of a union are no places.
    """
    place, unit, owner = "", unit_of(hint), hint
    for part in loc:
        fields = _fields(owner)
        if not place and fields and isinstance(part, int):  # a value given without its name
            part = [*fields][part] if part < len(fields) else part  # noqa: PLW2901
        if part in fields:
            place, inside = f"{place}.{part}", fields[str(part)]
            unit, owner = unit_of(inside), next(_classes_in(inside), None)
        elif isinstance(part, int) or (isinstance(value, Mapping) and part in value):
            place += f"[{part!r}]"
        else:
            continue
        try:
            value = value[part]
        except (LookupError, TypeError):  # a part that lacks
            value = None
    return place, unit, owner


def _rule(error: Mapping[str, Any]) -> str:
    said = str(error["msg"]).removeprefix("Value error, ").replace("Input should be", "must be", 1)
    return re.sub(
        "a valid (tuple|array)", "a sequence", re.sub("a valid (dictionary|object)", "a mapping", said)
    )


@functools.cache
def _hints(kind: type) -> dict[str, Any]:
    return typing.get_type_hints(kind, include_extras=True)


def _classes_in(hint: Any) -> Iterator[type]:
    """Yield the settings classes of an annotation, also those inside tuples and mappings."""
    if isinstance(hint, type) and dataclasses.is_dataclass(hint):
        yield hint
    for inside in typing.get_args(hint):
        yield from _classes_in(inside)


def _alternatives(hint: Any) -> list[Any]:
    """Return the members of a union without their metadata; the annotation itself if it is no union."""
    origin, args = typing.get_origin(hint), typing.get_args(hint)
    if origin is Annotated:
        return _alternatives(args[0])
    return [bare for each in args for bare in _alternatives(each)] if origin in UNIONS else [hint]


def unit_of(hint: Any) -> str:
    """Return the unit in an annotation or in the first member of a union that has one; empty without one."""
    origin, args = typing.get_origin(hint), typing.get_args(hint)
    if origin is Annotated:
        return next((item for item in args[1:] if isinstance(item, str)), "")
    return next(filter(None, map(unit_of, args)), "") if origin in UNIONS else ""


def units(kind: type, unit: str = "", prefix: str = "") -> dict[str, str]:
    """Return the units of the fields of a dataclass by their full names, "zmp_error.mean"; those that have none lack.

    The fields of a dataclass inside have the unit of the field that holds it.
    """
    found: dict[str, str] = {}
    for name, hint in _hints(kind).items():
        own, inside = unit_of(hint) or unit, next(_classes_in(hint), None)
        if inside is not None:
            found |= units(inside, own, f"{prefix}{name}.")
        elif own:
            found[prefix + name] = own
    return found


def nested_settings(kind: type, name: str) -> Any:
    """Return the settings class of a field; None if it has none."""
    members = _alternatives(_hints(kind)[name])
    return next((each for each in members if isinstance(each, type) and dataclasses.is_dataclass(each)), None)


def unit_and_choices(kind: type, name: str) -> tuple[str, list[str]]:
    """Return the unit of a field, empty without one, and its choices, empty without any."""
    hint = _hints(kind)[name]
    literals = (h for h in _alternatives(hint) if typing.get_origin(h) is Literal)
    return unit_of(hint), [
        choice for h in literals for choice in typing.get_args(h) if isinstance(choice, str)
    ]


def in_units(values: T, units: Mapping[str, float | tuple[float, ...]]) -> T:
    """Return a dataclass with each number times the value of its unit, that its annotation names; 1 for other units."""

    def factor(hint: Any) -> Any:
        if typing.get_origin(hint) is tuple and not hasattr(hint, "__metadata__"):
            return tuple(map(factor, typing.get_args(hint)))
        named = (part for part in getattr(hint, "__metadata__", ()) if isinstance(part, str))
        return units.get(next(named, ""), 1.0)

    changes: dict[str, Any] = {}
    hints = _hints(typing.cast(type, type(values)))
    for name in (field.name for field in dataclasses.fields(values)):  # type: ignore[arg-type]
        value, unit = getattr(values, name), factor(hints[name])
        if isinstance(value, tuple):
            unit = unit if isinstance(unit, tuple) else (unit,) * len(value)
            changes[name] = tuple(v * u for v, u in zip(value, unit, strict=True))
        elif unit != 1.0:
            changes[name] = value * unit
    return dataclasses.replace(values, **changes)  # type: ignore[type-var]


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


def setting_names(settings: Any, prefix: str = "") -> tuple[str, ...]:
    """Return the full names of all settings of a dataclass and of those nested in it, each behind a prefix."""
    names: list[str] = []
    for field in dataclasses.fields(settings):
        path, value = prefix + field.name, getattr(settings, field.name)
        nested = dataclasses.is_dataclass(value)
        if not nested or type(None) in _alternatives(_hints(typing.cast(type, type(settings)))[field.name]):
            names.append(path)
        if nested:
            names += setting_names(value, f"{path}.")
    return tuple(names)


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
    off. Values that change together are checked together, whatever their order; an integer may be 8.0. A setting that
    is changed under two names is an `InputError`.
    """
    return _changed(settings, changes)[0]


def normal_changes(settings: Any, changes: Mapping[str, Any] | Changes) -> Changes:
    """Return changes with full names, in alphabetical order, and with the values that the changed settings have.

    Equivalent changes are then equal, hash and are written equally: `dcm_p` of 5 is `gains.dcm_p` of (5.0, 5.0).
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
        if path in dict(named):
            raise InputError(f"setting '{path}' is given twice")
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
