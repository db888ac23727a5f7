"""Live view by MeshCat, which comes with every installation: it shows the run, and obeys nobody.

A thread serves the page on this machine alone, with a caption in front. The page watches; nothing that it says is read.
MeshCat's own server listens on all addresses of the machine, answers any host name, and hands on what pages say.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import math
import re
import time as clock
from collections.abc import Callable, Iterable
from pathlib import Path
from threading import Thread
from typing import Any

import numpy as np
from meshcat import commands, geometry
from meshcat.servers.zmqserver import VIEWER_HTML, VIEWER_ROOT, StaticFileHandlerNoCache
from tornado.web import Application, RequestHandler  # tornado comes with meshcat
from tornado.websocket import WebSocketClosedError, WebSocketHandler

from wbc.app.view.base import HOSTS, LOCAL, TEXT_PERIOD, View, ViewError
from wbc.app.view.marks import Mark, Picture, css, mark_mesh
from wbc.app.view.meshes import Mesh
from wbc.app.view.stage import DrawnScene, Stage
from wbc.base.numbers import Array
from wbc.robots.mechanism import Colour

ROOT = "/meshcat/wbc"
"""Root of all objects in MeshCat's tree."""

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


class MeshcatScene(DrawnScene):
    """Scene as commands of MeshCat.

    Attributes:
        messages: Commands that are to be sent, each after its kind and path.
    """

    def __init__(self, stage: Stage) -> None:
        super().__init__(stage)
        self.messages: list[tuple[tuple[str, ...], bytes]] = []
        self._put(ROOT, commands.Delete)
        self._put("/Background", commands.SetProperty, "top_color", [0.95, 0.97, 1.0])
        self._put("/Background", commands.SetProperty, "bottom_color", [0.82, 0.86, 0.90])
        self._put("/Axes", commands.SetProperty, "visible", False)
        eye = [part * stage.scale.height for part in (1.9, 0.5, 1.9)]
        self._put("/Cameras/default/rotated/<object>", commands.SetProperty, "position", eye)

    def draw(self, picture: Picture) -> None:
        """See `DrawnScene`; the camera follows."""
        super().draw(picture)
        # MeshCat's camera looks at the origin wherever it stands: the world moves so that the robot stays there.
        floor = self.stage.floor
        away = -np.array([*picture.target[:2], floor + 0.8 * self.stage.scale.height])
        self._place(ROOT, away)
        self._place("/Grid", away + (0.0, 0.0, floor))

    def _move(self, body: int) -> None:
        data = self.stage.data
        self._place(f"{ROOT}/body {body}", data.xpos[body], data.xmat[body].reshape(3, 3))

    def _paint(self, number: int, colour: Colour) -> None:
        body, _, mesh = self.meshes[number]
        self._set_mesh(f"{ROOT}/body {body}/{number}", mesh, colour)

    def _show(self, mark: Mark) -> None:
        on_top = mark.kind in ("ball", "arrow")
        self._set_mesh(f"{ROOT}/mark/{mark.name}", mark_mesh(mark), mark.colour, on_top=on_top)

    def _erase(self, mark: Mark) -> None:
        self._put(f"{ROOT}/mark/{mark.name}", commands.Delete)

    def _set_mesh(self, path: str, mesh: Mesh, colour: Colour, *, on_top: bool = False) -> None:
        red, green, blue = (round(255 * part) for part in colour[:3])
        options: dict[str, Any] = {"color": (red << 16) + (green << 8) + blue, "opacity": colour[3]}
        if on_top:  # drawn last and not hidden by anything
            options |= {"transparent": True, "depthTest": False}
        shape = geometry.TriangularMeshGeometry(mesh.vertices.astype(np.float32), mesh.faces)
        drawn = geometry.Mesh(shape, geometry.MeshLambertMaterial(**options))
        self._put(path, commands.SetObject, drawn)

    def _place(self, path: str, position: Array, axes: Array | None = None) -> None:
        """Move a path; `axes` are the columns of its rotation, shape (3, 3)."""
        matrix = np.eye(4)
        matrix[:3, 3] = position
        if axes is not None:
            matrix[:3, :3] = axes
        self._put(path, commands.SetTransform, matrix)

    def _put(self, path: str, kind: Any, *values: Any) -> None:
        plain = kind(*values, path=commands.Path(tuple(path.strip("/").split("/")))).lower()
        key = plain["type"], path, *(values[:1] if plain["type"] == "set_property" else ())
        self.messages.append((key, geometry.umsgpack.packb(plain)))


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
        self._server = app.listen(port, address=LOCAL)

    @property
    def busy(self) -> bool:
        """True while a page is still taking the last picture."""
        return self._sending is not None and not self._sending.done()

    def send(self, messages: list[tuple[tuple[str, ...], bytes]], caption: str | None) -> None:
        """Send MeshCat's commands, each after its kind and path, and a caption unless it is None."""
        self._sending = asyncio.run_coroutine_threadsafe(self._send(messages, caption), self._loop)

    async def _send(self, messages: list[tuple[tuple[str, ...], bytes]], caption: str | None) -> None:
        for (kind, path, *rest), data in messages:
            if kind == "delete":
                for gone in [key for key in self._scene if f"{key[1]}/".startswith(f"{path}/")]:
                    del self._scene[gone]
            else:
                self._scene[kind, path, *rest] = data
        waiting = [page.write_message(data, binary=True) for page in [*self.pages] for _, data in messages]
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


class MeshcatView(View):
    """Page in the browser that shows a robot as it moves; `View` lists its contents.

    The caption has texts, and a legend of all marks that were shown so far. It is updated only while a page is open.

    Any browser on this machine may open the page. The page cannot change the run; a `Workbench` can. The page keeps its
    last picture when the program has ended. The run does not wait for a page: while a page is busy with one picture,
    others are skipped.
    """

    def _open(self, port: int) -> None:
        try:
            self._server = MeshcatServer(port)
        except OSError as error:
            raise ViewError(f"MeshCat's page cannot be served at port {port}: {error}") from error
        self.url = f"http://{LOCAL}:{port}/static/"

    def _build(self) -> None:
        self._scene = MeshcatScene(self.run.stage)
        self._spoken = -math.inf  # clock of the last caption

    def _send(self, picture: Picture) -> None:
        if self._server.busy and self.frames > 1 and not self.closed:
            return
        self._scene.draw(picture)
        messages, self._scene.messages = self._scene.messages, []
        self._server.send(messages, self._caption(picture))

    def _caption(self, picture: Picture) -> str | None:
        """Return the caption as JSON; None if nobody reads it or it is recent, but for the first and last of a run."""
        due = self.pages > 0 and clock.perf_counter() >= self._spoken + TEXT_PERIOD
        if not (due or self.closed or self._spoken == -math.inf):
            return None
        self._spoken = clock.perf_counter()
        legends = [(meaning, css(colour)) for meaning, colour in self._scene.meanings.items()]
        return json.dumps({"lines": picture.lines, "legend": legends})

    def _count(self) -> int:
        return len(self._server.pages)

    def _end(self) -> None:
        self._server.close()
