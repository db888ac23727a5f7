"""Server of pages, and its guard: which requests are answered, what an answer may do in a browser, and its limits.

A page is asked for by the address that it is served at, never by the name of another site (DNS rebinding) and never by
another site's page. No page frames it, unless it was asked to let those of this machine do so (notebooks), and its own
scripts run, no others.
"""

from __future__ import annotations

import asyncio
import contextlib
import secrets
import sys
import threading
from collections.abc import Callable
from typing import Any

import tornado.httpserver
import tornado.web
from tornado.http1connection import HTTP1Connection

from wbc.app.address import Address, PortError, ServedAddress, listen

MAX_MESSAGE = 1 << 12
"""Largest message of a page, bytes."""

SEND_TIME = 60.0
"""Longest time for an answer to be taken, s; a client that is slower is dropped."""

PING_TIME = 60.0
"""Period of the pings of a WebSocket, and longest time for the answer, s; a client that does not read is dropped."""

IDLE_TIME = 60.0
"""Longest time for a request to come in over an open connection, s."""

FRAMES = "frame-ancestors 'none'"
LOCAL_FRAMES = "frame-ancestors http://localhost:* http://127.0.0.1:* https://localhost:* https://127.0.0.1:*"
"""Parts of a policy that let no page, or those of this machine, show the page in a frame."""

CLOSED_POLICY = "default-src 'none'; base-uri 'none'; form-action 'none'; " + FRAMES
"""Content security policy of everything that is served."""

PAGE_POLICY = (
    "script-src 'nonce-{nonce}'; style-src 'unsafe-inline'; img-src 'self' data: blob:; "
    "connect-src 'self' ws://{host}; " + CLOSED_POLICY
)
"""Content security policy of a page: MeshCat's viewer adds styles, and takes textures from data and blob URLs."""

HEADERS = {
    "Cache-Control": "no-store",
    "Content-Security-Policy": CLOSED_POLICY,
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
}
"""Headers of every answer."""


def new_nonce() -> str:
    """Return a random number for the content security policy of a page."""
    return secrets.token_urlsafe(16)


def admitted(served: ServedAddress, host: str, origin: str | None) -> bool:
    """Return true for a request that is meant for a served address and comes from its own page, or from no page.

    `host` and `origin` are headers of the request, the latter if it has one.
    """
    return served.admits(host) and origin in (None, f"http://{host}")


class GuardedHandler(tornado.web.RequestHandler):
    """Handler that answers only requests for the address that is served; others get status 403."""

    def set_default_headers(self) -> None:
        """See tornado."""
        for name, value in HEADERS.items():
            self.set_header(name, value)

    def prepare(self) -> None:
        """Refuse a request with the host or the origin of another site."""
        if not admitted(self.settings["served"], self.request.host, self.request.headers.get("Origin")):
            raise tornado.web.HTTPError(403, reason="Refused")

    def write_error(self, status_code: int, **_: Any) -> None:
        """See tornado; the answer says nothing of the request."""
        self.set_header("Content-Type", "text/plain; charset=utf-8")
        hint = ": open the page by the link that the program printed" if status_code == 403 else ""  # noqa: PLR2004
        self.finish(f"{status_code} {self._reason}{hint}\n")

    async def answer(self, body: bytes | str, nonce: str | None = None) -> None:
        """Send a body, of a page with the number that its scripts carry; drop a client that does not take it."""
        if nonce is not None:
            policy = PAGE_POLICY.format(nonce=nonce, host=self.request.host)
            if self.settings["framed"]:
                policy = policy.replace(FRAMES, LOCAL_FRAMES)
                self.clear_header("X-Frame-Options")
            self.set_header("Content-Security-Policy", policy)
        sent = self.finish(body)
        await asyncio.wait([sent], timeout=SEND_TIME)
        if not sent.done() and isinstance(self.request.connection, HTTP1Connection):
            self.request.connection.close()


class _NotFound(GuardedHandler):
    """Handler of all other paths."""

    def prepare(self) -> None:
        """Refuse, after the guard has."""
        super().prepare()
        raise tornado.web.HTTPError(404)


class PageHandler(GuardedHandler):
    """A page."""

    def initialize(self, page: Callable[[str], str | bytes], nonce: str = "") -> None:
        """Take the function that makes the page for the nonce of its scripts: a new one for each request if empty."""
        self._page, self._nonce = page, nonce

    async def get(self) -> None:
        """Answer a request."""
        nonce = self._nonce or new_nonce()
        await self.answer(self._page(nonce), nonce)


class PageServer:
    """Server of pages at an address, in a thread of its own, which ends with the program.

    Attributes:
        served: The address.
    """

    def __init__(self, what: str, address: Address) -> None:
        """Take the port; `what` is served there, for messages. `PortError` if it is in use."""
        try:
            self._socket, self.served = listen(address)
        except OSError as error:
            raise PortError.at(what, address, error.strerror or str(error)) from error
        self._thread: threading.Thread | None = None
        self._loop: asyncio.AbstractEventLoop

    def start(
        self, routes: list[Any], *, framed: bool = False, last: Callable[[], Any] | None = None
    ) -> None:
        """Serve, by rules of tornado whose handlers derive from `GuardedHandler`.

        With `framed` pages of this machine may show these in a frame; `last` is awaited at the end.
        """
        started = threading.Event()
        serving = self._serve(routes, framed, last, started)
        self._thread = threading.Thread(target=asyncio.run, args=(serving,), name="wbc-page", daemon=True)
        self._thread.start()
        started.wait()

    async def _serve(
        self, routes: list[Any], framed: bool, last: Callable[[], Any] | None, started: threading.Event
    ) -> None:
        self._loop, self._ended = asyncio.get_running_loop(), asyncio.Event()
        application = tornado.web.Application(
            routes,
            served=self.served,
            framed=framed,
            default_handler_class=_NotFound,
            websocket_max_message_size=MAX_MESSAGE,
            websocket_ping_interval=PING_TIME,
            websocket_ping_timeout=PING_TIME,
        )
        server = tornado.httpserver.HTTPServer(
            application, max_body_size=MAX_MESSAGE, idle_connection_timeout=IDLE_TIME
        )
        server.add_socket(self._socket)
        started.set()
        await self._ended.wait()
        server.stop()
        if last is not None:
            await last()
        await server.close_all_connections()

    def soon(self, function: Callable[..., object], *given: Any) -> None:
        """Call a function in the thread of the server; return at once."""
        with contextlib.suppress(RuntimeError):  # the server has been closed
            self._loop.call_soon_threadsafe(function, *given)

    def serve_page(self, page: str, nonce: str, seconds: float | None = None) -> None:
        """Serve one page, HTML whose scripts carry the nonce, until Ctrl-C, or for some seconds."""
        body = page.encode()
        self.start([(r"/", PageHandler, {"page": lambda _: body, "nonce": nonce})])
        print(f"replay: {self.served.url} (end with Ctrl-C)", file=sys.stderr, flush=True)
        with contextlib.suppress(KeyboardInterrupt):
            threading.Event().wait(seconds)
        self.close()

    def close(self) -> None:
        """End, and release the port."""
        if self._thread is None:
            self._socket.close()
        elif self._thread.is_alive():
            self.soon(self._ended.set)
            if self._thread is not threading.current_thread():
                self._thread.join()
