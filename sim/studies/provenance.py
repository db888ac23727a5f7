"""Version of the code that made a result: package, hash of the sources, libraries that compute."""

from __future__ import annotations

import hashlib
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

LIBRARIES = ("mujoco", "numpy", "pin", "proxsuite", "scipy")
"""Libraries that compute."""


@cache
def code_version() -> str:
    """Return the hash of all sources that can change the result of a trial, 12 hex digits; needs no version control."""
    root = Path(str(version.__file__)).parent
    digest = hashlib.sha256()
    for part in PARTS:
        folder = root / part
        for path in sorted(p for p in folder.rglob("*") if _computes(p.relative_to(root).parts)):
            digest.update(f"{part}/{path.relative_to(folder).as_posix()}\0".encode())
            digest.update(path.read_bytes())
            digest.update(b"\0")
    return digest.hexdigest()[:12]


def _computes(parts: tuple[str, ...]) -> bool:
    """Return True if a file of the package can change the result of a trial."""
    if not parts[-1].endswith(SUFFIXES) or {"__pycache__", RESULTS} & set(parts):
        return False
    return parts[:2] != STUDIES or parts[-1] == TRIALS


@cache
def provenance() -> Mapping[str, Any]:
    """Return package version, code version and versions of the libraries, as plain values."""
    return {
        "wbc": version.__version__,
        "code": code_version(),
        "libraries": {n: _version(n) for n in LIBRARIES},
    }


def differences(version: Mapping[str, Any]) -> list[str]:
    """Return how another version of the code differs from the present one, such as "mujoco 3.2.0 instead of 3.3.1".

    Args:
        version: The other one, as `provenance` gave it.
    """
    there, here = ({**v, **v.get("libraries", {})} for v in (version, provenance()))
    names = [name for name in {**here, **there} if name != "libraries"]
    return [
        f"{name} {there.get(name, 'unknown')} instead of {here.get(name, 'none')}"
        for name in names
        if there.get(name) != here.get(name)
    ]


def _version(name: str) -> str:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:  # a build from source that left no metadata
        return "unknown"
