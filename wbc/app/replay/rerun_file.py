"""Files of Rerun, RRD: signals, and bodies and marks of the scene. Names hold no spaces."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from wbc.app.log.reader import Log
from wbc.app.log.signals import Signal
from wbc.app.replay.replay import Replay
from wbc.app.view.marks import Mark, Picture, changes, mark_mesh
from wbc.app.view.meshes import Mesh, body_meshes, normals
from wbc.app.view.stage import Stage
from wbc.robots.mechanism import Colour

WAIT = 3600.0
"""Time after which Rerun writes rows that are no full chunk, s."""


class RerunFile:
    """A file for Rerun that is being written; `close` completes it."""

    def __init__(self, path: Path, log: Log) -> None:
        """Begin the file of a log."""
        import rerun  # noqa: PLC0415 - an extra

        self._path, self._log, self._rerun = path, log, rerun
        chunks = rerun.ChunkBatcherConfig(
            flush_tick=WAIT
        )  # large ones: each has a head of a kilobyte or more
        self._stream: Any = rerun.RecordingStream("wbc", default_enabled=True, batcher_config=chunks)
        self._content = self._stream.binary_stream()  # a full disk is no error of a stream that writes a file
        self._stream.send_recording_name(plain(str(log.header.get("title") or log.path.stem)))

    def write_numbers(self, group: str, signals: Sequence[Signal]) -> None:
        """Write the numbers of a group as one entity."""
        rerun, log, entity = self._rerun, self._log, plain(group)
        names = [f"{plain(signal.name.rpartition('/')[2])} ({signal.unit})" for signal in signals]
        self._stream.log(entity, rerun.SeriesLines(names=names), static=True)
        values = np.column_stack([log[signal.name] for signal in signals]).ravel()
        columns = rerun.Scalars.columns(scalars=values).partition(np.full(len(log), len(names)))
        self._stream.send_columns(entity, [rerun.TimeColumn("time", duration=log.time)], columns)

    def write_texts(self, name: str) -> None:
        """Write states as such, which last until the next one, and other texts as events."""
        texts, rerun = self._log.texts(name), self._rerun
        told = [i for i, text in enumerate(texts) if text is not None]
        if not told:
            return
        columns = rerun.TextLog.columns(text=[texts[i] for i in told])
        if len(told) == len(texts):
            told = [i for i in told if i == 0 or texts[i] != texts[i - 1]]
            columns = rerun.StateChange.columns(state=[texts[i] for i in told])
        times = rerun.TimeColumn("time", duration=self._log.time[told])
        self._stream.send_columns(plain(name), [times], columns)

    def write_scene(self, replay: Replay, rate: float) -> None:
        """Write bodies and marks so many times a second, 1/s."""
        scene = RerunScene(self._stream, replay)
        for tick in replay.ticks(rate):
            scene.draw(replay.picture(tick))

    def close(self) -> None:
        """Complete the file."""
        self._path.write_bytes(self._content.read())
        self._stream.disconnect()


class RerunScene:
    """Bodies of a stage under transforms, and its marks, in a stream of Rerun."""

    def __init__(self, stream: Any, stage: Stage) -> None:
        """Write the shapes."""
        import rerun  # noqa: PLC0415 - an extra

        self._rerun: Any = rerun
        self._stream, self._data = stream, stage.data
        self._shown: dict[str, Mark] = {}
        self._names = {0: "ground"}
        self._colours: dict[str, tuple[int, Colour]] = {}  # of shapes, with their bodies
        self._painted: dict[str, Colour] = {}
        stream.log("/", rerun.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        for number, (body, colour, mesh) in enumerate(body_meshes(stage.model)):
            place = f"robot/{plain(stage.model.body(body).name or str(body))}"
            name = f"{self._names.setdefault(body, place)}/{number}"
            self._colours[name] = body, colour
            stream.log(name, self._mesh(mesh), static=True)

    def draw(self, picture: Picture) -> None:
        """Write places of bodies, and the colours and marks that have changed."""
        self._stream.set_time("time", duration=picture.time)
        for body, name in self._names.items():
            if body > 0:
                turn, place = np.roll(self._data.xquat[body], -1), self._data.xpos[body]  # to xyzw
                self._stream.log(name, self._rerun.Transform3D(quaternion=turn, translation=place))
        for name, (body, own) in self._colours.items():
            if self._painted.get(name) != (colour := picture.colours.get(body, own)):
                self._painted[name] = colour
                self._stream.log(name, self._rerun.Mesh3D.from_fields(albedo_factor=tint(colour)))
        for name, mark in changes(self._shown, picture.marks):
            gone = self._rerun.Clear(recursive=False)
            drawn = gone if mark is None else self._mesh(mark_mesh(mark), albedo_factor=tint(mark.colour))
            self._stream.log(f"marks/{plain(name)}", drawn)

    def _mesh(self, mesh: Mesh, **how: Any) -> Any:
        vertices, faces = mesh
        return self._rerun.Mesh3D(
            vertex_positions=vertices, triangle_indices=faces, vertex_normals=normals(mesh), **how
        )


def tint(colour: Colour) -> tuple[int, ...]:
    """Return a colour as Rerun has it."""
    return tuple(round(255 * part) for part in colour)


def plain(name: str) -> str:
    """Return a name without spaces."""
    return "_".join(name.split())
