"""Writer of rows to an Arrow IPC file, one batch at a time.

The file is begun beside the one that it replaces, and takes its place with the first batch, so that a run that fails at
once leaves the old log. From then on a killed program or a full disk leaves a file that holds all batches before the
break, which `Log.open` reads. Two programs cannot write one log: the second is refused when it begins.
"""

from __future__ import annotations

import contextlib
import errno
import fcntl
import hashlib
import logging
import os
import weakref
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa  # type: ignore[import-untyped]
from pyarrow import ipc

from wbc.app.log.header import KEY, encode
from wbc.app.log.signals import Kind, Signals
from wbc.base.errors import InputError
from wbc.base.files import BESIDE, FileError, check_target, open_own, parsing
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
        self._place = _Place(self.path)
        self._failure: str | None = None
        self._rows = self._written = 0
        self._file: Any = None
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
        if len(self._objects) == ROWS:
            self._flush()

    def _flush(self) -> None:
        if self._failure is None and self._objects and self._place.is_own:
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
    """Place of a file that one program at a time writes: beside the old file until it takes that one's place.

    The lock is on the new file itself and goes with it, so that a program that is killed leaves none.

    Attributes:
        beside: The new file.
        file: Its descriptor.
    """

    def __init__(self, path: Path) -> None:
        self._target = path.resolve()
        name = hashlib.sha256(os.fsencode(self._target.name)).hexdigest()[:16]  # no longer than a name may be
        self.beside = self._target.parent / f"{BESIDE}{name}{path.suffix}"
        self._process = os.getpid()
        self.file = self._locked()
        self._taken = False
        self._finalizer = weakref.finalize(self, _leave, self._process, self.file, self.beside)
        try:
            old = os.open(self._target, os.O_RDONLY | os.O_CLOEXEC)
        except OSError:  # there is none as a rule
            return
        try:
            _take_lock(old, fcntl.LOCK_SH, self._target)
        except InputError:
            self.leave()
            raise
        finally:
            os.close(old)

    @property
    def is_own(self) -> bool:
        """True in the process that has begun the file; False in one that was forked from it."""
        return os.getpid() == self._process

    def _locked(self) -> int:
        """Return the new file, empty and locked; one that a killed program has left is used again."""
        while True:
            try:
                try:
                    file = open_own(self.beside, create=True)
                except OSError as error:
                    if error.errno not in (errno.ELOOP, errno.EEXIST, errno.ENXIO):
                        raise
                    self.beside.unlink()  # a link, a pipe or a file of somebody else that was put there
                    continue
            except OSError as error:
                raise InputError(f"cannot write the log {self._target}: {error.strerror or error}") from error
            try:
                _take_lock(file, fcntl.LOCK_EX, self._target)
                with contextlib.suppress(OSError):
                    if os.path.samestat(os.fstat(file), os.stat(self.beside)):
                        os.ftruncate(file, 0)
                        return file
            except BaseException:
                os.close(file)
                raise
            os.close(file)  # whoever had it has put it in its place, or removed it

    def take(self) -> None:
        """Put the file in the place of the old one, with its permissions; a second call does nothing."""
        if self._taken:
            return
        with contextlib.suppress(FileNotFoundError):
            os.fchmod(self.file, self._target.stat().st_mode & 0o777)
        os.replace(self.beside, self._target)
        self._taken = True
        self._finalizer.detach()
        self._finalizer = weakref.finalize(self, _leave, self._process, self.file, None)

    def leave(self) -> None:
        """Let other programs write; a file that has not taken its place is removed."""
        self._finalizer()


def _leave(process: int, lock: int, beside: Path | None) -> None:
    if beside is not None and os.getpid() == process:
        with contextlib.suppress(OSError):
            beside.unlink()
    os.close(lock)


def _take_lock(file: int, kind: int, path: Path) -> None:
    try:
        fcntl.flock(file, kind | fcntl.LOCK_NB)
    except BlockingIOError as error:
        raise InputError(
            f"the log {path} is being written by another recording; wait for it, or choose another name"
        ) from error
    except OSError:  # a file system without locks
        pass


def check_path(path: str | Path) -> Path:
    """Return the path of a log to be written; `InputError` for no such folder, or a file that is not a log."""
    target, start = check_target("the log", path), b""
    if target.exists():
        with parsing(target, "log"), target.open("rb") as file:
            start = file.read(len(MAGIC))
    if start and start != MAGIC:
        raise InputError(f"{target} is there already and is no log; choose another name")
    return target
