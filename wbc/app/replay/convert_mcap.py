"""Writer of logs as MCAP: messages in JSON with the schemas that Foxglove knows."""

from __future__ import annotations

import base64
import json
import math
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from wbc.app.log.reader import Log
from wbc.app.replay.groups import Group, Progress, groups_of, plain
from wbc.app.replay.replay import Replay
from wbc.app.scene.colours import ARROW_COLOURS
from wbc.app.scene.marks import translation, upright_axes
from wbc.app.scene.shapes import (
    ROOT,
    Colour,
    MeshFile,
    SceneObject,
    VisualBox,
    VisualCylinder,
    VisualEllipsoid,
)
from wbc.core.errors import Array

MEDIA = {".stl": "model/stl", ".obj": "model/obj", ".dae": "model/vnd.collada+xml"}
"""Ending of a mesh → its media type."""

Y_UP = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]])
"""Undoes the turn of a mesh that does not say what is up in it: viewers take y unless they are told otherwise."""

_FIELDS = {
    "time": "sec:integer nsec:integer",
    "Vector3": "x:number y:number z:number",
    "Quaternion": "x:number y:number z:number w:number",
    "Pose": "position:Vector3 orientation:Quaternion",
    "Color": "r:number g:number b:number a:number",
    "FrameTransforms": "transforms:FrameTransform*",
    "FrameTransform": "timestamp:time parent_frame_id:string child_frame_id:string translation:Vector3 "
    "rotation:Quaternion",
    "SceneUpdate": "deletions:SceneEntityDeletion* entities:SceneEntity*",
    "SceneEntityDeletion": "timestamp:time type:integer id:string",
    "SceneEntity": "timestamp:time frame_id:string id:string lifetime:time frame_locked:boolean arrows:Arrow* "
    "cubes:Shape* spheres:Shape* cylinders:Shape* triangles:Triangles* models:Model*",
    "Arrow": "pose:Pose shaft_length:number shaft_diameter:number head_length:number head_diameter:number color:Color",
    "Shape": "pose:Pose size:Vector3 bottom_scale:number top_scale:number color:Color",
    "Triangles": "pose:Pose points:Vector3* color:Color colors:Color* indices:integer*",
    "Model": "pose:Pose scale:Vector3 color:Color override_color:boolean media_type:string data:bytes",
    "Log": "timestamp:time level:integer message:string name:string",
}
"""Type of a message → its fields with their types; a star marks a list."""

_PRIMITIVES = ("arrows", "cubes", "spheres", "cylinders", "triangles", "models")


def write_mcap(log: Log, replay: Replay | None, new: Path, rate: float, progress: Progress) -> None:
    """Write a log: each group of signals as a topic, events, frames of the bodies, and the scene.

    Args:
        log: The log.
        replay: Its replay; None if it has none.
        new: File to write, the new one of `replacing`.
        rate: Pictures of the scene a second, 1/s.
        progress: Called after each tick.
    """
    from mcap.writer import Writer  # noqa: PLC0415 - an extra

    with new.open("wb") as file:
        writer = Writer(file)
        writer.start("", f"{log.header['program']}")
        facts = {key: value for key, value in log.header.items() if key not in ("plant", "description")}
        writer.add_metadata("wbc", {key: json.dumps(value) for key, value in facts.items()})
        topics = _Topics(writer)
        groups = [(topics.add(f"/{g.name}", f"wbc.{g.name}", _schema_of_group(g)), g) for g in groups_of(log)]
        told = dict[float, list[str]]()
        for time, event in log.events:
            told.setdefault(time, []).append(event)
        scene = None if replay is None else _SceneWriter(topics, replay)
        shown = set() if replay is None else set(replay.ticks(rate))
        for tick, time in enumerate(log.time.tolist()):
            for channel, group in groups:
                if message := _message(group, tick):
                    topics.write(channel, time, message)
            for event in told.get(time, ()):
                topics.say(time, event)
            if scene is not None and tick in shown:
                scene.write(time, tick)
            progress(tick + 1, len(log))
        writer.finish()


class _Topics:
    """Channels of a file."""

    def __init__(self, writer: Any) -> None:
        self._writer = writer
        self._log = self.add("/log", "foxglove.Log")

    def add(self, topic: str, schema: str, properties: dict[str, Any] | None = None) -> int:
        """Add a topic, and return its number; the schema is Foxglove's of that name unless it has properties."""
        content = {"title": schema, "type": "object", "properties": properties}
        if properties is None:
            content |= _schema(schema.removeprefix("foxglove."))
        number = self._writer.register_schema(schema, "jsonschema", json.dumps(content).encode())
        return int(self._writer.register_channel(topic, "json", number))

    def write(self, channel: int, time: float, message: dict[str, Any]) -> None:
        """Write a message."""
        stamp = round(1e9 * time)
        data = json.dumps(message, separators=(",", ":"), allow_nan=False).encode()
        self._writer.add_message(channel, stamp, data, stamp)

    def say(self, time: float, event: str) -> None:
        """Write an event."""
        self.write(self._log, time, {"timestamp": _stamp(time), "level": 2, "message": event, "name": "wbc"})


def _schema(kind: str) -> dict[str, Any]:
    """Return the JSON schema of a type."""
    if kind.endswith("*"):
        return {"type": "array", "items": _schema(kind[:-1])}
    if kind in _FIELDS:
        parts = (part.split(":") for part in _FIELDS[kind].split())
        return {"type": "object", "properties": {name: _schema(of) for name, of in parts}}
    return {"type": "string", "contentEncoding": "base64"} if kind == "bytes" else {"type": kind}


def _schema_of_group(group: Group) -> dict[str, Any]:
    signals = [*group.numbers.items(), *((part, signal) for part, (signal, _) in group.objects.items())]
    kinds: dict[str, dict[str, Any]] = {
        "text": {"type": "string"},
        "list": {"type": "array", "items": {"type": "number"}},
    }
    about = {part: f"{signal.about} ({signal.unit})" for part, signal in signals}
    return {
        part: {**kinds.get(s.kind, {"type": "number"}), "description": about[part]} for part, s in signals
    }


def _message(group: Group, tick: int) -> dict[str, Any]:
    """Return the values of a group in a tick, without those that there are not."""
    pairs = zip(group.numbers, group.values[tick].tolist(), strict=True)
    message: dict[str, Any] = {part: value for part, value in pairs if math.isfinite(value)}
    for part, (_, objects) in group.objects.items():
        if (value := objects[tick]) is not None:
            message[part] = value if isinstance(value, str) else value.tolist()
    return message


class _SceneWriter:
    """Frames of the bodies, the shapes on them, and all that appears beside the robot."""

    def __init__(self, topics: _Topics, replay: Replay) -> None:
        self._topics, self._replay, scene = topics, replay, replay.scene
        self._frames = topics.add("/tf", "foxglove.FrameTransforms")
        self._scene = topics.add("/scene", "foxglove.SceneUpdate")
        self._names = [plain(path.removeprefix(f"{ROOT}/")) for path in scene.moving]
        self._bodies = len(scene.bodies)
        forces = [i for i, path in enumerate(scene.moving) if path.startswith(f"{ROOT}/forces/")]
        self._marks = [i for i in range(self._bodies, len(scene.moving)) if i not in forces]
        places = {path: i for i, path in enumerate(scene.moving)}
        self._things: dict[int, list[SceneObject]] = {i: [] for i in range(-1, len(scene.moving))}
        for thing in scene.objects:
            self._things[places.get(thing.path.rpartition("/")[0], -1)].append(thing)
        self._last: Array | None = None

    def write(self, time: float, tick: int) -> None:
        """Write the frames, the forces, and what has changed since the last picture."""
        frames, stamp, bodies = self._replay.frame(tick), _stamp(time), range(self._bodies)
        transforms = []
        for name, matrix in zip(self._names, frames[: self._bodies], strict=False):
            pose = _pose(matrix)
            between = {"parent_frame_id": "world", "child_frame_id": name}
            place = {"translation": pose["position"], "rotation": pose["orientation"]}
            transforms.append({"timestamp": stamp, **between, **place})
        self._topics.write(self._frames, time, {"transforms": transforms})
        shown = np.linalg.norm(frames[:, :3, 0], axis=1) > 0.5  # hidden objects are scaled to nothing
        entities, deletions = [], []
        if self._last is None:
            entities.append(_entity(stamp, "world", "ground", self._things[-1], np.eye(4)))
            for i in bodies:
                entities.append(_entity(stamp, self._names[i], self._names[i], self._things[i], np.eye(4)))
        for i in self._marks:
            if self._last is not None and np.array_equal(self._last[i], frames[i]):
                continue
            if shown[i]:
                entities.append(_entity(stamp, "world", self._names[i], self._things[i], frames[i]))
            elif self._last is not None:
                deletions.append({"timestamp": stamp, "type": 0, "id": self._names[i]})
        forces = _entity(stamp, "world", "forces", (), np.eye(4))
        forces["arrows"] = _arrows(self._replay, tick)
        update = {"deletions": deletions, "entities": [*entities, forces]}
        self._topics.write(self._scene, time, update)
        self._last = frames


def _entity(
    stamp: dict[str, int], frame: str, name: str, things: Sequence[SceneObject], matrix: Array
) -> dict[str, Any]:
    entity: dict[str, Any] = {"timestamp": stamp, "frame_id": frame, "id": name, "lifetime": _stamp(0.0)}
    entity |= {"frame_locked": True, **{kind: [] for kind in _PRIMITIVES}}
    for thing in things:
        for kind, primitive in _primitives(thing, matrix @ thing.placement):
            entity[kind].append({**primitive, "color": _colour(thing.colour)})
    return entity


def _primitives(thing: SceneObject, placement: Array) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield the kind and the fields of each primitive of an object."""
    shape, pose = thing.shape, {"pose": _pose(placement)}
    if isinstance(shape, VisualBox):
        yield "cubes", {**pose, "size": _xyz(shape.size)}
    elif isinstance(shape, VisualEllipsoid):
        yield "spheres", {**pose, "size": _xyz(2.0 * np.array(shape.semi_axes))}
    elif isinstance(shape, VisualCylinder):
        width = 2.0 * shape.radius
        yield (
            "cylinders",
            {**pose, "size": _xyz((width, width, shape.length)), "bottom_scale": 1, "top_scale": 1},
        )
        for end in (-0.5, 0.5) if shape.round_ends else ():
            cap = placement @ translation(0.0, 0.0, end * shape.length)
            yield "spheres", {"pose": _pose(cap), "size": _xyz((width, width, width))}
    elif isinstance(shape, MeshFile):
        file, scale = Path(shape.path), shape.scale
        if (kind := MEDIA[file.suffix.lower()]) != MEDIA[".dae"]:  # which says what is up in it
            pose, scale = {"pose": _pose(placement @ Y_UP)}, (scale[0], scale[2], scale[1])
        data = base64.b64encode(file.read_bytes()).decode()
        # An STL has no colours of its own.
        own = {"scale": _xyz(scale), "override_color": kind == MEDIA[".stl"]}
        yield "models", {**pose, **own, "media_type": kind, "data": data}
    else:
        colours = [] if shape.colours is None else [_colour((*c, 1.0)) for c in shape.colours.tolist()]
        points = [_xyz(point) for point in shape.vertices]
        yield (
            "triangles",
            {**pose, "points": points, "colors": colours, "indices": shape.faces.ravel().tolist()},
        )


def _arrows(replay: Replay, tick: int) -> list[dict[str, Any]]:
    """Return an arrow for each force; pushes end at their point."""
    arrows, width = [], 0.02 * replay.scene.com_height
    for kind, point, force in replay.snapshot(tick).forces:
        reach = replay.scene.reach(force)
        length = float(np.linalg.norm(reach))
        if length < 1e-3:
            continue
        y, z, x = upright_axes(reach / length)  # the arrow points along x
        pose = np.eye(4)
        pose[:3, :3] = np.column_stack([x, y, z])
        pose[:3, 3] = point - length * x if kind == "push" else point
        shaft = {"shaft_length": 0.75 * length, "shaft_diameter": width}
        head = {"head_length": 0.25 * length, "head_diameter": 2.0 * width}
        arrows.append({"pose": _pose(pose), **shaft, **head, "color": _colour(ARROW_COLOURS[kind])})
    return arrows


def _stamp(time: float) -> dict[str, int]:
    seconds, rest = divmod(round(1e9 * time), 10**9)
    return {"sec": seconds, "nsec": rest}


def _xyz(values: Iterable[float]) -> dict[str, float]:
    return {axis: round(float(value), 5) for axis, value in zip("xyz", values, strict=True)}


def _pose(matrix: Array) -> dict[str, dict[str, float]]:
    quaternion = pin.Quaternion(matrix[:3, :3]).coeffs().tolist()
    turn = {axis: round(value, 6) for axis, value in zip("xyzw", quaternion, strict=True)}
    return {"position": _xyz(matrix[:3, 3]), "orientation": turn}


def _colour(colour: Colour) -> dict[str, float]:
    return dict(zip("rgba", (round(part, 3) for part in colour), strict=True))
