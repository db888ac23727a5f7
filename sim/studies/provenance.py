"""Version of the code that made a result: package, hash of its files, commit, and libraries."""

from __future__ import annotations

import contextlib
import hashlib
import os
import subprocess
from collections.abc import Iterable, Mapping
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Any

import wbc._version as version

LABEL = "git"
"""Part of a version that is for readers alone: the hash of the files says which code it was."""

PLUGINS = "wbc."
"""Beginning of the groups of entry points by which other packages offer robots, feet, grounds, policies and trials."""

LIBRARIES = (
    "coal",
    "daqp",
    "example-robot-data",
    "joblib",
    "mujoco",
    "numpy",
    "onnxruntime",
    "pandas",
    "pillow",
    "pin",
    "proxsuite",
    "pydantic",
    "qpsolvers",
    "scikit-learn",
    "scipy",
)
"""Libraries that can change a result."""


@cache
def provenance() -> Mapping[str, Any]:
    """Return package version, commit, hash of the files and versions of the libraries, as plain values."""
    root = Path(str(version.__file__)).resolve().parents[1]
    points = metadata.entry_points()
    offered = [
        point for group in points.groups if group.startswith(PLUGINS) for point in points.select(group=group)
    ]
    plugins = {point.dist.name for point in offered if point.dist is not None}
    return {
        "wbc": version.__version__,
        LABEL: _commit(root),
        "files": sources(root),
        "libraries": libraries({*LIBRARIES, *plugins} - {"wbc"}),
    }


def sources(root: Path) -> str:
    """Return a hash of all files of the package in a folder, those behind symbolic links included, 16 hex digits."""
    total = hashlib.sha256()
    for folder, folders, files in os.walk(root / "wbc", followlinks=True):
        folders[:] = sorted(name for name in folders if not name.startswith((".", "__pycache__")))
        for name in sorted(name for name in files if not name.startswith(".")):
            path = Path(folder, name)
            if path.is_file():  # and no link that leads nowhere
                content = hashlib.sha256(path.read_bytes()).hexdigest()
                total.update(f"{path.relative_to(root).as_posix()} {content}\n".encode())
    return total.hexdigest()[:16]


def libraries(names: Iterable[str]) -> dict[str, str]:
    """Return the versions of packages by name, of those that are installed."""
    found: dict[str, str] = {}
    for name in sorted(names):
        with contextlib.suppress(metadata.PackageNotFoundError):
            found[name] = metadata.version(name)
    return found


def _commit(root: Path) -> str | None:
    """Return `git describe` of the clone in a folder, with "-dirty" after a change; None where there is none."""
    try:
        command = ["git", "-C", str(root), "describe", "--always", "--tags", "--abbrev=12", "--dirty"]
        tracked = ["git", "-C", str(root), "ls-files", "--error-unmatch", "wbc/_version.py"]
        for words in (tracked, command):
            done = subprocess.run(words, capture_output=True, text=True, check=True, timeout=30.0)
    except (OSError, subprocess.SubprocessError, UnicodeDecodeError):
        return None
    return done.stdout.strip()


def code_of(version: Mapping[str, Any]) -> dict[str, Any]:
    """Return the parts of a version, of `provenance`, that can change a result."""
    return {name: value for name, value in version.items() if name != LABEL}


def differences(version: Mapping[str, Any]) -> list[str]:
    """Return how a version of the code, of `provenance`, differs from the present: "mujoco 3.2.0 instead of 3.3.1"."""
    there, here = ({**code_of(v), **v.get("libraries", {})} for v in (version, provenance()))
    names = [name for name in {**here, **there} if name != "libraries"]
    return [
        f"{name} {there.get(name, 'unknown')} instead of {here.get(name, 'none')}"
        for name in names
        if there.get(name) != here.get(name)
    ]
