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
from wbc.app.replay.replay import Replay
from wbc.app.view.marks import Mark, mark_mesh, repainted
from wbc.app.view.meshes import Mesh, body_meshes
from wbc.robots.mechanism import Colour

WORLD = "world"
"""Frame of the ground, of marks and of all places."""


class FoxgloveFile:
    """A file that is being written; `close` completes it."""

    def __init__(self, path: Path, log: Log) -> None:
        """Begin the file of a log; an empty file of this name is replaced."""
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
                at = self._timestamp(time)
                level = self._messages.LogLevel.Info
                said = self._messages.Log(timestamp=at, level=level, name=name, message=str(text))
                self._said.log(said, log_time=_nanoseconds(time))
            last = text

    def write_scene(self, replay: Replay, rate: float) -> None:
        """Write bodies and marks so many times a second, 1/s."""
        channels, messages, context = self._channels, self._messages, self._context
        meshes = body_meshes(replay.model)
        moving = sorted({each.body for each in meshes} - {0})
        names = {0: WORLD} | {body: replay.model.body(body).name or str(body) for body in moving}
        painted: dict[int, Colour] = {}  # shapes as they were written last
        robot, marks, ground = (
            channels.SceneUpdateChannel(topic, context=context) for topic in ("/robot", "/marks", "/map")
        )
        places = channels.FrameTransformsChannel("/tf", context=context)
        clouds: list[Mark] = []
        for tick in replay.ticks(rate):
            picture = replay.picture(tick)
            at, log_time = self._timestamp(picture.time), _nanoseconds(picture.time)
            transforms = []
            for body in moving:
                w, x, y, z = replay.data.xquat[body].tolist()
                place = messages.Vector3(**dict(zip("xyz", replay.data.xpos[body].tolist(), strict=True)))
                turn = messages.Quaternion(x=x, y=y, z=z, w=w)
                transforms.append(
                    messages.FrameTransform(
                        timestamp=at,
                        parent_frame_id=WORLD,
                        child_frame_id=names[body],
                        translation=place,
                        rotation=turn,
                    )
                )
            places.log(messages.FrameTransforms(transforms=transforms), log_time=log_time)
            shapes = []
            for number, colour in repainted(painted, meshes, picture.colours):
                frame = names[meshes[number].body]
                shape = self._entity(f"{frame}/{number}", frame, meshes[number].mesh, colour, locked=True)
                shapes.append(shape)
            if shapes:
                robot.log(messages.SceneUpdate(entities=shapes), log_time=log_time)
            marks.log(self._scene([m for m in picture.marks if m.kind != "cloud"]), log_time=log_time)
            found = [mark for mark in picture.marks if mark.kind == "cloud"]
            if [*map(id, found)] != [*map(id, clouds)]:
                clouds = found
                ground.log(self._scene(clouds), log_time=log_time)

    def close(self) -> None:
        """Complete the file."""
        self._writer.close()

    def _scene(self, marks: Sequence[Mark]) -> Any:
        """Return the update by which these marks take the place of all others of their topic."""
        messages = self._messages
        gone = messages.SceneEntityDeletion(type=messages.SceneEntityDeletionType.All)
        entities = [self._entity(mark.name, WORLD, mark_mesh(mark), mark.colour) for mark in marks]
        return messages.SceneUpdate(deletions=[gone], entities=entities)

    def _entity(self, name: str, frame: str, mesh: Mesh, colour: Colour, *, locked: bool = False) -> Any:
        messages = self._messages
        triangles = messages.TriangleListPrimitive(
            points=[messages.Point3(x=x, y=y, z=z) for x, y, z in mesh.vertices.tolist()],
            indices=np.asarray(mesh.faces).ravel().tolist(),
            color=messages.Color(**dict(zip("rgba", colour, strict=True))),
        )
        return messages.SceneEntity(id=name, frame_id=frame, frame_locked=locked, triangles=[triangles])

    def _timestamp(self, time: float) -> Any:
        return self._messages.Timestamp(*divmod(_nanoseconds(time), 10**9))


def _nanoseconds(time: float) -> int:
    return max(round(1e9 * time), 0)
