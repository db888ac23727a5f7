"""The public surface: what `wbc` and its rooms export, with signatures, the default of every setting, and studies.

`python tests/support/public_api.py > tests/house/public_api.txt` writes the list that the test compares with.
"""

from __future__ import annotations

import dataclasses
import importlib
import inspect
import re
from collections.abc import Iterator
from hashlib import sha256
from operator import attrgetter
from typing import Any

from wbc import InputError
from wbc.core.changes import setting_names
from wbc.core.settings import to_json
from wbc.sim.studies.catalog import STUDIES
from wbc.sim.studies.journal import canonical

SURFACES = (
    "wbc",
    "wbc.tasks",
    "wbc.robots",
    "wbc.feet",
    "wbc.walking",
    "wbc.motion",
    "wbc.machine",
    "wbc.sim",
)
"""The packages that users import from."""


def exported() -> Iterator[tuple[str, str, Any]]:
    """Yield package, name and value of everything that is exported."""
    for package in SURFACES:
        module = importlib.import_module(package)
        for name in module.__all__:
            yield package, name, getattr(module, name)


def described(package: str, name: str, value: Any) -> str:
    """Return a name with its signature, or with the type of its value."""
    if not callable(value) or not (inspect.isclass(value) or inspect.isroutine(value)):
        return f"{package}.{name}: {type(value).__name__}"
    try:
        signature = str(inspect.signature(value))
    except (ValueError, TypeError):
        signature = "(…)"
    return f"{package}.{name}{re.sub(r' at 0x[0-9a-f]+', '', signature)}"


def defaults(package: str, name: str, value: Any) -> list[str]:
    """Return the default of each setting of a class that can be made without arguments."""
    if not dataclasses.is_dataclass(value) or inspect.isabstract(value):
        return []
    try:
        made = value()
    except (InputError, TypeError):  # some of its values have no default
        return []
    return [f"{package}.{name}.{path} = {to_json(attrgetter(path)(made))!r}" for path in setting_names(made)]


def surface() -> str:
    """Return the whole list, names in the order of the packages and the alphabet, then defaults and studies."""
    names = sorted(exported(), key=lambda entry: (SURFACES.index(entry[0]), entry[1]))
    lines = [described(*entry) for entry in names]
    lines += [line for entry in names for line in defaults(*entry)]
    for name, make in STUDIES.items():
        study = make()
        digest = sha256(canonical(study.to_json()).encode()).hexdigest()
        lines.append(f"study {name}: {study.size} trials, {digest[:12]}")
    return "".join(f"{line}\n" for line in lines)


if __name__ == "__main__":
    print(surface(), end="")
