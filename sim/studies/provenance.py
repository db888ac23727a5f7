"""Version of the code that made a result: package, hash of the sources, libraries that compute."""

from __future__ import annotations

import ast
import hashlib
import re
from collections.abc import Mapping
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Any

import wbc._version as version

PARTS = ("core", "feet", "robots", "sim", "tasks", "walking")
"""Parts of the package that can change the result of a trial; the command line and the pictures cannot."""

STUDIES, TRIALS = ("sim", "studies"), "trials.py"
"""Folder of the studies: they choose walks, whose specs are in the key, and count results. Of its modules only the
one that runs trials is hashed."""

RESULTS = "data"
"""Name of the folders of results in feet and sim: models and tables are no code. A walk that uses one has its hash in
the spec."""

SUFFIXES = (".py", ".urdf", ".srdf", ".csv", ".json")
"""Endings of the files that are hashed."""

LIBRARIES = ("daqp", "mujoco", "numpy", "pin", "proxsuite", "scipy")
"""Libraries that compute."""


RENAMED = {
    "8b193a0eeb39": "da5fd04521c0",  # bfaee90
    "e7a4d1f354f6": "05534fa07e8f",  # d424345
    "7d889c658921": "3610f3b9423b",  # f15855e
}
"""Hashes of the bytes of the sources, in journals of earlier versions → `code_version` of the same sources."""

_EMPTY = re.compile(r"(, )?\w+=\[\]")
"""Empty lists in a dumped syntax tree: which are written differs between versions of Python."""


@cache
def code_version() -> str:
    """Return the hash of all sources that can change the result of a trial, 12 hex digits; needs no version control.

    Of a module its abstract syntax is hashed: comments, docstrings, layout and the name of its file do not count.
    """
    root = Path(str(version.__file__)).parent
    paths = (path for part in PARTS for path in (root / part).rglob("*"))
    found = sorted(_hash(path) for path in paths if _computes(path.relative_to(root).parts))
    return hashlib.sha256("".join(found).encode()).hexdigest()[:12]


def _hash(path: Path) -> str:
    """Return the hash of a source, hex digits: of the abstract syntax of a module, of the bytes of another file."""
    content = path.read_bytes()
    if path.suffix == ".py":
        tree = ast.parse(content)
        for node in ast.walk(tree):
            if isinstance(
                body := getattr(node, "body", None), list
            ):  # a text alone, such as a docstring, goes
                texts = [
                    isinstance(e, ast.Expr) and isinstance(getattr(e.value, "value", 0), str) for e in body
                ]
                body[:] = [each for each, text in zip(body, texts, strict=True) if not text]
        content = _EMPTY.sub("", ast.dump(tree)).encode()
    return hashlib.sha256(content).hexdigest()


def _computes(parts: tuple[str, ...]) -> bool:
    """Return True if a file of the package can change the result of a trial."""
    hashed = parts[-1].endswith(SUFFIXES) and RESULTS not in parts
    return hashed and (parts[:2] != STUDIES or parts[-1] == TRIALS)


@cache
def provenance() -> Mapping[str, Any]:
    """Return package version, code version and versions of the libraries, as plain values."""
    return {
        "wbc": version.__version__,
        "code": code_version(),
        "libraries": {n: _version(n) for n in LIBRARIES},
    }


def differences(version: Mapping[str, Any]) -> list[str]:
    """Return how a version of the code, of `provenance`, differs from the present: "mujoco 3.2.0 instead of 3.3.1"."""
    there, here = ({**v, **v.get("libraries", {})} for v in (renamed(version), provenance()))
    names = [name for name in {**here, **there} if name != "libraries"]
    return [
        f"{name} {there.get(name, 'unknown')} instead of {here.get(name, 'none')}"
        for name in names
        if there.get(name) != here.get(name)
    ]


def renamed(version: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return a version as `provenance` gives it today, also that of an earlier journal."""
    code = version.get("code")
    return {**version, "code": RENAMED[code]} if code in RENAMED else version


def _version(name: str) -> str:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:  # a build from source that left no metadata
        return "unknown"
