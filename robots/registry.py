"""Robots by name."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

from wbc.core.errors import InputError, unknown_name
from wbc.robots.description import RobotDescription
from wbc.robots.models import example_robots, hrp4_class

_FACTORIES: dict[str, Callable[[], RobotDescription]] = {
    "hrp4_class": hrp4_class.describe,
    "talos": example_robots.talos,
    "g1": example_robots.g1,
}


def names() -> tuple[str, ...]:
    """Names that `load` knows, built-in robots first."""
    return tuple(_FACTORIES)


def register(name: str, factory: Callable[[], RobotDescription]) -> None:
    """Make a robot known by name.

    Args:
        name: Name for `load`.
        factory: Makes the description, once, when it is first asked for.

    Raises:
        InputError: The name is taken.
    """
    if name in _FACTORIES:
        raise InputError(f"a robot '{name}' is registered already")
    _FACTORIES[name] = factory


def load(name: str) -> RobotDescription:
    """Return the description of a robot.

    Args:
        name: One of `names()`.

    Returns:
        Its description; the same object every time.

    Raises:
        UnknownNameError: No such robot; the nearest names are given.
    """
    if name not in _FACTORIES:
        unknown_name("robot", name, _FACTORIES)
    return _load(name)


@cache
def _load(name: str) -> RobotDescription:
    return _FACTORIES[name]()
