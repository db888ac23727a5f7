"""Writer of rows to an Arrow IPC file, one batch at a time, in a thread.

The caller fills the rows of a block of memory. A full block goes to a thread, which turns it into columns, compresses
and writes them while the caller fills the other block; most of that work runs outside of Python's lock.

A log is written beside its name: `walk.part.arrow` becomes `walk.arrow` when it has been closed and is complete. What
a killed program or a full disk leaves is `walk.part.arrow`, which holds all batches before the break.
"""

from __future__ import annotations

import atexit
import logging
import os
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import IO, Any

import numpy as np
import pyarrow as pa  # type: ignore[import-untyped]
from pyarrow import ipc

from wbc.app.log.header import KEY, encode
from wbc.app.log.signals import Kind, Signal, Signals
from wbc.core.errors import Array, InputError
from wbc.core.files import FileError, claimed, move_into_place

ROWS = 256
"""Rows of a batch. Of a 26 s walk at 200 Hz, 1024 rows make a file 6 % smaller than 256, but a program that is killed
loses 5 s instead of 1.3 s."""

MAGIC = b"ARROW1"
"""First bytes of an Arrow IPC file."""

TYPES: dict[Kind, Any] = {
    "number": pa.float32(),
    "double": pa.float64(),
    "whole": pa.int32(),
    "flag": pa.bool_(),
    "text": pa.string(),
    "list": pa.list_(pa.float32()),
}
"""Arrow's type for each kind of signal."""

_log = logging.getLogger(__name__)


class LogWriter:
    """A log that is being written.

    Attributes:
        path: The file; it is there after `close`, if nothing was lost.
        part: File that is written meanwhile, and kept if data was lost.
        failure: Reason why data was lost; None without a failure.
        rows: Number of committed rows.
        written: Number of rows in the file.
    """

    def __init__(self, path: str | Path) -> None:
        """Open the file; an existing log is replaced by a complete one.

        `InputError` if it cannot be written, exists and is not a log, or is being written by another recording.
        """
        self.path = check_path(path)
        self.part = check_path(part_path(self.path))
        try:
            self._claim: IO[bytes] = claimed(self.part)
            self._file = pa.output_stream(str(self.part), compression=None, buffer_size=1 << 20)
        except OSError as error:
            raise InputError(f"cannot write the log {self.path}: {error.strerror or error}") from error
        self.failure: str | None = None
        self.rows = self.written = 0
        self._out: Any = None
        self._pending: Future[None] | None = None
        self._thread: ThreadPoolExecutor | None = None
        atexit.register(self.close)

    def begin(self, signals: Signals, header: dict[str, Any]) -> None:
        """Write the schema; signals cannot be added afterwards."""
        self._signals = signals.columns
        numbers = [place for signal, place in signals.columns if signal.kind == "number"]
        self._numbers = np.array(numbers, dtype=np.intp)
        fields = [_field(signal) for signal, _ in signals.columns]
        self._schema = pa.schema(fields, metadata={KEY: encode(header)})
        self._attempt(self._write_schema)
        self._blocks = [np.full((ROWS, signals.width), np.nan) for _ in range(2)]
        self._block = self._blocks[0]
        self._objects: list[list[Any]] = []
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="wbc-log")

    def _write_schema(self) -> None:
        options = ipc.IpcWriteOptions(compression="lz4", use_threads=False)
        self._out = ipc.new_file(self._file, self._schema, options=options)
        self._file.flush()

    @property
    def row(self) -> Array:
        """The row of numbers to fill next, shape (width,); its values are undefined."""
        row: Array = self._block[len(self._objects)]
        return row

    def commit(self, objects: list[Any]) -> None:
        """Finish the current row with its texts and lists; lists are not copied."""
        self._objects.append(objects)
        self.rows += 1
        if len(self._objects) == ROWS:
            self._hand_over()

    def _hand_over(self) -> None:
        """Give the block to the thread, and continue with the other one once that has been written."""
        assert self._thread is not None
        self._wait()
        if self.failure is None:
            self._pending = self._thread.submit(self._write, self._block, self._objects)
        self._block = self._blocks[1] if self._block is self._blocks[0] else self._blocks[0]
        self._objects = []

    def _wait(self) -> None:
        """Wait until the thread is idle."""
        pending, self._pending = self._pending, None
        if pending is not None:
            self._attempt(pending.result)

    def _attempt(self, write: Callable[[], None]) -> None:
        try:
            write()
        except Exception as error:  # a full disk must not end a walk
            if self.failure is None:
                _log.error("the log %s ends here, the run goes on: %s", self.part, error)
            self.failure = self.failure or f"{error}"

    def _write(self, rows: Array, objects: list[list[Any]]) -> None:
        with np.errstate(all="ignore"):  # NaN stays NaN
            numbers = iter(rows.T[self._numbers].astype(np.float32))
        arrays = []
        for signal, place in self._signals:
            if signal.kind == "number":
                arrays.append(pa.array(next(numbers)))
            elif signal.kind in ("text", "list"):
                arrays.append(pa.array([row[place] for row in objects], TYPES[signal.kind]))
            else:  # what is NaN is null, but a time
                column = np.ascontiguousarray(rows[:, place])
                arrays.append(pa.array(column, from_pandas=signal.kind != "double").cast(TYPES[signal.kind]))
        self._out.write_batch(pa.RecordBatch.from_arrays(arrays, schema=self._schema))
        self._file.flush()
        self.written += len(rows)

    def close(self) -> None:
        """Write the last batch, end the file and give it its name, if nothing was lost. A second call does nothing."""
        atexit.unregister(self.close)
        if self._file is None:
            return
        if self._thread is not None:
            self._wait()
            self._thread.shutdown()
            if (
                self._objects and self.failure is None
            ):  # not in the thread: the interpreter may be shutting down
                self._attempt(lambda: self._write(self._block[: len(self._objects)], self._objects))
        file, out, self._file, self._out = self._file, self._out, None, None
        if out is None and self.failure is None:  # there was not a single row
            file.close()
            self.part.unlink(missing_ok=True)
            self._claim.close()
            return
        if out is not None:
            self._attempt(out.close)
        self._attempt(file.close)
        if self.failure is None:
            self._attempt(lambda: move_into_place(self.part, self.path))
        self._claim.close()

    @property
    def ended(self) -> bool:
        """True after `close`."""
        return self._file is None

    @property
    def loss(self) -> FileError | None:
        """Error that says how much was written, where, and why the rest was not; None if nothing was lost."""
        if self.failure is None:
            return None
        return FileError(
            f"the recording {self.path} lost data: {self.written} of {self.rows} ticks were written, to {self.part}: "
            f"{self.failure}"
        )


def part_path(path: Path) -> Path:
    """Return the name of a log while it is written: walk.part.arrow for walk.arrow."""
    return path.with_name(f"{path.stem}.part{path.suffix}") if path.name else path  # "" is a folder


def check_path(path: str | Path) -> Path:
    """Return the path of a log to be written; `InputError` for no such folder, or a file that is not a log."""
    target = Path(path)
    if not os.path.isdir(target.parent):  # names that are too long are none
        raise InputError(f"no folder {target.parent} to write the log {target.name} into")
    if os.path.isdir(target):
        raise InputError(f"cannot write the log {target}: it is a folder")
    try:
        with target.open("rb") as file:
            start = file.read(len(MAGIC))
    except FileNotFoundError:
        return target
    except OSError as error:
        raise InputError(f"cannot write the log {target}: {error.strerror}") from error
    if start and start != MAGIC:
        raise InputError(f"{target} is there already and is no log; choose another name")
    return target


def _field(signal: Signal) -> Any:
    metadata = {"unit": signal.unit, "about": signal.about}
    return pa.field(signal.name, TYPES[signal.kind], metadata=metadata)
