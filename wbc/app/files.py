"""Files that a command is to read or to write, looked at before it begins."""

from __future__ import annotations

from pathlib import Path

from wbc.core.errors import InputError


def check_target(what: str, path: str | Path, endings: tuple[str, ...]) -> Path:
    """Return where something is to be written; a file that is there stays as it is until then.

    Args:
        what: How the messages call it: "a figure".
        path: The file.
        endings: Endings that its name may have, such as (".png", ".svg").

    Raises:
        InputError: Another ending, no such folder, or not writable.
    """
    target = Path(path)
    if target.suffix.lower() not in endings:
        raise InputError(f"the name of {what} must end in one of {', '.join(endings)}, got '{target.name}'")
    if not target.parent.is_dir():
        raise InputError(f"no folder {target.parent} to write {target.name} into")
    if target.is_dir():
        raise InputError(f"cannot write {target}: it is a folder")
    there = target.exists()
    try:
        with target.open("ab"):
            pass
    except OSError as error:
        raise InputError(f"cannot write {target}: {error.strerror}") from error
    if not there:
        target.unlink()
    return target


def check_picture(path: Path | None) -> Path | None:
    """Return where a picture is to be written, None if none is wanted.

    Raises:
        InputError: As `check_target` raises it.
    """
    return None if path is None else check_target("a picture", path, (".png", ".pdf", ".svg", ".jpg"))
