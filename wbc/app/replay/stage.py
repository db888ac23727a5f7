"""The scene of a replay as a MuJoCo model, for films: bodies are moved by hand, nothing is simulated."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from wbc.app.replay.replay import Replay
from wbc.app.view.scene import ROOT, TILE, TILE_COLOURS, SceneObject
from wbc.app.view.shapes import Colour, MeshFile, Shape, Surface, VisualBox, VisualCylinder, VisualEllipsoid
from wbc.core.errors import Array, InputError
from wbc.sim.terrain import add_to_spec

READABLE = (".stl", ".obj")
"""Mesh files that MuJoCo reads itself; others are read by coal."""

_T = mujoco.mjtGeom


class Stage:
    """A model with a body for each thing that moves.

    Attributes:
        model: MuJoCo's model.
        data: Its state.
        shown: Paths whose bodies it has: those of the robot and what the overlays move.
    """

    def __init__(self, replay: Replay, width: int, height: int) -> None:
        """Build it.

        Args:
            replay: What is shown.
            width: Of the pictures, pixels.
            height: Of the pictures, pixels.
        """
        spec = mujoco.MjSpec()
        _light(spec, width, height)
        added = add_to_spec(spec, replay.plant.terrain)
        spec.geom(added.geoms[0]).material = "tiles"
        scene = replay.scene
        bodies = scene.moving[: len(scene.bodies)]
        overlays = tuple(path for path in replay.overlays.moving if not path.startswith(f"{ROOT}/markers/"))
        self.shown = (*bodies, *overlays)
        self._places = [replay.moving.index(path) for path in self.shown]
        owners = {path: spec.worldbody.add_body(name=path, mocap=True) for path in self.shown}
        for i, drawing in enumerate(scene.drawings):
            if drawing.path.startswith((f"{ROOT}/ground/", f"{ROOT}/markers/", f"{ROOT}/forces/")):
                continue
            owner = next((owners[p] for p in self.shown if drawing.path.startswith(p + "/")), spec.worldbody)
            _add(spec, owner, drawing, i)
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        body_of = {self.model.body(path).id: path for path in self.shown}
        owner = [body_of.get(int(body)) for body in self.model.geom_bodyid]
        self._soles = [[i for i, path in enumerate(owner) if path in paths] for paths in replay.sole_paths]

    def set(self, matrices: Array, sole_colours: Sequence[Colour] = ()) -> None:
        """Move everything, and colour the soles.

        Args:
            matrices: Of all paths that move, as `Replay.frame` gives them, shape (paths, 4, 4).
            sole_colours: As `Replay.sole_colours` gives them.
        """
        for geoms, colour in zip(self._soles, sole_colours, strict=False):
            self.model.geom_rgba[geoms] = colour
        for body, place in enumerate(self._places):
            matrix = matrices[place]
            there = np.linalg.norm(matrix[:3, 0]) > 0.5  # what is not there is scaled to nothing
            self.data.mocap_pos[body] = matrix[:3, 3] if there else (0.0, 0.0, -100.0)
            if there:
                mujoco.mju_mat2Quat(self.data.mocap_quat[body], np.ascontiguousarray(matrix[:3, :3]).ravel())
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_camlight(self.model, self.data)


def _light(spec: mujoco.MjSpec, width: int, height: int) -> None:
    """Lamps, sky and the size of the pictures."""
    spec.visual.global_.offwidth, spec.visual.global_.offheight = width, height
    spec.visual.headlight.ambient = [0.35, 0.35, 0.35]
    spec.visual.headlight.diffuse = [0.45, 0.45, 0.45]
    spec.visual.headlight.specular = [0.1, 0.1, 0.1]
    spec.visual.quality.shadowsize = 2048
    spec.visual.map.zfar = 40.0
    spec.add_texture(
        name="sky",
        type=mujoco.mjtTexture.mjTEXTURE_SKYBOX,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT,
        rgb1=[0.95, 0.97, 1.0],
        rgb2=[0.72, 0.78, 0.84],
        width=256,
        height=256,
    )
    spec.add_texture(
        name="tiles",
        type=mujoco.mjtTexture.mjTEXTURE_2D,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_CHECKER,
        rgb1=TILE_COLOURS[0],
        rgb2=TILE_COLOURS[1],
        width=256,
        height=256,
    )
    tiles = spec.add_material(name="tiles", texuniform=True, texrepeat=[0.5 / TILE, 0.5 / TILE])
    tiles.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = "tiles"
    spec.worldbody.add_light(
        pos=[0.0, -3.0, 6.0],
        dir=[0.1, 0.4, -1.0],
        type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL,
        diffuse=[0.45, 0.45, 0.45],
        castshadow=True,
    )


def _add(spec: mujoco.MjSpec, body: Any, drawing: SceneObject, number: int) -> None:
    """Add a geom for an object."""
    rotation = np.zeros(4)
    mujoco.mju_mat2Quat(rotation, np.ascontiguousarray(drawing.placement[:3, :3]).ravel())
    geom = body.add_geom(
        pos=drawing.placement[:3, 3],
        quat=rotation,
        rgba=drawing.colour,
        contype=0,
        conaffinity=0,
        group=0,
        mass=0.0,
    )
    shape = drawing.shape
    if isinstance(shape, VisualBox):
        geom.type, geom.size = _T.mjGEOM_BOX, np.array(shape.size) / 2.0
    elif isinstance(shape, VisualEllipsoid):
        geom.type, geom.size = _T.mjGEOM_ELLIPSOID, np.array(shape.semi_axes)
    elif isinstance(shape, VisualCylinder):
        geom.type = _T.mjGEOM_CAPSULE if shape.round_ends else _T.mjGEOM_CYLINDER
        geom.size = np.array([shape.radius, 0.5 * shape.length, 0.0])
    else:
        geom.type, geom.meshname = _T.mjGEOM_MESH, f"mesh_{number}"
        _add_mesh(spec, f"mesh_{number}", shape)


def _add_mesh(spec: mujoco.MjSpec, name: str, shape: Shape) -> None:
    # Surfaces need not be closed: their inertia is of no use here, but MuJoCo wants one.
    mesh = spec.add_mesh(name=name, inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL)
    if isinstance(shape, MeshFile):
        mesh.scale = np.array(shape.scale)
        if Path(shape.path).suffix.lower() in READABLE:
            mesh.file = shape.path
            return
        vertices, faces = read_mesh(shape.path)
    elif isinstance(shape, Surface):
        vertices, faces = shape.vertices, shape.faces
    else:
        raise InputError(f"a {type(shape).__name__} cannot be filmed")
    mesh.uservert = np.asarray(vertices, dtype=np.float64).ravel()
    mesh.userface = np.asarray(faces, dtype=np.int32).ravel()


def read_mesh(path: str) -> tuple[Array, Any]:
    """Vertices and triangles of a mesh file of any kind that assimp reads."""
    import coal  # noqa: PLC0415 - for COLLADA alone

    model = coal.MeshLoader().load(path, np.ones(3))
    faces = [[model.tri_indices(i)[k] for k in range(3)] for i in range(model.num_tris)]
    return np.array(model.vertices()), np.array(faces)
