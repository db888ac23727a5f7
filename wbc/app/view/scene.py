"""The scene of the live view: what stands still, what moves, and one picture of the moving things at an instant.

A scene is made once. Afterwards a frame is nothing but one matrix for each thing that moves, in a fixed order, so
that it can be handed over by copying a few kilobytes.
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from wbc.app.view.shapes import Colour, Part, Shape, Surface, VisualCylinder, sphere
from wbc.core.errors import Array
from wbc.sim.terrain import Terrain

ROOT = "/wbc"
"""Where everything of ours stands in the tree of the viewer."""

ARROWS = {"ground": 16, "push": 4}
"""How many forces of each kind can be shown at a time; the largest come first."""

SKY_COLOURS = {"top_color": (0.95, 0.97, 1.0), "bottom_color": (0.82, 0.86, 0.90)}
"""Background at the top and at the bottom of the page."""

TILE_COLOURS = np.array([[0.80, 0.82, 0.83], [0.86, 0.875, 0.885]])
COM_COLOUR: Colour = (0.95, 0.60, 0.10, 1.0)
ZMP_COLOUR: Colour = (0.75, 0.15, 0.75, 1.0)
ARROW_COLOURS: dict[str, Colour] = {"ground": (0.10, 0.60, 0.25, 0.9), "push": (0.85, 0.15, 0.10, 0.9)}

LEGEND = (
    ("centre of mass and its shadow", COM_COLOUR),
    ("ZMP", ZMP_COLOUR),
    ("contact force", ARROW_COLOURS["ground"]),
    ("push", ARROW_COLOURS["push"]),
)
"""What the colours mean, for the page."""

TILE, TILES = 0.5, 80
"""Sides of the tiles that show the endless plane, m, and how many there are each way."""

TILES_DEPTH = 0.004
"""How far the tiles lie under the floor, m: a rough part at the same level stays visible."""

MAP_NODES = 120_000
"""Most nodes of the mesh that a rough ground is drawn as."""

HIDDEN = np.diag([1e-6, 1e-6, 1e-6, 1.0])
"""Matrix of what is not there at the moment: too small to be seen (a zero scale has no inverse)."""

_LOW, _HIGH = np.array([0.40, 0.36, 0.33]), np.array([0.82, 0.77, 0.68])


@dataclass(frozen=True, eq=False)
class SceneObject:
    """An object of the viewer.

    Attributes:
        path: Its place in the tree; what moves is moved by a path above it.
        shape: The shape.
        colour: Its colour.
        placement: Relative to the path above, shape (4, 4), m.
        on_top: Shown through everything else.
        shaded: Lit by the lamps; in its plain colour when False.
        bends: A `Surface` whose vertices the notes of frames move.
    """

    path: str
    shape: Shape
    colour: Colour
    placement: Array
    on_top: bool = False
    shaded: bool = True
    bends: bool = False


@dataclass(frozen=True, eq=False)
class Snapshot:
    """The moving things at one instant.

    Attributes:
        time: s.
        poses: Of the bodies of the scene in the world, homogeneous, shape (number of bodies, 4, 4), m.
        com: Centre of mass in the world, shape (3,), m.
        zmp: Zero-tilting moment point in the world, shape (3,), m; None without contact.
        forces: Kind of arrow, point of attack (world, m) and force (world, N).
    """

    time: float
    poses: Array
    com: Array
    zmp: Array | None = None
    forces: Sequence[tuple[str, Array, Array]] = ()


@dataclass(eq=False)
class Note:
    """What a frame says beside its matrices.

    Attributes:
        text: Lines for the page.
        target: What the camera follows, in the world, m.
        colours: New colours of everything under a path.
        shapes: Vertices of drawings that bend, by their paths, shape (n, 3), m.
    """

    text: list[str] = field(default_factory=list)
    target: tuple[float, float, float] | None = None
    colours: dict[str, Colour] = field(default_factory=dict)
    shapes: dict[str, Array] = field(default_factory=dict)

    def pack(self) -> bytes:
        """Return it as JSON; places to a tenth of a millimetre, vertices in one list of numbers."""
        said: dict[str, Any] = {"text": "\n".join(self.text), "colours": self.colours}
        if self.target is not None:
            said["target"] = [round(value, 4) for value in self.target]
        said["shapes"] = {path: np.round(shape, 4).ravel().tolist() for path, shape in self.shapes.items()}
        return json.dumps(said, separators=(",", ":")).encode()


@dataclass(frozen=True, eq=False)
class Scene:
    """What the viewer shows.

    Attributes:
        title: Name of what is shown.
        bodies: Bodies that move, in the order of `Snapshot.poses`.
        drawings: All objects.
        moving: Paths that a frame moves, in the order of its matrices; `frame` gives the first of them, what is shown
            beside the robot (`wbc.app.view.layers`) the others.
        floor: Height of the endless plane, m.
        size: Height of the centre of mass at the start, m: the measure of camera, markers and arrows.
        newton: Length of an arrow for each newton, m.
        legend: What the colours mean.
    """

    title: str
    bodies: tuple[str, ...]
    drawings: tuple[SceneObject, ...]
    moving: tuple[str, ...]
    floor: float
    size: float
    newton: float
    _places: dict[str, int] = field(default_factory=dict)
    legend: tuple[tuple[str, Colour], ...] = LEGEND
    _own: int = 0

    def frame(self, snapshot: Snapshot) -> Array:
        """Return one matrix for each path that the robot, its forces and its markers move.

        Args:
            snapshot: The instant.

        Returns:
            Homogeneous matrices, scale included, shape (number of them, 4, 4).
        """
        matrices = np.tile(HIDDEN, (self._own or len(self.moving), 1, 1))
        count = len(self.bodies)
        matrices[:count] = snapshot.poses
        level = self.floor if snapshot.zmp is None else float(snapshot.zmp[2])  # on stairs: where it stands
        shadow = np.array([*snapshot.com[:2], level])
        for i, point in enumerate((snapshot.com, shadow, snapshot.zmp), start=count):
            if point is not None:
                matrices[i] = np.eye(4)
                matrices[i, :3, 3] = point
        for kind, most in ARROWS.items():
            start = self._places[kind]
            mine = [(point, force) for name, point, force in snapshot.forces if name == kind]
            mine.sort(key=lambda arrow: -float(np.linalg.norm(arrow[1])))
            for i, (point, force) in enumerate(mine[:most]):
                matrices[start + i] = self._arrow(kind, point, force)
        return matrices

    def extended(
        self,
        drawings: Sequence[SceneObject],
        moving: Sequence[str],
        legend: Sequence[tuple[str, Colour]],
    ) -> Scene:
        """Return the scene with more in it; the matrices of what is added come behind its own.

        Args:
            drawings: Objects.
            moving: Paths that frames move.
            legend: What their colours mean.
        """
        return replace(
            self,
            drawings=(*self.drawings, *drawings),
            moving=(*self.moving, *moving),
            legend=(*self.legend, *legend),
            _own=self._own or len(self.moving),
        )

    def _arrow(self, kind: str, point: Array, force: Array) -> Array:
        """Matrix that makes the unit arrow as long as the force is large; pushes end at their point."""
        size = float(np.linalg.norm(force))
        length = self.newton * size
        if length < 1e-3:
            return HIDDEN
        x, y, z = upright_axes(force / size)
        thickness = 0.025 * self.size
        matrix = np.eye(4)
        matrix[:3, 0], matrix[:3, 1], matrix[:3, 2] = thickness * x, thickness * y, length * z
        matrix[:3, 3] = point - length * z if kind == "push" else point
        return matrix


def upright_axes(direction: Array) -> tuple[Array, Array, Array]:
    """Axes of a right-handed frame whose z axis is a direction, a unit vector of shape (3,)."""
    a, b, c = direction.tolist()
    if abs(b) < 0.9:  # z × y, level
        norm = math.hypot(a, c)
        x = np.array((-c / norm, 0.0, a / norm))
    else:
        norm = math.hypot(b, c)
        x = np.array((0.0, c / norm, -b / norm))
    u, v, w = x.tolist()
    return x, np.array((b * w - c * v, c * u - a * w, a * v - b * u)), direction


@dataclass(frozen=True)
class Setup:
    """What the drawing process is told.

    Attributes:
        scene: What to draw.
        host: Address to listen at.
        port: Port to listen at; the first free one of a range when None, any free one when 0.
        rate: Most frames a second.
        fd: File descriptor of the channel.
        speed: Multiple of real time at the start; None for as fast as it goes.
        controls: What the page can change, and how it is at the start; see `wbc.app.view.controls`.
    """

    scene: Scene
    host: str
    port: int | None
    rate: float
    fd: int
    speed: float | None
    controls: dict[str, Any]


def make_scene(
    title: str, parts: Sequence[Part], terrain: Terrain | None, size: float, weight: float
) -> Scene:
    """Put a scene together.

    Args:
        title: Name of what is shown.
        parts: Shapes of the bodies that move.
        terrain: The ground; flat at z = 0 when None.
        size: Height of the centre of mass, m.
        weight: Of the robot, N: an arrow of this force is as long as `size`.
    """
    bodies = tuple(dict.fromkeys(part.body for part in parts))
    paths = {body: f"{ROOT}/robot/{body.replace('/', '_')}" for body in bodies}
    drawings = [
        SceneObject(f"{paths[part.body]}/{i}", part.shape, part.colour, part.placement)
        for i, part in enumerate(parts)
    ]
    floor = 0.0 if terrain is None else float(terrain.surface.floor)
    drawings += _ground(terrain, floor)
    disc = VisualCylinder(0.022 * size, 0.004 * size)
    markers: dict[str, tuple[Shape, Colour]] = {
        "com": (sphere(0.022 * size), COM_COLOUR),
        "com_shadow": (disc, COM_COLOUR),
        "zmp": (disc, ZMP_COLOUR),
    }
    moving = [*paths.values(), *(f"{ROOT}/markers/{name}" for name in markers)]
    drawings += [
        SceneObject(
            f"{ROOT}/markers/{name}/shape", shape, colour, np.eye(4), on_top=True, shaded=name == "com"
        )
        for name, (shape, colour) in markers.items()
    ]
    places = {}
    for kind, count in ARROWS.items():
        places[kind] = len(moving)
        arrows = [f"{ROOT}/forces/{kind}_{i}" for i in range(count)]
        moving += arrows
        drawings += [
            SceneObject(
                f"{path}/shape", _UNIT_ARROW, ARROW_COLOURS[kind], np.eye(4), on_top=True, shaded=False
            )
            for path in arrows
        ]
    return Scene(title, bodies, tuple(drawings), tuple(moving), floor, size, size / weight, places)


def _ground(terrain: Terrain | None, floor: float) -> list[SceneObject]:
    """The endless plane, and the rough part as a mesh."""
    under = np.eye(4)
    under[2, 3] = floor - TILES_DEPTH
    ground = [SceneObject(f"{ROOT}/ground/plane", _tiles(), (1.0, 1.0, 1.0, 1.0), under, shaded=False)]
    if terrain is not None:
        relief = _relief(terrain)
        if np.ptp(relief.vertices[:, 2]) > 0.0:
            ground.append(SceneObject(f"{ROOT}/ground/relief", relief, (1.0, 1.0, 1.0, 1.0), np.eye(4)))
    return ground


def _tiles() -> Surface:
    """A chequered plane."""
    edges = TILE * (np.arange(TILES + 1) - TILES / 2)
    i, j = (place.ravel() for place in np.meshgrid(np.arange(TILES), np.arange(TILES)))
    corners = [(edges[i + a], edges[j + b], np.zeros(i.size)) for a, b in ((0, 0), (1, 0), (1, 1), (0, 1))]
    vertices = np.stack([np.stack(corner, axis=1) for corner in corners], axis=1).reshape(-1, 3)
    first = 4 * np.arange(i.size)[:, None]
    faces = np.concatenate([first + [0, 1, 2], first + [0, 2, 3]]).astype(np.uint32)
    return Surface(vertices, faces, np.repeat(TILE_COLOURS[(i + j) % 2], 4, axis=0))


def _relief(terrain: Terrain) -> Surface:
    """The rough part and its strips on a grid, coloured by height."""
    x0, x1, y0, y1 = terrain.extent
    step = max(0.004, float(np.sqrt((x1 - x0) * (y1 - y0) / MAP_NODES)))
    # A hair inside the edges, where the height would be that of the floor outside.
    x = np.linspace(x0 + 1e-6, x1 - 1e-6, int((x1 - x0) / step) + 1)
    y = np.linspace(y0 + 1e-6, y1 - 1e-6, int((y1 - y0) / step) + 1)
    z = terrain.height(x[None, :], y[:, None])
    vertices = np.stack([*np.broadcast_arrays(x[None, :], y[:, None], z)], axis=-1).reshape(-1, 3)
    corner = (np.arange(y.size - 1)[:, None] * x.size + np.arange(x.size - 1)[None, :]).ravel()
    right, left = (corner, corner + 1, corner + x.size + 1), (corner, corner + x.size + 1, corner + x.size)
    faces = np.concatenate([np.stack(right, axis=1), np.stack(left, axis=1)]).astype(np.uint32)
    share = (vertices[:, 2:] - z.min()) / max(float(np.ptp(z)), 1e-9)
    return Surface(vertices, faces, _LOW + share * (_HIGH - _LOW))


def _unit_arrow(sides: int = 12) -> Surface:
    """An arrow of length 1 along z and a head of radius 1, to be scaled."""
    angle = 2.0 * np.pi * np.arange(sides) / sides
    rings = [(0.0, 0.0), (0.4, 0.0), (0.4, 0.75), (1.0, 0.75), (0.0, 1.0)]
    vertices = np.concatenate(
        [np.stack([r * np.cos(angle), r * np.sin(angle), np.full(sides, z)], axis=1) for r, z in rings]
    )
    i = np.arange(sides)
    j = (i + 1) % sides
    faces = []
    for ring in range(len(rings) - 1):
        a, b = ring * sides, (ring + 1) * sides
        faces += [np.stack([a + i, a + j, b + j], axis=1), np.stack([a + i, b + j, b + i], axis=1)]
    return Surface(vertices, np.concatenate(faces).astype(np.uint32))


_UNIT_ARROW = _unit_arrow()
