"""Rule of who may speak to the page of a workbench: it drives the robot, so another page of the browser must not.

Requests are answered if all of these hold:

- their path begins with a secret of the run, which stands in the link;
- their host is a name of this machine, so that no foreign name can be made to lead here;
- the page that has sent them, their origin, is the page itself, or they come from no page.
"""

from __future__ import annotations

import hmac
import http
import secrets
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any
from urllib.parse import urlsplit

HOSTS = ("127.0.0.1", "localhost", "::1")
"""Names of this machine, as a browser has them in an address."""

_one_at_a_time = threading.Lock()


class PageGuard:
    """Gate in front of viser's server, which itself answers everybody.

    Attributes:
        secret: First part of the path of every request.
        stands: True once it stands in front of a server.
    """

    def __init__(self) -> None:
        """Choose a secret."""
        self.secret = secrets.token_urlsafe(16)
        self.stands = False

    @contextmanager
    def guards(self) -> Iterator[None]:
        """Stand in front of viser's server that the block starts.

        viser has no means of its own: it hands its requests to a function of `websockets`, which is wrapped.
        """
        from websockets.asyncio import server  # noqa: PLC0415 - comes with viser, an extra

        serve = server.serve

        def serve_guarded(handler: Any, *places: Any, process_request: Any = None, **how: Any) -> Any:
            if handler.__module__.partition(".")[0] == "viser":
                process_request, self.stands = partial(self.answer, process_request), True
            return serve(handler, *places, process_request=process_request, **how)

        with _one_at_a_time:
            server.serve = serve_guarded  # type: ignore[assignment,misc]
            try:
                yield
            finally:
                server.serve = serve  # type: ignore[misc]

    def answer(self, answer: Callable[[Any, Any], Any], connection: Any, request: Any) -> Any:
        """Return the answer to a request (None lets a web socket in), or a refusal."""
        _, first, rest = [*request.path.split("/", 2), "", ""][:3]
        known = hmac.compare_digest(first.partition("?")[0].encode(), self.secret.encode())
        if not (known and self.is_own(request.headers.get_all("Host"), request.headers.get_all("Origin"))):
            return connection.respond(
                http.HTTPStatus.FORBIDDEN, "Open the link that the program has printed.\n"
            )
        request.path = f"/{rest}"
        return answer(connection, request)

    @staticmethod
    def is_own(hosts: list[str], origins: list[str]) -> bool:
        """Return true for a request to this machine by its name, from the page itself or from no page."""
        if len(hosts) != 1 or len(origins) > 1:
            return False
        try:
            named = urlsplit(f"//{hosts[0]}").hostname in HOSTS
        except ValueError:
            return False
        return named and all(origin == f"http://{hosts[0]}" for origin in origins)
