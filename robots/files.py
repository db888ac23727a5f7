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
from collections.abc import Mapping
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

ENDINGS = (".toml", ".xml", ".mjcf", ".urdf", ".sdf")
"""Endings of the files that describe a robot."""

NAMED = re.compile(r"\bfile(name)?\s*=\s*[\"']")
"""Attribute of an MJCF or a URDF that names another file."""


def is_path(name: str) -> bool:
    """Return True if the name of a robot is meant as the path of a file."""
    return name.lower().endswith(ENDINGS) or "/" in name or "\\" in name


def stamps(path: Path) -> tuple[tuple[tuple[int, int], ...], bool]:
    """Return time of the last change, ns, and size, bytes, of a file and of the robot file that a TOML names.

    Returned as well is True if that file names others, which it includes or takes meshes from.
    """
    places = [path]
    if path.suffix.lower() == ".toml" and path.is_file():
        places.append(path.parent / Path(str(read_toml(path).get("file", ""))).expanduser())
    found = [(each.stat().st_mtime_ns, each.stat().st_size) for each in places if each.is_file()]
    return tuple(found), places[-1].is_file() and bool(NAMED.search(read_xml(places[-1], "robot file")))


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
