"""Live view by MeshCat, which comes with every installation: it shows the run, and obeys nobody."""

from __future__ import annotations

import contextlib
import io
import os
import subprocess
import sys
import weakref
from typing import Any

import numpy as np

from wbc.app.view.base import LOCAL, View, ViewError
from wbc.app.view.marks import Mark, Picture, changes, mark_mesh
from wbc.app.view.meshes import Colour, Mesh, body_meshes
from wbc.core.errors import Array


class MeshcatView(View):
    """A page in the browser that shows a robot as it moves; see `View` for what it shows.

    Every page of this machine may watch; none changes the run, which a `Workbench` does. MeshCat's server is a process
    of its own, which ends with the program; the page keeps its last picture.
    """

    def _open(self, port: int) -> None:
        import meshcat  # noqa: PLC0415 - slow
        from meshcat import geometry  # noqa: PLC0415

        self._geometry: Any = geometry
        command = [sys.executable, "-m", "wbc.app.view.meshcat_server", str(port)]
        pipe = subprocess.PIPE
        server = subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=subprocess.DEVNULL)
        self._finalizer = weakref.finalize(self, server.communicate)
        assert server.stdout is not None
        address = server.stdout.readline().decode().strip()
        if not address:
            raise ViewError(
                f"MeshCat's server has not started at port {port}: `{' '.join(command)}` says why"
            )
        os.set_blocking(server.stdout.fileno(), False)
        self._lines, self._pages = server.stdout, 0
        with contextlib.redirect_stdout(io.StringIO()):
            self._root: Any = meshcat.Visualizer(address)
        self.url = f"http://{LOCAL}:{port}/static/"

    def _build(self) -> None:
        root, height = self._root, self.stage.scale.height
        self._scene: Any = root["wbc"]
        root["/Background"].set_property("top_color", [0.95, 0.97, 1.0])
        root["/Background"].set_property("bottom_color", [0.82, 0.86, 0.90])
        root["/Axes"].set_property("visible", False)
        root["/Grid"].set_transform(_matrix(np.array([0.0, 0.0, self.stage.floor])))
        eye = [1.9 * height, 0.5 * height, 1.9 * height]
        root["/Cameras/default/rotated/<object>"].set_property("position", eye)
        self._marks: dict[str, Mark] = {}
        self._colours: dict[int, Colour] = {}
        self._bodies: dict[int, list[str]] = {}
        for number, (body, colour, mesh) in enumerate(body_meshes(self.stage.model)):
            self._bodies.setdefault(body, []).append(name := f"{number}")
            self._set_mesh(self._scene[f"body {body}"][name], mesh, colour)

    def _send(self, picture: Picture) -> None:
        data = self.stage.data
        for body in self._bodies:
            self._scene[f"body {body}"].set_transform(_matrix(data.xpos[body], data.xmat[body].reshape(3, 3)))
        for body, colour in picture.colours.items():
            if self._colours.get(body) != colour:
                self._colours[body] = colour
                for name in self._bodies.get(body, ()):
                    self._scene[f"body {body}"][name].set_property("color", list(colour))
        for name, mark in changes(self._marks, picture.marks):
            if mark is None:
                self._scene["mark"][name].delete()
            else:
                on_top = mark.kind in ("ball", "arrow")
                self._set_mesh(self._scene["mark"][name], mark_mesh(mark), mark.colour, on_top=on_top)
        middle = self.stage.floor + 0.8 * self.stage.scale.height
        self._root["/Cameras/default"].set_transform(_matrix(np.array([*picture.target[:2], middle])))

    def _set_mesh(self, place: Any, mesh: Mesh, colour: Colour, *, on_top: bool = False) -> None:
        red, green, blue = (round(255 * part) for part in colour[:3])
        options: dict[str, Any] = {"color": (red << 16) + (green << 8) + blue, "opacity": colour[3]}
        if on_top:  # drawn last and not hidden by anything
            options |= {"transparent": True, "depthTest": False}
        shape = self._geometry.TriangularMeshGeometry(mesh.vertices.astype(np.float32), mesh.faces)
        place.set_object(shape, self._geometry.MeshLambertMaterial(**options))

    @property
    def pages(self) -> int:
        """Number of open browser pages."""
        if self.closed:
            return 0
        for line in (self._lines.read() or b"").split():
            self._pages += 1 if line == b"opened" else -1
        return self._pages

    def _end(self) -> None:
        self._root.window.zmq_socket.close(linger=0)
        self._finalizer()


def _matrix(position: Array, axes: Array | None = None) -> Array:
    """Return a homogeneous matrix; `axes` are its columns, shape (3, 3)."""
    matrix = np.eye(4)
    matrix[:3, 3] = position
    if axes is not None:
        matrix[:3, :3] = axes
    return matrix
