"""A robot read from a URDF: its records, tidied, and its feet by the frames that are given."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any, Unpack

from wbc.base.errors import InputError
from wbc.core.frames import FrameDescription
from wbc.robots import tidying, urdf
from wbc.robots.derivation.complete import Notes, Read, complete
from wbc.robots.derivation.soles import from_geometry
from wbc.robots.mesh_files import mesh_folders
from wbc.robots.options import DescriptionOptions


def fields(
    source: str | Path,
    soles: tuple[str | FrameDescription | None, str | FrameDescription | None],
    sole_size: tuple[float, float] | None,
    *,
    name: str | None,
    package_dirs: tuple[str, ...],
    fixed: bool,
    provenance: str | None,
    **options: Unpack[DescriptionOptions],
) -> dict[str, Any]:
    """Return the fields of the `RobotDescription` of a URDF; see `RobotDescription.from_urdf`."""
    left, right = soles
    if (left is None) != (right is None):
        raise InputError("give left_sole and right_sole, or none of both for a robot without feet")
    is_file, robot = urdf.is_file(source), urdf.read(source)
    folder = Path(source).expanduser().resolve().parent if is_file else None
    meshes = (shape.file for shape in robot.shapes if shape.kind == "mesh")
    folders, notes = mesh_folders(meshes, package_dirs, folder)
    locked, changes = tidying.tidy(robot, fixed, options.get("lock") or {}, options.get("repair", False))
    finder = None
    if left is not None and right is not None and not fixed:
        finder = from_geometry(robot.shapes, (left, right), sole_size, folders)
    read = Read(
        partial(robot.mechanism, fixed),
        name,
        provenance or (str(source) if is_file else "URDF string"),
        Notes(notes + changes),
        finder,
        named=left is not None,
        package_dirs=folders,
        fields={"locked": locked},
    )
    return complete(read, **options)
