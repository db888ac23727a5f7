"""Addresses of served pages: where a page listens, its URL, the names it answers to, and the errors of an address."""

from __future__ import annotations

import errno
import ipaddress
import os
import socket
from dataclasses import dataclass
from typing import Annotated

from pydantic import AfterValidator, Field

from wbc.core.errors import InputError, WbcError
from wbc.core.settings import settings

FIRST_PORT, PORTS = 7000, 200
"""Ports that are tried when none is given; MeshCat's own begin with 7000, too."""


class ViewError(WbcError):
    """The live view cannot be started."""


class PortError(ViewError, InputError):
    """A page cannot be served at an address or port; the message names an alternative."""

    @staticmethod
    def at(what: str, address: Address, reason: str) -> PortError:
        """Return the error of an address; `what` is served there, `reason` is the operating system's message."""
        place = address.host if address.port is None else f"{_bracketed(address.host)}:{address.port}"
        hint = "; choose another port, or leave it out to take a free one" if address.port else ""
        return PortError(f"the {what} cannot be served at {place}: {reason}{hint}")


def _listenable(host: str) -> str:
    """Return a host that names an address; the empty one would listen on every network."""
    try:
        named = bool(host.encode("idna")) and host.isprintable() and not any(map(str.isspace, host))
    except UnicodeError:
        named = False
    if not named:
        raise InputError(
            "host must be an address or a name of this machine, such as 127.0.0.1 (for this machine alone) or "
            f"0.0.0.0 (for every network), got {host!r}"
        )
    return host


Host = Annotated[str, AfterValidator(_listenable)]
"""Address or name of this machine to listen at."""

Port = Annotated[int, Field(ge=0, le=65535)]
"""Port to listen at; 0 is any free one."""


@settings
class Address:
    """Address to serve a page at.

    Attributes:
        host: The default is reached from this machine alone, 0.0.0.0 and :: from everywhere.
        port: The first free one from `FIRST_PORT` on when None, any free one when 0.
    """

    host: Host = "127.0.0.1"
    port: Port | None = None


@dataclass(frozen=True)
class ServedAddress:
    """Address that a page is served at.

    Attributes:
        host: Host as it was given.
        bound: Address that the socket is bound to.
        port: Port that the socket is bound to.
    """

    host: str
    bound: str
    port: int

    @property
    def everywhere(self) -> bool:
        """True if the page is served to all networks."""
        return ipaddress.ip_address(self.bound.partition("%")[0]).is_unspecified

    @property
    def url(self) -> str:
        """URL for other machines, if the page is served to them, or for this one."""
        host = os.uname().nodename if self.everywhere else self.host
        return f"http://{_bracketed(host)}:{self.port}/"

    def admits(self, host: str) -> bool:
        """Return true if a request's `Host` header, name or address with the port unless it is 80, names this address.

        A name of another site that resolves to this machine (DNS rebinding) does not. A page that is served to all
        networks is also asked for by this machine's name and by any address: an address is not resolved.
        """
        name, _, port = host.lower().rpartition(":")
        if not port.isdecimal():
            name, port = host.lower(), "80"
        if port != str(self.port):
            return False
        names = {"localhost", "127.0.0.1", "::1", self.host, self.bound}
        if self.everywhere:
            names.add(os.uname().nodename)
        return name in {_bracketed(known.lower()) for known in names} or (self.everywhere and _literal(name))


def _bracketed(host: str) -> str:
    """Return a host as URLs have it: an IPv6 address in brackets."""
    return f"[{host}]" if ":" in host else host


def _literal(host: str) -> bool:
    """Return true for an IP address, as URLs have it."""
    try:
        address = ipaddress.ip_address(host.removeprefix("[").removesuffix("]"))
    except ValueError:
        return False
    return host == _bracketed(str(address))


def listen(address: Address) -> tuple[socket.socket, ServedAddress]:
    """Return a listening socket, and the address that it has got.

    `OSError`: the port, or every port of the range, is in use; or there is no such host.
    """
    if address.port is None:
        for candidate in range(FIRST_PORT, FIRST_PORT + PORTS):
            try:
                return listen(Address(address.host, candidate))
            except OSError as error:
                if error.errno != errno.EADDRINUSE or candidate == FIRST_PORT + PORTS - 1:
                    raise
    try:
        family = socket.AF_INET6 if ":" in address.host else socket.AF_INET
        listening = socket.create_server((address.host, address.port or 0), family=family)
    except OSError as error:  # Python appends the address, which `PortError` has already
        raise OSError(error.errno, str(error.strerror or error).partition(" (while")[0]) from error
    listening.setblocking(False)
    bound, port = listening.getsockname()[:2]
    return listening, ServedAddress(address.host, bound, port)
