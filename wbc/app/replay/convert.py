"""Logs for Rerun, an open viewer of robots' data: files of its format RRD.

Signals keep their rate; each group, such as `com/estimated`, is one entity. Of a log that can be replayed, the scene
follows: ground, bodies with their frames, contact forces, footsteps. Names hold no spaces.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from wbc.app.files import check_target
from wbc.app.log.reader import Log
from wbc.app.log.signals import Signal
from wbc.app.replay.replay import Replay
from wbc.app.scene.robot_shapes import read_mesh
from wbc.app.scene.shapes import MeshFile, SceneObject, Surface
from wbc.core.arguments import checked
from wbc.core.errors import InputError
from wbc.core.files import replacing
from wbc.core.settings import Positive

RATE = 30.0
"""Rate at which the scene is written, 1/s."""

READABLE = (".stl", ".obj", ".glb", ".gltf")
"""Mesh formats that Rerun reads; coal reads the others."""


def check_conversion(path: str | Path, inputs: Iterable[str | Path] = ()) -> Path:
    """Return the path of a file to convert to after a check by `check_target`; `InputError` without rerun, too."""
    target = check_target("a converted log", path, (".rrd",), inputs)
    if importlib.util.find_spec("rerun") is None:
        raise InputError(f'{target.name} needs the extra "rerun": pip install -e ".[rerun]" in the clone')
    return target


@checked
def convert_log(
    log: Log,
    path: str | Path,
    *,
    rate: Annotated[Positive, "1/s"] = RATE,
    progress: Callable[[int, int], None] | None = None,
) -> str | None:
    """Write a log as RRD.

    Args:
        log: The log.
        path: File to write, .rrd.
        rate: Pictures of the scene for each second of the run, 1/s; signals keep their own.
        progress: Called with the number of finished groups and of all.

    Returns:
        Reason why the file holds the signals alone; None if it holds the scene, too.

    Raises:
        InputError: A path that cannot be written, no rerun, a rate that is not above zero, or an empty log.
    """
    target = check_conversion(path, [log.path])
    import rerun as rr  # noqa: PLC0415 - an extra

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
    with replacing(target) as new:
        stream: Any = rr.RecordingStream("wbc", default_enabled=True)
        stream.save(new)
        stream.send_recording_name(_plain(str(log.header.get("title") or log.path.stem)))
        for i, (name, signals) in enumerate(groups.items()):
            _write_numbers(rr, stream, log, _plain(name), signals)
            for signal in signals:
                if signal.kind == "text":  # lists are drawn in the scene
                    _write_texts(rr, stream, log, signal.name)
            if progress is not None:
                progress(i + 1, len(groups))
        if replay is not None:
            _write_scene(rr, stream, replay, rate)
        stream.disconnect()
    return reason


def _plain(name: str) -> str:
    """Return a name without spaces."""
    return "_".join(name.split())


def _write_numbers(rr: Any, stream: Any, log: Log, entity: str, signals: list[Signal]) -> None:
    """Write the signals of a group that have a number in at least one tick."""
    numbers = [s for s in signals if s.kind not in ("text", "list") and np.isfinite(log[s.name]).any()]
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
    """Write the shapes, and the moving ones under transforms."""
    ticks = replay.ticks(rate)
    frames = np.array([replay.frame(tick) for tick in ticks], dtype=np.float32)
    times = rr.TimeColumn("time", duration=replay.log.time[ticks])
    stream.log("/", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    for i, name in enumerate(replay.scene.moving):
        placements = rr.Transform3D.columns(mat3x3=frames[:, i, :3, :3], translation=frames[:, i, :3, 3])
        stream.send_columns(_plain(name), [times], placements)
    for thing in replay.scene.objects:
        matrix = thing.placement
        if isinstance(thing.shape, MeshFile):
            matrix = matrix @ np.diag([*thing.shape.scale, 1.0])
        place = rr.Transform3D(mat3x3=matrix[:3, :3], translation=matrix[:3, 3])
        stream.log(_plain(thing.path), place, _shape(rr, thing), static=True)


def _shape(rr: Any, thing: SceneObject) -> Any:
    """Return Rerun's shape of an object."""
    shape, colour = thing.shape, tuple(round(255 * part) for part in thing.colour)
    if isinstance(shape, MeshFile) and Path(shape.path).suffix.lower() in READABLE:
        return rr.Asset3D(path=shape.path, albedo_factor=colour)
    if isinstance(shape, Surface):
        vertices, faces, tints = shape.vertices, shape.faces, shape.colours
    else:
        (vertices, faces), tints = read_mesh(shape.path), None
    tint = (
        {"albedo_factor": colour}
        if tints is None
        else {"vertex_colors": np.round(255 * tints).astype(np.uint8)}
    )
    return rr.Mesh3D(vertex_positions=vertices, triangle_indices=faces, **tint)
