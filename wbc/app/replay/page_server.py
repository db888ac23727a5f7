"""Server of one page, until it is interrupted."""

from __future__ import annotations

import asyncio
import contextlib
import sys

from wbc.app.address import Address, PortError, listen
from wbc.app.view.guard import GuardedHandler, guarded_server, new_nonce


class _PageHandler(GuardedHandler):
    """The page."""

    def initialize(self, page: bytes, nonce: str) -> None:
        """Take the page that the application gives."""
        self._page, self._nonce = page, nonce

    async def get(self) -> None:
        """Answer a request."""
        await self.answer(self._page, self._nonce)


class PageServer:
    """A page at an address; see `wbc.app.view.guard` for who may ask for it.

    Attributes:
        url: The address.
        nonce: Number that the scripts of the page must carry.
    """

    def __init__(self, host: str = "127.0.0.1", port: int | None = None) -> None:
        """Take the port.

        Args:
            host: Address to listen at; the default is reached from this machine alone.
            port: Port to listen at; the first free one from 7000 on when None, any free one when 0.

        Raises:
            InputError: No host, or a port out of range.
            PortError: The port is in use.
        """
        address = Address(host, port)
        try:
            self._socket, self._served = listen(address)
        except OSError as error:
            raise PortError.at("replay", address, error.strerror or str(error)) from error
        self.url = self._served.url
        self.nonce = new_nonce()

    def serve(self, page: str, seconds: float | None = None) -> None:
        """Serve a page, HTML whose scripts carry the nonce, until Ctrl-C, or for some seconds."""
        print(f"replay: {self.url} (end with Ctrl-C)", file=sys.stderr, flush=True)
        with contextlib.suppress(KeyboardInterrupt):
            asyncio.run(self._run(page.encode(), seconds))

    async def _run(self, page: bytes, seconds: float | None) -> None:
        server = guarded_server(self._served, [(r"/", _PageHandler, {"page": page, "nonce": self.nonce})])
        server.add_socket(self._socket)
        try:
            await asyncio.sleep(1e9 if seconds is None else seconds)
        finally:
            server.stop()
            await server.close_all_connections()

    def close(self) -> None:
        """Release the port."""
        self._socket.close()
