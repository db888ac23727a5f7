"""Feet by name."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

from wbc.core.errors import choose
from wbc.feet.soles.foot import Foot
from wbc.feet.soles.rigid import FlatFoot, RigidFoot
from wbc.feet.soles.soft import LongArchFoot, SoftFoot, VariableStiffnessFoot

_FEET: dict[str, type[Foot]] = {
    "flat": FlatFoot,
    "rigid": RigidFoot,
    "soft": SoftFoot,
    "long_arch": LongArchFoot,
    "variable": VariableStiffnessFoot,
}


def foot_names() -> tuple[str, ...]:
    """Names that `foot` accepts."""
    return tuple(_FEET)


def foot(name: str, **parameters: Any) -> Foot:
    """A foot by name, with some of its parameters changed.

    Example: `foot("soft", stiffness=5.0)`.

    Args:
        name: One of `foot_names()`.
        **parameters: Fields of the foot's class.

    Raises:
        UnknownNameError: No such foot, or no such parameter of this foot.
        InputError: A parameter out of its range.
    """
    kind = _FEET[choose("foot", name, _FEET)]
    known = [f.name for f in fields(kind)]
    for parameter in parameters:
        choose(f"parameter of the foot '{name}'", parameter, known)
    return kind(**parameters)


def foot_name(design: Foot) -> str:
    """Name of a foot's kind: the one that `foot` takes, or that of its class if it is not registered."""
    return next((name for name, kind in _FEET.items() if kind is type(design)), type(design).__name__)


def register_foot(name: str, kind: type[Foot]) -> None:
    """Make a foot of your own available by name, replacing one of the same name.

    Args:
        name: Name for `foot` and the command line.
        kind: Frozen dataclass derived from `Foot`.
    """
    _FEET[name] = kind
