"""Logs for open viewers of robots' data: files of Rerun's format RRD, and of Foxglove's MCAP (`foxglove`).

Signals keep their rate; each group, such as `com/estimated`, is one entity. Of a log that can be replayed, the pictures
follow: ground, bodies with their frames, and marks such as contact forces and footsteps. Names hold no spaces.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from wbc.app.log.reader import Log
from wbc.app.log.signals import Signal
from wbc.app.replay.foxglove import FoxgloveFile
from wbc.app.replay.replay import Replay
from wbc.app.view.marks import Mark, changes, mark_mesh
from wbc.app.view.meshes import Colour, Mesh, body_meshes
from wbc.base.checked import checked
from wbc.base.errors import InputError
from wbc.base.files import check_target, replacing
from wbc.base.settings import Positive

VIEWERS = {".rrd": ("rerun", "rerun"), ".mcap": ("foxglove", "foxglove")}
"""Ending of a file → the module that writes it, and the extra that brings this module."""

RATE = 30.0
"""Rate at which the scene is written, 1/s."""


def check_conversion(path: str | Path, inputs: Iterable[str | Path] = ()) -> Path:
    """Return the path of a file to convert to, after `check_target` and a check that its writer is there."""
    target = check_target("a converted log", path, tuple(VIEWERS), inputs)
    module, extra = VIEWERS[target.suffix.lower()]
    if importlib.util.find_spec(module) is None:
        raise InputError(f'{target.name} needs the extra "{extra}": pip install -e ".[{extra}]" in the clone')
    return target


@checked
def convert_log(
    log: Log,
    path: str | Path,
    *,
    rate: Annotated[Positive, "1/s"] = RATE,
    progress: Callable[[Sequence[Any]], Iterable[Any]] = iter,
) -> str | None:
    """Write a log as an RRD file for Rerun, or as an MCAP file for Foxglove.

    Args:
        log: The log.
        path: File to write, .rrd or .mcap.
        rate: Pictures of the scene per second of the run, Hz; signals keep their own rate.
        progress: Wrapper that shows the progress, as for `render_video`.

    Returns:
        Reason why the file contains only the signals; None if it also contains the scene.
    """
    target = check_conversion(path, [log.path])
    if not len(log):
        raise InputError(f"{log.path} holds no ticks; there is nothing to convert")
    reason = replay = None
    try:
        replay = Replay(log)
    except InputError as error:
        reason = str(error)
    groups: dict[str, list[Signal]] = {}
    for name, signal in log.signals.items():
        if name != "time":
            groups.setdefault(name.rpartition("/")[0] or name, []).append(signal)
    write = _write_rrd if target.suffix.lower() == ".rrd" else _write_mcap
    with replacing(target) as new:
        write(new, log, progress(list(groups.items())), replay, rate)
    return reason


def _write_mcap(
    new: Path, log: Log, groups: Iterable[tuple[str, list[Signal]]], replay: Replay | None, rate: float
) -> None:
    file = FoxgloveFile(new)
    try:
        for name, signals in groups:
            if numbers := with_numbers(log, signals):
                file.write_numbers(log, name, numbers)
            for signal in signals:
                if signal.kind == "text":
                    file.write_texts(log, signal.name)
        if replay is not None:
            file.write_scene(replay, rate)
    finally:
        file.close()


def _write_rrd(
    new: Path, log: Log, groups: Iterable[tuple[str, list[Signal]]], replay: Replay | None, rate: float
) -> None:
    import rerun as rr  # noqa: PLC0415 - an extra

    stream: Any = rr.RecordingStream("wbc", default_enabled=True)
    content = stream.binary_stream()  # a full disk is no error of a stream that writes a file
    stream.send_recording_name(_plain(str(log.header.get("title") or log.path.stem)))
    for name, signals in groups:
        _write_numbers(rr, stream, log, _plain(name), signals)
        for signal in signals:
            if signal.kind == "text":  # lists are drawn in the scene
                _write_texts(rr, stream, log, signal.name)
    if replay is not None:
        _write_scene(rr, stream, replay, rate)
    new.write_bytes(content.read())
    stream.disconnect()


def with_numbers(log: Log, signals: Sequence[Signal]) -> list[Signal]:
    """Return the signals that have a number in at least one tick."""
    return [s for s in signals if s.kind not in ("text", "list") and np.isfinite(log[s.name]).any()]


def _plain(name: str) -> str:
    return "_".join(name.split())


def _write_numbers(rr: Any, stream: Any, log: Log, entity: str, signals: list[Signal]) -> None:
    """Write the signals of a group that have a number in at least one tick."""
    numbers = with_numbers(log, signals)
    if not numbers:
        return
    names = [f"{_plain(signal.name.rpartition('/')[2])} ({signal.unit})" for signal in numbers]
    stream.log(entity, rr.SeriesLines(names=names), static=True)
    columns = rr.Scalars.columns(scalars=np.column_stack([log[signal.name] for signal in numbers]).ravel())
    sizes = np.full(len(log), len(names))
    stream.send_columns(entity, [rr.TimeColumn("time", duration=log.time)], columns.partition(sizes))


def _write_texts(rr: Any, stream: Any, log: Log, name: str) -> None:
    """Write states as such, which last until the next one, and other texts as events."""
    texts = log.texts(name)
    told = [i for i, text in enumerate(texts) if text is not None]
    if not told:
        return
    columns = rr.TextLog.columns(text=[texts[i] for i in told])
    if len(told) == len(log):
        told = [i for i in told if i == 0 or texts[i] != texts[i - 1]]
        columns = rr.StateChange.columns(state=[texts[i] for i in told])
    stream.send_columns(_plain(name), [rr.TimeColumn("time", duration=log.time[told])], columns)


def _write_scene(rr: Any, stream: Any, replay: Replay, rate: float) -> None:
    """Write bodies under transforms, and marks at the times at which they change."""
    ticks, meshes = replay.ticks(rate), body_meshes(replay.model)
    moving = sorted({each.body for each in meshes} - {0})
    names = {body: f"robot/{_plain(replay.model.body(body).name or str(body))}" for body in moving} | {
        0: "ground"
    }
    places = np.empty((len(ticks), len(moving), 3))
    turns = np.empty((len(ticks), len(moving), 3, 3))
    shown: dict[str, Mark] = {}
    stream.log("/", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    for i, tick in enumerate(ticks):
        picture = replay.picture(tick)
        places[i] = replay.data.xpos[moving]
        turns[i] = replay.data.xmat[moving].reshape(-1, 3, 3)
        stream.set_time("time", duration=picture.time)
        for name, mark in changes(shown, picture.marks):
            drawn = rr.Clear(recursive=False) if mark is None else _mesh(rr, mark_mesh(mark), mark.colour)
            stream.log(f"marks/{_plain(name)}", drawn)
    stream.reset_time()
    times = rr.TimeColumn("time", duration=replay.log.time[ticks])
    for i, body in enumerate(moving):
        placements = rr.Transform3D.columns(mat3x3=turns[:, i], translation=places[:, i])
        stream.send_columns(names[body], [times], placements)
    for number, (body, colour, mesh) in enumerate(meshes):
        stream.log(f"{names[body]}/{number}", _mesh(rr, mesh, colour), static=True)


def _mesh(rr: Any, mesh: Mesh, colour: Colour) -> Any:
    tint = tuple(round(255 * part) for part in colour)
    return rr.Mesh3D(vertex_positions=mesh.vertices, triangle_indices=mesh.faces, albedo_factor=tint)
