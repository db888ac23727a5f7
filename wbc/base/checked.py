"""Arguments that are checked against their annotations: of constructors, attributes and functions that users call.

    class TorqueLimits(Limit):
        @checked
        def __init__(self, *, ratio: Ratio = 1.0, rate: PositiveNumbers | None = None) -> None: ...

The annotation is the check: type, range, shape, choices and unit, as in `wbc.base.settings`. It takes a microsecond for
each argument, so what runs in every tick goes without it.
"""

from __future__ import annotations

import collections.abc
import functools
import inspect
import types
import typing
from collections.abc import Callable, Iterator
from typing import Annotated, Any, Literal, NoReturn, TypeVar, Unpack

import numpy as np
from pydantic import PlainValidator, Strict, TypeAdapter, ValidationError

from wbc.base.errors import InputError, unknown_name
from wbc.base.numbers import read_only
from wbc.base.settings import CONFIG, Numbers, hashable, members_of, refuse

F = TypeVar("F", bound=Callable[..., Any])

NUMBERS = (float, int)
"""Types with values that are refused, such as NaN."""

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
    table: tuple[list[tuple[int, ArgumentCheck]], dict[str, ArgumentCheck], set[str] | None] | None = None

    @functools.wraps(function)
    def call(*args: Any, **values: Any) -> Any:
        nonlocal table
        if table is None:  # only now, as annotations may name classes that are defined further down
            by_name = {
                name: ArgumentCheck(function, name, hint) for name, hint in checkable(function).items()
            }
            kinds = [(each.name, each.kind) for each in inspect.signature(function).parameters.values()]
            places = [name for name, kind in kinds if kind <= inspect.Parameter.POSITIONAL_OR_KEYWORD]
            table = (
                [(places.index(name), by_name[name]) for name in by_name if name in places],
                by_name,
                _names(function),
            )
        by_place, by_name, names = table
        if names is not None and not names.issuperset(values):
            owner, method = function.__qualname__.rpartition("<locals>.")[2], ".__init__"
            wrong = next(name for name in values if name not in names)
            unknown_name(f"argument of {owner.removesuffix(method)}", wrong, names - {"self", "cls"})
        given, count = list(args), len(args)
        for place, check in by_place:
            if place < count and type(given[place]) not in check.taken:
                given[place] = check(given[place], args)
        for name, value in values.items():
            if name in by_name and type(value) not in by_name[name].taken:
                values[name] = by_name[name](value, args)
        return function(*given, **values)

    return typing.cast(F, call)


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
    """Attribute that shows another one, of which arrays cannot be written: its name, and what to do instead."""

    def __init__(self, source: str, instead: str) -> None:
        """Take the name of the attribute with the value, and what to do in place of an assignment."""
        super().__init__(instead)
        self._source = source

    def __get__(self, of: Any, owner: type) -> Any:
        """Return the value."""
        if of is None:
            return self
        value = getattr(of, self._source)
        return read_only(value) if isinstance(value, np.ndarray) else value

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


def _names(function: Callable[..., Any]) -> set[str] | None:
    """Return the names that arguments of a function can have; None if it takes any."""
    of_any = inspect.Parameter.VAR_KEYWORD
    kinds = {each.name: each.kind for each in inspect.signature(function).parameters.values()}
    known = {name for name, kind in kinds.items() if kind not in (of_any, inspect.Parameter.POSITIONAL_ONLY)}
    if of_any in kinds.values():
        options = hints_of(function).keys() - kinds.keys()
        return known | options if options else None
    return known


def checkable(function: Callable[..., Any]) -> dict[str, Any]:
    """Return the annotations of a function that `checked` checks, by the name of the argument."""
    return {name: hint for name, hint in hints_of(function).items() if _for_pydantic(hint) is not None}


class ArgumentCheck:
    """Check of one argument against its annotation.

    Attributes:
        taken: Types of which every value is right, and passed on as it is.
    """

    def __init__(self, function: Callable[..., Any], name: str, hint: Any) -> None:
        """Prepare the check of an argument of a function."""
        self._validate = TypeAdapter(_for_pydantic(hint), config=CONFIG).validator.validate_python
        self.taken = frozenset(
            part for part in members_of(hint) if isinstance(part, type) and part not in NUMBERS
        )
        self._plain = not any(isinstance(part, Numbers) for part in _parts(hint))
        self._is_method = next(iter(inspect.signature(function).parameters)) in ("self", "cls")
        self._hint, self._name, self._of = hint, name, function.__qualname__.rpartition("<locals>.")[2]
        if self._is_method:  # of a class that derives, perhaps, from the one that has it
            self._of = "" if function.__name__ == "__init__" else function.__name__
        if name == "value":
            self._name, self._of = function.__name__, ""

    def __call__(self, value: Any, args: tuple[Any, ...]) -> Any:
        """Return the value as its annotation has it; `args` begin with the object whose method is called."""
        try:
            return self._validate(hashable(value) if self._plain and type(value) not in NUMBERS else value)
        except ValidationError as error:
            owner = type(args[0]) if self._is_method and not isinstance(args[0], type) else None
            owner = owner or (args[0] if self._is_method else None)
            of = ".".join(filter(None, (getattr(owner, "__name__", ""), self._of)))
            refuse(error, value, self._hint, f"{self._name} of {of}")


def _for_pydantic(hint: Any) -> Any:
    """Return the annotation as Pydantic takes it, with classes as checks of instances; None if it is not checked."""
    origin, args = typing.get_origin(hint), typing.get_args(hint)
    if origin in (Literal, collections.abc.Callable) or hint in (float, int, bool, str, type(None)):
        return hint
    if origin is Annotated:
        numbers = next((item for item in args[1:] if isinstance(item, Numbers)), None)
        inside = (
            _for_pydantic(args[0]) if numbers is None else Annotated[Any, PlainValidator(numbers.checked)]
        )
        return None if inside is None else Annotated[inside, *args[1:]]
    if origin is not None:
        parts = tuple(part if part is ... else _for_pydantic(part) for part in args)
        if None in parts:
            return None
        if len(members_of(hint)) > 1:
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


def _parts(hint: Any) -> Iterator[Any]:
    """Yield an annotation and everything inside it."""
    yield hint
    for part in typing.get_args(hint):
        yield from _parts(part)
