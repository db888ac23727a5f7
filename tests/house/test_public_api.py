"""The public surface is what the list in this folder says, and everything in it is documented."""

from __future__ import annotations

import dataclasses
import importlib
import inspect
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from public_api import SURFACES, exported, surface

HERE = Path(__file__).resolve().parent
LISTED = HERE / "public_api.txt"


def test_the_surface_is_the_listed_one() -> None:
    assert surface() == LISTED.read_text(encoding="utf-8"), (
        "the public surface has changed; if that is meant: "
        "python tests/support/public_api.py > tests/house/public_api.txt, and a line in CHANGELOG.md"
    )


@pytest.mark.parametrize("package", SURFACES)
def test_names_are_exported_once_and_exist(package: str) -> None:
    names = importlib.import_module(package).__all__
    assert len(names) == len(set(names))


def inherited(kind: type, member: str) -> bool:
    """Return True if a base of a class documents the method already."""
    return any(inspect.getdoc(vars(base).get(member)) for base in kind.__mro__[1:] if member in vars(base))


def functions() -> Iterator[tuple[str, Any]]:
    """Yield exported functions, and the methods that exported classes define themselves."""
    for package, name, value in exported():
        if inspect.isfunction(value):
            yield f"{package}.{name}", value
        if inspect.isclass(value):
            for member, method in vars(value).items():
                method = getattr(method, "__func__", method)  # static and class methods  # noqa: PLW2901
                public = inspect.isfunction(method) and not member.startswith("_")
                if public and not inherited(value, member):
                    yield f"{package}.{name}.{member}", method


FUNCTIONS = dict(functions())


def test_every_exported_name_has_a_docstring() -> None:
    missing = [
        f"{package}.{name}"
        for package, name, value in exported()
        if (inspect.isclass(value) or inspect.isfunction(value)) and not (value.__doc__ or "").strip()
    ]
    missing += [name for name, function in FUNCTIONS.items() if not inspect.getdoc(function)]
    assert not missing, f"no docstring: {missing}"


def test_docstrings_say_shapes_and_errors() -> None:
    """An array has a shape, and an error that is raised is told of."""
    wrong = []
    for name, function in FUNCTIONS.items():
        text, source = inspect.getdoc(function) or "", inspect.getsource(function)
        if text.startswith("See ") or "@overload" in source or "@property" in source:
            continue
        if re.search(r"^\s+raise (InputError|UnknownNameError|ModelError)", source, re.MULTILINE):
            wrong += [f"{name}: no 'Raises:'"] * ("Raises:" not in text)
        arrays = [p for p in inspect.signature(function).parameters.values() if "Array" in str(p.annotation)]
        if arrays and not re.search(r"shape|scalar", text):
            wrong.append(f"{name}: no shape of {', '.join(p.name for p in arrays)}")
    assert not wrong, "\n".join(wrong)


def test_every_exported_name_stands_in_the_pages_of_the_api() -> None:
    """The pages hold every module of the packages that `docs/conf.py` names, rooms and rooms inside them."""
    conf = (HERE.parents[1] / "docs" / "conf.py").read_text(encoding="utf-8")
    packages = set(re.findall(r'^    "(\w+)": "\w+",$', conf, re.MULTILINE))
    assert {"core", "tasks", "sim"} <= packages
    index = (HERE.parents[1] / "docs" / "index.md").read_text(encoding="utf-8")
    assert not [package for package in packages if f"\napi/{package}\n" not in index]
    for package, name, value in exported():
        if inspect.isclass(value) or inspect.isfunction(value):
            top, *parts = value.__module__.split(".")
            assert top == "wbc" and parts[0] in packages, f"{package}.{name} is in no page"
            assert len(parts) <= 4 and not any(part.startswith("_") for part in parts), f"{package}.{name}"


CHECK_THEMSELVES = {
    *("conformance", "run", "settings", "family", "param", "scene_kind"),
    *("register", "register_foot", "register_stiffness_policy", "register_trial"),
}
"""Functions that take classes, callables or protocols, which `checked` does not look at."""


def test_every_exported_function_and_constructor_checks_its_arguments() -> None:
    unchecked = []
    for _, name, value in exported():
        call = value.__init__ if inspect.isclass(value) else value
        made = inspect.isclass(value) and "__init__" in vars(value) and not dataclasses.is_dataclass(value)
        if name in CHECK_THEMSELVES or getattr(value, "_is_protocol", False):
            continue
        if (made or inspect.isfunction(value)) and not hasattr(call, "__wrapped__"):
            takes = set(inspect.signature(call).parameters) - {"self"}
            unchecked += [name] if takes else []
    assert not unchecked, unchecked
