"""Channel between a run and its drawing process: the newest frame one way, the newest user input the other way."""

from __future__ import annotations

import errno
import mmap
import os
import tempfile
import zlib
from typing import IO, Any

import numpy as np

from wbc.app.view.user_input import MAX_BYTES
from wbc.core.errors import Array

MAX_ANNOTATIONS = 1 << 15
"""Largest packed annotations of a frame, bytes; larger ones are dropped."""

ATTEMPTS = 10
"""Attempts to read an entry that the writer overtakes."""


class Channel:
    """Shared memory with frames to the drawing process and user input back.

    Attributes:
        fd: File descriptor for the other process.
    """

    def __init__(self, paths: int, fd: int | None = None) -> None:
        """Make a channel for frames of that number of matrices, or join that of a file descriptor."""
        frame = _slot(MAX_ANNOTATIONS, ("time", "f8"), ("matrices", "f8", (paths, 16)))
        layout = np.dtype(
            [
                ("newest", "i8", (2,)),  # numbers of the newest frame and of the newest input
                ("shown", "i8"),
                ("pages", "i8"),
                ("drivers", "i8"),
                ("frames", frame, (2,)),
                ("inputs", _slot(MAX_BYTES), (2,)),
            ]
        )
        self._file: IO[Any] | None = None
        if fd is None:
            self._file = tempfile.TemporaryFile(prefix="wbc-view-", buffering=0)  # noqa: SIM115 (closed by `close`)
            fd = self._file.fileno()
            # All of it now: memory over a hole that a full disk cannot fill ends the program with a bus error.
            if self._file.write(bytes(layout.itemsize)) < layout.itemsize:
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), tempfile.gettempdir())
        self.fd = fd
        self._memory = mmap.mmap(fd, layout.itemsize)
        self._all: Any = np.frombuffer(self._memory, layout, 1)[0]
        self._frames = _Newest(self._all["newest"][:1], self._all["frames"])
        self._inputs = _Newest(self._all["newest"][1:], self._all["inputs"])

    def write(self, time: float, matrices: Array, annotations: bytes = b"{}") -> None:
        """Write a frame: time, s, homogeneous matrices, shape (paths, 4, 4), and packed annotations."""
        columns = matrices.transpose(0, 2, 1).reshape(-1, 16)  # as the viewer takes them
        text = annotations if len(annotations) <= MAX_ANNOTATIONS else b"{}"
        self._frames.write(text, time=time, matrices=columns)

    def read(self, after: int) -> tuple[int, float, Array, bytes] | None:
        """Return the newest frame after that number: number, time (s), matrices, annotations; None without a newer one.

        Matrices are by columns, shape (paths, 16), annotations packed.
        """
        newer = self._frames.read(after)
        if newer is None:
            return None
        number, frame, annotations = newer
        return number, float(frame["time"]), frame["matrices"], annotations

    def write_input(self, text: bytes) -> None:
        """Write a packed `UserInput` in place of the former one; dropped if it is longer than `MAX_BYTES`."""
        if len(text) <= MAX_BYTES:
            self._inputs.write(text)

    def read_input(self, after: int) -> tuple[int, bytes] | None:
        """Return number and packed `UserInput` of the newest input after that number; None if there is no newer one."""
        newer = self._inputs.read(after)
        return None if newer is None else (newer[0], newer[2])

    @property
    def newest(self) -> int:
        """Number of frames written so far."""
        return int(self._all["newest"][0])

    @property
    def shown(self) -> int:
        """Number of the last frame that was read."""
        return int(self._all["shown"])

    @shown.setter
    def shown(self, number: int) -> None:
        self._all["shown"] = number

    @property
    def pages(self) -> int:
        """Number of open browser pages."""
        return int(self._all["pages"])

    @pages.setter
    def pages(self, count: int) -> None:
        self._all["pages"] = count

    @property
    def drivers(self) -> int:
        """Number of open pages that may change the run."""
        return int(self._all["drivers"])

    @drivers.setter
    def drivers(self, count: int) -> None:
        self._all["drivers"] = count

    def close(self) -> None:
        """Release the memory; the numbers can still be read."""
        self._all = {name: self._all[name].copy() for name in ("newest", "shown", "pages", "drivers")}
        del self._frames, self._inputs
        self._memory.close()
        if self._file is not None:
            self._file.close()


def _slot(size: int, *fields: Any) -> list[Any]:
    """Return the layout of a slot with a text."""
    data = [*fields, ("length", "i8"), ("text", "u1", (size,))]
    return [("begun", "i8"), ("check", "u4"), ("data", data)]


class _Newest:
    """Two slots of which one holds the newest entry. A slow reader misses entries, and never gets parts of two.

    The writer never waits: it fills the slot that does not hold the newest entry, and says first which entry it begins
    there. A copy is of one entry if the slot still says so afterwards (a sequence lock). The checksum finds the rest on
    processors that reorder stores.
    """

    def __init__(self, number: Any, slots: Any) -> None:
        self._number, self._slots = number, slots

    def write(self, text: bytes, **fields: Any) -> None:
        number = int(self._number[0]) + 1
        slot = self._slots[number % 2]
        slot["begun"] = number
        for name, value in fields.items():
            slot["data"][name] = value
        slot["data"]["length"] = len(text)
        slot["data"]["text"][: len(text)] = np.frombuffer(text, np.uint8)
        slot["check"] = _checksum(number, slot["data"])
        self._number[0] = number

    def read(self, after: int) -> tuple[int, Any, bytes] | None:
        """Return number, fields and text of the newest entry; None if there is none after a number.

        None, too, if the writer has overtaken every attempt; there is a newer entry then, for the next call.
        """
        for _ in range(ATTEMPTS):
            number = int(self._number[0])
            if number <= after:
                return None
            slot = self._slots[number % 2]
            check, data = int(slot["check"]), slot["data"].copy()
            if int(slot["begun"]) == number and _checksum(number, data) == check:
                return number, data, data["text"][: data["length"]].tobytes()
        return None


def _checksum(number: int, data: Any) -> int:
    return zlib.crc32(data.tobytes(), number & 0xFFFFFFFF)
