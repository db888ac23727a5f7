"""Feet by name."""

from __future__ import annotations

import dataclasses
from functools import lru_cache
from typing import Any

from wbc.base.checked import checked
from wbc.base.errors import InputError, shown
from wbc.base.registry import Registry, call_checked
from wbc.base.settings import Changes, changed, normal_changes
from wbc.feet.soles.foot import Foot
from wbc.feet.soles.rigid import FlatFoot, RigidFoot
from wbc.feet.soles.soft import IitSoftFoot, LongArchFoot, PaperFoot, SoftFoot, VariableStiffnessFoot


def _check(kind: object) -> None:
    if not (isinstance(kind, type) and issubclass(kind, Foot)):
        raise InputError(f"a foot is registered by its class, derived from Foot, got {shown(kind)}")
    known = getattr(kind, "__pydantic_fields__", {})
    for field in dataclasses.fields(kind) if dataclasses.is_dataclass(kind) else ():
        if field.name not in known:
            raise InputError(
                f"the field '{field.name}' of {kind.__name__} is unknown to its constructor: decorate the class with "
                "@settings of wbc.base.settings"
            )


_FEET: Registry[type[Foot]] = Registry(
    "foot",
    {
        "flat": FlatFoot,
        "rigid": RigidFoot,
        "soft": SoftFoot,
        "long_arch": LongArchFoot,
        "variable": VariableStiffnessFoot,
        "paper": PaperFoot,
        "iit_softfoot": IitSoftFoot,
    },
    group="wbc.feet",
    check=_check,
)


def foot_names() -> tuple[str, ...]:
    """Return the names that `foot` takes."""
    return _FEET.names()


@checked
def foot(name: str, **parameters: Any) -> Foot:
    """Return a foot by name, with some of its parameters changed.

    Example: `foot("soft", stiffness=5.0)`. Parameters are fields of the foot's class.
    """
    return call_checked(f"foot '{name}'", _FEET[name], parameters)


@lru_cache(maxsize=256)
def changed_foot(name: str, stiffness: float | None, changes: Changes) -> Foot:
    """Return a foot by its name, with a stiffness of its hinges, Nm/rad, unless it is None, and other parameters."""
    design = foot(name)
    if stiffness is not None:
        if not hasattr(design, "stiffness"):
            raise InputError(f"a {name} foot has no stiffness; leave it out, or take a soft foot")
        changes = (*changes, ("stiffness", stiffness))
    return changed(design, changes)


def foot_changes(name: str, changes: Changes) -> Changes:
    """Return further parameters of a foot with full names; `InputError` for its stiffness."""
    normal = normal_changes(foot(name), changes)
    if any(path == "stiffness" for path, _ in normal):
        raise InputError("the stiffness of a foot is an option of its own, not one of its further parameters")
    return normal


def foot_name(design: Foot) -> str:
    """Return the name under which a foot's class is registered, or the name of the class if it is not."""
    return next((name for name, kind in _FEET.items() if kind is type(design)), type(design).__name__)


def register_foot(name: str, kind: type[Foot]) -> None:
    """Register a foot of your own, a class with `@settings` derived from `Foot`, for `foot` and the command line.

    Raises:
        InputError: The name is taken by another foot, or the constructor of the class does not know its fields, because
            the class has no `@settings`.
    """
    _FEET.add(name, kind)
