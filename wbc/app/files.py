"""Files that a command reads, and checks of those that it writes before it begins."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from wbc.base.errors import InputError
from wbc.base.files import check_writable, read_json, same_file

PICTURES = (".png", ".pdf", ".svg", ".jpg")


def check_target(
    what: str, path: str | Path, endings: tuple[str, ...], inputs: Iterable[str | Path | None] = ()
) -> Path:
    """Return the path of a file to write, `what` in messages, after a check; an existing file stays unchanged."""
    target = Path(path)
    if target.suffix.lower() not in endings:
        raise InputError(f"the name of {what} must end in one of {', '.join(endings)}, got '{target.name}'")
    if not target.parent.is_dir():
        raise InputError(f"no folder {target.parent} to write {target.name} into")
    try:
        check_writable(target)
    except (OSError, ValueError) as error:
        raise InputError(f"cannot write {target}: {getattr(error, 'strerror', None) or error}") from error
    for given in inputs:
        # The value of a setting may be a file; a file may have an equals sign in its name.
        named = () if given is None else (str(given), str(given).partition("=")[2])
        if any(name and same_file(target, name) for name in named):
            raise InputError(f"cannot write {what} to {target}: it is read, too; choose another name")
    return target


def unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Return a JSON object, for `json.loads`; `ValueError` for a name given twice, of which the first would be lost."""
    found: dict[str, Any] = {}
    for name, value in pairs:
        if name in found:
            raise ValueError(f"'{name}' is given twice")
        found[name] = value
    return found


def read_object(what: str, path: Path) -> dict[str, Any]:
    """Return the object in a JSON file, of a `what` such as "walk"."""
    data = read_json(path, object_pairs_hook=unique)
    if not isinstance(data, dict):
        raise InputError(f"{path} is no {what}: it must hold a JSON object")
    return data


def check_picture(path: Path | None, inputs: Iterable[str | Path | None] = ()) -> Path | None:
    """Return the path of a picture after a check by `check_target`; None without one."""
    return None if path is None else check_target("a picture", path, PICTURES, inputs)
