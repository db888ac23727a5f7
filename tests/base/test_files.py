"""Files are replaced whole or not at all, whatever the disk and the program do meanwhile."""

from __future__ import annotations

import contextlib
import errno
import os
import re
import stat
from collections.abc import Callable
from pathlib import Path

import pytest
from full_disk import limited_file_size

from wbc.base.errors import InputError
from wbc.base.files import (
    BESIDE,
    FileError,
    check_target,
    decoding,
    file_hash,
    first_tag,
    parse_xml,
    parsing,
    read_text,
    read_toml,
    replacing,
    same_file,
    write_text,
)

OLD = "old\n"


@pytest.fixture
def old(tmp_path: Path) -> Path:
    path = tmp_path / "table.csv"
    path.write_text(OLD)
    return path


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_a_new_file_takes_the_place_of_the_old_one_when_it_is_complete(old: Path) -> None:
    with replacing(old) as new:
        new.write_text("half")
        assert old.read_text() == OLD
        assert new.parent == old.parent and new.suffix == old.suffix and new.name.startswith(BESIDE)
        new.write_text("whole")
    assert old.read_text() == "whole" and names(old.parent) == [old.name]


@pytest.mark.parametrize(
    "error",
    [OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)), OSError("unknown"), ValueError(), KeyboardInterrupt()],
)
def test_after_an_error_the_old_file_is_as_it_was(old: Path, error: BaseException) -> None:
    kind = FileError if isinstance(error, OSError) else type(error)
    with pytest.raises(kind) as caught, replacing(old) as new:  # noqa: PT012 - the block is what is tested
        new.write_text("half")
        raise error
    if isinstance(error, OSError):
        assert str(old) in str(caught.value) and str(error.strerror or error) in str(caught.value)
    assert old.read_text() == OLD and names(old.parent) == [old.name]


def test_a_full_disk_leaves_the_old_file(old: Path) -> None:
    with limited_file_size(100), pytest.raises(FileError, match="write"):
        write_text(old, 1000 * "x")
    assert old.read_text() == OLD and names(old.parent) == [old.name]


def forked(block: Callable[[], object]) -> None:
    """Run a block in a forked process, which then ends as Python programs do, but runs no other test."""
    child = os.fork()
    if child == 0:
        with contextlib.suppress(BaseException):
            block()
        os._exit(0)
    os.waitpid(child, 0)


def test_a_forked_process_leaves_the_file_of_its_parent(old: Path) -> None:
    writing = replacing(old)
    new = writing.__enter__()
    new.write_text("whole")
    forked(lambda: writing.__exit__(SystemExit, SystemExit(), None))
    writing.__exit__(None, None, None)
    assert old.read_text() == "whole" and names(old.parent) == [old.name]


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full here")
def test_a_device_is_not_replaced() -> None:
    before = os.stat("/dev/full")
    with pytest.raises(FileError, match="no regular file|Permission"):
        write_text("/dev/full", "x")
    assert os.stat("/dev/full").st_ino == before.st_ino and stat.S_ISCHR(os.stat("/dev/full").st_mode)


def test_permissions_and_symbolic_links_stay(old: Path) -> None:
    old.chmod(0o640)
    link = old.with_name("link.csv")
    link.symlink_to(old.name)
    write_text(link, "new")
    assert link.is_symlink() and old.read_text() == "new" and stat.S_IMODE(old.stat().st_mode) == 0o640
    plain = old.with_name("plain.csv")
    plain.touch()
    write_text(old.with_name("fresh.csv"), "new")
    assert old.with_name("fresh.csv").stat().st_mode == plain.stat().st_mode


def test_the_same_file_is_known_by_all_its_names(old: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    symbolic, hard, other = (old.with_name(name) for name in ("symbolic", "hard", "other"))
    symbolic.symlink_to(old)
    hard.hardlink_to(old)
    other.write_text(OLD)
    monkeypatch.chdir(old.parent)
    for path in (symbolic, hard, Path(old.name), Path("../") / old.parent.name / old.name):
        assert same_file(old, path) and same_file(path, old)
    assert not same_file(old, other) and not same_file(old, "missing") and not same_file(old, "a\0b")


def test_what_is_read_is_a_file_of_a_size_and_what_was_meant(old: Path) -> None:
    with decoding(old, "table", largest=4) as path:
        assert path == old
    for path in (old, old.parent, old.with_name("none")):  # too large, a folder, nothing
        with pytest.raises(InputError, match=re.escape(str(path))), decoding(path, "table", largest=3):
            raise AssertionError
    # The beginning of `printf 'old\n' | sha256sum`.
    assert file_hash(old) == "01d09d19c2139a46"


def test_a_file_to_write_is_checked_before_work_begins(tmp_path: Path) -> None:
    """One check for logs, pictures, tables and films: ending, folder, permission, and not one of the inputs."""
    read, log = tmp_path / "read.csv", tmp_path / "log.arrow"
    read.write_text(OLD)
    for bad, rule in (
        (tmp_path / "a.txt", "must end in one of .csv, .json"),
        (tmp_path / "no" / "a.csv", "no folder"),
        (tmp_path / ("x" * 300 + ".csv"), "cannot write a table"),
        (read, "it is read, too"),
    ):
        with pytest.raises(InputError, match=re.escape(rule)):
            check_target("a table", bad, (".csv", ".json"), [None, f"source={read}"])
    folder = tmp_path / "folder.csv"
    folder.mkdir()
    with pytest.raises(InputError, match="it is a folder"):
        check_target("a table", folder, (".csv",))
    assert check_target("the log", str(log)) == log and not log.exists()
    other = tmp_path / "other.csv"
    other.touch()
    assert (
        check_target("a table", read, (".csv",), [other, f"source={other}"]) == read
        and read.read_text() == OLD
    )
    read.chmod(0o444)
    if os.geteuid():  # root may write everything
        with pytest.raises(InputError, match="write-protected"):
            check_target("a table", read)


def test_texts_are_read_without_their_byte_order_mark(tmp_path: Path) -> None:
    path, text = tmp_path / "file", "<a>häß</a>"
    path.write_bytes(text.encode("utf-8-sig"))
    assert read_text(path) == text
    assert first_tag(f"<!-- <b> --><?xml?>{text}") == "a" and first_tag("text") == ""
    assert parse_xml('<a xmlns="x:y"><b/></a>').find("b") is not None
    path.write_text("a = 1")
    assert read_toml(path) == {"a": 1}


def test_what_is_wrong_with_a_file_is_said_in_one_line(tmp_path: Path) -> None:
    path = tmp_path / "file"
    for content, read, said in (
        (b"\xff", read_text, "no text in utf-8"),
        (b"a = 1 = 2", read_toml, "is not TOML"),
    ):
        path.write_bytes(content)
        with pytest.raises(InputError, match=said) as refusal:
            read(path)
        assert str(path) in str(refusal.value) and "\n" not in str(refusal.value)
    for error, said in (
        (ValueError("a\nb"), "is not a table: a b"),
        (ValueError(), "is not a table: ValueError"),
        (ValueError("x" * 900), "x" * 500),
        (OSError(errno.ENOENT, "nothing there"), "cannot be read: nothing there"),
        (OSError("gone"), "cannot be read: gone"),
        (MemoryError(), "fits into memory"),
        (InputError("known"), "known"),
    ):
        with pytest.raises(InputError) as refusal, parsing(path, "table"):
            raise error
        assert str(refusal.value).endswith(said) and "x" * 501 not in str(refusal.value)
    for bad in ("a\0b", "\ud800"):
        with pytest.raises(InputError, match="cannot be the name of a file"), decoding(bad, "table"):
            raise AssertionError


def test_no_descriptor_is_left_open(old: Path) -> None:
    folder = Path("/proc/self/fd")
    if not folder.exists():
        pytest.skip("no /proc here")
    before = len(list(folder.iterdir()))
    for _ in range(5):
        write_text(old, "new")
        with pytest.raises(ValueError, match="stop"), replacing(old):
            raise ValueError("stop")
        with pytest.raises(FileError):
            write_text(old.parent, "new")
        with pytest.raises(FileError):
            write_text(old.parent / "none" / "file", "new")
    assert len(list(folder.iterdir())) == before
