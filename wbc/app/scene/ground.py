"""The ground of a scene: tiles for the endless plane, a mesh for the rough part."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from wbc.app.scene.colours import HIGH_COLOUR, LOW_COLOUR, TILE_COLOURS
from wbc.app.scene.marks import translation
from wbc.app.scene.shapes import ROOT, Colour, SceneObject, Surface

if TYPE_CHECKING:
    from wbc.sim.terrain.spec import Terrain

TILE, TILES = 0.5, 80
"""Side of the tiles that show the endless plane, m, and their number in each direction."""

TILES_DEPTH = 0.004
"""Depth of the tiles below the floor, m: a rough part at the same level stays visible."""

MAP_NODES = 120_000
"""Largest number of nodes of the mesh of a rough ground."""

_WHITE: Colour = (1.0, 1.0, 1.0, 1.0)


def ground_objects(terrain: Terrain | None) -> list[SceneObject]:
    """Return the endless plane and, if it is rough, the terrain; flat at z = 0 when None."""
    floor = 0.0 if terrain is None else float(terrain.surface.floor)
    under = translation(0.0, 0.0, floor - TILES_DEPTH)
    ground = [SceneObject(f"{ROOT}/ground/plane", _tiles(), _WHITE, under, shaded=False)]
    if terrain is not None:
        relief = _relief(terrain)
        if np.ptp(relief.vertices[:, 2]) > 0.0:
            ground.append(SceneObject(f"{ROOT}/ground/relief", relief, _WHITE, np.eye(4)))
    return ground


def _tiles() -> Surface:
    """Return a chequered plane."""
    edges = TILE * (np.arange(TILES + 1) - TILES / 2)
    i, j = (place.ravel() for place in np.meshgrid(np.arange(TILES), np.arange(TILES)))
    corners = [(edges[i + a], edges[j + b], np.zeros(i.size)) for a, b in ((0, 0), (1, 0), (1, 1), (0, 1))]
    vertices = np.stack([np.stack(corner, axis=1) for corner in corners], axis=1).reshape(-1, 3)
    first = 4 * np.arange(i.size)[:, None]
    faces = np.concatenate([first + [0, 1, 2], first + [0, 2, 3]]).astype(np.uint32)
    return Surface(vertices, faces, np.repeat(TILE_COLOURS[(i + j) % 2], 4, axis=0))


def _relief(terrain: Terrain) -> Surface:
    """Return the rough part and its strips as a grid, coloured by height."""
    x0, x1, y0, y1 = terrain.extent
    step = max(0.004, float(np.sqrt((x1 - x0) * (y1 - y0) / MAP_NODES)))
    # Slightly inside the edges: on them the height is that of the floor outside.
    x = np.linspace(x0 + 1e-6, x1 - 1e-6, int((x1 - x0) / step) + 1)
    y = np.linspace(y0 + 1e-6, y1 - 1e-6, int((y1 - y0) / step) + 1)
    z = terrain.height(x[None, :], y[:, None])
    vertices = np.stack([*np.broadcast_arrays(x[None, :], y[:, None], z)], axis=-1).reshape(-1, 3)
    corner = (np.arange(y.size - 1)[:, None] * x.size + np.arange(x.size - 1)[None, :]).ravel()
    right, left = (corner, corner + 1, corner + x.size + 1), (corner, corner + x.size + 1, corner + x.size)
    faces = np.concatenate([np.stack(right, axis=1), np.stack(left, axis=1)]).astype(np.uint32)
    share = (vertices[:, 2:] - z.min()) / max(float(np.ptp(z)), 1e-9)
    return Surface(vertices, faces, LOW_COLOUR + share * (HIGH_COLOUR - LOW_COLOUR))
