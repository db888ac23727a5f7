"""Journal of a sweep: one line of JSON for each trial that has ended, appended and never changed.

    {"key": …, "spec": …, "version": …, "status": …, "result": …, "clock": …, "error": …, "ended": …}

`key` is a hash of spec and version: the same trial by the same code has the same key, and a sweep that finds it does
not run it again. `result` depends on spec and code alone; `clock` holds wall-clock timings. A later line with
the same key replaces an earlier one.

A process that is killed in the middle of a line leaves a torn one: it is cut off when the journal is next opened for
writing, and skipped by readers. One process at a time writes; any number reads.
"""

from __future__ import annotations

import contextlib
import datetime
import fcntl
import functools
import hashlib
import json
import logging
import lzma
import os
import sys
from collections.abc import Mapping
from dataclasses import field
from functools import cached_property
from pathlib import Path
from types import TracebackType
from typing import Annotated, Any

from pydantic import AfterValidator, ConfigDict
from pydantic.dataclasses import dataclass
from pydantic_core import from_json, to_jsonable_python

from wbc.base.checked import checked
from wbc.base.errors import InputError, WbcError, check_parts
from wbc.base.files import STAMPED, decoding
from wbc.base.numbers import plain
from wbc.base.settings import to_json
from wbc.sim.studies.outcomes import AnyTrialSpec, Status, trial_from_json
from wbc.sim.studies.provenance import code_of, provenance

PACKED = ".xz"
"""Ending of a compressed journal."""

BEGIN = b'{"clock":'
"""Begin of each line: keys are sorted."""

_log = logging.getLogger(__name__)


class JournalError(WbcError):
    """Failure to read or write a journal."""


def _now() -> str:
    return datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds")


def _with_libraries(version: Mapping[str, Any]) -> Mapping[str, Any]:
    if not isinstance(version.get("libraries", {}), Mapping):
        raise ValueError("libraries must be an object of names and versions")
    return version


@dataclass(frozen=True, config=ConfigDict(strict=True, extra="forbid"))
class Entry:
    """One row of the journal: a trial's spec, status and result, as plain values.

    Their types are checked; what a result holds is the business of its kind of trial.

    Attributes:
        spec: Spec of the trial.
        status: End of the trial: "done", "diverged", "timeout" or "crashed".
        result: Result of the trial; None without one.
        clock: Wall-clock timings; None without a result.
        error: Reason why there is no result; None with one.
        version: Version of the code that ran the trial.
        ended: Date and time of the end (UTC).
    """

    spec: Mapping[str, Any]
    status: Status
    result: Mapping[str, Any] | None
    clock: Mapping[str, Any] | None
    error: str | None
    version: Annotated[Mapping[str, Any], AfterValidator(_with_libraries)]
    ended: str = field(default_factory=_now)

    @cached_property
    def key(self) -> str:
        """Hash of spec and version."""
        return trial_key(self.spec, self.version)

    def line(self) -> bytes:
        """Return the entry as a line of the journal."""
        return canonical({"key": self.key, **to_json(self)}).encode(errors="replace") + b"\n"


def trial_key(spec: Mapping[str, Any], version: Mapping[str, Any] | None = None) -> str:
    """Return the key of a trial: a hash of its spec and of the (present) code that runs it, 32 hex digits.

    A file that a spec names with its hash is in the key by its content, whatever its name.
    """
    code = _own_version() if version is None else canonical(code_of(version))
    content = f'{{"spec":{canonical(_by_content(spec))},"version":{code}}}'
    return hashlib.sha256(content.encode()).hexdigest()[:32]


def own_key(spec: Mapping[str, Any]) -> str | None:
    """Return the key of a stored spec with this code; None for a spec that it cannot read.

    The spec is read and written again, so that one of an earlier version has the key of today.
    """
    try:
        return trial_key(trial_from_json(spec).to_json())
    except (InputError, TypeError, ValueError, AttributeError, LookupError):
        return None


@functools.cache
def _own_version() -> str:
    return canonical(code_of(provenance()))


def _by_content(part: Any) -> Any:
    """Return a part of a spec with the hashes of files in place of their names."""
    if isinstance(part, Mapping):
        return {name: _by_content(value) for name, value in part.items()}
    stamp = STAMPED.fullmatch(part) if isinstance(part, str) else None
    return part if stamp is None else stamp[2]


def canonical(data: Any) -> str:
    """Return JSON that is equal for equal values: keys sorted, no spaces, NaN and infinity as null."""
    values = to_jsonable_python(to_json(data), inf_nan_mode="null", fallback=plain)
    return json.dumps(values, sort_keys=True, separators=(",", ":"), ensure_ascii=False)


@checked
def read_journal(path: Path | str, *, any_code: bool = False) -> dict[str, Entry]:
    """Return all entries of a journal by key; of entries with the same key, the last one.

    Incomplete and damaged lines are skipped, and their number is logged.

    Args:
        path: The file. A file that does not exist counts as empty; a name that ends in .xz is that of a compressed
            file.
        any_code: Count results of other versions of the code as results of this one: the keys are computed with the
            present version.

    Raises:
        JournalError: The file cannot be read, or is no journal.
    """
    entries, _ = _read(path)
    return _as_own(entries) if any_code else entries


def _read(path: Path | str) -> tuple[dict[str, Entry], int]:
    """Return the entries of a file by key, and the length of a torn last line, bytes."""
    try:
        with decoding(path, "journal", largest=sys.maxsize) as file:
            content = file.read_bytes()
            content = lzma.decompress(content) if file.suffix == PACKED else content
    except InputError as error:
        if isinstance(error.__cause__, FileNotFoundError):
            return {}, 0
        raise JournalError(f"journal {error}") from error
    *lines, last = content.split(b"\n")
    if not last or _entry(last) is not None:  # nothing, or whole without the end of its line
        lines, last = [*lines, last], b""
    found = {number: _entry(line) for number, line in enumerate(lines, 1) if line.strip()}
    entries = {entry.key: entry for entry in found.values() if entry is not None}
    if not entries and (found or not last.startswith(BEGIN[: len(last)])):
        raise JournalError(f"{path} is no journal: none of its lines is an entry")
    if bad := [number for number, entry in found.items() if entry is None]:
        _log.warning("journal %s: %d damaged lines skipped, the first is line %d", path, len(bad), bad[0])
    if last:
        _log.info("journal %s: its last line is torn", path)
    return entries, len(last)


def _entry(line: bytes) -> Entry | None:
    """Return the entry of a line; None if it is none."""
    try:
        data = from_json(line)
        del data["key"]
        data.pop("sum", None)  # a checksum, which journals of earlier versions have
        return Entry(ended=data.pop("ended"), **data)
    except (ValueError, TypeError, KeyError, AttributeError):
        return None


def _as_own(entries: Mapping[str, Entry]) -> dict[str, Entry]:
    """Return entries by the keys of their specs with this code, whatever code made them; its own come first."""
    found: dict[str, Entry] = {}
    unreadable = 0
    for key, entry in entries.items():
        today = own_key(entry.spec)
        if today is None:
            unreadable += 1
        elif today == key or today not in entries:
            found[today] = entry
    if unreadable:
        _log.warning(
            "%d entries whose spec this version cannot read, or of code that is not named, are left out",
            unreadable,
        )
    return found


class Journal:
    """Journal that is open for writing.

        with Journal("sweep.jsonl") as journal:
            if key not in journal:
                journal.add(entry)

    Attributes:
        path: The file.
        entries: Entries of the journal, by key.
    """

    @checked
    def __init__(self, path: Path | str, *, any_code: bool = False) -> None:
        """Open a journal or start a new one, lock it, and cut off an incomplete last line.

        Args:
            path: The file; missing folders are made.
            any_code: Count results of other versions of the code as results of this one; see `read_journal`.

        Raises:
            JournalError: Another process writes to the file, or the file is no journal or cannot be written.
        """
        self.path = check_journal_path(path)
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            self._file = os.open(self.path, os.O_RDWR | os.O_CREAT | os.O_APPEND | os.O_CLOEXEC, 0o644)
        except OSError as error:
            raise JournalError(f"journal {path} cannot be written: {error}") from error
        try:
            try:
                fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError as error:
                raise JournalError(
                    f"journal {path} is being written by another program; wait for it, or use another journal"
                ) from error
            entries, torn = _read(self.path)
            self.entries = _as_own(entries) if any_code else entries
            if torn:
                _log.warning("journal %s: torn last line of %d bytes cut off", self.path, torn)
                os.ftruncate(self._file, os.fstat(self._file).st_size - torn)
            size = os.fstat(self._file).st_size
            if size and os.pread(self._file, 1, size - 1) != b"\n":
                os.write(self._file, b"\n")
        except BaseException:
            self.close()
            raise

    def __contains__(self, key: object) -> bool:
        return key in self.entries

    def entry(self, spec: AnyTrialSpec) -> Entry | None:
        """Return the entry of a trial; None if it has not been run."""
        check_parts("a trial", spec, "kind", "to_json")
        return self.entries.get(trial_key(spec.to_json()))

    @checked
    def add(self, entry: Entry) -> None:
        """Append an entry.

        Raises:
            JournalError: The disk is full, or the journal is closed; no part of the entry is in the file then.
        """
        if self._file < 0:
            raise JournalError(f"journal {self.path} is closed")
        line = entry.line()
        size = os.fstat(self._file).st_size
        try:
            written = os.write(self._file, line)
            if written < len(line):
                raise OSError(f"{written} of {len(line)} bytes written")
            os.fsync(self._file)  # a line survives a loss of power; the kill of the process in any case
        except OSError as error:
            with contextlib.suppress(OSError):
                os.ftruncate(self._file, size)
            raise JournalError(f"journal {self.path} cannot be written: {error}") from error
        self.entries[entry.key] = entry

    def close(self) -> None:
        """Release the lock."""
        file, self._file = self._file, -1
        if file >= 0:
            os.close(file)

    def __enter__(self) -> Journal:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def check_journal_path(path: Path | str) -> Path:
    """Return the path of a journal to write; refused are a folder and a compressed file, before a long run begins."""
    path = Path(path)
    if os.path.isdir(path):
        raise InputError(f"a journal is a file, but {path} is a folder")
    if path.suffix == PACKED:
        raise InputError(
            f"{path} is compressed, and such a journal is only read; unpack it with `xz -dk` to go on"
        )
    return path
