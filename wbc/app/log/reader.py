"""Reader of logs: arrays by the names of the signals."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Iterator, Mapping
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal

import numpy as np
import pyarrow as pa  # type: ignore[import-untyped]
from numpy.typing import NDArray
from pyarrow import ipc

from wbc.app.log.header import decode
from wbc.app.log.signals import QUATERNION, WRENCH, XY, XYZ, Kind, Signal
from wbc.app.log.writer import LARGEST_BATCH, MAGIC, TYPES
from wbc.base.checked import checked
from wbc.base.errors import InputError, unknown_name
from wbc.base.files import LARGEST_FILE, decoding
from wbc.base.numbers import Array

KINDS = {kind: name for name, kind in TYPES.items()}
"""Kind of a signal for each of Arrow's types."""

AXES = {2: XY, 3: XYZ, 4: QUATERNION, 6: WRENCH}
"""Number of a vector's parts → their names: a point or a direction, a quaternion, a wrench."""


def parts_of(group: str, size: int) -> list[str]:
    """Return the names of the parts of a vector, or that of a signal of size 1."""
    return [group] if size == 1 else [f"{group}/{part}" for part in AXES[size]]


STREAM = 8
"""Offset of the Arrow stream in an Arrow IPC file, bytes: after the magic bytes and their padding."""

MEMORY = 2**30
"""Largest size that is unpacked as a whole, bytes; of a larger log one signal after the other."""

LARGEST_RATIO = 50
"""Largest ratio of the unpacked size to that of the file. Batches of 256 rows reach no more than 10, as each of their
columns has a head of some 50 bytes in the file."""


class Log:
    """Log of a run: signals by their names.

    Signals of a log of more than 1 GiB (unpacked) stay in the file, and are read when they are used.

    Attributes:
        path: The file.
        header: Facts about the run, see `wbc.app.log.header`.
        signals: All signals by name, in the order of the file.
        broken: Reason why the log is cut off; None if it is complete.
    """

    header: Mapping[str, Any]

    def __init__(self, path: Path, rows: _Rows, header: dict[str, Any]) -> None:
        self.path, self.broken = path, rows.broken
        self.header = MappingProxyType(header)
        self._rows = rows
        self.signals = MappingProxyType({field.name: _signal(field) for field in rows.schema})
        if len(self.signals) < len(rows.schema):
            raise InputError(f"{path} is not a log: two of its signals have one name")
        self._arrays: dict[str, Array] = {}

    @staticmethod
    @checked
    def open(path: str | Path) -> Log:
        """Read a log.

        A log that is cut off is read up to that place, as is one whose time goes back, and `broken` has the reason.

        Args:
            path: The file.
        """
        place = Path(path)
        with decoding(place, "log", largest=sys.maxsize):
            with place.open("rb") as file:
                start = file.read(len(MAGIC))
            if start != MAGIC:
                what = f"no log: it begins with {start!r}" if start else "empty: nothing was recorded"
                raise InputError(f"{place} is {what}")
            rows = _Rows(place)
            header = decode(str(place), rows.schema.metadata)
            log = Log(place, rows, header)
            if "time" in log:
                good = np.isfinite(log.time) & (np.diff(log.time, prepend=-np.inf) >= 0.0)
                if not good.all():
                    rows.cut(int(np.argmin(good)), "the next time is no number that follows")
                    return Log(place, rows, header)
            return log

    def __len__(self) -> int:
        return self._rows.count

    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and name in self.signals

    def __iter__(self) -> Iterator[str]:
        return iter(self.signals)

    def __repr__(self) -> str:
        title = self.header.get("title", "")
        return f"Log('{self.path}', {title}, {len(self)} ticks, {len(self.signals)} signals)"

    @property
    def units(self) -> dict[str, str]:
        """Unit of each signal."""
        return {name: signal.unit for name, signal in self.signals.items()}

    @cached_property
    def time(self) -> Array:
        """Time of each tick, shape (ticks,), s."""
        return self["time"]

    @checked
    def __getitem__(self, name: str) -> Array:
        """Return the values of a signal, or of a group of signals.

        Args:
            name: A signal, or the common beginning of a group's names: "com/estimated".

        Returns:
            Shape (ticks,) of a signal, (ticks, parts) of a group, float64; truth values are 0 and 1, and
            values that were not measured are NaN.

        Raises:
            UnknownNameError: No such signal or group; the nearest ones are given.
        """
        if name not in self._arrays:
            if name in self.signals:
                kind = self.signals[name].kind
                if kind in ("text", "list"):
                    raise InputError(
                        f"{self.path}: signal '{name}' holds {kind}s, not numbers; use log.{kind}s('{name}')"
                    )
                array = np.array(self.column(name).cast(pa.float64()).to_numpy())
            else:
                array = np.stack([self[part] for part in self.parts(name)], axis=1)
            array.setflags(write=False)
            self._arrays[name] = array
        return self._arrays[name]

    @checked
    def vector(self, group: str, size: Literal[2, 3, 4, 6]) -> Array:
        """Return the values of a vector, whatever the order of its parts in the file.

        Args:
            group: The common beginning of the names of its parts: "com/estimated".
            size: Number of parts: 2 for x and y, 3 with z, 4 for a quaternion xyzw, 6 for a wrench.

        Returns:
            Shape (ticks, size), float64; values that were not measured are NaN.

        Raises:
            InputError: The log has not all of these parts.
        """
        parts = parts_of(group, size)
        for part in parts:
            if part not in self:
                raise InputError(
                    f"{self.path} has no '{part}': {', '.join(AXES[size])} of a vector are needed"
                )
        return np.stack([self[part] for part in parts], axis=1)

    @checked
    def column(self, name: str) -> Any:
        """Return a signal as it is in the file: a pyarrow column."""
        if name not in self.signals:
            unknown_name(f"signal of {self.path}", name, self.signals)
        return self._rows.column(name)

    @checked
    def parts(self, group: str) -> list[str]:
        """Return the names of all numeric signals of a group; raise an `UnknownNameError` for an unknown group."""
        names = [
            name
            for name, signal in self.signals.items()
            if group and name.rpartition("/")[0] == group and signal.kind not in ("text", "list")
        ]
        if not names:
            groups = {name.rpartition("/")[0] for name in self.signals} - {""}
            unknown_name(f"signal of {self.path}", group, groups | set(self.signals))
        return names

    @checked
    def texts(self, name: str) -> NDArray[np.object_]:
        """Return the texts of a signal, shape (ticks,), with None in ticks without a text."""
        return self._objects(name, "text")

    @checked
    def lists(self, name: str) -> list[Array | None]:
        """Return the lists of a signal, each of shape (any,), for every tick; None in ticks without a list."""
        values = self._objects(name, "list")
        return [None if value is None else np.asarray(value, dtype=np.float64) for value in values]

    def _objects(self, name: str, kind: Kind) -> NDArray[np.object_]:
        column = self.column(name)
        if self.signals[name].kind != kind:
            raise InputError(f"{self.path}: signal '{name}' holds {self.signals[name].kind}s, not {kind}s")
        values: NDArray[np.object_] = column.to_numpy(zero_copy_only=False)
        return values

    @property
    def events(self) -> list[tuple[float, str]]:
        """Time (s) and text of each event of a program or a walk; empty for other runs."""
        columns = [self.texts(name) for name in ("program/event", "walk/event") if name in self]
        ticks = zip(self.time.tolist(), *columns, strict=True)
        return [
            (time, event) for time, *texts in ticks for text in texts if text for event in text.split("; ")
        ]


class _Rows:
    """Rows of a file, up to the break if there is one.

    Attributes:
        schema: Names, types and metadata of the columns.
        count: Number of rows.
        broken: Reason for the break; None without one.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        size = path.stat().st_size
        # From memory as a rule: a file that another program shortens meanwhile would end this one.
        self._content: Any = (
            pa.py_buffer(path.read_bytes())
            if size <= LARGEST_FILE
            else pa.memory_map(str(path)).read_buffer()
        )
        with contextlib.suppress(pa.ArrowException, OSError, EOFError):  # of a damaged file: `_read` says so
            for message in ipc.MessageReader.open_stream(self._stream()):
                if message.body.size > LARGEST_BATCH:
                    raise InputError(
                        f"{path} has a batch of {message.body.size} bytes, of at most {LARGEST_BATCH} that wbc writes"
                    )
        self._table, self.broken = self._read(None)
        self.schema, self.count = ipc.open_stream(self._stream()).schema, int(self._table.num_rows)

    def column(self, name: str) -> Any:
        """Return a column."""
        index = self.schema.get_field_index(name)
        table = self._table if len(self._table.schema) == len(self.schema) else self._read(index)[0]
        return table.column(name).slice(0, self.count)

    def cut(self, count: int, why: str) -> None:
        """Leave the rows from a number on out."""
        self.count, self.broken = count, why

    def _stream(self) -> Any:
        """Return the stream of Arrow in the file; what its end says of places in the file is not believed."""
        stream = pa.BufferReader(self._content)
        stream.seek(min(STREAM, self._content.size))
        return stream

    def _read(self, column: int | None) -> tuple[Any, str | None]:
        """Return a column, or when None all of them, the first one of too many, and the reason for a break."""
        broken, expected, batches, whole = None, 0, [], 0
        most = max(MEMORY, LARGEST_RATIO * self._content.size)
        try:
            expected = ipc.open_file(pa.BufferReader(self._content)).num_record_batches
        except (pa.ArrowException, OSError) as error:
            broken = str(error)
        try:
            options = ipc.IpcReadOptions(included_fields=None if column is None else [column])
            reader = ipc.open_stream(self._stream(), options=options)
        except (pa.ArrowException, OSError, EOFError) as error:
            raise InputError(f"{self._path} ends before anything was recorded: {error}") from error
        try:
            for batch in reader:
                batch.validate(full=True)  # offsets of texts and lists are followed without a look
                whole += batch.nbytes
                if whole > most:
                    raise InputError(
                        f"{self._path} has {self._content.size} bytes and unpacks to more than {most}: wbc has not "
                        "written it"
                    )
                batches.append(batch)
                if column is None and whole > MEMORY:
                    batches = [each.select([0]) for each in batches]
        except (pa.ArrowException, OSError, EOFError) as error:
            broken = broken or str(error)
        if broken is None and len(batches) < expected:
            broken = f"batch {len(batches) + 1} of {expected} is damaged"
        schema = batches[0].schema if batches else reader.schema
        return pa.Table.from_batches(batches, schema=schema), broken


def _signal(field: Any) -> Signal:
    facts = {key.decode(): value.decode() for key, value in (field.metadata or {}).items()}
    return Signal(field.name, facts.get("unit", "1"), facts.get("about", ""), KINDS[field.type])
