"""Addresses of served pages: listening socket, URL, and the errors of an address."""

from __future__ import annotations

import contextlib
import os
import socket

from wbc.core.errors import InputError, WbcError

FIRST_PORT, PORTS = 7000, 200
"""Ports that are tried when none is given; MeshCat's own begin with 7000, too."""


class ViewError(WbcError):
    """The live view cannot be started."""


class PortError(ViewError, InputError):
    """A page cannot be served at an address or port; the message names an alternative."""

    @staticmethod
    def at(what: str, host: str, port: int | None, reason: str) -> PortError:
        """Return the error of an address; `what` is served there, `reason` is the operating system's message."""
        place = host if port is None else f"{host}:{port}"
        hint = "; choose another port, or leave it out to take a free one" if port else ""
        return PortError(f"the {what} cannot be served at {place}: {reason}{hint}")


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
    except OSError as error:  # Python appends the address, which `PortError` has already
        raise OSError(error.errno, str(error.strerror or error).partition(" (while")[0]) from error
    listening.setblocking(False)
    return listening


def url(host: str, port: int) -> str:
    """Return the URL for other machines, if the page is served to them, or for this one."""
    return f"http://{os.uname().nodename if host == '0.0.0.0' else host}:{port}/"
