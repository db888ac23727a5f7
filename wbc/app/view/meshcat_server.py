"""MeshCat's server in a process of its own: `python -m wbc.app.view.meshcat_server PORT`.

MeshCat binds its page to every network; here it is bound to this machine alone. The process prints the address that
takes commands, then a line for each page that opens or closes, and ends when its standard input is closed.
"""

from __future__ import annotations

import sys
import threading
from functools import partial
from typing import Any

from meshcat.servers.zmqserver import WebSocketHandler, ZMQWebSocketBridge

LOCAL = "127.0.0.1"

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
    """MeshCat's server, bound to this machine."""

    def make_app(self) -> Any:
        """Return the application."""
        app = super().make_app()
        app.add_handlers(".*", [("/", Page, {"bridge": self})])
        app.listen = partial(app.listen, address=LOCAL)
        return app


if __name__ == "__main__":
    bridge = Bridge(port=int(sys.argv[1]))
    print(bridge.zmq_url, flush=True)

    def wait_for_end() -> None:
        """Stop the server when the program that has started it has ended."""
        sys.stdin.read()
        bridge.ioloop.add_callback(bridge.ioloop.call_later, LAST, bridge.ioloop.stop)

    threading.Thread(target=wait_for_end, daemon=True).start()
    bridge.run()
