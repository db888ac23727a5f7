"""Text files, read with errors that say what is wrong with them."""

from __future__ import annotations

from pathlib import Path

from wbc.core.errors import InputError


def read_text(path: Path, kind: str = "text file") -> str:
    """What a text file holds, without its byte order mark.

    Args:
        path: The file.
        kind: What it should be, for the message.

    Raises:
        InputError: It cannot be read, or is no text.
    """
    try:
        return path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise InputError(f"{path} is not a {kind}: it is no text") from error
