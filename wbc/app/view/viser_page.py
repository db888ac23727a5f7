"""A page of viser that shows a model and marks, for the workbench and for replays."""

from __future__ import annotations

import contextlib
import io
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np

from wbc.app.view.base import LOCAL, ViewError
from wbc.app.view.marks import Picture, Shown, changes, legend
from wbc.app.view.meshes import Colour, body_meshes
from wbc.app.view.stage import Stage
from wbc.app.view.widgets import Widgets
from wbc.core.errors import Array
from wbc.sim.plant.hands import SCENE_PREFIX

if TYPE_CHECKING:
    import viser

ROOT = "/wbc"
"""Root of all nodes."""


def start_server(port: int, title: str) -> tuple[viser.ViserServer, str]:
    """Start viser at a port of this machine; return it with its link. `ViewError` without viser."""
    try:
        import viser  # noqa: PLC0415 - an extra
    except ImportError as missing:
        raise ViewError(
            f"this page needs viser ({missing}): in a clone, pip install -e '.[workbench]'"
        ) from missing
    with contextlib.redirect_stdout(io.StringIO()):
        server = viser.ViserServer(LOCAL, port, title, verbose=False)
    server.gui.configure_theme(show_share_button=False, show_logo=False)
    return server, f"http://{LOCAL}:{server.get_port()}/"


def stop_server(server: viser.ViserServer) -> None:
    """Stop a server."""
    with contextlib.redirect_stdout(io.StringIO()):
        server.stop()


class ViserPage:
    """Nodes of a stage in viser: a frame for each body with its meshes below, and the marks.

    Attributes:
        said: Time and text of the last picture.
        meanings: Meaning of the colours that have been drawn.
    """

    def __init__(
        self, server: viser.ViserServer, stage: Stage, pull: Callable[[str, Array], None] | None = None
    ) -> None:
        """Make all nodes; `pull` gets link and displacement of the mouse (m, world) while one is dragged with Ctrl."""
        self._server, self._stage, self._follows = server, stage, True
        self.said: list[str] = []
        self.meanings: dict[str, Colour] = {}
        self._target = np.zeros(3)
        scene, model, height = server.scene, stage.model, stage.scale.height
        server.initial_camera.position = (2.6 * height, -2.0 * height, 1.7 * height)
        server.initial_camera.look_at = (0.0, 0.0, 0.8 * height)
        self._root = scene.add_frame(ROOT, show_axes=False)
        scene.add_grid(f"{ROOT}/grid", 40.0, 40.0, position=(0.0, 0.0, stage.floor))
        self._frames: dict[int, Any] = {}
        self._meshes: dict[int, list[Any]] = {}
        for number, (body, colour, mesh) in enumerate(body_meshes(model)):
            if body not in self._frames:
                self._frames[body] = scene.add_frame(f"{ROOT}/body {body}", show_axes=False)
            name = f"{ROOT}/body {body}/{number}"
            made = scene.add_mesh_simple(
                name, mesh.vertices, mesh.faces, **_paint(colour), cast_shadow=body > 0
            )
            self._meshes.setdefault(body, []).append(made)
            link = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_BODY, body)
            if pull is not None and body > 0 and "/" not in link and not link.startswith(SCENE_PREFIX):
                _let_pull(made, link, pull)
        self._shown = np.full((model.nbody, 7), np.nan)
        self._colours: dict[int, Colour] = {}
        self._marks: Shown = {}
        self._nodes: dict[str, Any] = {}  # of marks

    def draw(self, picture: Picture) -> None:
        """Show a picture."""
        data = self._stage.data
        poses = np.concatenate([data.xpos, data.xquat], axis=1)
        with self._server.atomic():
            for body, frame in self._frames.items():
                if body > 0 and (poses[body] != self._shown[body]).any():
                    frame.position, frame.wxyz = poses[body, :3], poses[body, 3:]
            self._shown = poses
            for body, colour in picture.colours.items():
                if self._colours.get(body) != colour:
                    self._colours[body] = colour
                    for mesh in self._meshes.get(body, ()):
                        mesh.color = _paint(colour)["color"]
            self._draw_marks(picture)
            self._target = picture.target
            self.follow(self._follows)
        self.said = [f"**{picture.time:.2f} s**", *picture.text]
        self.meanings |= legend([picture])

    def _draw_marks(self, picture: Picture) -> None:
        scene = self._server.scene
        for name, mark, place, anew in changes(self._marks, picture.marks):
            path = f"{ROOT}/marks/{name}"
            if mark is None:
                self._nodes.pop(name).remove()
            elif place is None:
                colour, size = _paint(mark.colour)["color"], 2.0 * mark.size
                self._nodes[name] = scene.add_point_cloud(
                    path, mark.points, colour, point_size=size, precision="float32"
                )
            else:
                if anew:
                    (vertices, faces), paint = place.mesh, _paint(mark.colour)
                    self._nodes[name] = scene.add_mesh_simple(
                        path, vertices, faces, **paint, cast_shadow=False
                    )
                node, quaternion = self._nodes[name], np.empty(4)
                mujoco.mju_mat2Quat(quaternion, np.ascontiguousarray(place.rotation).ravel())
                node.position, node.wxyz = place.position, quaternion
                node.scale = tuple(place.scale.tolist())

    def options(self, widgets: Widgets) -> None:
        """Add what changes the picture alone to a panel, and the meaning of the colours."""
        widgets.checkbox("camera follows", True, self.follow)
        widgets.checkbox("see through the robot", False, self.see_through)
        with self._server.gui.add_folder("meaning of the colours", expand_by_default=False):
            widgets.text(lambda: legend_html(self.meanings), html=True)

    def follow(self, on: bool) -> None:
        """Move the world so that the robot stays where it is in the picture, or leave it where it is."""
        self._follows = on
        x, y = self._target[:2] if on else (0.0, 0.0)
        self._root.position = (-x, -y, 0.0)

    def see_through(self, on: bool) -> None:
        """Draw what moves transparent, to see forces and marks behind it, or solid."""
        for body, meshes in self._meshes.items():
            for mesh in meshes if body > 0 else ():
                mesh.opacity = 0.4 if on else None


def legend_html(meanings: dict[str, Colour]) -> str:
    """Return a legend."""
    lines = (
        f'<span style="color: rgb{tuple(round(255 * part) for part in colour[:3])}">⬤</span> {text}'
        for text, colour in meanings.items()
    )
    return f"<div style='padding: 0 1em; font-size: 0.85em'>{'<br>'.join(lines)}</div>"


def _let_pull(mesh: Any, link: str, pull: Callable[[str, Array], None]) -> None:
    async def drag(event: Any) -> None:
        way = np.subtract(event.end_position, event.start_position)
        pull(link, np.zeros(3) if event.phase == "end" else way)

    mesh.on_drag("left", modifier="cmd/ctrl")(drag)


def _paint(colour: Colour) -> dict[str, Any]:
    """Return colour and opacity of a mesh as viser has them."""
    red, green, blue = (round(255 * part) for part in colour[:3])
    return {"color": (red, green, blue), "opacity": colour[3] if colour[3] < 1.0 else None}
