"""Logs for Foxglove, an open viewer of robots' data: files of the format MCAP.

Each group of signals, such as `/com/estimated`, is a topic of JSON messages whose schema has names and units. Texts are
messages of `/texts`. Of a log that can be replayed, `/tf` has the places of the bodies, `/robot` their shapes, `/marks`
contact forces and footsteps, `/map` what is known of the ground.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from wbc.app.log.reader import Log
from wbc.app.log.signals import Signal
from wbc.app.view.marks import Mark, Picture, mark_mesh
from wbc.app.view.meshes import Mesh
from wbc.app.view.stage import DrawnScene, Stage
from wbc.robots.mechanism import Colour

WORLD = "world"
"""Frame of the ground, of marks and of all places."""


class FoxgloveFile:
    """A file that is being written; `close` completes it."""

    def __init__(self, path: Path, log: Log) -> None:
        import foxglove  # noqa: PLC0415 - an extra
        from foxglove import channels, messages  # noqa: PLC0415

        self._foxglove, self._channels, self._messages = foxglove, channels, messages
        self._log, self._context = log, foxglove.Context()
        self._writer = foxglove.open_mcap(path, allow_overwrite=True, context=self._context)
        self._said: Any = channels.LogChannel("/texts", context=self._context)

    def write_numbers(self, group: str, signals: Sequence[Signal]) -> None:
        """Write the numbers of a group, one message a tick; a value that is not known is left out."""
        names = [signal.name.rpartition("/")[2] for signal in signals]
        properties = {
            name: {"type": "number", "description": f"{signal.unit}: {signal.about}"}
            for name, signal in zip(names, signals, strict=True)
        }
        schema = {"type": "object", "title": f"wbc.{group.replace('/', '.')}", "properties": properties}
        topic = self._foxglove.Channel(f"/{group}", schema=schema, context=self._context)
        rows = np.column_stack([self._log[signal.name] for signal in signals])
        for time, row in zip(self._log.time, rows.tolist(), strict=True):
            known = {name: value for name, value in zip(names, row, strict=True) if np.isfinite(value)}
            topic.log(known, log_time=_nanoseconds(time))

    def write_texts(self, name: str) -> None:
        """Write the texts of a signal where they change."""
        last = None
        for time, text in zip(self._log.time, self._log.texts(name), strict=True):
            if text is not None and text != last:
                at = _timestamp(self._messages, time)
                level = self._messages.LogLevel.Info
                said = self._messages.Log(timestamp=at, level=level, name=name, message=str(text))
                self._said.log(said, log_time=_nanoseconds(time))
            last = text

    def scene(self, stage: Stage) -> FoxgloveScene:
        """Begin the scene of a stage."""
        return FoxgloveScene(stage, self._channels, self._messages, self._context)

    def close(self) -> None:
        """Complete the file."""
        self._writer.close()


class FoxgloveScene(DrawnScene):
    """Scene in a file of Foxglove: shapes under the transforms of their bodies, and marks.

    Each picture has all of its marks, so that a viewer may begin with any of them.
    """

    def __init__(self, stage: Stage, channels: Any, messages: Any, context: Any) -> None:
        super().__init__(stage)
        self._messages = messages
        self._names = {0: WORLD} | {each: stage.model.body(each).name or str(each) for each in self.moving}
        self._robot, self._beside, self._map = (
            channels.SceneUpdateChannel(topic, context=context) for topic in ("/robot", "/marks", "/map")
        )
        self._tf = channels.FrameTransformsChannel("/tf", context=context)
        self._entities: dict[str, Any] = {}  # of the marks, by their names
        # Of the present picture: time, places of bodies, shapes painted anew, and whether clouds have come or gone.
        self._at, self._places, self._shapes, self._clouded = None, list[Any](), list[Any](), False

    def draw(self, picture: Picture) -> None:
        """See `DrawnScene`."""
        messages, when = self._messages, {"log_time": _nanoseconds(picture.time)}
        self._at, self._clouded = _timestamp(messages, picture.time), False
        self._places, self._shapes = [], []
        super().draw(picture)
        self._tf.log(messages.FrameTransforms(transforms=self._places), **when)
        if self._shapes:
            self._robot.log(messages.SceneUpdate(entities=self._shapes), **when)
        self._beside.log(self._all(clouds=False), **when)
        if self._clouded:
            self._map.log(self._all(clouds=True), **when)

    def _move(self, body: int) -> None:
        messages, data, child = self._messages, self.stage.data, self._names[body]
        place = messages.Vector3(**dict(zip("xyz", data.xpos[body].tolist(), strict=True)))
        turn = messages.Quaternion(**dict(zip("wxyz", data.xquat[body].tolist(), strict=True)))
        parts = {"parent_frame_id": WORLD, "child_frame_id": child, "translation": place, "rotation": turn}
        self._places.append(messages.FrameTransform(timestamp=self._at, **parts))

    def _paint(self, number: int, colour: Colour) -> None:
        body, _, mesh = self.meshes[number]
        frame = self._names[body]
        self._shapes.append(self._entity(f"{frame}/{number}", frame, mesh, colour, locked=True))

    def _show(self, mark: Mark) -> None:
        self._entities[mark.name] = self._entity(mark.name, WORLD, mark_mesh(mark), mark.colour)
        self._clouded |= mark.kind == "cloud"

    def _erase(self, mark: Mark) -> None:
        del self._entities[mark.name]
        self._clouded |= mark.kind == "cloud"

    def _all(self, *, clouds: bool) -> Any:
        """Return the update by which all clouds, or all other marks, take the place of those of their topic."""
        messages, shown = self._messages, self._marks
        gone = messages.SceneEntityDeletion(type=messages.SceneEntityDeletionType.All)
        entities = [each for name, each in self._entities.items() if (shown[name].kind == "cloud") is clouds]
        return messages.SceneUpdate(deletions=[gone], entities=entities)

    def _entity(self, name: str, frame: str, mesh: Mesh, colour: Colour, *, locked: bool = False) -> Any:
        messages = self._messages
        triangles = messages.TriangleListPrimitive(
            points=[messages.Point3(x=x, y=y, z=z) for x, y, z in mesh.vertices.tolist()],
            indices=np.asarray(mesh.faces).ravel().tolist(),
            color=messages.Color(**dict(zip("rgba", colour, strict=True))),
        )
        return messages.SceneEntity(id=name, frame_id=frame, frame_locked=locked, triangles=[triangles])


def _timestamp(messages: Any, time: float) -> Any:
    return messages.Timestamp(*divmod(_nanoseconds(time), 10**9))


def _nanoseconds(time: float) -> int:
    return max(round(1e9 * time), 0)
