"""Size of a log when it is unpacked, known before it is: a small file may hold long rows of equal numbers.

The sizes stand in the metadata of Arrow's messages and in front of each packed buffer
(https://arrow.apache.org/docs/format/Columnar.html#compression).
"""

from __future__ import annotations

import contextlib
import struct
from typing import Any

import numpy as np
import pyarrow as pa  # type: ignore[import-untyped]
from pyarrow import ipc

MEMORY = 2**30
"""Largest size that is unpacked as a whole, bytes; of a larger log one signal after the other."""

LARGEST_RATIO = 50
"""Largest ratio of the unpacked size to that of the file. Batches of 256 rows reach no more than 10, as each of their
columns has a head of some 50 bytes in the file."""

LZ4 = 255
"""Largest number of bytes that one byte of LZ4 stands for."""

RECORD_BATCH = 3
"""Kind of the messages that hold rows."""


def unpacked_sizes(stream: Any) -> list[int]:
    """Return the size of each batch of an Arrow stream when it is unpacked, bytes, up to the first damaged one."""
    sizes = []
    with contextlib.suppress(pa.ArrowException, OSError, EOFError, struct.error):
        for message in ipc.MessageReader.open_stream(stream):
            head = _Table(message.metadata, _number(message.metadata, "<I", 0))
            if head.get("<B", 1) != RECORD_BATCH:
                continue
            size = _size(head.table(2), message.metadata, message.body)
            if size > LZ4 * message.body.size:
                break
            sizes.append(int(size))
    return sizes


def _size(batch: _Table, metadata: Any, body: Any) -> float:
    start, count = batch.vector(2)
    offsets, sizes = np.frombuffer(metadata, "<i8", 2 * count, start).reshape(-1, 2).T
    if not batch.has(3):  # not compressed
        return float(sizes.sum())
    kept = (sizes > 0) & (offsets >= 0) & (offsets <= body.size - 8)  # Arrow refuses the others
    said = np.frombuffer(body, "<u1")[offsets[kept, None] + np.arange(8)].view("<i8")[:, 0]
    return float(np.maximum(said, sizes[kept]).astype(float).sum())


class _Table:
    """A table of FlatBuffers: places of its fields in a buffer that Arrow has verified."""

    def __init__(self, buffer: Any, place: int) -> None:
        self._buffer, self._place = buffer, place
        self._fields = place - _number(buffer, "<i", place)

    def _field(self, index: int) -> int:
        """Return the place of a field; 0 if it is left out."""
        known = _number(self._buffer, "<H", self._fields)
        offset = _number(self._buffer, "<H", self._fields + 4 + 2 * index) if 4 + 2 * index < known else 0
        return self._place + offset if offset else 0

    def has(self, index: int) -> bool:
        return self._field(index) > 0

    def get(self, kind: str, index: int) -> int:
        place = self._field(index)
        return _number(self._buffer, kind, place) if place else 0

    def table(self, index: int) -> _Table:
        place = self._field(index)
        return _Table(self._buffer, place + _number(self._buffer, "<I", place))

    def vector(self, index: int) -> tuple[int, int]:
        """Return the place of the first item of a vector, and their number."""
        place = self._field(index)
        start = place + _number(self._buffer, "<I", place)
        return start + 4, _number(self._buffer, "<I", start)


def _number(buffer: Any, kind: str, place: int) -> int:
    return int(struct.unpack_from(kind, buffer, place)[0])
