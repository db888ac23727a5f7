"""A robot read from a URDF: its records, tidied, and its feet by the frames that are given."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path

from wbc.base.errors import InputError
from wbc.base.files import home_path
from wbc.core.frames import FrameDescription
from wbc.robots import tidying, urdf
from wbc.robots.derivation.complete import FileRobot
from wbc.robots.derivation.soles import find_soles
from wbc.robots.mesh_files import mesh_folders


def read(
    source: str | Path,
    soles: tuple[str | FrameDescription | None, str | FrameDescription | None],
    sole_size: tuple[float, float] | None,
    *,
    package_dirs: tuple[str, ...],
    fixed: bool,
    lock: Mapping[str, float],
    repair: bool,
) -> FileRobot:
    """Return the robot in a URDF; see `RobotDescription.from_urdf`."""
    left, right = soles
    if (left is None) != (right is None):
        raise InputError("give left_sole and right_sole, or none of both for a robot without feet")
    is_file, robot = urdf.is_file(source), urdf.read(source)
    folder = home_path(source).resolve().parent if is_file else None
    meshes = (shape.file for shape in robot.shapes if shape.kind == "mesh")
    folders, notes = mesh_folders(meshes, package_dirs, folder)
    locked, changes = tidying.tidy(robot, fixed, lock, repair)
    finder = None
    if left is not None and right is not None and not fixed:
        finder = partial(find_soles, robot.shapes, sole_size, folders, (left, right))
    return FileRobot(
        mechanism=partial(robot.mechanism, fixed),
        source=str(source) if is_file else "URDF string",
        notes=(*notes, *changes),
        doubtful=robot.doubtful,
        find_soles=finder,
        named=left is not None,
        package_dirs=folders,
        locked=locked,
    )
