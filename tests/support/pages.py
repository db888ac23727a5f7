"""Requests and messages to the live view, for tests without a browser."""

from __future__ import annotations

import asyncio
import http.client
import json
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any
from urllib.parse import urljoin, urlsplit

from tornado.websocket import WebSocketClientConnection

from wbc.app.view.guard import PageServer
from wbc.app.view.meshcat_view import MeshcatView

PAUSE = '{"paused": true}'
"""Message of a page that pauses a run."""


def page_url(view: MeshcatView, name: str, *, token: bool = True) -> str:
    """Return the address of a part of the page, as the page itself asks for it.

    Args:
        view: The view.
        name: "stream" for the WebSocket, or a file.
        token: Keep the token of the link.
    """
    address = urljoin(view.url, name) + (f"?{urlsplit(view.url).query}" if token else "")
    return address.replace("http", "ws", 1) if name == "stream" else address


def taken(server: PageServer) -> None:
    """Wait until a server has done what it was to do so far."""
    asyncio.run_coroutine_threadsafe(asyncio.sleep(0), server._loop).result(20.0)


@dataclass
class Answer:
    """Answer to a request.

    Attributes:
        status: Status code.
        headers: Its headers.
        body: Its body.
    """

    status: int
    headers: http.client.HTTPMessage
    body: bytes


def get(url: str, path: str = "/", **headers: str) -> Answer:
    """Return the answer to a request, whose `Host` can be anything."""
    port = urlsplit(url).port
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=20.0)
    try:
        connection.putrequest("GET", path, skip_host=True)
        for name, value in {"Host": f"127.0.0.1:{port}", **headers}.items():
            connection.putheader(name, value)
        connection.endheaders()
        answer = connection.getresponse()
        return Answer(answer.status, answer.headers, answer.read())
    finally:
        connection.close()


async def facts(page: WebSocketClientConnection, until: Callable[[dict[str, Any]], Any]) -> dict[str, Any]:
    """Return the next message with facts of which something is true."""
    while True:
        message = await asyncio.wait_for(page.read_message(), 20.0)
        assert message is not None, "the connection has been closed"
        if isinstance(message, str) and until(said := json.loads(message)):
            return dict(said)


async def close_code(page: WebSocketClientConnection) -> int | None:
    """Return the code with which a connection ends."""
    protocol = page.protocol
    while await asyncio.wait_for(page.read_message(), 20.0) is not None:
        pass
    if protocol is not None:
        page.close()
        protocol.stream.close()
    return page.close_code
