"""Channel between a run and its drawing process: the newest frame one way, the newest user input the other way.

It is shared memory with two slots each way. The writer never waits: it copies into the slot that does not hold the
newest frame and then increments the number of the newest one. A slow reader misses frames.
"""

from __future__ import annotations

import mmap
import os
import tempfile
from typing import IO, Any

import numpy as np

from wbc.app.view.user_input import MAX_BYTES
from wbc.core.errors import Array

_NEWEST, _SHOWN, _PAGES, _INPUT = range(4)
"""Words of the header: number of the newest frame, of the last one shown, open pages, number of the newest input."""

MAX_ANNOTATIONS = 1 << 15
"""Largest packed annotations of a frame, bytes; larger ones are dropped."""


class Channel:
    """Frames to the drawing process, user input back.

    Attributes:
        fd: File descriptor for the other process.
        paths: Number of matrices in a frame.
    """

    def __init__(self, paths: int, fd: int | None = None) -> None:
        """Make or join a channel.

        Args:
            paths: Number of matrices in a frame.
            fd: File descriptor of the channel to join; None makes one.
        """
        self.paths = paths
        slot = [
            ("time", "f8"),
            ("matrices", "f8", (paths, 16)),
            ("length", "i8"),
            ("annotations", "u1", (MAX_ANNOTATIONS,)),
        ]
        layout = np.dtype(
            [
                ("header", "i8", (4,)),
                ("slots", slot, (2,)),
                ("input", [("length", "i8"), ("text", "u1", (MAX_BYTES,))], (2,)),
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
        self._header, self._slots, self._input = whole["header"], whole["slots"], whole["input"]

    def write(self, time: float, matrices: Array, annotations: bytes = b"{}") -> None:
        """Write a frame.

        Args:
            time: s.
            matrices: Homogeneous, shape (paths, 4, 4).
            annotations: Packed annotations.
        """
        number = self.newest + 1
        slot = self._slots[number % 2]
        slot["time"] = time
        slot["matrices"].reshape(-1, 4, 4)[:] = matrices.transpose(0, 2, 1)  # by columns, for the viewer
        _store(slot, "annotations", annotations if len(annotations) <= MAX_ANNOTATIONS else b"{}")
        self._header[_NEWEST] = number

    def read(self, after: int) -> tuple[int, float, Array, bytes] | None:
        """Return the newest frame.

        Args:
            after: Number of the last frame that was read.

        Returns:
            Number, time (s), matrices by columns, shape (paths, 16), and packed annotations; None if there is no newer
            frame.
        """
        number = self.newest
        if number <= after:
            return None
        slot = self._slots[number % 2]
        time, matrices, annotations = float(slot["time"]), slot["matrices"].copy(), _load(slot, "annotations")
        if self.newest > number + 1:  # overtaken twice while copying: the slot may hold parts of two frames
            return None
        return number, time, matrices, annotations

    def write_input(self, text: bytes) -> None:
        """Write the user input; it replaces the former one.

        Args:
            text: Packed `UserInput`; dropped if it is longer than `MAX_BYTES`.
        """
        if len(text) > MAX_BYTES:
            return
        number = int(self._header[_INPUT]) + 1
        _store(self._input[number % 2], "text", text)
        self._header[_INPUT] = number

    def read_input(self, after: int) -> tuple[int, bytes] | None:
        """Return the newest user input.

        Args:
            after: Number of the last input that was read.

        Returns:
            Number and packed `UserInput`; None if there is no newer one.
        """
        number = int(self._header[_INPUT])
        if number <= after:
            return None
        text = _load(self._input[number % 2], "text")
        return None if int(self._header[_INPUT]) > number + 1 else (number, text)

    @property
    def newest(self) -> int:
        """Number of frames written so far."""
        return int(self._header[_NEWEST])

    @property
    def shown(self) -> int:
        """Number of the last frame that was read."""
        return int(self._header[_SHOWN])

    @shown.setter
    def shown(self, number: int) -> None:
        self._header[_SHOWN] = number

    @property
    def pages(self) -> int:
        """Number of open browser pages."""
        return int(self._header[_PAGES])

    @pages.setter
    def pages(self, count: int) -> None:
        self._header[_PAGES] = count

    def close(self) -> None:
        """Release the memory; the numbers can still be read."""
        self._header = self._header.copy()
        del self._slots, self._input
        self._memory.close()
        if self._file is not None:
            self._file.close()


def _store(slot: Any, name: str, text: bytes) -> None:
    slot["length"] = len(text)
    slot[name][: len(text)] = np.frombuffer(text, np.uint8)


def _load(slot: Any, name: str) -> bytes:
    length = int(slot["length"])
    return bytes(slot[name][: min(max(length, 0), slot[name].size)])
