"""Server of MeshCat's page, on this machine alone, with a caption in front: lines and a legend.

A thread serves the page. The page watches; nothing that it says is read. MeshCat's own server listens on all addresses
of the machine, answers any host name, and hands on what pages say.
"""

from __future__ import annotations

import asyncio
import contextlib
import re
from collections.abc import Callable, Iterable
from pathlib import Path
from threading import Thread
from typing import Any

from meshcat.servers.zmqserver import VIEWER_HTML, VIEWER_ROOT, StaticFileHandlerNoCache
from tornado.web import Application, RequestHandler  # tornado comes with meshcat
from tornado.websocket import WebSocketClosedError, WebSocketHandler

from wbc.app.view.page_guard import HOSTS

PATIENCE = 3.0
"""Longest time that the server may take to start or to end, and pages to take the last picture, s."""

CAPTION = """
<div id="caption"><div id="caption-lines"></div>
<details hidden><summary>Legend</summary><div id="caption-legend"></div></details></div>
<style>
#caption { position: fixed; top: 0; left: 0; margin: 8px; padding: 6px 10px; max-width: 45vw; pointer-events: none;
    font: 13px/1.45 sans-serif; color: #111; background: rgba(255, 255, 255, 0.8); border-radius: 4px; }
#caption:has(#caption-lines:empty) { display: none; }
#caption-lines div:first-child { font-weight: bold; }
#caption summary { pointer-events: auto; cursor: pointer; }
#caption-legend span { display: inline-block; width: 0.8em; height: 0.8em; margin-right: 0.5em; border-radius: 50%; }
</style>
<script>
document.querySelector("#caption details").open = innerWidth > 600;
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
        self.finish(before + CAPTION + end + after)


class Feed(WebSocketHandler):
    """Connection of a page, which only watches."""

    def initialize(self, readers: set[Feed], present: Callable[[], Iterable[bytes | str]]) -> None:
        """Store the readers, among which it is while it is open, and what is sent first."""
        self._readers, self._present = readers, present

    def open(self) -> None:
        """Send what is shown at present."""
        self._readers.add(self)
        for message in self._present():
            self.write_message(message, binary=isinstance(message, bytes))

    def on_message(self, message: object) -> None:
        """Ignore whatever a page says."""

    def on_close(self) -> None:
        """Forget the page."""
        self._readers.discard(self)


class MeshcatServer:
    """Scene and caption of MeshCat's pages; a page that is opened later gets all that is shown.

    Attributes:
        pages: Connections of the pages that are open.
    """

    def __init__(self, port: int) -> None:
        """Serve at a port; `OSError` if that cannot be."""
        self.pages: set[Feed] = set()
        self._readers: set[Feed] = set()  # of captions
        self._scene: dict[tuple[str, ...], bytes] = {}
        self._caption = '{"lines": [], "legend": []}'
        self._loop = asyncio.new_event_loop()
        self._thread = Thread(target=self._loop.run_forever, name="MeshCat", daemon=True)
        self._thread.start()
        self._sending: Any = None  # future of the last picture
        try:
            asyncio.run_coroutine_threadsafe(self._listen(port), self._loop).result(PATIENCE)
        except BaseException:
            self._stop()
            raise

    async def _listen(self, port: int) -> None:
        # Only under the names of this machine, and for the origin of the page itself; requests are not told.
        app = Application(log_function=lambda _: None)
        app.add_handlers(
            "|".join(map(re.escape, HOSTS)),
            [
                (r"/static/(?:index\.html)?", Start),
                (r"/static/(.*)", StaticFileHandlerNoCache, {"path": VIEWER_ROOT}),
                ("/", Feed, {"readers": self.pages, "present": self._scene.values}),
                ("/caption", Feed, {"readers": self._readers, "present": lambda: [self._caption]}),
            ],
        )
        self._server = app.listen(port, address=HOSTS[0])

    @property
    def busy(self) -> bool:
        """True while a page is still taking the last picture."""
        return self._sending is not None and not self._sending.done()

    def send(self, orders: list[tuple[tuple[str, ...], bytes]], caption: str | None) -> None:
        """Send MeshCat's commands, each after its kind and path, and a caption unless it is None."""
        self._sending = asyncio.run_coroutine_threadsafe(self._send(orders, caption), self._loop)

    async def _send(self, orders: list[tuple[tuple[str, ...], bytes]], caption: str | None) -> None:
        for (kind, path, *rest), data in orders:
            if kind == "delete":
                for gone in [key for key in self._scene if f"{key[1]}/".startswith(f"{path}/")]:
                    del self._scene[gone]
            else:
                self._scene[kind, path, *rest] = data
        waiting = [page.write_message(data, binary=True) for page in [*self.pages] for _, data in orders]
        if caption is not None:
            self._caption = caption
            waiting += [reader.write_message(caption) for reader in [*self._readers]]
        for taken in waiting:
            with contextlib.suppress(WebSocketClosedError):
                await taken

    def close(self) -> None:
        """End when the pages have the last picture."""
        with contextlib.suppress(Exception):  # a page that takes nothing more is left alone
            if self._sending is not None:
                self._sending.result(PATIENCE)
            asyncio.run_coroutine_threadsafe(self._end(), self._loop).result(PATIENCE)
        self._stop()

    async def _end(self) -> None:
        self._server.stop()
        for page in [*self.pages, *self._readers]:
            page.close()
        await self._server.close_all_connections()

    def _stop(self) -> None:
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join(PATIENCE)
