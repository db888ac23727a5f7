"""Writer of logs as RRD, the format of Rerun."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from wbc.app.log.reader import Log
from wbc.app.replay.groups import Group, Progress, groups_of, plain
from wbc.app.replay.replay import Replay
from wbc.app.scene.robot_shapes import read_mesh
from wbc.app.scene.shapes import MeshFile, SceneObject, Surface, VisualBox, VisualCylinder, VisualEllipsoid

READABLE = (".stl", ".obj", ".glb", ".gltf")
"""Mesh formats that Rerun reads; coal reads the others."""


def write_rrd(log: Log, replay: Replay | None, new: Path, rate: float, progress: Progress) -> None:
    """Write a log: signals as scalars, states as such, other texts as texts, the scene as shapes under transforms.

    Args:
        log: The log.
        replay: Its replay; None if it has none.
        new: File to write, the new one of `replacing`.
        rate: Pictures of the scene a second, 1/s.
        progress: Called after each group.
    """
    import rerun as rr  # noqa: PLC0415 - an extra

    stream: Any = rr.RecordingStream("wbc", default_enabled=True)
    stream.save(new)
    stream.send_recording_name(plain(str(log.header.get("title") or log.path.stem)))
    groups = groups_of(log)
    for i, group in enumerate(groups):
        _write_group(rr, stream, log, group)
        progress(i + 1, len(groups))
    if replay is not None:
        _write_scene(rr, stream, log, replay, rate)
    stream.disconnect()


def _write_group(rr: Any, stream: Any, log: Log, group: Group) -> None:
    if group.numbers:
        names = [f"{part} ({signal.unit})" for part, signal in group.numbers.items()]
        stream.log(group.name, rr.SeriesLines(names=names), static=True)
        columns = rr.Scalars.columns(scalars=group.values.ravel())
        sizes = np.full(len(log), len(names))
        stream.send_columns(group.name, [rr.TimeColumn("time", duration=log.time)], columns.partition(sizes))
    for part, (signal, texts) in group.objects.items():
        if signal.kind != "text":  # lists are drawn in the scene
            continue
        told = [i for i, text in enumerate(texts) if text is not None]
        columns = rr.TextLog.columns(text=[texts[i] for i in told])  # events
        if len(told) == len(log):  # states, which last until the next one
            told = [i for i in told if i == 0 or texts[i] != texts[i - 1]]
            columns = rr.StateChange.columns(state=[texts[i] for i in told])
        times = rr.TimeColumn("time", duration=log.time[told])
        stream.send_columns(f"{group.name}/{part}", [times], columns)


def _write_scene(rr: Any, stream: Any, log: Log, replay: Replay, rate: float) -> None:
    ticks = replay.ticks(rate)
    frames = np.array([replay.frame(tick) for tick in ticks], dtype=np.float32)
    times = rr.TimeColumn("time", duration=log.time[ticks])
    stream.log("/", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    for i, name in enumerate(replay.scene.moving):
        placements = rr.Transform3D.columns(mat3x3=frames[:, i, :3, :3], translation=frames[:, i, :3, 3])
        stream.send_columns(plain(name), [times], placements)
    for thing in replay.scene.objects:
        matrix = thing.placement
        if isinstance(thing.shape, MeshFile):
            matrix = matrix @ np.diag([*thing.shape.scale, 1.0])
        place = rr.Transform3D(mat3x3=matrix[:3, :3], translation=matrix[:3, 3])
        stream.log(plain(thing.path), place, _shape(rr, thing), static=True)


def _shape(rr: Any, thing: SceneObject) -> Any:
    """Return Rerun's shape of an object."""
    shape, colour = thing.shape, tuple(round(255 * part) for part in thing.colour)
    solid = {"colors": [colour], "fill_mode": "solid"}
    if isinstance(shape, VisualBox):
        return rr.Boxes3D(sizes=[shape.size], **solid)
    if isinstance(shape, VisualEllipsoid):
        return rr.Ellipsoids3D(half_sizes=[shape.semi_axes], **solid)
    if isinstance(shape, VisualCylinder):
        size = {"lengths": [shape.length], "radii": [shape.radius]}
        if shape.round_ends:
            return rr.Capsules3D(**size, translations=[(0.0, 0.0, -0.5 * shape.length)], **solid)
        return rr.Cylinders3D(**size, **solid)
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
