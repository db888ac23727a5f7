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
        """Register a value under a new name.

        Args:
            name: The name.
            value: Its value.

        Raises:
            InputError: The name is not text, is empty or is taken.
        """
        if isinstance(name, str) and name in self:
            raise InputError(f"a {self.kind} '{name}' is registered already")
        self[name] = value


def call_checked(what: str, make: Callable[..., T], parameters: Mapping[str, Any]) -> T:
    """Call a function with named parameters, after a check that it takes them and gets those it needs.

    Args:
        what: Its name in messages: "foot 'soft'", "stiffness policy 'fixed'", …
        make: A class or function of named parameters.
        parameters: Names and values.

    Raises:
        UnknownNameError: It has no such parameter.
        InputError: A parameter that it needs is missing, or a value is out of range.
    """
    known = inspect.signature(make).parameters
    for name in parameters:
        choose(f"parameter of the {what}", name, known)
    for parameter in known.values():
        needed = parameter.default is parameter.empty and parameter.kind is not parameter.VAR_KEYWORD
        if needed and parameter.name not in parameters:
            raise InputError(f"the {what} needs a value for '{parameter.name}'")
    return make(**parameters)
