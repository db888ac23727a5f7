"""Registry: robots, feet, grounds, policies and trials by name, with the same errors everywhere."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from typing import Any, NoReturn, TypeVar

from wbc.core.errors import InputError, choose, shown, unknown_name

T = TypeVar("T")


class Registry(dict[str, T]):
    """A dictionary of names whose missing names raise an error with the nearest known ones.

    Attributes:
        kind: The noun of its messages: "robot", "foot", "terrain", …
    """

    def __init__(self, kind: str, entries: Mapping[str, T] | None = None) -> None:
        super().__init__(entries or {})
        self.kind = kind

    def __missing__(self, name: object) -> NoReturn:
        unknown_name(self.kind, name, self)

    def __setitem__(self, name: str, value: T) -> None:
        if not isinstance(name, str) or not name.strip():
            raise InputError(f"the name of a {self.kind} must be text, got {shown(name)}")
        super().__setitem__(name, value)

    def add(self, name: str, value: T) -> None:
        """Register a value under a new name; `InputError` if that is not text, is empty or is taken."""
        if isinstance(name, str) and name in self:
            raise InputError(f"a {self.kind} '{name}' is registered already")
        self[name] = value


def call_checked(what: str, make: Callable[..., T], parameters: Mapping[str, Any]) -> T:
    """Call a function, in messages `what`, with named parameters, after a check that it takes and gets what it needs.

    Raises `UnknownNameError` for a parameter that it does not have, `InputError` for one that is missing or out of
    range.
    """
    known = inspect.signature(make).parameters
    for name in parameters:
        choose(f"parameter of the {what}", name, known)
    for parameter in known.values():
        needed = parameter.default is parameter.empty and parameter.kind is not parameter.VAR_KEYWORD
        if needed and parameter.name not in parameters:
            raise InputError(f"the {what} needs a value for '{parameter.name}'")
    return make(**parameters)
