"""Header of a log: one JSON object in the metadata of the file.

format          number of the format, see `FORMAT`
program         "wbc" and its version
versions        of the code, as `wbc.sim.studies.provenance` has it: package, commit, hash of its files, libraries
created         date and time (UTC)
title           of the run
seed            of the plant; null without one
control_period  s; null for a controller of one's own
robot           name, mass_kg, soles (name, length_m, width_m), torque_limit_Nm (joint → limit)
spec            the specification of the run as plain values; null if there was none
plant           parts of the plant: description, foot (name, parameters), terrain (family, parameters, track),
                physics, noise, scene; null without a plant
description     the robot of another loop; null with a plant, or if only its model is known
"""

from __future__ import annotations

import datetime
import json
import math
from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import BaseModel, Field, ValidationError
from pydantic_core import to_json as to_json_bytes

from wbc._version import __version__
from wbc.app.log.signals import Tick
from wbc.base.errors import InputError, shown
from wbc.base.settings import Period, from_json, to_json
from wbc.feet.soles.catalog import foot, foot_name, foot_names
from wbc.robots import RobotDescription
from wbc.sim import Plant
from wbc.sim.plant.physics import PhysicsSettings
from wbc.sim.studies.provenance import provenance
from wbc.sim.terrain.families.base import terrain_families
from wbc.sim.terrain.families.image import GreyMap
from wbc.sim.terrain.spec import Terrain

FORMAT = 1
"""Format of the logs that this version writes; a new number when older readers would misread them."""

KEY = b"wbc"
"""Key of the object in the metadata of the file."""


_Side = Annotated[float, Field(gt=0.0, le=10.0)]
"""Length or width of a sole, m."""


class _Sole(BaseModel, strict=True):
    name: str
    length_m: _Side
    width_m: _Side


class _Robot(BaseModel, strict=True):
    name: str
    mass_kg: Annotated[float, Field(gt=0.0, le=1e6)]
    soles: list[_Sole]
    torque_limit_Nm: dict[str, float]


class _Versions(BaseModel, strict=True):
    libraries: dict[str, Any] = {}


class _Header(BaseModel, strict=True):
    """Types and ranges of the values of a header; spec, plant and description are checked by who makes use of them."""

    program: str = ""
    versions: _Versions = _Versions()
    created: str = ""
    title: str = ""
    seed: int | None = None
    control_period: Period | None = None
    robot: _Robot | None = None
    plant: dict[str, Any] | None = None
    description: dict[str, Any] | None = None


def make_header(tick: Tick, spec: Any = None, title: str = "") -> dict[str, Any]:
    """Return the header of a run, from its first tick; the spec is plain values."""
    robot, plant = tick.robot, tick.plant if isinstance(tick.plant, Plant) else None
    return {
        "format": FORMAT,
        "program": f"wbc {__version__}",
        "versions": dict(provenance()),
        "created": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
        "title": title or robot.name,
        "seed": None if plant is None else plant.seed,
        "control_period": None if tick.controller is None else tick.controller.dt,
        "robot": {
            "name": robot.name,
            "mass_kg": robot.mass,
            "soles": [{"name": s.name, "length_m": s.length, "width_m": s.width} for s in robot.soles],
            "torque_limit_Nm": dict(zip(robot.joint_names, robot.torque_limit.tolist(), strict=True)),
        },
        "spec": spec,
        "plant": None if plant is None else _plant_parts(plant),
        "description": to_json(tick.description if plant is None else None),
    }


def encode(header: dict[str, Any]) -> bytes:
    """Return the header as JSON, which has no infinity: it becomes a text."""
    return to_json_bytes(header, inf_nan_mode="strings", fallback=repr)


def _with_infinity(values: Any) -> Any:
    """Return values of a header with the numbers that are texts in JSON."""
    if isinstance(values, dict):
        return {name: _with_infinity(value) for name, value in values.items()}
    if isinstance(values, list):
        return [_with_infinity(value) for value in values]
    return _NO_JSON.get(values, values) if isinstance(values, str) else values


_NO_JSON = {"Infinity": math.inf, "-Infinity": -math.inf, "NaN": math.nan}


def decode(where: str, stored: dict[bytes, bytes] | None) -> dict[str, Any]:
    """Return the header in the metadata of a file with a name; `InputError` for no log of wbc, or another format."""
    if not stored or KEY not in stored:
        raise InputError(f"{where} is an Arrow file but no log of wbc: it has no metadata '{KEY.decode()}'")
    try:
        header = json.loads(stored[KEY])
        for part in ("plant", "spec", "description"):
            if part in header:
                header[part] = _with_infinity(header[part])
        number = header["format"]
        if number == FORMAT:
            _Header.model_validate(header)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        place, got = ".".join(map(str, first["loc"])), shown(first["input"])
        raise InputError(
            f"{where}: '{place}' of its header cannot be used: {first['msg']}, got {got}"
        ) from error
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise InputError(f"{where}: the metadata '{KEY.decode()}' cannot be read ({shown(error)})") from error
    if number != FORMAT:
        raise InputError(
            f"{where} was written by {header.get('program', 'another version')} in format {number}; "
            f"wbc {__version__} reads format {FORMAT}"
        )
    return dict(header)


def _plant_parts(plant: Plant) -> dict[str, Any]:
    ground = to_json(plant.terrain)
    source = getattr(plant.terrain.parameters, "source", None)
    if isinstance(source, GreyMap):
        ground["parameters"]["source"] = source.array.tolist()
    return {
        "description": to_json(plant.description),
        "foot": {"name": foot_name(plant.foot), "parameters": to_json(plant.foot)},
        "terrain": {"family": plant.terrain.name, **ground},
        "physics": to_json(plant.physics),
        "noise": to_json(plant.noise),
        "timestep": plant.timestep,
        "scene": plant.scene,
        "start": plant.start.tolist(),
    }


def _own(kind: str, name: str, known: Mapping[str, type[Any]]) -> type[Any]:
    """Return the class of a foot or a ground, which may be one of one's own."""
    if name not in known:
        raise InputError(
            f"{kind} '{name}' is not known here: register it before the log is replayed, or name the file that does "
            f"with --code; known are {', '.join(known)}"
        )
    return known[name]


def read_plant(header: dict[str, Any]) -> Plant:
    """Return the plant of a header, without sensor errors; feet and grounds of one's own must be registered."""
    parts = header["plant"]
    ground = dict(parts["terrain"])
    family = _own("ground", ground.pop("family"), terrain_families())
    ground["parameters"] = from_json(family, ground["parameters"])
    own_foot = _own("foot", parts["foot"]["name"], {name: type(foot(name)) for name in foot_names()})
    return Plant(
        from_json(RobotDescription, parts["description"]),
        foot=from_json(own_foot, parts["foot"]["parameters"]),
        terrain=Terrain(**ground),
        physics=from_json(PhysicsSettings, parts["physics"]),
        timestep=float(parts["timestep"]),
        control_period=float(header["control_period"]),
        seed=int(header.get("seed") or 0),
        scene=parts.get("scene"),
        initial_configuration=parts.get("start"),
    )
