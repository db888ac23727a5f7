"""Live view by MeshCat, which comes with every installation: it shows the run, and obeys nobody."""

from __future__ import annotations

import json
import math
import time as clock
from typing import Any

import numpy as np

from wbc.app.view.base import LOCAL, TEXT_PERIOD, View, ViewError
from wbc.app.view.marks import Mark, Picture, changes, css, legend, mark_mesh, repainted
from wbc.app.view.meshes import Mesh, body_meshes
from wbc.base.numbers import Array
from wbc.robots.mechanism import Colour

ROOT = "/meshcat/wbc"
"""Root of all objects in MeshCat's tree."""


class MeshcatView(View):
    """Page in the browser that shows a robot as it moves; `View` lists its contents.

    The caption has texts, and a legend of all marks that were shown so far. It is updated only while a page is open.

    Any browser on this machine may open the page. The page cannot change the run; a `Workbench` can. The page keeps its
    last picture when the program has ended. The run does not wait for a page: while a page is busy with one picture,
    others are skipped.
    """

    def _open(self, port: int) -> None:
        from meshcat import commands, geometry  # noqa: PLC0415 - slow

        from wbc.app.view.meshcat_server import MeshcatServer  # noqa: PLC0415 - slow

        self._commands: Any = commands
        self._geometry: Any = geometry
        try:
            self._server = MeshcatServer(port)
        except OSError as error:
            raise ViewError(f"MeshCat's page cannot be served at port {port}: {error}") from error
        self.url = f"http://{LOCAL}:{port}/static/"

    def _build(self) -> None:
        height, properties = self.run.stage.scale.height, self._commands.SetProperty
        self._orders: list[tuple[tuple[str, ...], bytes]] = []  # of the present picture
        self._order(ROOT, self._commands.Delete)  # of the run before
        self._order("/Background", properties, "top_color", [0.95, 0.97, 1.0])
        self._order("/Background", properties, "bottom_color", [0.82, 0.86, 0.90])
        self._order("/Axes", properties, "visible", False)
        eye = [1.9 * height, 0.5 * height, 1.9 * height]
        self._order("/Cameras/default/rotated/<object>", properties, "position", eye)
        self._marks: dict[str, Mark] = {}
        self._meanings: dict[str, Colour] = {}
        self._spoken = -math.inf  # clock of the last caption
        self._meshes = body_meshes(self.run.stage.model)
        self._colours = {number: mesh.colour for number, mesh in enumerate(self._meshes)}
        for number, (body, colour, mesh) in enumerate(self._meshes):
            self._set_mesh(f"{ROOT}/body {body}/{number}", mesh, colour)
        self._post(None)

    def _post(self, caption: str | None) -> None:
        self._server.send(self._orders, caption)
        self._orders = []

    def _order(self, path: str, kind: Any, *values: Any) -> None:
        """Add a command of MeshCat to the picture."""
        plain = kind(*values, path=self._commands.Path(tuple(path.strip("/").split("/")))).lower()
        key = plain["type"], path, *(values[:1] if plain["type"] == "set_property" else ())
        self._orders.append((key, self._geometry.umsgpack.packb(plain)))

    def _send(self, picture: Picture) -> None:
        if self._server.busy and self.frames > 1 and not self.closed:
            return
        stage, data = self.run.stage, self.run.stage.data
        for body in {mesh.body for mesh in self._meshes}:
            self._move(f"{ROOT}/body {body}", data.xpos[body], data.xmat[body].reshape(3, 3))
        for number, colour in repainted(self._colours, self._meshes, picture.colours):
            path = f"{ROOT}/body {self._meshes[number].body}/{number}"
            self._order(path, self._commands.SetProperty, "color", list(colour))
        for name, mark in changes(self._marks, picture.marks):
            path = f"{ROOT}/mark/{name}"
            if mark is None:
                self._order(path, self._commands.Delete)
            else:
                on_top = mark.kind in ("ball", "arrow")
                self._set_mesh(path, mark_mesh(mark), mark.colour, on_top=on_top)
        # MeshCat's camera looks at the origin wherever it stands: the world moves so that the robot stays there.
        away = -np.array([*picture.target[:2], stage.floor + 0.8 * stage.scale.height])
        self._move(ROOT, away)
        self._move("/Grid", away + (0.0, 0.0, stage.floor))
        self._post(self._caption(picture))

    def _caption(self, picture: Picture) -> str | None:
        """Return the caption as JSON; None if nobody reads it, or it is younger than `TEXT_PERIOD` and not the last."""
        if self.frames > 1 and self.pages == 0 and not self.closed:
            return None
        self._meanings |= legend(picture)  # of short pushes, too
        if not self.closed and clock.perf_counter() < self._spoken + TEXT_PERIOD:
            return None
        self._spoken = clock.perf_counter()
        legends = [(meaning, css(colour)) for meaning, colour in self._meanings.items()]
        return json.dumps({"lines": [f"{picture.time:.2f} s", *picture.text], "legend": legends})

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
        return 0 if self.closed else len(self._server.pages)

    def _end(self) -> None:
        self._server.close()
