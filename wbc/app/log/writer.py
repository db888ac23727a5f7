"""Writer of rows to an Arrow IPC file, one batch at a time.

An old log is replaced with the first batch, so that a run that fails at once leaves it. From then on a killed program
or a full disk leaves a file that holds all batches before the break, which `Log.open` reads. Two programs cannot write
one log: the second is refused when it begins.
"""

from __future__ import annotations

import fcntl
import logging
from collections.abc import Callable
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import pyarrow as pa  # type: ignore[import-untyped]
from pyarrow import ipc

from wbc.app.log.header import KEY, encode
from wbc.app.log.signals import Kind, Signals
from wbc.base.errors import InputError
from wbc.base.files import FileError, check_target, parsing
from wbc.base.numbers import Array

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
    """A log that is being written, one batch at a time.

    Attributes:
        path: The file; an existing log is replaced when the first batch is there, or at the end.
        ended: True after `close`.
    """

    def __init__(self, path: str | Path) -> None:
        """Check the path, and keep other programs from writing there.

        Raises:
            InputError: The file cannot be written, exists and is not a log, or is being written.
        """
        self.path, self.ended = check_path(path), False
        self._is_new = not self.path.exists()
        self._file = _locked(self.path)
        self._failure: str | None = None
        self._rows = self._written = 0
        self._schema: Any = None
        self._out: Any = None
        self._objects: list[list[Any]] = []

    def begin(self, signals: Signals, header: dict[str, Any]) -> None:
        """Write the schema; signals cannot be added afterwards."""
        self._signals = signals.columns
        fields = [
            pa.field(each.name, TYPES[each.kind], metadata={"unit": each.unit, "about": each.about})
            for each, _ in signals.columns
        ]
        self._schema = pa.schema(fields, metadata={KEY: encode(header)})
        self._block = np.full((ROWS, signals.width), np.nan)

    def _open(self) -> None:
        """Begin the file in the place of the old log."""
        self._file.truncate(0)
        options = ipc.IpcWriteOptions(compression="lz4", use_threads=False)
        self._out = ipc.new_file(self._file, self._schema, options=options)

    @property
    def row(self) -> Array:
        """The row of numbers to fill next, shape (width,); its values are undefined."""
        row: Array = self._block[len(self._objects)]
        return row

    def commit(self, objects: list[Any]) -> None:
        """Finish the current row with its texts and lists; lists are not copied."""
        self._objects.append(objects)
        self._rows += 1
        if len(self._objects) == ROWS:
            self._flush()

    def _flush(self) -> None:
        if self._failure is None and self._objects:
            self._attempt(self._write)
        self._objects = []

    def _write(self) -> None:
        count = len(self._objects)
        numbers, arrays = np.ascontiguousarray(self._block[:count].T), []
        for signal, place in self._signals:
            if signal.kind in ("text", "list"):
                arrays.append(pa.array([row[place] for row in self._objects], TYPES[signal.kind]))
            else:  # what is NaN is null where the type has none
                array = pa.array(numbers[place], from_pandas=signal.kind in ("whole", "flag"))
                arrays.append(array.cast(TYPES[signal.kind]))
        if self._out is None:
            self._open()
        self._out.write_batch(pa.RecordBatch.from_arrays(arrays, schema=self._schema))
        self._file.flush()
        self._written += count

    def _attempt(self, write: Callable[[], None]) -> None:
        try:
            write()
        except Exception as error:  # a full disk must not end a walk
            if self._failure is None:
                _log.error("the log %s ends here, the run goes on: %s", self.path, error)
            self._failure = self._failure or str(error)

    @property
    def loss(self) -> FileError | None:
        """Error that says how much was written and why the rest was not; None if nothing was lost."""
        if self._failure is None:
            return None
        return FileError(
            f"the recording {self.path} lost data: {self._written} of {self._rows} ticks were written: {self._failure}"
        )

    def close(self) -> None:
        """Write the last batch and end the file. A second call does nothing."""
        if self.ended:
            return
        self.ended = True
        self._flush()
        if self._out is None and self._failure is None and self._schema is not None:
            self._attempt(self._open)  # of a log without rows
        if self._out is not None:
            self._attempt(self._out.close)
        self._attempt(self._file.close)
        if self._is_new and self._out is None:
            self.path.unlink(missing_ok=True)


def _locked(path: Path) -> BinaryIO:
    """Open a log to be written, which keeps other programs from it; it is not changed yet."""
    try:
        file = path.open("r+b" if path.exists() else "w+b", buffering=1 << 20)
    except OSError as error:
        raise InputError(f"cannot write the log {path}: {error.strerror or error}") from error
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        file.close()
        raise InputError(
            f"the log {path} is being written by another recording; wait for it, or choose another name"
        ) from error
    except OSError:  # a file system without locks
        pass
    return file


def check_path(path: str | Path) -> Path:
    """Return the path of a log to be written; `InputError` for no such folder, or a file that is not a log."""
    target, start = check_target("the log", path), b""
    if target.exists():
        with parsing(target, "log"), target.open("rb") as file:
            start = file.read(len(MAGIC))
    if start and start != MAGIC:
        raise InputError(f"{target} is there already and is no log; choose another name")
    return target
