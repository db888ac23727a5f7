"""MeshCat's server in a process of its own, on this machine alone; its argument is the port.

Its page is that of MeshCat with a caption in front: lines and a legend, which come by a web socket of their own.

It prints the address that takes commands, then a line for each page that opens or closes, and ends with its input.
"""

from __future__ import annotations

import re
import sys
from functools import partial
from pathlib import Path
from typing import Any

from meshcat.servers.zmqserver import (
    VIEWER_HTML,
    VIEWER_ROOT,
    StaticFileHandlerNoCache,
    WebSocketHandler,
    ZMQWebSocketBridge,
)
from tornado.web import RequestHandler  # tornado comes with meshcat
from tornado.websocket import WebSocketHandler as WebSocket

from wbc.app.view.page_guard import HOSTS

LAST = 0.5
"""Time in which pages take the last picture, s."""


CAPTION = "caption"
"""Command that gives the pages a new caption, and the path of their web socket for it."""

OVERLAY = """
<div id="caption"><div id="caption-lines"></div>
<details open hidden><summary>Legend</summary><div id="caption-legend"></div></details></div>
<style>
#caption { position: fixed; top: 0; left: 0; margin: 8px; padding: 6px 10px; max-width: 45vw; pointer-events: none;
    font: 13px/1.45 sans-serif; color: #111; background: rgba(255, 255, 255, 0.8); border-radius: 4px; }
#caption:has(#caption-lines:empty) { display: none; }
#caption-lines div:first-child { font-weight: bold; }
#caption summary { pointer-events: auto; cursor: pointer; }
#caption-legend span { display: inline-block; width: 0.8em; height: 0.8em; margin-right: 0.5em; border-radius: 50%; }
</style>
<script>
new WebSocket(location.origin.replace("http", "ws") + "/caption").onmessage = message => {
    const caption = JSON.parse(message.data);
    const line = text => Object.assign(document.createElement("div"), {textContent: text});
    document.getElementById("caption-lines").replaceChildren(...caption.lines.map(line));
    document.getElementById("caption-legend").replaceChildren(...caption.legend.map(([meaning, colour]) => {
        const row = line(meaning), dot = document.createElement("span");
        dot.style.background = colour;
        row.prepend(dot);
        return row;
    }));
    document.querySelector("#caption details").hidden = !caption.legend.length;
};
</script>
"""
"""Caption and its script, put into MeshCat's page; texts are set as texts, never as HTML."""


class Start(RequestHandler):
    """MeshCat's page with the caption."""

    def get(self) -> None:
        """Send it."""
        page = (Path(VIEWER_ROOT) / VIEWER_HTML).read_text(encoding="utf-8")
        before, end, after = page.rpartition("</body>")
        self.set_header("Cache-Control", "no-store")
        self.finish(before + OVERLAY + end + after)


class Caption(WebSocket):
    """Connection by which a page gets its caption: it only reads."""

    def initialize(self, bridge: Bridge) -> None:
        """Store the server."""
        self._bridge = bridge

    def open(self) -> None:
        """Send the present caption."""
        self._bridge.readers.add(self)
        self.write_message(self._bridge.caption)

    def on_message(self, message: object) -> None:
        """Ignore whatever a page says."""

    def on_close(self) -> None:
        """Forget the page."""
        self._bridge.readers.discard(self)


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
    """MeshCat's server; as it comes it would listen to every network.

    Attributes:
        caption: Lines and legend of all pages, as JSON.
        readers: Connections of the pages that show it.
    """

    def __init__(self, port: int) -> None:
        self.caption = '{"lines": [], "legend": []}'
        self.readers: set[Caption] = set()
        super().__init__(port=port)

    def handle_zmq(self, frames: list[bytes]) -> None:
        """Carry out a command: a caption, or one of MeshCat."""
        if frames[0] != CAPTION.encode():
            super().handle_zmq(frames)
            return
        self.caption = frames[1].decode()
        for reader in self.readers:
            reader.write_message(self.caption)
        self.zmq_socket.send(b"ok")

    def make_app(self) -> Any:
        """Return the application."""
        files = {"path": VIEWER_ROOT, "default_filename": VIEWER_HTML}
        app = type(super().make_app())()  # that of MeshCat would answer under every name
        # Only under the names of this machine; tornado compares the origin of a web socket with its host.
        app.add_handlers(
            "|".join(map(re.escape, HOSTS)),
            [
                (r"/static/(?:index\.html)?", Start),
                (r"/static/(.*)", StaticFileHandlerNoCache, files),
                ("/", Page, {"bridge": self}),
                (f"/{CAPTION}", Caption, {"bridge": self}),
            ],
        )
        app.listen = partial(app.listen, address=self.host)
        return app


def main() -> None:
    """Run the process."""
    bridge = Bridge(int(sys.argv[1]))
    loop = bridge.ioloop

    def end(stdin: Any, events: int) -> None:
        """Stop when the program that has started the server has ended, or has closed its view."""
        loop.remove_handler(stdin)
        loop.call_later(LAST, loop.stop)

    loop.add_handler(sys.stdin, end, loop.READ)
    print(bridge.zmq_url, flush=True)
    bridge.run()
