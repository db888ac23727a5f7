"""Checks of the arguments of public functions and constructors against their annotations.

    @checked
    def walk_distance(start: FootstepPlan, distance: float, *, first: str = "left") -> FootstepPlan: ...

    walk_distance(None, 1.0)  # InputError: start must be FootstepPlan, got None

Settings check themselves (`wbc.core.settings`); `checked` does it for everything else that a user calls. Functions of
the tick are `checked_on_failure`: a good call costs nothing.
"""

from __future__ import annotations

import functools
import inspect
import types
import typing
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Annotated, Any, Literal, ParamSpec, TypeVar

import numpy as np
from numpy.typing import ArrayLike
from pydantic import PlainValidator, TypeAdapter, ValidationError

from wbc.core.errors import Array, InputError, choose, finite_array, shown, unknown_name
from wbc.core.settings import CONFIG, choices_of, plain_value, rule_of, unit_of, unusable

P = ParamSpec("P")
T = TypeVar("T")

SIMPLE = (bool, int, float, str, type(None))

WRONG = (TypeError, ValueError, LookupError, AttributeError, ArithmeticError, RecursionError)
"""Exceptions that a wrong argument causes in code that does not expect it."""


def checked(function: Callable[P, T]) -> Callable[P, T]:
    """Decorate a public function or constructor: its arguments are checked against its annotations before it runs.

    Numbers are finite, arrays hold finite numbers, objects are instances of their class, callables can be called.
    Of `**options: Unpack[Options]` each is checked like a parameter. Protocols are not looked at; annotations must be
    importable at run time. The function raises `InputError` naming the argument, the rule and the value.
    """
    signature = _spelled_out(function)

    @functools.wraps(function)
    def call(*args: P.args, **kwargs: P.kwargs) -> T:
        _check(function, signature, args, kwargs)
        return function(*args, **kwargs)

    return call


def _spelled_out(function: Callable[..., Any]) -> inspect.Signature:
    """Return the signature of a function in which `**options: Unpack[Options]` is each option by itself.

    The default of an option that may be None is None there, that of any other `...`. Help shows the same.
    """
    signature = inspect.signature(function)
    parameters = [*signature.parameters.values()]
    if not parameters or "Unpack" not in str(parameters[-1].annotation):
        return signature
    last = parameters.pop()
    hint = types.SimpleNamespace(__annotations__={last.name: last.annotation})
    names = getattr(function, "__globals__", {})
    (options,) = typing.get_args(typing.get_type_hints(hint, globalns=names)[last.name])
    vars(function)["__options__"] = kinds = typing.get_type_hints(options, include_extras=True)
    for name, kind in kinds.items():
        default = None if type(None) in typing.get_args(kind) else ...
        text = getattr(options.__annotations__[name], "__forward_arg__", kind)
        parameters.append(
            inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=text)
        )
    vars(function)["__signature__"] = signature = signature.replace(parameters=parameters)
    return signature


def checked_on_failure(function: Callable[P, T]) -> Callable[P, T]:
    """Decorate a public function of the tick: its arguments are checked only when it raises."""
    signature = inspect.signature(function)

    @functools.wraps(function)
    def call(*args: P.args, **kwargs: P.kwargs) -> T:
        try:
            return function(*args, **kwargs)
        except InputError:
            raise
        except WRONG as error:
            _check(function, signature, args, kwargs)
            raise InputError(f"{function.__name__} cannot use its arguments: {error}") from error

    return call


def check_fields(value: Any) -> None:
    """Check the fields of a dataclass that is not made with `@settings`, for its `__post_init__`; lists become tuples.

    Of one that derives from settings those fields are checked which it inherits, by the rules that they have there.
    Raises `InputError` for a field that does not agree with its annotation.
    """
    kinds = type(value).__mro__
    kind = next((each for each in kinds if "__pydantic_validator__" in vars(each)), kinds[0])
    for name, (rule, hint) in _rules_of(kind).items():
        given = getattr(value, name)
        checked = _check_one(name, given, rule, hint)
        if isinstance(given, list):
            object.__setattr__(value, name, checked)


def _check(
    function: Callable[..., Any],
    signature: inspect.Signature,
    args: Sequence[Any],
    kwargs: Mapping[str, Any],
) -> None:
    rules = _rules_of(function)
    if not any(each.kind is each.VAR_KEYWORD for each in signature.parameters.values()):
        for name in kwargs:
            choose(
                f"parameter of {function.__qualname__.removesuffix('.__init__')}", name, signature.parameters
            )
    for name, value in signature.bind(*args, **kwargs).arguments.items():
        if name in rules:
            _check_one(name, value, *rules[name])


def _check_one(name: str, value: Any, rule: TypeAdapter[Any], hint: Any) -> Any:
    unit = unit_of(hint)
    what = f"{name} ({unit})" if unit else name
    try:
        given = rule.validate_python(plain_value(value))
    except (ValidationError, RecursionError, OverflowError):
        choices = choices_of(hint)
        if choices and isinstance(value, str):
            unknown_name(name.replace("_", " "), value, choices)
        raise InputError(f"{what} must be {rule_of(hint)}, got {shown(value)}") from None
    reason = unusable(given)
    if reason:
        raise InputError(f"{what} must be {reason}, got {shown(value)}")
    return given


@functools.cache
def _rules_of(owner: Any) -> dict[str, tuple[TypeAdapter[Any], Any]]:
    """Rule and annotation of every parameter of a function, or field of a class, that can be checked."""
    if isinstance(owner, type):
        hints = typing.get_type_hints(owner, include_extras=True)
    else:
        several = (inspect.Parameter.VAR_KEYWORD, inspect.Parameter.VAR_POSITIONAL)
        parameters = inspect.signature(owner).parameters.values()
        options = getattr(owner, "__options__", {})
        texts = {each.name: each.annotation for each in parameters if each.kind not in several}
        texts = {
            n: text for n, text in texts.items() if text is not inspect.Parameter.empty and n not in options
        }
        alone = types.SimpleNamespace(
            __annotations__=texts
        )  # what it returns may be known to type checkers alone
        names = getattr(inspect.unwrap(owner), "__globals__", {})
        hints = typing.get_type_hints(alone, globalns=names, include_extras=True) | options
    rules = {}
    for name, hint in hints.items():
        if typing.get_origin(hint) is not typing.ClassVar:
            rule = _rule(hint)
            if rule is not Any:
                rules[name] = (TypeAdapter(rule, config=CONFIG), hint)
    return rules


def _numbers(value: Any) -> Any:
    if not isinstance(value, tuple):
        raise ValueError("a single value")
    return finite_array("values", value)


Numbers = Annotated[Any, PlainValidator(_numbers)]


def _rule(hint: Any) -> Any:
    """Return an annotation as Pydantic checks it: classes by their instances, arrays by their numbers."""
    origin, inside = typing.get_origin(hint), typing.get_args(hint)
    if hint in (ArrayLike, Any):
        return Any  # `finite_array` checks it where its shape and unit are known
    if origin is np.ndarray:
        return Numbers if hint == Array else _instance(np.ndarray)
    if origin is Annotated:
        return Annotated[(_rule(inside[0]), *inside[1:])] if inside[0] in SIMPLE else _rule(inside[0])
    if origin in (typing.Union, types.UnionType):
        rules = [_rule(each) for each in inside]
        if any(rule is Any for rule in rules):
            return Any
        return typing.Union[tuple(rules)]  # noqa: UP007
    if origin is tuple:
        return tuple[tuple(each if each is ... else _rule(each) for each in inside)]  # type: ignore[misc]
    if origin in (Sequence, list):
        return tuple.__class_getitem__((_rule(inside[0]), ...))
    if origin in (Mapping, dict):
        return Annotated[Any, PlainValidator(_mapping_check(_rule(inside[0]), _rule(inside[1])))]
    if origin is Literal:
        return hint
    if origin in (Iterable, Callable):
        return _instance(origin)
    if hint in SIMPLE:
        return hint
    special = getattr(hint, "_is_protocol", False) or hasattr(hint, "__total__") or hint is object
    return _instance(hint) if isinstance(hint, type) and origin is None and not special else Any


def _instance(kind: Any) -> Any:
    def check(given: Any) -> Any:
        if not isinstance(given, kind):
            raise ValueError("another class")
        return given

    return Annotated[Any, PlainValidator(check)]


def _mapping_check(key: Any, value: Any) -> Callable[[Any], Any]:
    items = TypeAdapter(tuple[tuple[key, value], ...], config=CONFIG)

    def check(given: Any) -> Any:
        if not isinstance(given, Mapping):
            raise ValueError("no mapping")
        if not isinstance(given, (dict, types.MappingProxyType)):
            return given  # it may make its values when they are asked for
        return items.validate_python(tuple((k, plain_value(v)) for k, v in given.items()))

    return check
