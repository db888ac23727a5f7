"""Meshes in files: where they are, what is wrong with them, and their vertices."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Iterable
from pathlib import Path
from urllib.parse import unquote

import coal
import numpy as np

from wbc.base.errors import shown
from wbc.base.numbers import Array

PACKAGE_DEPTH = 5
"""Most folders above that of a URDF in which its packages are looked for."""

LARGEST_MESH = 100_000_000
"""Bytes of a mesh that are looked at for defects."""


def read_mesh(path: Path) -> tuple[Array, coal.BVHModelBase] | None:
    """Return the vertices of a mesh, shape (n, 3), m, and coal's model of it in the unit of the file.

    The formats are those that assimp reads. None is returned when it cannot be read: geometry is optional.
    """
    if mesh_defect(path):
        return None
    try:
        mesh = coal.MeshLoader().load(str(path))
    except (ValueError, RuntimeError):
        return None
    vertices = np.array(mesh.vertices(), dtype=np.float64)
    return (vertices * collada_unit(path), mesh) if len(vertices) and np.isfinite(vertices).all() else None


def collada_unit(path: Path) -> float:
    """Return the unit of length of a COLLADA mesh, m, as the field's viewers read it; one for all other files."""
    if path.suffix.lower() != ".dae":
        return 1.0
    text = re.sub(rb"<!--.*?-->", b"", path.read_bytes(), flags=re.DOTALL)
    found = re.search(rb"<(?:\w+:)?unit\b[^>]*?\smeter\s*=\s*[\"']\s*([^\"'\s]+)", text)
    try:
        unit = float(found[1]) if found else 1.0
    except ValueError:
        return 1.0
    return unit if 0.0 < unit < math.inf else 1.0


def mesh_defect(path: Path) -> str:
    """Return why the file of a mesh holds no whole mesh, by its size, begin and end; "" where nothing is wrong."""
    with path.open("rb") as file:
        content = file.read(LARGEST_MESH)
    begin, end, kind = content[:512].lstrip().lower(), content[-512:].lower(), path.suffix.lower()
    if not begin:
        return "is empty"
    if begin.startswith(b"version https://git-lfs"):
        return "is a pointer of Git LFS: run `git lfs pull` in its repository"
    if begin.startswith((b"<!doctype html", b"<html")):
        return "is a page of the web"
    whole = True
    if kind == ".stl":
        count = int.from_bytes(content[80:84], "little")
        whole = 84 + 50 * count <= len(content) and len(content) > 84
        if whole:
            numbers = np.frombuffer(content, np.dtype([("corners", "<f4", 12), ("more", "<u2")]), count, 84)
            if not np.isfinite(numbers["corners"][:, 3:]).all():
                return "has corners that are no numbers"
        whole |= begin.startswith(b"solid") and b"endsolid" in end
    elif kind == ".dae":
        whole = b"collada>" in end
    elif kind == ".obj":
        whole = re.search(rb"[\r\n]\s*f\s", content) is not None
    return "" if whole or len(content) == LARGEST_MESH else "is cut off, or of another format"


def resolve(filename: str, folders: tuple[str, ...]) -> Path | None:
    """Return the file of a mesh; None where there is none.

    The name is that of a package (`package://`, `model://`), absolute, or relative to a folder, as a URL (`file://`) or
    as a path, with slashes of any kind; `folders` are searched in their order.
    """
    places = [*map(Path, folders)]
    scheme, found, rest = filename.partition("://")
    if not found:
        scheme, rest = ("file", filename[5:]) if filename.startswith("file:") else ("", filename)
    rest = rest.removeprefix("localhost") if scheme == "file" else rest
    for name in dict.fromkeys((rest, unquote(rest), unquote(rest).replace("\\", "/"))):
        candidates = [
            *(folder / name for folder in places),
            Path(name),
        ]  # an absolute name is its own in each
        if scheme in ("package", "model"):
            tail = name.split("/", 1)[-1]
            candidates = [folder / part for folder in places for part in (name, tail)]
        for path in candidates:
            if os.path.isfile(path):  # False for a name that is too long, too
                return path
    return None


def mesh_folders(
    names: Iterable[str], given: tuple[str, ...], base: Path | None
) -> tuple[tuple[str, ...], list[str]]:
    """Return the folders in which meshes of these names are, and notes on those that are nowhere or broken.

    The folders are those given, that of the file for relative names, and those above it in which a package is: as ROS
    has it, the file lies in a folder of its package.
    """
    folders = list(given)
    if base is not None:
        folders.append(str(base))
    names = list(dict.fromkeys(names))
    missing = [name for name in names if resolve(name, tuple(folders)) is None]
    for above in [] if base is None else list(base.parents)[:PACKAGE_DEPTH]:
        if found := [name for name in missing if resolve(name, (str(above),)) is not None]:
            folders.append(str(above))
            missing = [name for name in missing if name not in found]
    notes = [
        f"mesh {shown(name)} {defect}: its link has no shape of it"
        for name in names
        if (path := resolve(name, tuple(folders))) is not None and (defect := mesh_defect(path))
    ]
    if missing:
        notes.append(
            f"{len(missing)} of {len(names)} meshes are not found, first {shown(missing[0])}: their links have no "
            "shape of them; package_dirs are the folders of packages"
        )
    return tuple(folders), notes
