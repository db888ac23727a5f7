"""Version of the code that made a result: package, commit of the sources, libraries that compute."""

from __future__ import annotations

import hashlib
import subprocess
from collections.abc import Mapping
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Any

import wbc._version as version

SOURCES = ("wbc/core", "wbc/ground", "wbc/walking", "feet", "robots", "sim", "tasks")
"""Parts of the clone that can change the result of a trial; the command line and the pictures cannot."""

LIBRARIES = ("daqp", "mujoco", "numpy", "pin", "proxsuite", "scipy")
"""Libraries that compute."""


@cache
def provenance() -> Mapping[str, Any]:
    """Return package version, commit of the sources and versions of the libraries, as plain values."""
    return {
        "wbc": version.__version__,
        "git": sources(Path(str(version.__file__)).resolve().parents[1]),
        "libraries": {name: _version(name) for name in LIBRARIES},
    }


def sources(root: Path) -> str | None:
    """Return `git describe` of the last commit that changed the sources, and a hash of changes since then.

    None where the package is installed, and no clone: its version says what it is.
    """
    if not _git(root, "ls-files", "wbc/_version.py"):
        return None
    commit = _git(root, "log", "-1", "--format=%H", "--", *SOURCES) or "HEAD"
    described = _git(root, "describe", "--always", "--tags", "--abbrev=12", commit)
    changes = f"{_git(root, 'diff', 'HEAD', '--', *SOURCES)}{_untracked(root)}"
    return f"{described}-dirty-{hashlib.sha256(changes.encode()).hexdigest()[:12]}" if changes else described


def _untracked(root: Path) -> str:
    """Return names and contents of source files that are not in the repository yet."""
    names = (_git(root, "ls-files", "--others", "--exclude-standard", "--", *SOURCES) or "").splitlines()
    return "".join(name + (root / name).read_text(encoding="utf-8", errors="replace") for name in names)


def _git(root: Path, *words: str) -> str | None:
    """Return the output of git in a folder; None if it fails, or is not installed."""
    try:
        done = subprocess.run(
            ["git", "-C", str(root), *words], capture_output=True, text=True, check=True, timeout=30.0
        )
    except (OSError, subprocess.SubprocessError, UnicodeDecodeError):
        return None
    return done.stdout.strip()


def differences(version: Mapping[str, Any]) -> list[str]:
    """Return how a version of the code, of `provenance`, differs from the present: "mujoco 3.2.0 instead of 3.3.1"."""
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
