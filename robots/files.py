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
import os
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

from wbc.base.errors import InputError, shown_path
from wbc.base.files import decoding, first_tag, home_path, read_text, read_toml, write_text
from wbc.base.settings import from_json
from wbc.core.frames import FrameDescription, Sole
from wbc.robots.derivation.servo import ServoRule
from wbc.robots.description import RobotDescription

ENDINGS = (".toml", ".xml", ".mjcf", ".urdf", ".sdf")
"""Endings of the files that describe a robot, and of those of Gazebo, which are refused."""


def is_path(name: str) -> bool:
    """Return True if the name of a robot is meant as the path of a file."""
    return name.lower().endswith(ENDINGS) or "/" in name or "\\" in name


def read(path: str | Path) -> RobotDescription:
    """Return the description of a robot in an MJCF, a URDF or a TOML description; `InputError` if it cannot be used.

    The same object is returned until the file, or the one that a TOML names, has changed. A change of a mesh or of an
    included file alone is seen by the next process. The last 32 are kept.
    """
    place, values = home_path(path), dict[str, Any]()
    if place.suffix.lower() == ".toml":
        values = read_toml(place)
        source = values.pop("file", None)
        if not isinstance(source, str):
            raise InputError(f'{shown_path(path)} must name the file of the robot: file = "my.xml"')
        values.setdefault("name", place.stem)
        place = place.parent / home_path(source)
    state = place.stat() if os.path.isfile(place) else None
    return _described(place, json.dumps(values, default=str), state and (state.st_mtime_ns, state.st_size))


@lru_cache(maxsize=32)
def _described(path: Path, parameters: str, _: tuple[int, int] | None) -> RobotDescription:
    return describe(path, json.loads(parameters))


def describe(path: Path, parameters: Mapping[str, Any]) -> RobotDescription:
    """Return the description of an MJCF or a URDF with some parameters of its reader as plain values."""
    with decoding(path, "robot that can be read"):
        known = {"name": path.stem, **{name: _typed(name, value) for name, value in parameters.items()}}
        is_urdf = first_tag(read_text(path, "robot file")) == "robot"
        return (RobotDescription.from_urdf if is_urdf else RobotDescription.from_mjcf)(path, **known)


def write(target: Path, path: Path, parameters: Mapping[str, Any]) -> None:
    """Write a TOML description of the robot in a file, with some parameters of its reader as plain values."""
    lines, tables = [f"file = {_toml(str(home_path(path).resolve()))}"], []
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
