"""Logs for Rerun: files of its format RRD."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from wbc.app.log.reader import Log
from wbc.app.log.signals import Signal
from wbc.app.view.rerun_view import RerunScene, plain
from wbc.app.view.stage import Stage

WAIT = 3600.0
"""Time after which Rerun writes rows that are no full chunk, s."""


class RerunFile:
    """A file for Rerun that is being written; `close` completes it."""

    def __init__(self, path: Path, log: Log) -> None:
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
