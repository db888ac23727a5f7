"""MeshCat's server in a process of its own, on this machine alone; its argument is the port.

It prints the address that takes commands, then a line for each page that opens or closes, and ends with its input.
"""

from __future__ import annotations

import re
import sys
from functools import partial
from typing import Any

from meshcat.servers.zmqserver import (
    VIEWER_HTML,
    VIEWER_ROOT,
    StaticFileHandlerNoCache,
    WebSocketHandler,
    ZMQWebSocketBridge,
)

from wbc.app.view.door import HOSTS

LAST = 0.5
"""Time in which pages take the last picture, s."""


class Page(WebSocketHandler):  # type: ignore[misc]
    """Connection of a page: it only watches."""

    def open(self) -> None:
        """Send the scene."""
        super().open()
        print("opened", flush=True)

    def on_message(self, message: object) -> None:
        """Ignore whatever a page says."""

    def on_close(self) -> None:
        """Forget the page."""
        super().on_close()
        print("closed", flush=True)


class Bridge(ZMQWebSocketBridge):  # type: ignore[misc]
    """MeshCat's server; as it comes it would listen to every network."""

    def make_app(self) -> Any:
        """Return the application."""
        app = super().make_app()
        files = {"path": VIEWER_ROOT, "default_filename": VIEWER_HTML}
        app = type(super().make_app())()  # that of MeshCat would answer under every name
        # Only under the names of this machine; tornado compares the origin of a web socket with its host.
        app.add_handlers(
            "|".join(map(re.escape, HOSTS)),
            [(r"/static/(.*)", StaticFileHandlerNoCache, files), ("/", Page, {"bridge": self})],
        )
        app.listen = partial(app.listen, address=self.host)
        return app


def main() -> None:
    """Run the process."""
    bridge = Bridge(port=int(sys.argv[1]))
    loop = bridge.ioloop

    def end(stdin: Any, events: int) -> None:
        """Stop when the program that has started the server has ended, or has closed its view."""
        loop.remove_handler(stdin)
        loop.call_later(LAST, loop.stop)

    loop.add_handler(sys.stdin, end, loop.READ)
    print(bridge.zmq_url, flush=True)
    bridge.run()
