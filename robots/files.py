"""Robots in files: an MJCF or a URDF as it is, or a TOML description.

A TOML description names the file of the robot and gives the parameters of `RobotDescription.from_mjcf` or `from_urdf`
that are not to be derived:

    file = "/home/me/robots/my.xml"     # relative to the TOML otherwise
    left_sole = "left_foot"
    right_sole = "right_foot"
    sole_size = [0.2, 0.1]              # m
    gains = { left_knee = [150.0, 4.0] }
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from wbc.base.checked import checked
from wbc.base.errors import InputError, shown_path
from wbc.base.files import decoding, first_tag, read_toml, read_xml, write_text
from wbc.base.registry import call_checked
from wbc.base.settings import from_json
from wbc.core.frames import FrameDescription, Sole
from wbc.robots.derivation.servo import ServoRule
from wbc.robots.description import RobotDescription
from wbc.robots.mesh_files import mesh_folders, resolve

ENDINGS = (".toml", ".xml", ".mjcf", ".urdf", ".sdf")
"""Endings of the files that describe a robot."""

NAMED = re.compile(r"\bfile(?:name)?\s*=\s*[\"']([^\"']+)")
"""Names of other files in an MJCF or a URDF."""

FOLDERS = re.compile(r"\b(?:mesh|texture|asset)dir\s*=\s*[\"']([^\"']+)")
"""Folders in which an MJCF looks for them."""


def is_path(name: str) -> bool:
    """Return True if the name of a robot is meant as the path of a file."""
    return name.lower().endswith(ENDINGS) or "/" in name or "\\" in name


def parts(path: Path) -> tuple[Path, ...]:
    """Return a robot's file and all files that it names.

    They are the robot file of a TOML, and what an MJCF or a URDF includes or takes its meshes from. A name is looked
    for in all folders that it may be meant for.
    """
    found, named, folders = set[Path](), {str(path)}, [str(path.parent)]
    while (
        new := {at.resolve() for name in named for each in folders if (at := resolve(name, (each,)))} - found
    ):
        found |= new
        for place in new:
            if place.suffix.lower() == ".toml":
                values = read_toml(place)
                named.add(str(Path(str(values.get("file", ""))).expanduser()))
                folders += [str(Path(str(each)).expanduser()) for each in values.get("package_dirs", ())]
            elif place.suffix.lower() in ENDINGS:
                text, here = read_xml(place, "robot file"), place.parent
                named |= {part for name in NAMED.findall(text) for part in (name, Path(name).name)}
                folders += [str(here / folder) for folder in FOLDERS.findall(text)]
                folders = [*dict.fromkeys(mesh_folders(named, tuple(folders), here)[0])]
    return tuple(found)


def stamps(paths: Iterable[Path]) -> tuple[tuple[int, int], ...]:
    """Return time of the last change, ns, and size, bytes, of the files that are there."""
    found = (each.stat() for each in paths if each.is_file())
    return tuple((each.st_mtime_ns, each.st_size) for each in found)


def read(path: str | Path) -> RobotDescription:
    """Return the description of a robot in an MJCF, a URDF or a TOML description; `InputError` if it cannot be used."""
    place = Path(path).expanduser()
    if not place.is_file():
        raise InputError(f"no robot file {shown_path(path)}; give an MJCF, a URDF or a TOML description")
    if place.suffix.lower() != ".toml":
        return describe(place, {})
    values = read_toml(place)
    source = values.pop("file", None)
    if not isinstance(source, str):
        raise InputError(f'{shown_path(path)} must name the file of the robot: file = "my.xml"')
    values.setdefault("name", place.stem)
    return describe(place.parent / Path(source).expanduser(), values)


def describe(path: Path, parameters: Mapping[str, Any]) -> RobotDescription:
    """Return the description of an MJCF or a URDF with some parameters of its reader as plain values."""
    with decoding(path, "robot that can be read"):
        known = {"name": path.stem, **{name: _typed(name, value) for name, value in parameters.items()}}
        if first_tag(read_xml(path, "robot file")) == "robot":
            return call_checked("URDF reader", RobotDescription.from_urdf, {"source": path, **known})
        return call_checked("MJCF reader", RobotDescription.from_mjcf, {"source": path, **known})


@checked
def read_sdf(path: str | Path) -> Any:
    """Return the robot of an SDF as an `mujoco.MjSpec` without drives, to which these and a ground can be added.

    `RobotDescription.from_mjcf` takes the spec, and the path of an SDF as well.
    """
    from wbc.robots.readers import compile_mjcf  # noqa: PLC0415  MuJoCo is imported with it

    return compile_mjcf.read_sdf(Path(path).expanduser())


def write(target: Path, path: Path, parameters: Mapping[str, Any]) -> None:
    """Write a TOML description of the robot in a file, with some parameters of its reader as plain values."""
    lines, tables = [f"file = {_toml(str(path.expanduser().resolve()))}"], []
    for key, value in parameters.items():
        if isinstance(value, Mapping):
            tables += [f"[{key}]", *(f"{_toml(name)} = {_toml(each)}" for name, each in value.items())]
        else:
            lines.append(f"{key} = {_toml(value)}")
    write_text(target, "\n".join([*lines, *tables, ""]))


def _toml(value: Any) -> str:
    """Return text, a number, a truth value or a list of them: TOML and JSON write them alike."""
    return json.dumps(value, ensure_ascii=False)


def _typed(name: str, value: Any) -> Any:
    """Return a plain value of a TOML as the readers take it: tables as frames and rules, lists as tuples."""
    if isinstance(value, Mapping) and name in ("left_sole", "right_sole", "imu"):
        if "length" in value:
            return from_json(Sole, {"frame": name, "name": name.replace("sole", "foot"), **value})
        return from_json(FrameDescription, {"frame": name, **value})
    if isinstance(value, Mapping) and name == "servo":
        return from_json(ServoRule, value)
    if isinstance(value, Mapping):
        return {key: tuple(each) if isinstance(each, list) else each for key, each in value.items()}
    return tuple(value) if isinstance(value, list) else value
