"""Objects in JSON files that a command reads, and pictures that it writes."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from wbc.base.errors import InputError
from wbc.base.files import parsing, read_text
from wbc.sim.studies.journal import BEGIN

PICTURES = (".png", ".pdf", ".svg", ".jpg")


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
    text = read_text(path, "JSON")
    if text.startswith(BEGIN.decode()):
        raise InputError(f"{path} is no {what} but a journal, which `wbc study` takes as --journal {path}")
    with parsing(path, "JSON"):
        data = json.loads(text, object_pairs_hook=unique)
    if not isinstance(data, dict):
        raise InputError(f"{path} is no {what}: it must hold a JSON object")
    return data
