"""The public surface: what `wbc` and its rooms export, with signatures.

`python tests/support/public_api.py > tests/house/public_api.txt` writes the list that the test compares with.
"""

from __future__ import annotations

import importlib
import inspect
import re
from collections.abc import Iterator
from typing import Any

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


def surface() -> str:
    """Return the whole list, a line for each name, in the order of the packages and the alphabet."""
    lines = sorted(
        (SURFACES.index(package), name, described(package, name, value))
        for package, name, value in exported()
    )
    return "".join(f"{line}\n" for _, _, line in lines)


if __name__ == "__main__":
    print(surface(), end="")
