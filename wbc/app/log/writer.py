"""Writer of rows to an Arrow IPC file, one batch at a time.

The file is begun beside the one that it replaces, and takes its place with the first batch, so that a run that fails at
once leaves the old log. From then on a killed program or a full disk leaves a file that holds all batches before the
break, which `Log.open` reads. Two programs cannot write one log: the second is refused when it begins.
"""

from __future__ import annotations

import contextlib
import fcntl
import logging
import os
import tempfile
import weakref
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa  # type: ignore[import-untyped]
from pyarrow import ipc

from wbc.app.log.header import KEY, encode
from wbc.app.log.signals import Kind, Signals
from wbc.base.errors import InputError
from wbc.base.files import BESIDE, FileError, check_target, parsing
from wbc.base.numbers import Array

ROWS = 256
"""Rows of a batch. Of a 26 s walk at 200 Hz, 1024 rows make a file 6 % smaller than 256, but a program that is killed
loses 5 s instead of 1.3 s."""

LARGEST_BATCH = 2**22
"""Largest batch in the file, bytes. A small file may hold long rows of equal numbers: one byte of LZ4 stands for 255 at
most, so that this much unpacks to a gigabyte, whatever the file says."""

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
        self.path, self.ended, start = check_target("the log", path), False, b""
        if self.path.exists():
            with parsing(self.path, "log"), self.path.open("rb") as file:
                start = file.read(len(MAGIC))
        if start and start != MAGIC:
            raise InputError(f"{self.path} is there already and is no log; choose another name")
        self._place = _Place(self.path)
        self._failure: str | None = None
        self._rows = self._written = 0
        self._file: Any = None
        self._out: Any = None
        self._objects: list[list[Any]] = []
        self._size = 0  # of the rows that wait, bytes, unpacked

    def begin(self, signals: Signals, header: dict[str, Any]) -> None:
        """Write the schema; signals cannot be added afterwards."""
        self._signals = signals.columns
        fields = [
            pa.field(each.name, TYPES[each.kind], metadata={"unit": each.unit, "about": each.about})
            for each, _ in signals.columns
        ]
        self._schema = pa.schema(fields, metadata={KEY: encode(header)})
        self._block = np.full((ROWS, signals.width), np.nan)
        self._attempt(self._open)

    def _open(self) -> None:
        # Not by its name, which may lead elsewhere meanwhile.
        self._file = open(self._place.file, "wb", buffering=1 << 20, closefd=False)  # noqa: SIM115
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
        self._rows += 1
        self._size += 8 * self._block.shape[1] + sum(4 * len(each) for each in objects if each is not None)
        if len(self._objects) == ROWS or self._size > LARGEST_BATCH // 2:
            self._flush()

    def _flush(self) -> None:
        if self._failure is None and self._objects and self._place.is_own:
            self._attempt(self._write)
        self._objects, self._size = [], 0

    def _write(self) -> None:
        count = len(self._objects)
        numbers, arrays = np.ascontiguousarray(self._block[:count].T), []
        for signal, place in self._signals:
            if signal.kind in ("text", "list"):
                arrays.append(pa.array([row[place] for row in self._objects], TYPES[signal.kind]))
            else:  # what is NaN is null where the type has none
                array = pa.array(numbers[place], from_pandas=signal.kind in ("whole", "flag"))
                arrays.append(array.cast(TYPES[signal.kind]))
        self._out.write_batch(pa.RecordBatch.from_arrays(arrays, schema=self._schema))
        self._file.flush()
        self._place.take()
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
        if not self._place.is_own:  # the file is that of another process
            return
        self._flush()
        for part in (self._out, self._file):
            if part is not None:
                self._attempt(part.close)
        if self._out is not None and self._failure is None:
            self._attempt(self._place.take)  # of a log without rows
        self._place.leave()


class _Place:
    """Place of a log that one program at a time writes: the new file is beside the old one until it takes its place.

    Both are locked: the old file keeps others from beginning, and the lock of the new one goes with it to its place.
    The locks end with the program, however it ends.

    Attributes:
        file: Descriptor of the new file.
    """

    def __init__(self, path: Path) -> None:
        self._target, self._process, self._taken = path.resolve(), os.getpid(), False
        with contextlib.ExitStack() as opened:
            try:
                gone = [] if self._target.exists() else [self._target]
                old = os.open(self._target, os.O_RDONLY | os.O_CREAT | os.O_CLOEXEC, 0o666)
                opened.callback(os.close, old)
                _lock(old, self._target)
                self.file, beside = tempfile.mkstemp(self._target.suffix, BESIDE, self._target.parent)
                opened.callback(os.close, self.file)
                os.fchmod(self.file, os.fstat(old).st_mode & 0o777)
            except OSError as error:
                raise InputError(f"cannot write the log {self._target}: {error.strerror or error}") from error
            _lock(self.file, self._target)
            self._beside = Path(beside)
            self._descriptors = opened.pop_all()
        self._finalizer = weakref.finalize(
            self, _leave, self._process, self._descriptors, (*gone, self._beside)
        )

    @property
    def is_own(self) -> bool:
        """True in the process that has begun the file; False in one that was forked from it."""
        return os.getpid() == self._process

    def take(self) -> None:
        """Put the file in the place of the old one, with its permissions; a second call does nothing."""
        if not self._taken:
            os.replace(self._beside, self._target)
            self._taken = True
            self._finalizer.detach()
            self._finalizer = weakref.finalize(self, _leave, self._process, self._descriptors, ())

    def leave(self) -> None:
        """Let other programs write; a file that has not taken its place is removed."""
        self._finalizer()


def _leave(process: int, descriptors: contextlib.ExitStack, files: Sequence[Path]) -> None:
    """Close descriptors, and remove files in the process that has made them."""
    for file in files if os.getpid() == process else ():
        with contextlib.suppress(OSError):
            file.unlink()
    descriptors.close()


def _lock(file: int, path: Path) -> None:
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        raise InputError(
            f"the log {path} is being written by another recording; wait for it, or choose another name"
        ) from error
    except OSError:  # a file system without locks
        pass
