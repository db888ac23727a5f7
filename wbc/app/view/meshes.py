"""Triangles of what a MuJoCo model shows: one mesh for each body and colour, in the frame of the body."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import NamedTuple

import mujoco
import numpy as np

from wbc.base.numbers import Array
from wbc.robots.mechanism import Colour

Faces = np.ndarray[tuple[int, int], np.dtype[np.uint32]]
"""Triangles: indices of their vertices, shape (m, 3)."""

SHOWN_GROUPS = 3
"""Groups of geoms below this one are shown, as in MuJoCo's viewers."""

ENDLESS = 20.0
"""Half the side of a plane without end, m."""

PLANE_DEPTH = 0.004
"""Depth of planes below where they are, m: a rough part at the same level stays visible."""

SIDES, RINGS = 20, 9
"""Sides of a round shape, and rings of a ball from pole to pole."""

SHADES = 48
"""Shades of each colour of what never moves: solids of a ground are drawn together."""


class Mesh(NamedTuple):
    """Triangles: vertices, shape (n, 3), m, and faces."""

    vertices: Array
    faces: Faces


class BodyMesh(NamedTuple):
    """Triangles of one colour in the frame of a body; those that never move are in the world, body 0."""

    body: int
    colour: Colour
    mesh: Mesh


def body_meshes(model: mujoco.MjModel) -> list[BodyMesh]:
    """Return everything that a model shows."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    fixed = (model.body_weldid == 0) & (model.body_mocapid[model.body_rootid] < 0)
    parts: dict[tuple[int, Colour], list[Mesh]] = {}
    for geom in np.flatnonzero(model.geom_group < SHOWN_GROUPS).tolist():
        mesh, colour = geom_mesh(model, geom), geom_colour(model, geom)
        if mesh is None or colour[3] == 0.0:
            continue
        body, place, turn = int(model.geom_bodyid[geom]), model.geom_pos[geom], np.empty(9)
        mujoco.mju_quat2Mat(turn, model.geom_quat[geom])
        if fixed[body]:
            body, place, turn = 0, data.geom_xpos[geom], data.geom_xmat[geom]
            red, green, blue, opacity = (round(SHADES * part) / SHADES for part in colour)
            colour = red, green, blue, opacity
        placed = Mesh(mesh.vertices @ turn.reshape(3, 3).T + place, mesh.faces)
        parts.setdefault((body, colour), []).append(placed)
    return [BodyMesh(body, colour, merged(meshes)) for (body, colour), meshes in parts.items()]


def geom_colour(model: mujoco.MjModel, geom: int) -> Colour:
    """Return the colour of a geom: its own, else that of its material."""
    own, material = model.geom_rgba[geom], int(model.geom_matid[geom])
    plain = material >= 0 and (own == (0.5, 0.5, 0.5, 1.0)).all()
    red, green, blue, opacity = (model.mat_rgba[material] if plain else own).tolist()
    return red, green, blue, opacity


def geom_mesh(model: mujoco.MjModel, geom: int) -> Mesh | None:
    """Return the shape of a geom in its own frame; None for kinds that are not drawn."""
    kinds, kind = mujoco.mjtGeom, model.geom_type[geom]
    x, y, z = model.geom_size[geom].tolist()
    if kind == kinds.mjGEOM_MESH:
        number = int(model.geom_dataid[geom])
        first, count = int(model.mesh_vertadr[number]), int(model.mesh_vertnum[number])
        start, faces = int(model.mesh_faceadr[number]), int(model.mesh_facenum[number])
        # Each triangle has corners of its own: edges are sharp.
        corners = model.mesh_face[start : start + faces].ravel()
        vertices = model.mesh_vert[first : first + count][corners]
        return Mesh(vertices, np.arange(len(corners), dtype=np.uint32).reshape(-1, 3))
    if kind == kinds.mjGEOM_PLANE:
        x, y = x or ENDLESS, y or ENDLESS
        corners = np.array([(x, y, 0.0), (-x, y, 0.0), (-x, -y, 0.0), (x, -y, 0.0)]) - (0.0, 0.0, PLANE_DEPTH)
        return Mesh(corners, np.array([(0, 1, 2), (0, 2, 3)], dtype=np.uint32))
    if kind == kinds.mjGEOM_HFIELD:
        return _field(model, int(model.geom_dataid[geom]))
    if kind == kinds.mjGEOM_BOX:
        return box(x, y, z)
    if kind == kinds.mjGEOM_SPHERE:
        return ball(x, x, x)
    if kind == kinds.mjGEOM_ELLIPSOID:
        return ball(x, y, z)
    if kind == kinds.mjGEOM_CYLINDER:
        return lathe([(0.0, -y), (x, -y), (x, -y), (x, y), (x, y), (0.0, y)])
    if kind == kinds.mjGEOM_CAPSULE:
        end = [
            (x * math.cos(a), y + x * math.sin(a)) for a in np.linspace(0.0, 0.5, RINGS // 2 + 1) * math.pi
        ]
        return lathe([*((r, -h) for r, h in reversed(end)), *end])
    return None


def merged(meshes: Sequence[Mesh]) -> Mesh:
    """Return several meshes as one."""
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    faces = [mesh.faces + np.uint32(start) for mesh, start in zip(meshes, starts[:-1], strict=True)]
    vertices = np.concatenate([mesh.vertices for mesh in meshes])
    return Mesh(vertices, np.concatenate(faces).astype(np.uint32))


def normals(mesh: Mesh) -> Array:
    """Return the outward normal at each vertex, shape (n, 3): the mean of its triangles by their areas."""
    a, b, c = mesh.vertices[mesh.faces].transpose(1, 0, 2)
    found = np.zeros(mesh.vertices.shape)
    np.add.at(found, mesh.faces, np.cross(b - a, c - a)[:, None])
    unit: Array = found / np.maximum(np.linalg.norm(found, axis=1, keepdims=True), 1e-12)
    return unit


def box(x: float, y: float, z: float) -> Mesh:
    """Return a box of half sizes, m."""
    corners = np.array(list(itertools.product((-x, x), (-y, y), (-z, z))))
    sides = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
    first = 4 * np.arange(6, dtype=np.uint32)[:, None]  # each side has corners of its own: edges are sharp
    return Mesh(
        corners[np.ravel(sides)], np.concatenate([first + [0, 1, 2], first + [0, 2, 3]]).astype(np.uint32)
    )


def ball(*semi_axes: float) -> Mesh:
    """Return an ellipsoid, m."""
    angles = np.linspace(-0.5, 0.5, RINGS) * math.pi
    vertices, faces = lathe([(math.cos(angle), math.sin(angle)) for angle in angles])
    return Mesh(vertices * semi_axes, faces)


def lathe(profile: Sequence[tuple[float, float]]) -> Mesh:
    """Return what a profile, radius and height (m) of each point from below, makes around z; edges are points twice."""
    angle = math.tau * np.arange(SIDES) / SIDES
    circle = np.stack([np.cos(angle), np.sin(angle), np.ones(SIDES)], axis=1)
    vertices = np.concatenate([circle * (r, r, z) for r, z in profile])
    i = np.arange(SIDES)
    j = (i + 1) % SIDES
    below = SIDES * np.arange(len(profile) - 1)[:, None, None]
    quads = [np.stack([i, j, SIDES + j], axis=1), np.stack([i, SIDES + j, SIDES + i], axis=1)]
    faces = (below + np.concatenate(quads)).reshape(-1, 3)
    a, b, c = vertices[faces].transpose(1, 0, 2)
    return Mesh(vertices, faces[np.abs(np.cross(b - a, c - a)).max(axis=1) > 1e-12].astype(np.uint32))


def _field(model: mujoco.MjModel, number: int) -> Mesh:
    """Return the top of a height field."""
    rows, columns = int(model.hfield_nrow[number]), int(model.hfield_ncol[number])
    x, y, top, _ = model.hfield_size[number]
    first = int(model.hfield_adr[number])
    z = top * model.hfield_data[first : first + rows * columns].reshape(rows, columns)
    grid = np.broadcast_arrays(np.linspace(-x, x, columns)[None, :], np.linspace(-y, y, rows)[:, None], z)
    corner = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)[None, :]).ravel()
    right, left = (corner, corner + 1, corner + columns + 1), (corner, corner + columns + 1, corner + columns)
    faces = np.concatenate([np.stack(right, axis=1), np.stack(left, axis=1)]).astype(np.uint32)
    return Mesh(np.stack(grid, axis=-1).reshape(-1, 3), faces)
