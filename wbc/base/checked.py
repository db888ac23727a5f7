"""Arguments that are checked against their annotations: of constructors, attributes and functions that users call.

    class TorqueLimits(Limit):
        @checked
        def __init__(self, *, ratio: Ratio = 1.0, rate: PositiveNumbers | None = None) -> None: ...

The annotation is the check: type, range, shape, choices and unit, as in `wbc.base.settings`. It takes some microseconds
a call, so what runs in every tick goes without it.
"""

from __future__ import annotations

import collections.abc
import functools
import inspect
import operator
import types
import typing
from collections.abc import Callable
from typing import Annotated, Any, Literal, NoReturn, TypeVar, Unpack

import numpy as np
from pydantic import BeforeValidator, PlainValidator, Strict, TypeAdapter, ValidationError
from pydantic_core import CoreSchema, SchemaValidator
from pydantic_core.core_schema import CoreConfig, typed_dict_field, typed_dict_schema

from wbc.base.errors import InputError, unknown_name
from wbc.base.numbers import read_only
from wbc.base.settings import CONFIG, UNIONS, Numbers, hashable, refuse

F = TypeVar("F", bound=Callable[..., Any])

SEQUENCES = (list, collections.abc.Sequence, collections.abc.Iterable)
MAPPINGS = (dict, collections.abc.Mapping)


def checked(function: F) -> F:
    """Check the arguments of a function against its annotations at every call.

    Numbers, texts, choices, arrays with `Numbers`, functions and objects of classes are checked, alone, in a union, and
    in tuples, sequences and mappings. An annotation with any other part, such as a protocol or `ArrayLike`, checks
    nothing. NumPy numbers become Python's, arrays with `Numbers` become float64, sequences become tuples and mappings
    become dicts. Defaults are taken as they are.

    Args:
        function: A function, a method, a constructor, or the setter of a property: its argument is named `value`, and
            has the name of the property in messages. Of a dataclass, the constructor is checked.

    Returns:
        The function. A call raises an `InputError` for the first argument that breaks a rule (name, unit, rule, value),
        and for an argument of a name that there is not, with the nearest names.
    """
    if inspect.isclass(function):
        setattr(function, "__init__", checked(function.__init__))  # noqa: B010 (no assignment to a method for mypy)
        return function
    arguments: Arguments | None = None

    @functools.wraps(function)
    def call(*args: Any, **values: Any) -> Any:
        nonlocal arguments
        if arguments is None:  # only now, as annotations may name classes that are defined further down
            arguments = Arguments(function)
        given, named = arguments.check(args, values)
        return function(*given, **named)

    return typing.cast(F, call)


class Arguments:
    """Check of the arguments of a function: to Pydantic they are a dictionary with a type for each name."""

    def __init__(self, function: Callable[..., Any]) -> None:
        """Prepare the check of a function."""
        kinds = inspect.signature(function).parameters.values()
        self._places = [each.name for each in kinds if each.kind <= inspect.Parameter.POSITIONAL_OR_KEYWORD]
        self._names, self._hints, self._function = names_of(function), hints_of(function), function
        self._is_method = self._places[:1] in (["self"], ["cls"])
        self._sets = self._is_method and self._places[1:] == ["value"]
        names = dict.fromkeys((*self._places, *(self._names or ()), *self._hints))
        fields = {name: typed_dict_field(_schema(self._hints.get(name)), required=False) for name in names}
        config = CoreConfig(strict=True, allow_inf_nan=False)
        schema = typed_dict_schema(fields, extra_behavior="allow", config=config)
        self._validate = SchemaValidator(schema).validate_python

    def check(self, args: tuple[Any, ...], values: dict[str, Any]) -> tuple[list[Any], dict[str, Any]]:
        """Return arguments, those given by place and those by name, as their annotations have them."""
        if self._names is not None and not self._names.issuperset(values):
            wrong = next(name for name in values if name not in self._names)
            unknown_name(f"argument of {self._owner(args)}", wrong, self._names - {"self", "cls"})
        given = dict(zip(self._places, args, strict=False))
        if not given.keys().isdisjoint(values):
            self._function(*args, **values)  # raises Python's error for an argument that is given twice
        given |= values
        try:
            right = self._validate(given)
        except ValidationError as error:
            refuse(error, given, self._hints, lambda place: self._named(place, args))
        named = {name: right.pop(name) for name in values}
        return [*right.values(), *args[len(self._places) :]], named

    def _named(self, place: str, args: tuple[Any, ...]) -> str:
        """Return an argument, or a place in it, with its owner; that of a setter is called as the property."""
        name = place.replace("value", self._function.__name__, 1) if self._sets else place
        return f"{name} of {self._owner(args)}"

    def _owner(self, args: tuple[Any, ...]) -> str:
        """Return the function, or the class whose constructor or property it is; one that derives is named itself."""
        *_, name = self._function.__qualname__.rpartition("<locals>.")
        if not self._is_method or not args:
            return name
        owner = args[0] if isinstance(args[0], type) else type(args[0])
        is_own = self._sets or self._function.__name__ == "__init__"
        return owner.__name__ if is_own else f"{owner.__name__}.{self._function.__name__}"


class Fixed:
    """Attribute that is set once, when its object is made; it is read as fast as any other one.

    class Plant:
        control_period: float = fixed("make another plant")
    """

    def __init__(self, instead: str) -> None:
        """Say what to do in place of an assignment."""
        self._instead = instead

    def __set_name__(self, owner: type, name: str) -> None:
        """Take the name of the attribute."""
        self._name = name

    def __set__(self, of: Any, value: Any) -> None:
        """Set the value of an object that has none yet; raise an `InputError` for one that has it."""
        if self._name in vars(of):
            self._refuse(of)
        vars(of)[self._name] = value

    def _refuse(self, of: Any) -> NoReturn:
        raise InputError(f"{self._name} of {type(of).__name__} cannot be assigned: {self._instead}")


class Result(Fixed):
    """Attribute that shows another one, of which arrays and dictionaries cannot be written."""

    def __init__(self, source: str, instead: str) -> None:
        """Take the attribute with the value, such as "gate.faults", and what to do in place of an assignment."""
        super().__init__(instead)
        self._value = operator.attrgetter(source)

    def __get__(self, of: Any, owner: type) -> Any:
        """Return the value."""
        if of is None:
            return self
        value = self._value(of)
        if isinstance(value, np.ndarray):
            return read_only(value)
        return types.MappingProxyType(value) if type(value) is dict else value

    def __set__(self, of: Any, value: Any) -> None:
        """Raise an `InputError`."""
        self._refuse(of)


fixed: Callable[[str], Any] = Fixed
result: Callable[[str, str], Any] = Result


def hints_of(function: Callable[..., Any]) -> dict[str, Any]:
    """Return the annotations of the arguments of a function, with those of the options that it takes as `**options`."""
    function = inspect.unwrap(function)
    hints: dict[str, Any] = {}
    for name, text in function.__annotations__.items():
        alone = types.SimpleNamespace(__annotations__={name: text})
        try:
            hint = typing.get_type_hints(alone, function.__globals__, include_extras=True)[name]
        except NameError:  # a class that is imported for type checkers alone
            continue
        if typing.get_origin(hint) is Unpack:
            hints |= typing.get_type_hints(typing.get_args(hint)[0], include_extras=True)
        elif name != "return":
            hints[name] = hint
    return hints


def names_of(function: Callable[..., Any]) -> set[str] | None:
    """Return the names by which a function takes arguments; None if it takes any."""
    of_any = inspect.Parameter.VAR_KEYWORD
    kinds = {name: each.kind for name, each in inspect.signature(function).parameters.items()}
    known = {name for name, kind in kinds.items() if kind not in (of_any, inspect.Parameter.POSITIONAL_ONLY)}
    if of_any in kinds.values():
        options = hints_of(function).keys() - kinds.keys()
        return known | options if options else None
    return known


def _schema(hint: Any) -> CoreSchema:
    """Return Pydantic's schema of an annotation, arrays and NumPy's numbers as plain values; of any value for None."""
    inside = _for_pydantic(hint)
    if inside is None:
        return TypeAdapter(Any).core_schema
    whole: Any = inside if _has_arrays(hint) else Annotated[inside, BeforeValidator(hashable)]
    return TypeAdapter(whole, config=CONFIG).core_schema


def _has_arrays(hint: Any) -> bool:
    return isinstance(hint, Numbers) or any(map(_has_arrays, typing.get_args(hint)))


def _for_pydantic(hint: Any) -> Any:
    """Return the annotation as Pydantic takes it, with classes as checks of instances; None if it is not checked."""
    origin, args = typing.get_origin(hint), typing.get_args(hint)
    if origin in (Literal, collections.abc.Callable) or hint in (float, int, bool, str, type(None)):
        return hint
    if origin is Annotated:
        inside = args[0] if _has_arrays(hint) else _for_pydantic(args[0])
        return None if inside is None else Annotated[inside, *args[1:]]
    if origin is not None:
        parts = tuple(part if part is ... else _for_pydantic(part) for part in args)
        if None in parts:
            return None
        if origin in UNIONS:
            return typing.Union[parts]  # noqa: UP007 (made of a tuple)
        if origin in MAPPINGS:
            return Annotated[types.GenericAlias(dict, parts), Strict(False)]
        if origin in SEQUENCES:
            return Annotated[types.GenericAlias(tuple, (parts[0], ...)), Strict(False)]
        return tuple[parts] if origin is tuple else None  # type: ignore[valid-type]
    if not isinstance(hint, type) or getattr(hint, "_is_protocol", False) or hint is Any:
        return None
    if hint.__module__ in ("builtins", "types", "collections.abc"):
        return None
    return Annotated[Any, PlainValidator(functools.partial(_instance, hint))]


def _instance(kind: type, value: Any) -> Any:
    if isinstance(value, kind):
        return value
    advice = kind.instead_of(value) if hasattr(kind, "instead_of") else ""
    raise ValueError(f"must be of class {kind.__name__}{f' ({advice})' if advice else ''}")
