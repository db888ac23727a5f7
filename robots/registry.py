"""Robots by name."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

from wbc.core.arguments import checked
from wbc.core.registry import Registry
from wbc.robots.description import RobotDescription
from wbc.robots.models import example_robots, hrp4_class

_FACTORIES: Registry[Callable[[], RobotDescription]] = Registry(
    "robot",
    {"hrp4_class": hrp4_class.describe, "talos": example_robots.talos, "g1": example_robots.g1},
)


def names() -> tuple[str, ...]:
    """Return the names that `load` takes, built-in robots first."""
    return tuple(_FACTORIES)


def register(name: str, factory: Callable[[], RobotDescription]) -> None:
    """Register a robot under a name.

    Args:
        name: Name for `load`.
        factory: Function that returns the description; `load` calls it once.

    Raises:
        InputError: The name is not text, is empty or is taken.
    """
    _FACTORIES.add(name, factory)


@checked
def load(name: str) -> RobotDescription:
    """Return the description of a robot, the same object at every call.

    Args:
        name: One of `names()`.

    Raises:
        UnknownNameError: No such robot; the nearest names are given.
    """
    return _load(name)


@cache
def _load(name: str) -> RobotDescription:
    return _FACTORIES[name]()
