"""Reading of text files."""

from __future__ import annotations

from pathlib import Path

from wbc.core.errors import InputError


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
