"""Errors of the live view, and the message of an address that cannot be served."""

from __future__ import annotations

from wbc.core.errors import InputError, WbcError


class ViewError(WbcError):
    """The live view cannot be started."""


class PortError(ViewError, InputError):
    """A page cannot be served at an address or port; the message names an alternative."""

    @staticmethod
    def at(what: str, host: str, port: int | None, reason: str) -> PortError:
        """Return the error of an address.

        Args:
            what: What is served: "live view" or "replay".
            host: The address.
            port: The port; None for the first free one.
            reason: Message of the operating system.
        """
        address = host if port is None else f"{host}:{port}"
        hint = "; choose another port, or leave it out to take a free one" if port else ""
        return PortError(f"the {what} cannot be served at {address}: {reason}{hint}")
