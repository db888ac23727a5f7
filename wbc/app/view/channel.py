"""How frames reach the process that draws, and wishes come back: a piece of shared memory where only the newest counts.

The writer never waits, whatever the reader does: it copies a frame into the slot that the newest one is not in and
then says that this is the newest. A reader that is slow misses frames.
"""

from __future__ import annotations

import mmap
import os
import tempfile
from typing import IO, Any

import numpy as np

from wbc.core.errors import Array

_HEADER = 4
"""Words of the header: number of the newest frame, of the last one shown, pages open, number of the newest wishes."""

NOTE = 1 << 15
"""Most bytes that a frame can say beside its matrices; longer notes are left out."""

WISHES = 1 << 12
"""Most bytes of what is wished for."""


class Channel:
    """Frames from one process to another, wishes the other way.

    Attributes:
        fd: File descriptor to hand to the other process.
        paths: Number of matrices in a frame.
    """

    def __init__(self, paths: int, fd: int | None = None) -> None:
        """Make a channel, or join one.

        Args:
            paths: Number of matrices in a frame.
            fd: File descriptor of a channel that another process has made.
        """
        self.paths = paths
        slot = [
            ("time", "f8"),
            ("matrices", "f8", (paths, 16)),
            ("length", "i8"),
            ("note", "u1", (NOTE,)),
        ]
        layout = np.dtype(
            [
                ("header", "i8", (_HEADER,)),
                ("slots", slot, (2,)),
                ("wishes", [("length", "i8"), ("text", "u1", (WISHES,))], (2,)),
            ]
        )
        self._file: IO[Any] | None = None
        if fd is None:
            self._file = tempfile.TemporaryFile(prefix="wbc-view-")  # noqa: SIM115 (closed by `close`)
            fd = self._file.fileno()
            os.ftruncate(fd, layout.itemsize)
        self.fd = fd
        self._memory = mmap.mmap(fd, layout.itemsize)
        whole = np.frombuffer(self._memory, layout, 1)[0]
        self._header, self._slots, self._wishes = whole["header"], whole["slots"], whole["wishes"]

    def write(self, time: float, matrices: Array, note: bytes = b"{}") -> None:
        """Make a frame the newest one.

        Args:
            time: s.
            matrices: Homogeneous, shape (paths, 4, 4).
            note: What it says beside them, as JSON.
        """
        number = int(self._header[0]) + 1
        slot = self._slots[number % 2]
        slot["time"] = time
        by_columns = matrices.transpose(0, 2, 1)  # as the viewer wants them
        slot["matrices"].reshape(-1, 4, 4)[:] = by_columns
        _store(slot, "note", note if len(note) <= NOTE else b"{}")
        self._header[0] = number

    def read(self, after: int) -> tuple[int, float, Array, bytes] | None:
        """Return the newest frame.

        Args:
            after: Number of a frame that is known already.

        Returns:
            Its number, its time (s), its matrices by columns, shape (paths, 16), and its note; None if there is no
            newer one.
        """
        number = int(self._header[0])
        if number <= after:
            return None
        slot = self._slots[number % 2]
        time, matrices, note = float(slot["time"]), slot["matrices"].copy(), _load(slot, "note")
        if int(self._header[0]) > number + 1:  # overtaken twice while copying: the slot may hold two frames
            return None
        return number, time, matrices, note

    def wish(self, text: bytes) -> None:
        """Say what is wished for by those who look on; takes the place of what was wished for before.

        Args:
            text: JSON of at most `WISHES` bytes; longer ones are left out.
        """
        if len(text) > WISHES:
            return
        number = int(self._header[3]) + 1
        _store(self._wishes[number % 2], "text", text)
        self._header[3] = number

    def wishes(self, after: int) -> tuple[int, bytes] | None:
        """Return what is wished for.

        Args:
            after: Number of the wishes that are known already.

        Returns:
            Number and JSON; None if there is nothing newer.
        """
        number = int(self._header[3])
        if number <= after:
            return None
        text = _load(self._wishes[number % 2], "text")
        return None if int(self._header[3]) > number + 1 else (number, text)

    @property
    def newest(self) -> int:
        """Number of frames written so far."""
        return int(self._header[0])

    @property
    def shown(self) -> int:
        """Number of the last frame that was taken out."""
        return int(self._header[1])

    @shown.setter
    def shown(self, number: int) -> None:
        self._header[1] = number

    @property
    def pages(self) -> int:
        """Number of browser pages that are open."""
        return int(self._header[2])

    @pages.setter
    def pages(self, count: int) -> None:
        self._header[2] = count

    def close(self) -> None:
        """Let go of the memory; the numbers can still be read."""
        self._header = self._header.copy()
        del self._slots, self._wishes
        self._memory.close()
        if self._file is not None:
            self._file.close()


def _store(slot: Any, name: str, text: bytes) -> None:
    slot["length"] = len(text)
    slot[name][: len(text)] = np.frombuffer(text, np.uint8)


def _load(slot: Any, name: str) -> bytes:
    length = int(slot["length"])
    return bytes(slot[name][: min(max(length, 0), slot[name].size)])
