"""Robots by name."""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

from wbc.base.checked import checked
from wbc.base.errors import InputError, shown
from wbc.base.files import existing
from wbc.base.registry import Registry
from wbc.robots import files
from wbc.robots.description import RobotDescription
from wbc.robots.models import example_robots, hrp4_class

_FACTORIES: Registry[Callable[[], RobotDescription]] = Registry(
    "robot",
    {
        "hrp4_class": hrp4_class.describe,
        "talos": example_robots.talos,
        "g1": example_robots.g1,
        "panda": example_robots.panda,
        "go1": example_robots.go1,
    },
    group="wbc.robots",
)

_FEETLESS = ("panda", "go1")
"""Built-in robots without feet."""


def names() -> tuple[str, ...]:
    """Return the names of the built-in robots with feet, and then of the registered ones."""
    return tuple(name for name in _FACTORIES if name not in _FEETLESS)


def others() -> tuple[str, ...]:
    """Return the other robots that `load` knows: those without feet, those of other packages.

    A package offers robots by entry points of the group "wbc.robots".
    """
    return (*_FACTORIES.offered(), *_FEETLESS)


@checked
def register(name: str, factory: Callable[[], RobotDescription]) -> None:
    """Register a robot under a name; `load` calls the factory of its description once.

    The same line may run again, as in a notebook: its factory takes the place of the one before.

    Raises:
        InputError: The name is taken by another robot.
    """
    _FACTORIES.add(name, factory)


def name_of(robot: RobotDescription | Any) -> Any:
    """Return the name by which `load` finds a description in this process; what is none is returned as it is.

    A copy of a built-in robot, such as one from another process, has the name of that robot.
    """
    if not isinstance(robot, RobotDescription):
        return robot
    known = _FACTORIES.get(robot.name)
    if known is not None and _load(robot.name, known).digest == robot.digest:
        return robot.name
    name = f"{robot.name}#{robot.digest}"
    _GIVEN[name] = robot
    return name


_GIVEN: dict[str, RobotDescription] = {}
"""Descriptions that were given where a name is kept: name with the hash of the content → description."""


STAMPED = re.compile(r"(.+)#([0-9a-f]{12})", re.DOTALL)
"""Name of a robot in a file with the hash of what was in the file."""


def stamped(name: str) -> str:
    """Return a robot's name as specs keep it: that of a robot in a file with the hash of its content behind it.

    So results of one file are not taken for those of another that has its name.
    """
    description = load(name)
    if name in _FACTORIES or name in _GIVEN or STAMPED.fullmatch(name) or not files.is_path(name):
        return name
    return f"{name}#{description.digest}"


@checked
def load(name: str | Path) -> RobotDescription:
    """Return the description of a robot; every call with the same name returns the same object.

    Of a file it does until it has changed, see `wbc.robots.files.read`.

    Args:
        name: One of `names()` or `others()`, or the path of an MJCF, a URDF or a TOML description.
    """
    name = str(name)
    if name in _GIVEN:
        return _GIVEN[name]
    if name not in _FACTORIES and (stamp := STAMPED.fullmatch(name)):
        description = load(stamp[1])
        if description.digest != stamp[2]:
            raise InputError(
                f"robot {stamp[1]} has changed: a spec has its content {stamp[2]}, now it is {description.digest}"
            )
        return description
    if name not in _FACTORIES and files.is_path(name):
        return files.read(existing(name, "robot", "an MJCF, a URDF or a TOML description"))
    return _load(name, _FACTORIES[name])


@checked
def as_description(description: RobotDescription | str) -> RobotDescription:
    """Return a description as it is, that of a robot by its name."""
    return load(description) if isinstance(description, str) else description


@cache
def _load(name: str, factory: Callable[[], RobotDescription]) -> RobotDescription:
    description: object = factory()
    if not isinstance(description, RobotDescription):
        raise InputError(
            f"the factory of robot '{name}' must return a RobotDescription, got {shown(description)}"
        )
    return description
