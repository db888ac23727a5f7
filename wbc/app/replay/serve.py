"""Serves one page until it is interrupted."""

from __future__ import annotations

import asyncio
import contextlib
import os
import socket
import sys

import tornado.httpserver
import tornado.web

from wbc.app.view.server import FIRST_PORT, PORTS
from wbc.app.view.view import PortError


class _One(tornado.web.RequestHandler):
    """The page."""

    def initialize(self, page: bytes) -> None:
        """Take it over."""
        self._page = page

    def get(self) -> None:
        """Answer a request."""
        self.set_header("Cache-Control", "no-store")
        self.finish(self._page)


class Server:
    """A page at an address.

    Attributes:
        url: The address.
    """

    def __init__(self, host: str = "127.0.0.1", port: int | None = None) -> None:
        """Take the port, so that one that cannot be had is known before anything else begins.

        Args:
            host: Address to listen at; the default is reached from this machine alone.
            port: Port to listen at; the first free one from 7000 on when None, any free one when 0.

        Raises:
            PortError: The port cannot be had.
        """
        try:
            self._socket = _listen(host, port)
        except OSError as error:
            where = host if port is None else f"{host}:{port}"
            raise PortError(
                f"the replay cannot be served at {where}: {error.strerror or error}; choose another port, or "
                "leave it out to take a free one"
            ) from error
        name = os.uname().nodename if host == "0.0.0.0" else host
        self.url = f"http://{name}:{self._socket.getsockname()[1]}/"

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
        server = tornado.httpserver.HTTPServer(tornado.web.Application([(r"/", _One, {"page": page})]))
        server.add_socket(self._socket)
        try:
            await asyncio.sleep(1e9 if seconds is None else seconds)
        finally:
            server.stop()
            await server.close_all_connections()

    def close(self) -> None:
        """Let the port go."""
        self._socket.close()


def _listen(host: str, port: int | None) -> socket.socket:
    """Return a listening socket.

    Raises:
        OSError: No port that was asked for, or none of the range, is free.
    """
    if port is None:
        for candidate in range(FIRST_PORT, FIRST_PORT + PORTS - 1):
            with contextlib.suppress(OSError):
                return _listen(host, candidate)
        port = FIRST_PORT + PORTS - 1
    listening = socket.create_server((host, port), family=socket.AF_INET6 if ":" in host else socket.AF_INET)
    listening.setblocking(False)
    return listening
