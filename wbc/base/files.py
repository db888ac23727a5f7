"""Files: reading, hashes, and writing beside the old file, which is replaced when the new one is complete."""

from __future__ import annotations

import contextlib
import hashlib
import io
import os
import re
import stat
import tempfile
import tomllib
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree

from wbc.base.errors import InputError, WbcError, shown_path

if TYPE_CHECKING:
    from matplotlib.figure import Figure

BESIDE = ".wbc-"
"""Beginning of the name of a file that is being written; one that is left over belongs to a killed program."""


STAMPED = re.compile(r"(.+)#([0-9a-f]{16})", re.DOTALL)
"""Name of a file with the hash of its content, as specs have it: a spec stays one trial, also if the file changes."""


class FileError(WbcError):
    """A file that could not be written to its end, because the disk is full for example; an old one is unchanged."""


LARGEST_FILE = 2**30
"""Largest file that is read, bytes; a journal that unpacks to more says how to raise it."""


@contextlib.contextmanager
def decoding(path: str | Path, kind: str, *, largest: int = LARGEST_FILE) -> Iterator[Path]:
    """Give the path of a file of some kind to read: every reader of files goes through here.

        with decoding("ground.npy", "array") as file:
            heights = np.load(file)

    A pipe or a device, which might never end, is refused before it is opened, and so is a file of more than `largest`
    bytes. Decoders of other libraries raise exceptions of any kind on damaged files; each becomes one line, an
    `InputError`.
    """
    with parsing(path, kind):
        found = os.stat(path)
        if not stat.S_ISREG(found.st_mode):
            raise InputError(
                f"{_line(path)} cannot be read: it is {_SORTS.get(stat.S_IFMT(found.st_mode), 'no file')}"
            )
        if found.st_size > largest:
            raise InputError(f"{_line(path)} has {found.st_size} bytes; a {kind} may have {largest} at most")
        yield Path(path)


def home_path(path: str | Path) -> Path:
    """Return a path with the home folder in place of `~`; that of an unknown user, or of odd text, stays as it is."""
    try:
        return Path(os.path.expanduser(path))
    except ValueError:
        return Path(path)


def existing(name: str | Path, kind: str, choices: str) -> Path:
    """Return the path of a file of a kind such as "URDF"; without one an `InputError` with the choices."""
    path = home_path(name)
    if not os.path.isfile(path):  # False for a name that is too long, or that no file can have
        raise InputError(f"no {kind} file {shown_path(path)}; give {choices}")
    return path


def stamped_file(name: str, what: str, *endings: str) -> str:
    """Return the name of a file with the hash of its content, and of that of files beside it with other endings.

    Raises:
        InputError: A file, a `what`, that cannot be read, or whose content is not that of a hash in the name.
    """
    given = STAMPED.fullmatch(name)
    file, digest = given[1] if given else name, hashlib.sha256()
    for each in (Path(file), *map(Path(file).with_suffix, endings)):
        if each == Path(file) or each.is_file():
            with decoding(each, what) as path:
                digest.update(path.read_bytes())
    found = digest.hexdigest()[:16]
    if given and found != given[2]:
        raise InputError(f"{file} has changed: its hash is {found}, the trial was specified with {given[2]}")
    return f"{file}#{found}"


def file_of(name: str) -> str:
    """Return the file of a name with a hash."""
    return name.rpartition("#")[0]


@contextlib.contextmanager
def parsing(path: str | Path, kind: str) -> Iterator[None]:
    """Turn what the block raises on the content of a file into an `InputError` of one line; see `decoding`."""
    kind = kind if kind in ("JSON", "TOML") else f"a {kind}"
    where = _line(path)
    try:
        yield
    except WbcError:
        raise
    except OSError as error:
        raise InputError(f"{where} cannot be read: {error.strerror or error}") from error
    except UnicodeDecodeError as error:
        raise InputError(f"{where} is not {kind}: it is no text in {error.encoding}") from error
    except RecursionError as error:
        raise InputError(f"{where} is not {kind}: its values are nested too deeply") from error
    except MemoryError as error:
        raise InputError(f"{where} is not {kind} that fits into memory") from error
    except Exception as error:
        if "\0" in str(path) or isinstance(error, UnicodeEncodeError):
            raise InputError(f"{where} cannot be the name of a file") from error
        said = " ".join(str(error).split())[:500] or type(error).__name__
        raise InputError(f"{where} is not {kind}: {said}") from error


@contextlib.contextmanager
def naming(path: str | Path, kind: str) -> Iterator[None]:
    """Begin each `InputError` of the block with the path, and turn what else it raises into one; see `parsing`."""
    with parsing(path, kind):
        try:
            yield
        except InputError as error:
            if str(error).startswith(_line(path)):
                raise
            raise InputError(f"{_line(path)}: {error}") from error


def _line(path: str | Path) -> str:
    return str(path) if str(path).isprintable() else shown_path(path)


_SORTS = {
    stat.S_IFDIR: "a folder",
    stat.S_IFIFO: "a pipe",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
    stat.S_IFSOCK: "a socket",
}


def read_text(path: Path, kind: str = "text file") -> str:
    """Return the content of a text file of some kind without its byte order mark, or raise an `InputError`."""
    with decoding(path, kind) as file:
        return file.read_text(encoding="utf-8-sig")


def parse_xml(text: str) -> ElementTree.Element:
    """Return the first element of an XML; tags of a default namespace (`xmlns="…"`) are those of files without one.

    Text that is no XML is a `ParseError`.
    """
    return ElementTree.fromstring(re.sub(r"\sxmlns\s*=\s*(\"[^\"]*\"|'[^']*')", "", text))


def first_tag(text: str) -> str:
    """Return the tag of the first element of an XML; "" where there is none."""
    text = re.sub(r"<!--.*?-->", "", text, flags=re.DOTALL)
    found = re.search(r"<\s*([A-Za-z][\w:.-]*)", text)
    return found[1] if found else ""


def read_toml(path: Path) -> dict[str, Any]:
    """Return the values in a TOML file; `InputError` for one that cannot be read or is nested too deeply."""
    text = read_text(path, "TOML")
    with parsing(path, "TOML"):
        return tomllib.loads(text)


@contextlib.contextmanager
def replacing(path: str | Path) -> Iterator[Path]:
    """Give an empty file to write in place of another; it takes that one's name when the block has ended.

        with replacing("walk.png") as new:
            figure.savefig(new)

    The new file is in the same folder and has the same ending. Until it is complete and on the disk, nothing happens to
    the old one; after an error the new one is removed. A symbolic link stays one: the file that it names is replaced.
    What cannot be made or written is a `FileError`; an `OSError` in the block becomes this, too.
    """
    new: Path | None = None
    process = os.getpid()
    try:
        target = Path(path).resolve()
        file, name = tempfile.mkstemp(prefix=BESIDE, suffix=target.suffix, dir=target.parent)
        new, mask = Path(name), os.umask(0)
        os.umask(mask)
        os.fchmod(file, 0o666 & ~mask)
        os.close(file)
        yield new
        move_into_place(new, target)
    except OSError as error:
        raise FileError(f"cannot write {path}: {error.strerror or error}") from error
    finally:
        if new is not None and os.getpid() == process:  # not in a process that was forked in the block
            with contextlib.suppress(OSError):
                new.unlink(missing_ok=True)


def write_text(path: str | Path, text: str) -> None:
    """Write a text file (UTF-8) in place of an old one, as `replacing` does."""
    with replacing(path) as new:
        new.write_text(text, encoding="utf-8", newline="")


def save_figure(figure: Figure, path: str | Path, *, dpi: float) -> None:
    """Write a figure of Matplotlib in place of an old file, as `replacing` does; its ending chooses the format."""
    picture = io.BytesIO()  # a figure that fails in the middle of a file would leave it open
    figure.savefig(picture, format=Path(path).suffix[1:].lower(), dpi=dpi)
    with replacing(path) as new:
        new.write_bytes(picture.getvalue())


def move_into_place(new: Path, target: Path) -> None:
    """Put a complete file in the place of another, with the permissions of that one, once it is on the disk.

    `OSError`: the disk is full, or the target is a folder or a device.
    """
    if target.exists():
        if not target.is_file():
            raise OSError(f"{target} is no regular file")
        new.chmod(target.stat().st_mode & 0o777)
    with new.open("rb+") as file:
        os.fsync(file.fileno())
    os.replace(new, target)


def check_target(
    what: str, path: str | Path, endings: tuple[str, ...] = (), inputs: Iterable[str | Path | None] = ()
) -> Path:
    """Return the path of a file to write, `what` in messages, after a check; an existing file stays unchanged.

    Args:
        what: Noun with its article, such as "a picture".
        path: The path.
        endings: Endings of its name that are allowed; any where there are none.
        inputs: Files, and settings as name=value that may name one, that are read and must not be written.
    """
    target = Path(path)
    if endings and target.suffix.lower() not in endings:
        raise InputError(f"the name of {what} must end in one of {', '.join(endings)}, got '{target.name}'")
    if not os.path.isdir(target.parent):  # names that are too long are none
        raise InputError(f"no folder {target.parent} to write {what} {target.name} into")
    try:
        _check_writable(target)
    except (OSError, ValueError) as error:
        raise InputError(
            f"cannot write {what} {target}: {getattr(error, 'strerror', None) or error}"
        ) from error
    for given in inputs:
        # The value of a setting may be a file; a file may have an equals sign in its name.
        named = () if given is None else (str(given), str(given).partition("=")[2])
        if any(name and same_file(target, name) for name in named):
            raise InputError(f"cannot write {what} to {target}: it is read, too; choose another name")
    return target


def _check_writable(path: Path) -> None:
    """Raise an `OSError` if a file cannot be written with `replacing`; nothing is changed.

    A name that no file can have is a `ValueError`.
    """
    with contextlib.suppress(FileNotFoundError):
        mode = path.stat().st_mode  # refuses names that are too long
        if not stat.S_ISREG(mode):
            raise OSError("it is a folder" if stat.S_ISDIR(mode) else "it is no regular file")
        if not os.access(path, os.W_OK):
            raise OSError("it is write-protected")
    with tempfile.TemporaryFile(dir=path.resolve().parent):
        pass


def same_file(one: str | Path, other: str | Path) -> bool:
    """Return true if two paths lead to the same file, by symbolic or hard links, too."""
    one, other = Path(one), Path(other)
    try:
        return one.resolve() == other.resolve() or os.path.samefile(one, other)
    except (OSError, ValueError):  # one of them does not exist, or is no path
        return False


def file_hash(path: str | Path) -> str:
    """Return the hash of a file's content, 16 hex digits; `InputError` if it cannot be read."""
    with decoding(path, "file") as file:
        return hashlib.sha256(file.read_bytes()).hexdigest()[:16]
