"""Guarded viser server: the same rules as those of all served pages, see `wbc.app.view.guard`.

viser answers everybody who reaches its port, on a free port near the one it is asked for. Here it listens on a socket
that is given to it, and each request passes the guard first: host, origin, and for the connection that carries the
scene and the controls the token of the link that the run has printed. Nobody watches without it. viser's tunnel to a
public server is switched off.
"""

from __future__ import annotations

import contextlib
import http
import io
import secrets
from collections.abc import Callable
from typing import TYPE_CHECKING, Any
from urllib.parse import parse_qs, quote, urlsplit

from wbc.app.address import Address, PortError, ServedAddress, ViewError, listen
from wbc.app.view.guard import FRAMES, HEADERS, LOCAL_FRAMES, admitted

if TYPE_CHECKING:
    import viser
    from websockets import Request, Response

PAGE_POLICY = (
    "default-src 'none'; script-src 'self' 'unsafe-inline' 'unsafe-eval' blob: data:; "
    "style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; font-src 'self' data:; "
    "worker-src blob: data:; connect-src 'self' ws://{host} data: blob:; base-uri 'none'; form-action 'none'; "
)
"""Content security policy: viser's page unpacks its scripts itself; it reaches no other server."""


class Guard:
    """Guard of requests to viser.

    Attributes:
        token: Secret of the link.
        asked: True once viser has asked the guard to stand before its requests.
    """

    def __init__(self, served: ServedAddress, framed: bool) -> None:
        """Make a token for the address; with `framed` pages of this machine may show the page in a frame."""
        self._served, self._framed = served, framed
        self.token = secrets.token_urlsafe(16)
        self.asked = False

    def around(self, answer: Callable[[Any, Request], Any]) -> Callable[[Any, Request], Any]:
        """Return a function that answers a request, or refuses it before `answer` sees it."""
        from websockets import Headers, Response  # noqa: PLC0415 - an extra

        self.asked = True

        def guarded(connection: Any, request: Request) -> Any:
            host, query = request.headers.get("Host", ""), parse_qs(urlsplit(request.path).query)
            known = secrets.compare_digest("".join(query.get("token", [])).encode(), self.token.encode())
            connects, page = "Upgrade" in request.headers, urlsplit(request.path).path == "/"
            if not admitted(self._served, host, request.headers.get("Origin")) or (
                (connects or page) and not known
            ):
                hint = "403 Refused: open the page by the link that the program printed\n"
                return self._with_headers(Response(403, "Refused", Headers(), hint.encode()), host)
            if page and not connects and "websocket" not in query:
                place = quote(f"ws://{host}/?token={self.token}", safe="")
                goal = Headers(Location=f"/?token={self.token}&websocket={place}")
                return self._with_headers(Response(http.HTTPStatus.FOUND, "Found", goal), host)
            answered = answer(connection, request)
            return answered if answered is None else self._with_headers(answered, host)

        return guarded

    def _with_headers(self, response: Response, host: str) -> Response:
        policy = PAGE_POLICY.format(host=host) + (LOCAL_FRAMES if self._framed else FRAMES)
        for name, value in (HEADERS | {"Content-Security-Policy": policy}).items():
            if name != "X-Frame-Options" or not self._framed:
                response.headers[name] = value
        response.headers.setdefault("Content-Length", str(len(response.body or b"")))
        return response


def start_server(address: Address, title: str, framed: bool) -> tuple[viser.ViserServer, str]:
    """Start a server with a title, and return it with the link to its page.

    With `framed` pages of this machine may show the page in a frame. Raises `PortError` when the port is in use,
    `ViewError` for no viser, or one that cannot be guarded; nothing is left running.
    """
    try:
        import viser  # noqa: PLC0415 - an extra
        import websockets.asyncio.server  # noqa: PLC0415
        from viser import _messages  # noqa: PLC0415
    except ImportError as missing:
        raise ViewError(
            f"the workbench needs viser ({missing}): in a clone, pip install -e '.[workbench]'; the live view without "
            "it shows the run, and drives it"
        ) from missing
    try:
        listening, served = listen(address)
    except OSError as error:
        raise PortError.at("workbench", address, error.strerror or str(error)) from error
    guard, serve = Guard(served, framed), websockets.asyncio.server.serve

    def guarded_serve(handler: Any, _host: Any = None, _port: Any = None, /, **options: Any) -> Any:
        options["process_request"] = guard.around(options["process_request"])
        return serve(handler, sock=listening, **options)

    websockets.asyncio.server.serve = guarded_serve
    try:
        with contextlib.redirect_stdout(io.StringIO()):  # viser prints addresses that have no token
            server = viser.ViserServer("127.0.0.1", served.port, title, verbose=False)
    finally:
        websockets.asyncio.server.serve = serve
    if not guard.asked:
        server.stop()
        raise ViewError(
            f"viser {viser.__version__} cannot be guarded; use the live view without the workbench"
        )
    for tunnel in (_messages.ShareUrlRequest, _messages.ShareUrlDisconnect):
        server._websock_server.unregister_handler(tunnel)
    server.gui.configure_theme(show_share_button=False, show_logo=False)
    return server, f"{served.url}?token={guard.token}"


def stop_server(server: viser.ViserServer) -> None:
    """Stop a server."""
    with contextlib.redirect_stdout(io.StringIO()):
        server.stop()
