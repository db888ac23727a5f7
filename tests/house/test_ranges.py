"""Ranges of public arguments: a value just outside of one that an annotation states is refused.

All that the rooms export is looked through: constructors, attributes that can be assigned, methods and functions, and
the fields of all settings. A value just outside each range is given and must be refused by name.
"""

from __future__ import annotations

import functools
import importlib
import inspect
import math
import pkgutil
import typing
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from enum import Enum
from types import ModuleType, UnionType
from typing import Annotated, Any, NamedTuple

import pytest
from pydantic import TypeAdapter, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import ArgsKwargs

import wbc
from wbc.base.checked import hints_of
from wbc.base.errors import InputError
from wbc.base.settings import Numbers, Positive, Share
from wbc.core.robot import Robot
from wbc.robots import RobotDescription
from wbc.tasks import JointTorqueTask, PostureTask
from wbc.walking import FootstepPlan, WalkingControl, WalkingControlSettings

ROOMS = ("app", "core", "feet", "ground", "machine", "motion", "robots", "sim", "tasks", "walking")


RESULTS = {
    "Command",
    "Estimate",
    "FootFit",
    "FootParts",
    "Measurement",
    "RunReport",
    "SweepSummary",
    "SwingScan",
}
"""Values that the library, a foot of one's own or a machine hands out in bulk: what takes them checks them."""


BY_WHAT_IS_KNOWN = {
    *(f"{task}.{where}" for task in ("PostureTask", "JointTorqueTask") for where in ("__init__", "target")),
}
"""Doors that check by joints or limits that a made object alone has."""


UNIONS = (typing.Union, UnionType)


class Place(NamedTuple):
    """An argument: how it is given a value, where it stands, its annotation."""

    call: Callable[[Any], object]
    of: str
    name: str
    hint: Any


def modules() -> Iterator[ModuleType]:
    """Yield the modules of all rooms, but for those that need what is not installed."""
    for room in ROOMS:
        package = importlib.import_module(f"wbc.{room}")
        yield package
        for found in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
            yield importlib.import_module(found.name)


@functools.cache
def exported() -> tuple[tuple[str, Any], ...]:
    """Return all that the rooms and `wbc` itself export, each once, by its name."""
    found = {id(getattr(wbc, name)): (name, getattr(wbc, name)) for name in wbc.__all__}
    for module in modules():
        for name in getattr(module, "__all__", ()):
            found[id(getattr(module, name))] = name, getattr(module, name)
    return tuple((name, value) for name, value in found.values() if callable(value))


@functools.cache
def all_settings() -> tuple[type, ...]:
    """Return the classes of settings of all rooms."""
    kinds = {
        value
        for module in modules()
        for value in vars(module).values()
        if isinstance(value, type)
        and hasattr(value, "__pydantic_fields__")
        and value.__module__ == module.__name__
        and not value.__name__.startswith("_")
    }
    return tuple(sorted(kinds, key=lambda kind: f"{kind.__module__}.{kind.__qualname__}"))


def functions_of(name: str, value: Any) -> Iterator[tuple[str, Callable[..., Any], bool]]:
    """Yield the functions of an exported object that users call: name, function, and True where it is a door.

    A door, which takes no bare number, is a constructor, a setter, or a function by itself. Methods may be called in a
    tick, and state a range only where they check it.
    """
    if not isinstance(value, type):
        yield name, value, True
        return
    seen: set[str] = set()
    for kind in value.__mro__[:-1]:
        if not kind.__module__.startswith("wbc."):
            continue
        for attribute, member in vars(kind).items():
            if attribute in seen or (attribute.startswith("_") and attribute != "__init__"):
                continue
            seen.add(attribute)
            if getattr(member, "__isabstractmethod__", False):
                continue  # never called: what overrides it is a door
            if isinstance(member, property) and member.fset is not None:
                yield f"{name}.{attribute}", member.fset, True
            elif isinstance(member, (classmethod, staticmethod)):
                yield f"{name}.{attribute}", member.__func__, False
            elif inspect.isfunction(member):
                yield f"{name}.{attribute}", member, attribute == "__init__" and name not in RESULTS


@functools.cache
def arguments() -> tuple[tuple[Place, bool], ...]:
    """Return the arguments of all that is exported, but for settings, each with True where it is one of a door."""
    found: list[tuple[Place, bool]] = []
    for name, value in exported():
        if isinstance(value, type) and (
            hasattr(value, "__pydantic_fields__") or issubclass(value, (Exception, Enum))
        ):
            continue
        for of, function, door in functions_of(name, value):
            parameters = [*inspect.signature(function).parameters.values()]
            stand_in = type(name, (), {})()  # arguments are checked before the object is looked at
            first = [stand_in] if parameters and parameters[0].name in ("self", "cls") else []
            for argument, hint in hints_of(function).items():
                places = [i for i, p in enumerate(parameters) if p.name == argument]
                only_by_place = (
                    bool(places) and parameters[places[0]].kind is inspect.Parameter.POSITIONAL_ONLY
                )
                call = functools.partial(
                    give, function, first, None if only_by_place else argument, places[0] if places else 0
                )
                found.append((Place(call, of, argument, hint), door))
    return tuple(found)


def give(function: Callable[..., Any], first: list[Any], name: str | None, place: int, value: Any) -> object:
    if name is not None:
        return function(*first, **{name: value})
    return function(*first, *[None] * (place - len(first)), value)


def set_field(kind: Any, name: str, value: Any) -> None:
    """Give one field of settings a value, as their constructor does where all others are given as well."""
    try:
        concrete: Any = type(kind.__name__, (kind,), {})
        concrete.__abstractmethods__ = frozenset()
        kind.__pydantic_validator__.validate_python(
            ArgsKwargs((), {name: value}), self_instance=object.__new__(concrete)
        )
    except ValidationError as error:
        for each in error.errors():
            if each["loc"][0] == name:
                raise InputError(f"{name}: {each['msg']}") from None


def fields() -> list[Place]:
    """Return the fields of all settings."""
    return [
        Place(functools.partial(set_field, kind, name), kind.__qualname__, name, hint)
        for kind in all_settings()
        for name, hint in typing.get_type_hints(kind, include_extras=True).items()
        if name in kind.__pydantic_fields__  # type: ignore[attr-defined]
    ]


def numbers_in(hint: Any, metadata: tuple[Any, ...] = ()) -> Iterator[tuple[type, tuple[Any, ...]]]:
    """Yield the kinds of numbers in an annotation, float, int or `Numbers`, each with the rules that it states.

    Those inside a tuple, a mapping or a function are left out: for tuples and mappings, see `inside`.
    """
    origin, parts = typing.get_origin(hint), typing.get_args(hint)
    if origin is Annotated:
        rules = metadata + parts[1:]
        if any(isinstance(rule, Numbers) for rule in rules):
            yield Numbers, rules
        else:
            yield from numbers_in(parts[0], rules)
    elif origin in UNIONS:
        for part in parts:
            yield from numbers_in(part, metadata)
    elif hint in (float, int):
        yield hint, metadata


def inside(
    hint: Any, rules: tuple[Any, ...] = (), depth: int = 0
) -> Iterator[tuple[type, tuple[Any, ...], Any]]:
    """Yield the numbers inside tuples, sequences and mappings: kind, rules, and what puts a number in its place."""
    origin, parts = typing.get_origin(hint), typing.get_args(hint)
    if origin is Annotated:
        if not any(isinstance(rule, Numbers) for rule in parts[1:]):
            yield from inside(parts[0], rules + parts[1:] if parts[0] in (float, int) else (), depth)
    elif origin in UNIONS:
        for part in parts:
            yield from inside(part, rules, depth)
    elif origin is tuple and ... not in parts:
        for k, part in enumerate(parts):
            for kind, of, put in inside(part, (), depth + 1):
                around = [sample(each) for each in parts]
                yield kind, of, lambda x, k=k, put=put, around=around: (*around[:k], put(x), *around[k + 1 :])
    elif origin in (tuple, list, Sequence, Iterable):
        for kind, of, put in inside(parts[0], (), depth + 1):
            yield kind, of, lambda x, put=put: [put(x)]
    elif origin in (dict, Mapping):
        for kind, of, put in inside(parts[1], (), depth + 1):
            yield kind, of, lambda x, put=put: {"any": put(x)}
    elif hint in (float, int) and depth:
        yield hint, rules, lambda x: x


def sample(hint: Any) -> Any:
    """Return a value that an annotation of a number, a text or a tuple of them takes."""
    origin, parts = typing.get_origin(hint), typing.get_args(hint)
    if origin is Annotated:
        good = TypeAdapter(hint)
        return (
            next(value for value in (1, 0.5, 2) if valid(good, value))
            if parts[0] in (float, int)
            else sample(parts[0])
        )
    if origin in UNIONS:
        return sample(parts[0])
    if origin is tuple:
        return tuple(sample(part) for part in parts if part is not ...)
    return "any" if hint is str else None if hint is type(None) else 1


def valid(adapter: TypeAdapter[Any], value: Any) -> bool:
    try:
        adapter.validate_python(value)
    except ValidationError:
        return False
    return True


def outside(kind: type, rules: tuple[Any, ...]) -> list[Any]:
    """Return values just outside the range that rules state; with nothing stated, none."""
    values: list[Any] = []
    for rule in rules:
        if isinstance(rule, Numbers):
            above = math.nextafter(rule.above, math.inf) if math.isfinite(rule.above) else -math.inf
            low, high = max(rule.low, above), rule.high
            values += [
                math.nextafter(bound, bound + way)
                for bound, way in ((low, -1.0), (high, 1.0))
                if math.isfinite(bound)
            ]
            bad = math.nan, math.inf, "1.0", True
            values += bad if rule.shape is None else [[0.5] * (rule.shape[0] + 1)]
            for each in bad if rule.shape is not None and len(rule.shape) == 1 else ():
                values += [[each] * rule.shape[0], [0.5] * (rule.shape[0] - 1) + [each]]
        for each in getattr(rule, "metadata", ()) if isinstance(rule, FieldInfo) else ():
            for name, way in (("ge", -1), ("gt", 0), ("le", 1), ("lt", 0)):
                bound = getattr(each, name, None)
                if bound is not None:
                    near = (
                        bound + way if kind is int else math.nextafter(bound, bound + way) if way else bound
                    )
                    values.append(near)
    if kind is float and any(isinstance(rule, FieldInfo) for rule in rules):
        values += [math.nan, "1.0", True]
    return values


def refused(place: Place, value: Any) -> str:
    """Return what is wrong about how a value is refused; empty if it is refused by name."""
    try:
        place.call(value)
    except InputError as error:
        names = (place.name, place.of.rpartition(".")[2], "'any'")  # the last is that of a key
        return "" if any(name in str(error) for name in names) else f"unnamed: {error}"
    except Exception as error:
        return f"not checked first: {type(error).__name__}: {error}"
    return "taken"


def message(place: Place, value: Any) -> str:
    with pytest.raises(InputError) as refusal:
        place.call(value)
    return str(refusal.value)


def test_every_range_that_is_stated_is_kept() -> None:
    wrong: list[str] = []
    count: dict[str, int] = {}
    for group, places in (("arguments", [place for place, _ in arguments()]), ("fields", fields())):
        for place in places:
            for kind, rules in numbers_in(place.hint):
                for value in outside(kind, rules):
                    count[group] = count.get(group, 0) + 1
                    if fault := refused(place, value):
                        wrong.append(f"{place.of}({place.name}={value!r}): {fault}")
    assert not wrong, "\n".join(wrong)
    assert count["arguments"] > 100 and count["fields"] > 1000, count


def test_numbers_inside_tuples_sequences_and_mappings_are_checked() -> None:
    """Of doors, and of all else whose arguments are checked: each number must be one, finite and in its range."""
    wrong: list[str] = []
    count = 0
    places = [*(place for place, door in arguments() if door or is_checked(place)), *fields()]
    for place in [place for place in places if place.of not in BY_WHAT_IS_KNOWN]:
        for kind, rules, put in inside(place.hint):
            endless = any(
                getattr(each, "allow_inf_nan", False)
                for rule in rules
                for each in getattr(rule, "metadata", ())
            )
            values = [
                *outside(kind, rules),
                math.nan,
                "1.0",
                True,
                *([] if endless else [math.inf, -math.inf]),
            ]
            for value in values:
                count += 1
                if fault := refused(place, put(value)):
                    wrong.append(f"{place.of}({place.name}={put(value)!r}): {fault}")
    assert not wrong, "\n".join(wrong)
    assert count > 500, count


def test_numbers_are_checked_where_the_object_is_needed_for_it() -> None:
    robot = wbc.load_robot("hrp4_class").robot()
    stand = FootstepPlan.standing(robot)
    joint = robot.joint_names[0]
    for bad in (math.nan, math.inf, "1.0", True):
        for task in (PostureTask(), JointTorqueTask()):
            task.bind(robot)
            with pytest.raises(InputError, match=joint):
                task.target = {joint: bad}
            with pytest.raises(InputError, match=joint):
                type(task)({joint: bad}).bind(robot)
        for control in (
            WalkingControl(robot, stand, 0.002),
            WalkingControl(robot, stand, 0.002, WalkingControlSettings(mode="torque")),
        ):
            for velocity in ((bad, 0.0, 0.0), (0.0, bad, 0.0), (0.0, 0.0, bad)):
                with pytest.raises(InputError, match="velocity"):
                    control.velocity = velocity


def is_checked(place: Place) -> bool:
    return hasattr(place.call.args[0], "__wrapped__")


def test_every_number_of_a_door_has_a_range_or_says_that_it_has_none() -> None:
    bare = [
        f"{place.of}({place.name}: {place.hint})"
        for place in [*(place for place, door in arguments() if door), *fields()]
        for kind, rules in numbers_in(place.hint)
        if kind is float and not any(isinstance(rule, (FieldInfo, Numbers)) for rule in rules)
    ]
    assert not bare, "\n".join(bare)


def test_no_range_stands_where_nothing_reads_it() -> None:
    """`Annotated[Share, Positive]`: an annotation among the rules of another one checks nothing."""

    def inner(hint: Any) -> Iterator[Any]:
        if typing.get_origin(hint) is Annotated:
            yield from (rule for rule in typing.get_args(hint)[1:] if typing.get_origin(rule) is not None)
        for part in typing.get_args(hint):
            yield from inner(part)

    places = [*(place for place, _ in arguments()), *fields()]
    assert not [f"{place.of}({place.name}: {place.hint})" for place in places if any(inner(place.hint))]
    assert any(inner(Annotated[Share, Positive]))


def test_a_robot_is_told_from_its_description_and_its_name() -> None:
    description = wbc.load_robot("hrp4_class")
    robot = description.robot()
    wrong: list[str] = []
    count = {Robot: 0, RobotDescription: 0}
    for place, door in arguments():
        parts = typing.get_args(place.hint) if typing.get_origin(place.hint) in UNIONS else [place.hint]
        for kind in [kind for kind in count if kind in parts] if door else []:
            count[kind] += 1
            given = ((description, "description.robot()"), ("g1", "load_robot('g1')"), (7, "Robot"))
            if kind is RobotDescription:
                given = ((robot, "load_robot('hrp4_class')"), (7, "RobotDescription"))
            for value, advice in given:
                fault = refused(place, value)
                if not fault and advice not in message(place, value):
                    fault = f"says nothing of {advice}"
                if fault:
                    wrong.append(f"{place.of}({place.name}={value!r}): {fault}")
    assert not wrong, "\n".join(wrong)
    assert count[Robot] >= 12 and count[RobotDescription] >= 5, count
