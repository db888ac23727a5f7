"""The scene of a live view in viser: a node for each moving path, and meshes below it."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.spatial.transform import Rotation

from wbc.app.scene.layer import Annotations
from wbc.app.scene.robot_shapes import read_mesh
from wbc.app.scene.scene import Scene, body_path
from wbc.app.scene.shapes import ROOT, Colour, SceneObject, Surface
from wbc.core.errors import Array

if TYPE_CHECKING:
    import viser

SMALLEST = 1e-4
"""Scale below which an object is hidden."""


class WorkbenchScene:
    """Scene in viser.

    Attributes:
        follows: The world moves so that the robot stays where it is in the picture.
    """

    def __init__(self, server: viser.ViserServer, scene: Scene, pull: Callable[[str, Any], None]) -> None:
        """Make all nodes; `pull` gets link and displacement of the mouse (m, world) while one is dragged with Ctrl."""
        self._server, self.follows = server, True
        height = scene.com_height
        server.initial_camera.position = (2.6 * height, -2.0 * height, 1.7 * height)
        server.initial_camera.look_at = (0.0, 0.0, 0.8 * height)
        self._root = server.scene.add_frame(ROOT, show_axes=False)
        self._frames = [server.scene.add_frame(path, show_axes=False) for path in scene.moving]
        self._meshes: dict[str, Any] = {}
        bodies = {body_path(body): body for body in scene.bodies}
        for thing in scene.objects:
            mesh = self._meshes[thing.path] = self._add(thing)
            body = bodies.get(thing.path.rpartition("/")[0], "")
            if body and "/" not in body:
                self._let_pull(mesh, body, pull)
        self._below = [
            [mesh for name, mesh in self._meshes.items() if name.startswith(f"{path}/")]
            for path in scene.moving
        ]
        self._shown = np.full((len(scene.moving), 4, 4), np.nan)
        self._scaled = np.ones((len(scene.moving), 3))
        self._colours: dict[str, Colour] = {}

    def draw(self, matrices: Array, annotations: Annotations) -> None:
        """Show a picture: matrices of moving paths, shape (n, 4, 4), colours, deformed shapes, point to follow."""
        moved = np.flatnonzero((matrices != self._shown).any(axis=(1, 2)))
        scales = np.linalg.norm(matrices[moved, :3, :3], axis=1)
        seen = scales.max(axis=1, initial=0.0) > SMALLEST
        turns = Rotation.from_matrix(matrices[moved, :3, :3] / np.maximum(scales, 1e-9)[:, None, :])
        quaternions = turns.as_quat()[:, [3, 0, 1, 2]]
        with self._server.atomic():
            for k, i in enumerate(moved.tolist()):
                frame = self._frames[i]
                if frame.visible != bool(seen[k]):
                    frame.visible = bool(seen[k])
                if not seen[k]:
                    continue
                frame.position, frame.wxyz = matrices[i, :3, 3], quaternions[k]
                if abs(scales[k] - self._scaled[i]).max() > SMALLEST:
                    self._scaled[i] = scales[k]
                    for mesh in self._below[i]:
                        mesh.scale = tuple(scales[k].tolist())
            self._shown[moved] = matrices[moved]
            for path, colour in annotations.colours.items():
                if self._colours.get(path) != colour:
                    self._colours[path] = colour
                    for name, mesh in self._meshes.items():
                        if name.startswith(f"{path}/"):
                            mesh.color = _rgb(colour)
            for path, vertices in annotations.shapes.items():
                self._meshes[path].vertices = vertices.astype(np.float32)
            if annotations.target is not None:
                x, y, _ = annotations.target if self.follows else (0.0, 0.0, 0.0)
                self._root.position = (-x, -y, 0.0)

    def see_through(self, on: bool) -> None:
        """Draw the robot transparent, to see forces and marks behind it, or solid."""
        for path, mesh in self._meshes.items():
            if path.startswith(f"{ROOT}/robot/"):
                mesh.opacity = 0.4 if on else None

    def _add(self, thing: SceneObject) -> Any:
        shape = thing.shape
        colours = shape.colours if isinstance(shape, Surface) else None
        x, y, z, w = Rotation.from_matrix(thing.placement[:3, :3]).as_quat().tolist()
        place: dict[str, Any] = {"wxyz": (w, x, y, z), "position": thing.placement[:3, 3]}
        if colours is not None and isinstance(shape, Surface):
            import trimesh  # noqa: PLC0415 - an extra

            paint = np.column_stack([255 * colours, np.full(len(colours), 255)]).astype(np.uint8)
            mesh = trimesh.Trimesh(shape.vertices, shape.faces, process=False, vertex_colors=paint)
            return self._server.scene.add_mesh_trimesh(thing.path, mesh, cast_shadow=False, **place)
        vertices, faces = _triangles(thing)
        return self._server.scene.add_mesh_simple(
            thing.path,
            vertices,
            faces,
            color=_rgb(thing.colour),
            opacity=thing.colour[3] if thing.colour[3] < 1.0 else None,
            side="front" if thing.shaded else "double",
            cast_shadow=thing.shaded,
            **place,
        )

    @staticmethod
    def _let_pull(mesh: Any, body: str, pull: Callable[[str, Any], None]) -> None:
        async def drag(event: Any) -> None:
            way = np.subtract(event.end_position, event.start_position)
            pull(body, np.zeros(3) if event.phase == "end" else way)

        mesh.on_drag("left", modifier="cmd/ctrl")(drag)


def _triangles(thing: SceneObject) -> tuple[Array, Any]:
    """Return vertices, shape (n, 3), m, and triangles of a shape."""
    shape = thing.shape
    if isinstance(shape, Surface):
        return shape.vertices, shape.faces
    if shape.path.lower().endswith(".dae"):  # trimesh reads the others, and much faster
        vertices, faces = read_mesh(shape.path)
    else:
        import trimesh  # noqa: PLC0415 - an extra

        made = trimesh.load_mesh(shape.path)
        vertices, faces = np.asarray(made.vertices), np.asarray(made.faces)
    return vertices * np.array(shape.scale), faces


def _rgb(colour: Colour) -> tuple[int, int, int]:
    red, green, blue = (round(255 * value) for value in colour[:3])
    return red, green, blue
