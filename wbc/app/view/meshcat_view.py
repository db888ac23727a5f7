"""Live view by MeshCat, which comes with every installation: it shows the run, and obeys nobody."""

from __future__ import annotations

import json
import logging
import math
import os
import select
import subprocess
import tempfile
import time as clock
import weakref
from typing import Any

import numpy as np
import zmq  # comes with meshcat

from wbc.app.view.base import LOCAL, TEXT_PERIOD, View, ViewError
from wbc.app.view.marks import Mark, Picture, changes, css, legend, mark_mesh
from wbc.app.view.meshes import Colour, Mesh, body_meshes
from wbc.base.numbers import Array
from wbc.base.processes import child_command

ROOT = "/meshcat/wbc"
"""Root of all objects in MeshCat's tree."""

START_TIME, PATIENCE = 60.0, 5.0
"""Longest times that the server may take to start, and to answer a command, s."""

END_TIME = 3.0
"""Longest time that the server may take to end, s."""

POLL = 100
"""Period at which a server that is waited for is looked at, ms."""

_log = logging.getLogger(__name__)


class MeshcatView(View):
    """Page in the browser that shows a robot as it moves; `View` lists its contents.

    The caption has texts, and a legend of all marks that were shown so far. It is updated only while a page is open.

    Any browser on this machine may open the page. The page cannot change the run; a `Workbench` can. MeshCat's server
    is a separate process that ends with the program; the page then keeps its last picture. The run does not wait for
    the server: while the server is busy with one picture, others are skipped. If the server dies or no longer answers,
    the program logs a warning, and the run goes on without a view.
    """

    def _open(self, port: int) -> None:
        from meshcat import commands, geometry  # noqa: PLC0415 - slow

        self._commands: Any = commands
        self._geometry: Any = geometry
        pipe, self._said = subprocess.PIPE, tempfile.TemporaryFile()  # noqa: SIM115 - open as long as the server
        server = subprocess.Popen(
            child_command("wbc.app.view.meshcat_server", str(port)),
            stdin=pipe,
            stdout=pipe,
            stderr=self._said,
        )
        self._finalizer = weakref.finalize(self, _end_server, server)
        self._server, self._pages, self._lost = server, 0, False
        self._lines: Any = server.stdout
        address = self._address()
        if not address:
            self._finalizer()
            self._said.seek(0)
            said = self._said.read().decode(errors="replace").strip().rpartition("\n")[2]
            raise ViewError(
                f"MeshCat's server has not started at port {port}: {said or 'it does not answer'}"
            )
        self._socket: Any = zmq.Context.instance().socket(zmq.DEALER)
        self._socket.connect(address)
        self._unanswered, self._heard = 0, clock.monotonic()
        self.url = f"http://{LOCAL}:{port}/static/"

    def _address(self) -> str:
        """Return the address that takes commands, which the server says first; empty if it does not come."""
        os.set_blocking(self._lines.fileno(), False)
        said, end = b"", clock.monotonic() + START_TIME
        while not said.endswith(b"\n") and (left := end - clock.monotonic()) > 0.0:
            if select.select([self._lines], [], [], left)[0]:
                part = self._lines.read()
                if not part:  # it has ended
                    return ""
                said += part
        return said.decode(errors="replace").strip()

    def _build(self) -> None:
        height, properties = self.stage.scale.height, self._commands.SetProperty
        eye = [1.9 * height, 0.5 * height, 1.9 * height]
        self._order("/Background", properties, "top_color", [0.95, 0.97, 1.0])
        self._order("/Background", properties, "bottom_color", [0.82, 0.86, 0.90])
        self._order("/Axes", properties, "visible", False)
        self._order("/Cameras/default/rotated/<object>", properties, "position", eye)
        self._move("/Grid", np.array([0.0, 0.0, self.stage.floor]))
        self._marks: dict[str, Mark] = {}
        self._colours: dict[int, Colour] = {}
        self._meanings: dict[str, Colour] = {}
        self._spoken = -math.inf  # clock of the last caption
        self._meshes: dict[int, list[str]] = {}  # path of each mesh of a body
        for number, (body, colour, mesh) in enumerate(body_meshes(self.stage.model)):
            path = f"{ROOT}/body {body}/{number}"
            self._meshes.setdefault(body, []).append(path)
            self._set_mesh(path, mesh, colour)
        self._answered(wait=True)

    def _order(self, path: str, kind: Any, *values: Any) -> None:
        """Send a command of MeshCat to a path; its answer is not waited for."""
        plain = kind(*values, path=self._commands.Path(tuple(path.strip("/").split("/")))).lower()
        self._tell(plain["type"].encode(), plain["path"].encode(), self._geometry.umsgpack.packb(plain))

    def _tell(self, *parts: bytes) -> None:
        """Send the parts of a command; its answer is not waited for."""
        if not self._unanswered:
            self._heard = clock.monotonic()
        self._socket.send_multipart([b"", *parts])
        self._unanswered += 1

    def _answered(self, *, wait: bool) -> bool:
        """Take the server's answers; return True if it has carried out all commands, and takes more."""
        while self._unanswered and not self._lost:
            try:
                self._socket.recv_multipart(zmq.NOBLOCK)
                self._unanswered, self._heard = self._unanswered - 1, clock.monotonic()
            except zmq.Again:
                if self._server.poll() is not None or clock.monotonic() > self._heard + PATIENCE:
                    self._lost = True
                    how = "does not answer" if self._server.returncode is None else "has ended"
                    _log.warning("the live view shows nothing more: MeshCat's server %s", how)
                elif not wait:
                    return False
                else:
                    self._socket.poll(POLL)
        return not self._lost

    def _send(self, picture: Picture) -> None:
        if not self._answered(wait=self.closed):
            return
        data = self.stage.data
        for body in self._meshes:
            self._move(f"{ROOT}/body {body}", data.xpos[body], data.xmat[body].reshape(3, 3))
        for body, colour in picture.colours.items():
            if self._colours.get(body) != colour:
                self._colours[body] = colour
                for path in self._meshes.get(body, ()):
                    self._order(path, self._commands.SetProperty, "color", list(colour))
        for name, mark in changes(self._marks, picture.marks):
            path = f"{ROOT}/mark/{name}"
            if mark is None:
                self._order(path, self._commands.Delete)
            else:
                on_top = mark.kind in ("ball", "arrow")
                self._set_mesh(path, mark_mesh(mark), mark.colour, on_top=on_top)
        middle = self.stage.floor + 0.8 * self.stage.scale.height
        self._move("/Cameras/default", np.array([*picture.target[:2], middle]))
        if self.frames == 1 or self.pages > 0 or self.closed:
            self._speak(picture)

    def _speak(self, picture: Picture) -> None:
        """Bring the caption up to date if it is older than `TEXT_PERIOD`, or the last one."""
        self._meanings |= legend(picture)  # of short pushes, too
        if self.closed or clock.perf_counter() >= self._spoken + TEXT_PERIOD:
            self._spoken = clock.perf_counter()
            lines = [f"{picture.time:.2f} s", *picture.text]
            legends = [(meaning, css(colour)) for meaning, colour in self._meanings.items()]
            self._tell(b"caption", json.dumps({"lines": lines, "legend": legends}).encode())

    def _set_mesh(self, path: str, mesh: Mesh, colour: Colour, *, on_top: bool = False) -> None:
        red, green, blue = (round(255 * part) for part in colour[:3])
        options: dict[str, Any] = {"color": (red << 16) + (green << 8) + blue, "opacity": colour[3]}
        if on_top:  # drawn last and not hidden by anything
            options |= {"transparent": True, "depthTest": False}
        geometry = self._geometry
        shape = geometry.TriangularMeshGeometry(mesh.vertices.astype(np.float32), mesh.faces)
        drawn = geometry.Mesh(shape, geometry.MeshLambertMaterial(**options))
        self._order(path, self._commands.SetObject, drawn)

    def _move(self, path: str, position: Array, axes: Array | None = None) -> None:
        """Move a path; `axes` are the columns of its rotation, shape (3, 3)."""
        matrix = np.eye(4)
        matrix[:3, 3] = position
        if axes is not None:
            matrix[:3, :3] = axes
        self._order(path, self._commands.SetTransform, matrix)

    @property
    def pages(self) -> int:
        """Number of open browser pages."""
        if self.closed or self._lost:
            return 0
        for line in (self._lines.read() or b"").split():
            self._pages += 1 if line == b"opened" else -1
        return self._pages

    def _end(self) -> None:
        self._answered(wait=True)
        self._socket.close(linger=0)
        self._finalizer()
        self._said.close()


def _end_server(server: subprocess.Popen[bytes]) -> None:
    """End the server by the end of its input; one that does not end is killed."""
    try:
        server.communicate(timeout=END_TIME)
    except subprocess.TimeoutExpired:
        server.kill()
        server.communicate()
