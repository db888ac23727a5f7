"""Every rule that stands in the annotation of a setting is kept, in all settings of the package.

The rule itself, `Annotated[Positive, "m"]`, stands in the list of the public surface. So no test of a room has to say
that a length of -1 is refused; rules of `__post_init__`, about several fields or names, are tested where they are.
"""

from __future__ import annotations

import dataclasses
import importlib
import inspect
import math
import pkgutil
import typing
from collections.abc import Iterator
from functools import cache
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, get_args, get_origin

import numpy as np
import pytest
from pydantic.fields import FieldInfo

import wbc
from wbc.core.errors import InputError, UnknownNameError
from wbc.core.settings import from_json, settings, unit_and_choices

OF_EXTRAS = ("wbc.sim.environment", "wbc.app.workbench", "wbc.machine.unitree.dds")
BOUNDS = {"gt": 0.0, "ge": -math.inf, "lt": 0.0, "le": math.inf}
"""Constraint → which way the nearest number lies that breaks it; a bound itself breaks `gt` and `lt`."""


@cache
def kinds() -> list[type]:
    """All settings classes of the package that validate their fields."""
    found: dict[type, None] = {}
    for module in pkgutil.walk_packages(wbc.__path__, "wbc."):
        if module.name.endswith("__main__") or module.name.startswith(OF_EXTRAS):
            continue
        for kind in filter(inspect.isclass, vars(importlib.import_module(module.name)).values()):
            validated = dataclasses.is_dataclass(kind) and "__pydantic_validator__" in vars(kind)
            if validated and not inspect.isabstract(kind):
                found[kind] = None
    return sorted(found, key=lambda kind: f"{kind.__module__}.{kind.__qualname__}")


def breaking(hint: Any, bounds: tuple[Any, ...] = ()) -> Iterator[Any]:
    """Values that break the rule of an annotation, as near to what it allows as there are."""
    if get_origin(hint) is Annotated:
        inner, *metadata = get_args(hint)
        parts = [p for item in metadata for p in (item.metadata if isinstance(item, FieldInfo) else [item])]
        yield from breaking(inner, (*bounds, *parts))
    elif get_origin(hint) in (typing.Union, UnionType):
        members = [h for h in get_args(hint) if h is not NoneType]
        if len(members) == 1:
            yield from breaking(members[0], bounds)
    elif get_origin(hint) is Literal:
        yield from ("nothing of the kind", 3.5)
    elif get_origin(hint) is tuple and ... not in get_args(hint):
        good = [0.5] * len(get_args(hint))
        yield good[:-1]
        yield [*good, 0.5]
    elif hint in (int, float):
        yield from ("much", True, [1.0], 1e300)
        if not any(getattr(part, "allow_inf_nan", False) for part in bounds):
            yield from (math.nan, -math.inf)
        if hint is int:
            yield 1.5
        for part in bounds:
            for name, way in BOUNDS.items():
                if hasattr(part, name):
                    bound = getattr(part, name)
                    step = int(math.copysign(1, way)) if hint is int else np.nextafter(bound, way) - bound
                    yield bound + (step if way else 0)
    elif hint is str:
        yield from (3, "a\0b")
    elif hint is bool:
        yield from (1, "true")
    elif hint in kinds():
        yield 3


@pytest.mark.parametrize("kind", kinds(), ids=lambda kind: kind.__qualname__)
def test_what_breaks_the_rule_of_a_field_is_refused_by_name_with_rule_and_value(kind: type) -> None:
    hints = typing.get_type_hints(kind, include_extras=True)
    names = [field.name for field in dataclasses.fields(kind) if field.init]
    alone = settings(  # the fields with none for a default, and without the rules about several
        dataclasses.make_dataclass(
            kind.__name__, [(n, hints[n], dataclasses.field(default=None)) for n in names], frozen=True
        )
    )
    for name in names:
        for value in breaking(hints[name]):
            with pytest.raises(InputError) as refused:
                from_json(alone, {name: value})
            said, unit = str(refused.value), unit_and_choices(kind, name)[0]
            assert name in said and "\n" not in said and len(said) < 1000, said
            if isinstance(refused.value, UnknownNameError):
                assert "choices: " in said or "did you mean" in said or "nothing of the kind" in said
            else:
                assert " must be " in said and "got " in said and unit in said, said
