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
from wbc.app.view.rerun_view import RerunScene, plain
from wbc.app.view.scene import DrawnScene
from wbc.app.view.stage import Stage
from wbc.base.checked import checked
from wbc.base.errors import InputError
from wbc.base.files import check_target, replacing
from wbc.base.settings import Positive

FORMATS = {".rrd": ("rerun", "rerun"), ".mcap": ("foxglove", "foxglove")}
"""Ending of a file → the module that writes it, and the extra that brings this module."""

WAIT = 3600.0
"""Time after which Rerun writes rows that are no full chunk, s."""

RATE = 30.0
"""Rate at which the scene is written, 1/s."""


def check_conversion(path: str | Path, inputs: Iterable[str | Path] = ()) -> Path:
    """Return the path of a file to convert to, after `check_target` and a check that its writer is there."""
    target = check_target("a converted log", path, tuple(FORMATS), inputs)
    module, extra = FORMATS[target.suffix.lower()]
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
        log: The log, with one tick at least.
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
    with replacing(target) as new:
        file: Any = (RerunFile if target.suffix.lower() == ".rrd" else FoxgloveFile)(new, log)
        try:
            for name, signals in progress(list(groups.items())):
                if numbers := with_numbers(log, signals):
                    file.write_numbers(name, numbers)
                for signal in signals:
                    if signal.kind == "text":  # lists are drawn in the scene
                        file.write_texts(signal.name)
            if replay is not None:
                scene: DrawnScene = file.scene(replay)
                for tick in dict.fromkeys(replay.ticks(rate)):
                    scene.draw(replay.picture(tick))
        finally:
            file.close()
    return reason


def with_numbers(log: Log, signals: Sequence[Signal]) -> list[Signal]:
    """Return the signals that have a number in at least one tick."""
    return [s for s in signals if s.kind not in ("text", "list") and np.isfinite(log[s.name]).any()]


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

    def scene(self, stage: Stage) -> RerunScene:
        """Begin the scene of a stage."""
        return RerunScene(stage, self._stream)

    def close(self) -> None:
        """Complete the file."""
        self._path.write_bytes(self._content.read())
        self._stream.disconnect()
