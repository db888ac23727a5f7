"""Robots in files: an MJCF or a URDF as it is, and TOML descriptions in the user's configuration folder.

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

import platformdirs

from wbc.core.errors import InputError, shown, shown_path
from wbc.core.files import decoding, read_toml, read_xml, write_text
from wbc.core.registry import call_checked
from wbc.core.settings import from_json
from wbc.robots.derivation.servo import ServoRule
from wbc.robots.description import RobotDescription
from wbc.robots.frames import FrameDescription, SoleDescription

ENDINGS = (".toml", ".xml", ".mjcf", ".urdf")
"""Endings of the files that describe a robot."""

RESERVED = ("add", "check")
"""Words of `wbc robots` that no robot can be called."""


def folder() -> Path:
    """Return the folder of the user's own robots; it need not exist."""
    return platformdirs.user_config_path("wbc") / "robots"


def own_robots() -> tuple[str, ...]:
    """Return the names of the user's own robots, those that `save` wrote, in alphabetical order."""
    try:
        return tuple(sorted(path.stem for path in folder().glob("*.toml")))
    except OSError:
        return ()


def is_path(name: str) -> bool:
    """Return True if the name of a robot is meant as the path of a file."""
    return name.lower().endswith(ENDINGS) or "/" in name or "\\" in name


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
    """Return the description of an MJCF or a URDF with some parameters of its reader as plain values.

    Raises `UnknownNameError` for a parameter that the reader does not have, `InputError` for a file or value that
    cannot be used.
    """
    with decoding(path, "robot that can be read"):
        known = {"name": path.stem, **{name: _typed(name, value) for name, value in parameters.items()}}
        text = re.sub(r"<!--.*?-->|<\?.*?\?>", "", read_xml(path, "robot file"), flags=re.DOTALL)
        if text.lstrip().startswith("<robot"):
            return call_checked("URDF reader", RobotDescription.from_urdf, {"source": path, **known})
        return call_checked("MJCF reader", RobotDescription.from_mjcf, {"source": path, **known})


def save(name: str, path: str | Path, parameters: Mapping[str, Any]) -> Path:
    """Check a robot, write its TOML description to the user's configuration folder and return the file.

    `load` finds it by the name from now on. Raises `InputError` for a name or a robot that cannot be used.
    """
    if not re.fullmatch(r"\w[\w.-]*", name) or name in RESERVED or is_path(name):
        raise InputError(
            f"the name of a robot must be letters, digits, '_', '-' and no command, got {shown(name)}"
        )
    source = Path(path).expanduser().resolve()
    describe(source, {**parameters, "name": name})
    lines, tables = [f"file = {json.dumps(str(source), ensure_ascii=False)}"], []
    for key, value in parameters.items():
        if isinstance(value, Mapping):
            tables += [f"[{key}]", *(f"{json.dumps(each)} = {json.dumps(v)}" for each, v in value.items())]
        else:
            lines.append(f"{key} = {json.dumps(value, ensure_ascii=False)}")
    target = folder() / f"{name}.toml"
    target.parent.mkdir(parents=True, exist_ok=True)
    write_text(target, "\n".join([f"# wbc robots add: `--robot {name}` reads it.", *lines, *tables, ""]))
    return target


def _typed(name: str, value: Any) -> Any:
    """Return a plain value of a TOML as the readers take it: tables as frames and rules, lists as tuples."""
    if isinstance(value, Mapping) and name in ("left_sole", "right_sole", "imu"):
        if "length" in value:
            return from_json(SoleDescription, {"frame": name, "name": name.replace("sole", "foot"), **value})
        return from_json(FrameDescription, {"frame": name, **value})
    if isinstance(value, Mapping) and name == "servo":
        return from_json(ServoRule, value)
    if isinstance(value, Mapping):
        return {key: tuple(each) if isinstance(each, list) else each for key, each in value.items()}
    return tuple(value) if isinstance(value, list) else value
