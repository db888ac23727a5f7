"""Files that a command reads, and checks of those that it writes before it begins."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from wbc.core.errors import InputError
from wbc.core.files import read_json


def check_target(what: str, path: str | Path, endings: tuple[str, ...]) -> Path:
    """Return the path of a file to write after a check; an existing file stays unchanged.

    Args:
        what: Noun for the messages: "a figure".
        path: The file.
        endings: Endings that its name may have, such as (".png", ".svg").

    Raises:
        InputError: Another ending, a folder that does not exist, or a file that is not writable.
    """
    target = Path(path)
    if target.suffix.lower() not in endings:
        raise InputError(f"the name of {what} must end in one of {', '.join(endings)}, got '{target.name}'")
    if not target.parent.is_dir():
        raise InputError(f"no folder {target.parent} to write {target.name} into")
    if target.is_dir():
        raise InputError(f"cannot write {target}: it is a folder")
    existed = target.exists()
    try:
        with target.open("ab"):
            pass
    except OSError as error:
        raise InputError(f"cannot write {target}: {error.strerror}") from error
    if not existed:
        target.unlink()
    return target


def read_object(what: str, path: Path) -> dict[str, Any]:
    """Return the object in a JSON file.

    Args:
        what: Noun for the messages: "walk".
        path: The file.

    Raises:
        InputError: The file cannot be read, is not JSON or holds no object.
    """
    data = read_json(path)
    if not isinstance(data, dict):
        raise InputError(f"{path} is no {what}: it must hold a JSON object")
    return data


def check_picture(path: Path | None) -> Path | None:
    """Return the path of a picture after a check; None without one.

    Raises:
        InputError: As `check_target` raises it.
    """
    return None if path is None else check_target("a picture", path, (".png", ".pdf", ".svg", ".jpg"))
