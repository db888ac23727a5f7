"""Form of the house: imports go down only and never in circles, and come from declared dependencies.

`.ci/run` runs it, and so does `pytest .ci/test_form.py`; it is no part of the test suite.
"""

from __future__ import annotations

import ast
import importlib.util
import re
import sys
import tomllib
from collections.abc import Iterator
from functools import cache
from graphlib import TopologicalSorter
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
FOLDERS = {
    "wbc.base": ROOT / "wbc" / "base",
    "wbc.core": ROOT / "wbc" / "core",
    "wbc.robots": ROOT / "robots",
    "wbc.feet": ROOT / "feet",
    "wbc.ground": ROOT / "wbc" / "ground",
    "wbc.tasks": ROOT / "tasks",
    "wbc.walking": ROOT / "wbc" / "walking",
    "wbc.motion": ROOT / "wbc" / "motion",
    "wbc.policy": ROOT / "wbc" / "policy",
    "wbc.machine": ROOT / "wbc" / "machine",
    "wbc.sim": ROOT / "sim",
    "wbc.app": ROOT / "wbc" / "app",
}
_spec = importlib.util.spec_from_file_location("architecture", ROOT / "docs" / "pictures" / "architecture.py")
assert _spec is not None and _spec.loader is not None
architecture = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(architecture)

FLOOR = {package: height for height, floor in enumerate(architecture.FLOORS) for package in floor}


def sources(folder: Path) -> Iterator[Path]:
    return (file for file in folder.rglob("*.py") if "__pycache__" not in file.parts)


@cache
def all_imports(file: Path) -> tuple[list[tuple[str, int]], list[tuple[str, int]]]:
    """All modules that a file names in imports, with their lines, and those that it imports when it is imported."""
    tree = ast.parse(file.read_text(encoding="utf-8"))
    return list(_imports(tree, False)), list(_imports(tree, True))


def imports(file: Path, *, at_import_time: bool = False) -> list[tuple[str, int]]:
    """Modules that a file names in imports, with their lines; types alone are not looked at."""
    return all_imports(file)[at_import_time]


def _imports(node: ast.AST, at_import_time: bool) -> Iterator[tuple[str, int]]:
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.Import):
            yield from ((alias.name, child.lineno) for alias in child.names)
        elif isinstance(child, ast.ImportFrom):
            assert child.level == 0, f"relative import in line {child.lineno}"
            yield from ((f"{child.module}.{alias.name}", child.lineno) for alias in child.names)
        else:
            types_alone = isinstance(child, ast.If) and "TYPE_CHECKING" in ast.unparse(child.test)
            later = at_import_time and isinstance(child, (ast.FunctionDef, ast.AsyncFunctionDef, ast.Lambda))
            if not (types_alone or later):
                yield from _imports(child, at_import_time)


IN_PREFIX = {"pinocchio": "pin", "coal": "pin", "proxsuite": "proxsuite", "rerun": "rerun-sdk"}
"""Modules where their distributions do not list them; coal is released together with pin, which asks for it."""


OF_AN_EXTRA = ("sim/environment.py",)
"""Modules that nothing imports but who has the extra: their classes derive from its."""


@pytest.mark.parametrize("at_import_time", [True, False])
def test_what_is_imported_is_declared(at_import_time: bool) -> None:
    """Modules come from dependencies; those of an extra are imported inside functions alone."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = [] if at_import_time else [*project["optional-dependencies"].values()]
    lines = [*project["dependencies"], *(line for extra in extras for line in extra)]
    declared = {canonical(re.split(r"[\[<>=!~; ]", line, maxsplit=1)[0]) for line in lines}
    offered = {module for name in declared for module in modules_of(name)}
    unknown: dict[str, str] = {}
    for folder in FOLDERS.values():
        for file in sources(folder):
            if at_import_time and file.relative_to(ROOT).as_posix() in OF_AN_EXTRA:
                continue
            for module, line in imports(file, at_import_time=at_import_time):
                top = module.split(".")[0]
                if top == "wbc" or top in sys.stdlib_module_names:
                    continue
                if IN_PREFIX.get(top) not in declared and top not in offered:
                    unknown.setdefault(top, f"{file.relative_to(ROOT)}:{line}")
    assert not unknown, f"imported, but not among the dependencies: {unknown}"


@cache
def modules_of(name: str) -> set[str]:
    """Return the modules at the top of a distribution; its own name where it is not installed."""
    try:
        files = distribution(name).files or ()
    except PackageNotFoundError:
        return {name.replace("-", "_")}
    return {file.parts[0].partition(".")[0] for file in files}


def canonical(distribution: str) -> str:
    return re.sub(r"[-_.]+", "-", distribution).lower()


def package_of(module: str) -> str | None:
    return next((package for package in FLOOR if f"{module}.".startswith(f"{package}.")), None)


@pytest.mark.parametrize("package", FOLDERS)
def test_no_import_goes_up_or_sideways(package: str) -> None:
    files = list(sources(FOLDERS[package]))
    assert files, f"{FOLDERS[package]} holds no module"
    wrong = []
    for file in files:
        for module, line in imports(file):
            other = package_of(module)
            if other not in (None, package) and FLOOR[other] >= FLOOR[package]:  # type: ignore[index]
                wrong.append(f"{file.relative_to(ROOT)}:{line} imports {module}")
            # `wbc` itself imports almost everything: a module that asks it for a name goes round in a circle.
            if module.startswith("wbc.") and other is None and not module.startswith("wbc._version"):
                wrong.append(f"{file.relative_to(ROOT)}:{line} imports {module}")
    assert not wrong, "\n".join(wrong)


def test_nothing_below_the_simulator_imports_mujoco_when_imported() -> None:
    wrong = []
    for package, folder in FOLDERS.items():
        if FLOOR[package] >= FLOOR["wbc.sim"]:
            continue
        for file in sources(folder):
            if package in ("wbc.feet", "wbc.robots") and file.stem.endswith("_mjcf"):
                continue
            for module, line in imports(file, at_import_time=True):
                if module.split(".")[0] == "mujoco" or (
                    module.startswith("wbc.") and any(part.endswith("_mjcf") for part in module.split("."))
                ):
                    wrong.append(f"{file.relative_to(ROOT)}:{line} imports {module}")
    assert not wrong, "\n".join(wrong)


def test_modules_do_not_import_each_other_in_circles() -> None:
    """Imports inside functions and for type checkers count, too: a circle is one idea in two files."""
    TopologicalSorter(architecture.module_graph(ROOT)).prepare()  # an error names the circle


def test_rooms_do_not_import_each_other_in_circles() -> None:
    """A room is a folder of a package; modules that lie in the package itself belong to no room."""
    graph = architecture.module_graph(ROOT)
    rooms = {module: architecture.room_of(ROOT, module) for module in graph if module.count(".") > 1}
    rooms = {module: room for module, room in rooms.items() if room.count(".") > 1}
    TopologicalSorter(architecture.grouped(graph, rooms)).prepare()
