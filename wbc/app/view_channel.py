"""How frames reach the process that draws: a piece of shared memory in which only the newest frame counts.

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
"""Words of the header: number of the newest frame, number of the last one shown, pages open, spare."""


class Channel:
    """Frames from one process to another.

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
        words = _HEADER + 2 * (1 + 16 * paths)
        self._file: IO[Any] | None = None
        if fd is None:
            self._file = tempfile.TemporaryFile(prefix="wbc-view-")  # noqa: SIM115 (closed by `close`)
            fd = self._file.fileno()
            os.ftruncate(fd, 8 * words)
        self.fd = fd
        self._memory = mmap.mmap(fd, 8 * words)
        self._header = np.frombuffer(self._memory, np.int64, _HEADER)
        self._slots = np.frombuffer(self._memory, np.float64, offset=8 * _HEADER).reshape(2, -1)

    def write(self, time: float, matrices: Array) -> None:
        """Make a frame the newest one.

        Args:
            time: s.
            matrices: Homogeneous, shape (paths, 4, 4).
        """
        number = int(self._header[0]) + 1
        slot = self._slots[number % 2]
        slot[0] = time
        slot[1:].reshape(-1, 4, 4)[:] = matrices.transpose(0, 2, 1)  # by columns, as the viewer wants them
        self._header[0] = number

    def read(self, after: int) -> tuple[int, float, Array] | None:
        """Return the newest frame.

        Args:
            after: Number of a frame that is known already.

        Returns:
            Its number, its time (s) and its matrices by columns, shape (paths, 16); None if there is no newer one.
        """
        number = int(self._header[0])
        if number <= after:
            return None
        slot = self._slots[number % 2].copy()
        if int(self._header[0]) > number + 1:  # overtaken twice while copying: the slot may hold two frames
            return None
        return number, float(slot[0]), slot[1:].reshape(-1, 16)

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
        """Let go of the memory."""
        del self._header, self._slots
        self._memory.close()
        if self._file is not None:
            self._file.close()
