"""MeshCat's server in a process of its own, on this machine alone: `python -m wbc.app.view.meshcat_server PORT`.

It prints the address that takes commands, then a line for each page that opens or closes, and ends with its input.
"""

from __future__ import annotations

import sys
from functools import partial
from typing import Any

from meshcat.servers.zmqserver import WebSocketHandler, ZMQWebSocketBridge

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
        app.add_handlers(".*", [("/", Page, {"bridge": self})])
        app.listen = partial(app.listen, address=self.host)
        return app


if __name__ == "__main__":
    bridge = Bridge(port=int(sys.argv[1]))
    loop = bridge.ioloop

    def end(stdin: Any, events: int) -> None:
        """Stop when the program that has started the server has ended, or has closed its view."""
        loop.remove_handler(stdin)
        loop.call_later(LAST, loop.stop)

    loop.add_handler(sys.stdin, end, loop.READ)
    print(bridge.zmq_url, flush=True)
    bridge.run()
