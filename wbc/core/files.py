"""Reading of text files."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from wbc.core.errors import InputError, shown


def read_text(path: Path, kind: str = "text file") -> str:
    """Return the content of a text file without its byte order mark.

    Args:
        path: The file.
        kind: Kind of file in messages.

    Raises:
        InputError: A file that cannot be read, or is not text.
    """
    try:
        return path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise InputError(f"{path} is not a {kind}: it is no text") from error
    except ValueError as error:  # a name with NUL or a surrogate
        raise InputError(f"{shown(str(path))} cannot be the name of a file") from error


def read_json(path: Path, kind: str = "JSON", **how: Any) -> Any:
    """Return the values in a JSON file.

    Args:
        path: The file.
        kind: Kind of file in messages.
        **how: Options of `json.loads`.

    Raises:
        InputError: A file that cannot be read, is not JSON, or is nested too deeply.
    """
    text = read_text(path)
    try:
        return json.loads(text, **how)
    except ValueError as error:
        raise InputError(f"{path} is not {kind}: {error}") from error
    except RecursionError as error:
        raise InputError(f"{path} is not {kind}: its values are nested too deeply") from error
