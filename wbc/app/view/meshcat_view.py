"""Live view by MeshCat, which comes with every installation: it shows the run, and obeys nobody."""

from __future__ import annotations

import contextlib
import io
import os
import queue
import subprocess
import sys
import threading
import weakref
from collections.abc import Callable
from typing import Any

import numpy as np
import zmq  # comes with meshcat

from wbc.app.view.base import LOCAL, View, ViewError
from wbc.app.view.marks import Mark, Picture, placed
from wbc.app.view.meshes import Colour, Mesh, body_meshes
from wbc.core.errors import Array

ROOT = "wbc"
"""Root of all objects in MeshCat's tree."""


DIGITS = 4
"""Digits of a matrix (m) from which on a path has not moved."""


class _Pipeline:
    """Socket that takes MeshCat's commands without waiting for the answer to each: half the time."""

    def __init__(self, address: str) -> None:
        self._socket: Any = zmq.Context.instance().socket(zmq.DEALER)
        self._socket.connect(address)
        self._open = 0

    def send_multipart(self, command: list[bytes]) -> None:
        """Send a command."""
        self._socket.send_multipart([b"", *command])
        self._open += 1

    def recv(self) -> None:
        """Do not wait for its answer."""

    def wait(self) -> None:
        """Wait for the answers to all commands."""
        for _ in range(self._open):
            self._socket.recv_multipart()
        self._open = 0

    def close(self) -> None:
        """Close the socket."""
        self._socket.close(linger=0)


class MeshcatView(View):
    """A page in the browser that shows a robot as it moves; see `View` for what it shows.

    Every page of this machine may watch; none changes the run, which a `Workbench` does. MeshCat's server is a process
    of its own, which ends with the program; the page keeps its last picture. Pictures are sent by a thread: MeshCat
    takes one command after the other, some dozens a picture, and the run waits for none of them.
    """

    RATE = 20.0

    def _open(self, port: int) -> None:
        import meshcat  # noqa: PLC0415 - slow

        command = [sys.executable, "-m", "wbc.app.view.meshcat_server", str(port)]
        server = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
        )
        self._finalizer = weakref.finalize(self, _stop, server)
        assert server.stdout is not None
        address = server.stdout.readline().decode().strip()
        if not address:
            raise ViewError(
                f"MeshCat's server has not started at port {port}: `{' '.join(command)}` says why"
            )
        os.set_blocking(server.stdout.fileno(), False)
        self._lines, self._pages = server.stdout, 0
        with contextlib.redirect_stdout(io.StringIO()):
            self._page: Any = meshcat.Visualizer(zmq_url=address)
        self._page.window.zmq_socket.close()
        self._pipeline = self._page.window.zmq_socket = _Pipeline(address)
        self.url = f"http://{LOCAL}:{port}/static/"

    def _build(self) -> None:
        page = self._page
        page[ROOT].delete()
        page["/Background"].set_property("top_color", [0.95, 0.97, 1.0])
        page["/Background"].set_property("bottom_color", [0.82, 0.86, 0.90])
        page["/Axes"].set_property("visible", False)
        page["/Grid"].set_transform(_matrix(np.array([0.0, 0.0, self.stage.floor])))
        height = self.stage.scale.height
        page["/Cameras/default/rotated/<object>"].set_property(
            "position", [1.9 * height, 0.5 * height, 1.9 * height]
        )
        self._names: dict[int, list[str]] = {}
        self._shown: dict[str, Any] = {}
        # A path is that of the parent, and a body is sent when it has moved from there: few have, most of the time.
        self._paths = ["body"]
        for body, parent in enumerate(self.stage.model.body_parentid[1:].tolist(), start=1):
            self._paths.append(f"{self._paths[parent]}/{body}")
        for number, (body, colour, mesh) in enumerate(body_meshes(self.stage.model)):
            name = f"{self._paths[body]}/mesh {number}"
            self._set(name, mesh, colour)
            self._names.setdefault(body, []).append(name)
        self._pipeline.wait()
        self._marks: dict[str, tuple[Mark, Mesh | None]] = {}  # marks and their triangles as they are shown
        self._pictures: queue.Queue[tuple[Picture, Array, Array] | None] = queue.Queue()
        self._sender = threading.Thread(target=self._send_all, daemon=True)
        self._sender.start()

    def _send(self, picture: Picture) -> None:
        self._pictures.put((picture, self.stage.data.xpos.copy(), self.stage.data.xmat.copy()))

    def _send_all(self) -> None:
        """Draw the latest picture, again and again; the thread of MeshCat's commands."""
        while (latest := self._pictures.get()) is not None:
            with contextlib.suppress(queue.Empty):
                while (later := self._pictures.get_nowait()) is not None:
                    latest = later
                self._pictures.put(None)
            self._draw(*latest)
            self._pipeline.wait()

    def _draw(self, picture: Picture, positions: Array, rotations: Array) -> None:
        """Send a picture, and where the bodies are in it: positions, shape (n, 3), m, and matrices, shape (n, 9)."""
        axes, parents = rotations.reshape(-1, 3, 3), self.stage.model.body_parentid
        back = axes[parents].transpose(0, 2, 1)
        turns, ways = back @ axes, np.einsum("bij,bj->bi", back, positions - positions[parents])
        for path, way, turn in zip(self._paths[1:], ways[1:], turns[1:], strict=True):
            self._move(path, _matrix(way, turn))
        for body, colour in picture.colours.items():
            if self._shown.get(f"colour of {body}") != colour:
                self._shown[f"colour of {body}"] = colour
                for name in self._names.get(body, ()):
                    self._page[f"{ROOT}/{name}"].set_property("color", list(colour))
        gone = self._marks.keys() - {mark.name for mark in picture.marks}
        for name in gone:
            self._page[f"{ROOT}/mark/{name}"].delete()
            del self._marks[name]
            self._shown.pop(f"mark/{name}", None)
        for mark in picture.marks:
            old, path = self._marks.get(mark.name), f"mark/{mark.name}"
            if old is not None and mark.looks_like(old[0]):
                continue
            if mark.kind == "cloud":
                self._set_cloud(f"{path}/shape", mark)
                self._marks[mark.name] = (mark, None)
                continue
            mesh, position, rotation, scale = placed(mark)
            if old is None or old[1] is not mesh or old[0].colour != mark.colour:
                self._set(f"{path}/shape", mesh, mark.colour, on_top=mark.kind in ("ball", "arrow"))
            self._marks[mark.name] = (mark, mesh)
            self._move(path, _matrix(position, rotation * scale))
        middle = self.stage.floor + 0.8 * self.stage.scale.height
        self._move("/Cameras/default", _matrix(np.array([*picture.target[:2], middle])))

    def _set(self, path: str, mesh: Mesh, colour: Colour, *, on_top: bool = False) -> None:
        """Show triangles at a path."""
        from meshcat import geometry  # noqa: PLC0415 - slow

        options: dict[str, Any] = {"color": _hexadecimal(colour), "opacity": colour[3]}
        if on_top:  # drawn last and not hidden by anything
            options |= {"transparent": True, "depthTest": False}
        shape = geometry.TriangularMeshGeometry(mesh.vertices.astype(np.float32), mesh.faces)
        self._page[f"{ROOT}/{path}"].set_object(shape, geometry.MeshLambertMaterial(**options))

    def _set_cloud(self, path: str, mark: Mark) -> None:
        """Show points at a path."""
        from meshcat import geometry  # noqa: PLC0415 - slow

        places = np.ascontiguousarray(mark.points.T, dtype=np.float32)
        colours = np.tile(np.array(mark.colour[:3], dtype=np.float32)[:, None], len(mark.points))
        material = geometry.PointsMaterial(2.0 * mark.size)
        self._page[f"{ROOT}/{path}"].set_object(
            geometry.Points(geometry.PointsGeometry(places, colours), material)
        )

    def _move(self, path: str, matrix: Array) -> None:
        """Move a path, if it is not there already."""
        if self._shown.get(path) != (place := (matrix.round(DIGITS) + 0.0).tobytes()):
            self._shown[path] = place
            self._page[path if path.startswith("/") else f"{ROOT}/{path}"].set_transform(matrix)

    @property
    def pages(self) -> int:
        """Number of open browser pages."""
        if self.closed:
            return 0
        for line in (self._lines.read() or b"").split():
            self._pages += 1 if line == b"opened" else -1
        return self._pages

    def _take_orders(self, time: float, picture: Callable[[], Picture]) -> None:
        """Pages give none."""

    def _end(self) -> None:
        self._pictures.put(None)
        self._sender.join()
        self._pipeline.close()
        self._finalizer()


def _hexadecimal(colour: Colour) -> int:
    """Return red, green and blue as one number."""
    red, green, blue = (round(255 * part) for part in colour[:3])
    return (red << 16) + (green << 8) + blue


def _matrix(position: Array, axes: Array | None = None) -> Array:
    """Return a homogeneous matrix; `axes` are its columns, shape (3, 3)."""
    matrix = np.eye(4)
    matrix[:3, 3] = position
    if axes is not None:
        matrix[:3, :3] = axes
    return matrix


def _stop(server: subprocess.Popen[bytes]) -> None:
    """End the server."""
    server.communicate()
