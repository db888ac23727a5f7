"""Server of one page, until it is interrupted."""

from __future__ import annotations

import asyncio
import contextlib
import sys

import tornado.httpserver
import tornado.web

from wbc.app.view.address import PortError, listen, url


class _PageHandler(tornado.web.RequestHandler):
    """The page."""

    def initialize(self, page: bytes) -> None:
        """Take the page that the application gives."""
        self._page = page

    def get(self) -> None:
        """Answer a request."""
        self.set_header("Cache-Control", "no-store")
        self.finish(self._page)


class PageServer:
    """A page at an address.

    Attributes:
        url: The address.
    """

    def __init__(self, host: str = "127.0.0.1", port: int | None = None) -> None:
        """Take the port.

        Args:
            host: Address to listen at; the default is reached from this machine alone.
            port: Port to listen at; the first free one from 7000 on when None, any free one when 0.

        Raises:
            PortError: The port is in use.
        """
        try:
            self._socket = listen(host, port)
        except OSError as error:
            raise PortError.at("replay", host, port, error.strerror or str(error)) from error
        self.url = url(host, self._socket.getsockname()[1])

    def serve(self, page: str, seconds: float | None = None) -> None:
        """Serve a page until Ctrl-C, or for a while.

        Args:
            page: HTML.
            seconds: s; endless when None.
        """
        print(f"replay: {self.url} (end with Ctrl-C)", file=sys.stderr, flush=True)
        with contextlib.suppress(KeyboardInterrupt):
            asyncio.run(self._run(page.encode(), seconds))

    async def _run(self, page: bytes, seconds: float | None) -> None:
        server = tornado.httpserver.HTTPServer(
            tornado.web.Application([(r"/", _PageHandler, {"page": page})])
        )
        server.add_socket(self._socket)
        try:
            await asyncio.sleep(1e9 if seconds is None else seconds)
        finally:
            server.stop()
            await server.close_all_connections()

    def close(self) -> None:
        """Release the port."""
        self._socket.close()
