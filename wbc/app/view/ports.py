"""Listening socket and address of a served page."""

from __future__ import annotations

import contextlib
import os
import socket

FIRST_PORT, PORTS = 7000, 200
"""Ports that are tried when none is given; MeshCat's own begin with 7000, too."""


def listen(host: str, port: int | None) -> socket.socket:
    """Return a listening socket.

    Args:
        host: Address to listen at.
        port: Port to listen at; the first free one from `FIRST_PORT` on when None, any free one when 0.

    Raises:
        OSError: The port, or every port of the range, is in use.
    """
    if port is None:
        for candidate in range(FIRST_PORT, FIRST_PORT + PORTS - 1):
            with contextlib.suppress(OSError):
                return listen(host, candidate)
        port = FIRST_PORT + PORTS - 1
    try:
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        listening = socket.create_server((host, port), family=family)
    except OSError as error:  # Python appends the address, which the caller's message has already
        raise OSError(error.errno, str(error.strerror or error).partition(" (while")[0]) from error
    listening.setblocking(False)
    return listening


def address(host: str, port: int) -> str:
    """Return the URL for other machines, if the page is served to them, or for this one."""
    return f"http://{os.uname().nodename if host == '0.0.0.0' else host}:{port}/"
