"""MuJoCo model of a scene, for films: its bodies are moved, nothing is simulated."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from wbc.app.scene.colours import TILE_COLOURS
from wbc.app.scene.ground import TILE
from wbc.app.scene.robot_shapes import read_mesh
from wbc.app.scene.scene import Scene
from wbc.app.scene.shapes import ROOT, Colour, MeshFile, SceneObject
from wbc.core.errors import Array
from wbc.sim.terrain.render import FLOOR, add_to_spec
from wbc.sim.terrain.spec import Terrain

READABLE = (".stl", ".obj")
"""Mesh formats that MuJoCo reads; coal reads the others."""

FORCES, MARKERS = f"{ROOT}/forces/", f"{ROOT}/markers/"
"""Objects that films draw as arrows of the picture, not of the model; and objects that lie on the ground."""

MARKER_LIFT = 0.006
"""Height of markers above where they are in the page, which draws them over everything, m."""

_STAGE = """
<mujoco>
  <visual>
    <global offwidth="{width}" offheight="{height}"/>
    <headlight ambient="0.35 0.35 0.35" diffuse="0.45 0.45 0.45" specular="0.1 0.1 0.1"/>
    <quality shadowsize="2048"/> <map zfar="40"/>
  </visual>
  <asset>
    <texture type="skybox" builtin="gradient" rgb1="0.95 0.97 1" rgb2="0.72 0.78 0.84" width="256" height="256"/>
    <texture name="tiles" type="2d" builtin="checker" rgb1="{light}" rgb2="{dark}" width="256" height="256"/>
    <material name="tiles" texture="tiles" texuniform="true" texrepeat="{repeat} {repeat}"/>
  </asset>
  <worldbody>
    <light directional="true" pos="0 -3 6" dir="0.1 0.4 -1" diffuse="0.45 0.45 0.45" castshadow="true"/>
  </worldbody>
</mujoco>
"""
"""Lamps, sky and tiles, and the size of the pictures."""


class MujocoScene:
    """A model with a body for each moving object.

    Attributes:
        model: MuJoCo's model.
        data: Its state.
        shown: Paths of its bodies: those of the robot and of the overlays.
    """

    def __init__(
        self,
        scene: Scene,
        terrain: Terrain,
        width: int,
        height: int,
        sole_paths: Sequence[tuple[str, ...]] = (),
    ) -> None:
        """Build the model for pictures of a size in pixels; `sole_paths` are those of feet whose colour can change."""
        light, dark = (" ".join(map(str, colour)) for colour in TILE_COLOURS)
        stage = _STAGE.format(width=width, height=height, light=light, dark=dark, repeat=0.5 / TILE)
        spec = mujoco.MjSpec.from_string(stage)
        add_to_spec(spec, terrain)
        spec.geom(FLOOR).material = "tiles"
        self.shown = tuple(path for path in scene.moving if not path.startswith(FORCES))
        self._places = [scene.moving.index(path) for path in self.shown]
        owners = {path: spec.worldbody.add_body(name=path, mocap=True) for path in self.shown}
        for i, thing in enumerate(scene.objects):
            if thing.path.startswith((f"{ROOT}/ground/", FORCES)):
                continue
            owner = next((owners[p] for p in self.shown if thing.path.startswith(p + "/")), spec.worldbody)
            _add(spec, owner, thing, i)
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        body_of = {self.model.body(path).id: path for path in self.shown}
        owner = [body_of.get(int(body)) for body in self.model.geom_bodyid]
        self._soles = [[i for i, path in enumerate(owner) if path in paths] for paths in sole_paths]

    def set(self, matrices: Array, sole_colours: Sequence[Colour] = ()) -> None:
        """Move all bodies, shape (paths, 4, 4) of the scene's moving paths, and colour the soles of each foot."""
        for geoms, colour in zip(self._soles, sole_colours, strict=False):
            self.model.geom_rgba[geoms] = colour
        for body, place in enumerate(self._places):
            matrix = matrices[place]
            shown = np.linalg.norm(matrix[:3, 0]) > 0.5  # hidden objects are scaled to nothing
            self.data.mocap_pos[body] = matrix[:3, 3] if shown else (0.0, 0.0, -100.0)
            if shown:
                mujoco.mju_mat2Quat(self.data.mocap_quat[body], np.ascontiguousarray(matrix[:3, :3]).ravel())
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_camlight(self.model, self.data)


def _add(spec: mujoco.MjSpec, body: Any, thing: SceneObject, number: int) -> None:
    """Add a geom for an object."""
    rotation = np.zeros(4)
    mujoco.mju_mat2Quat(rotation, np.ascontiguousarray(thing.placement[:3, :3]).ravel())
    lift = MARKER_LIFT if thing.path.startswith(MARKERS) else 0.0
    geom = body.add_geom(
        pos=thing.placement[:3, 3] + (0.0, 0.0, lift),
        quat=rotation,
        rgba=thing.colour,
        contype=0,
        conaffinity=0,
        group=0,
        mass=0.0,
    )
    geom.type, geom.meshname, shape = mujoco.mjtGeom.mjGEOM_MESH, f"mesh_{number}", thing.shape
    # Surfaces need not be closed: MuJoCo wants an inertia although nothing is simulated.
    mesh = spec.add_mesh(name=geom.meshname, inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL)
    if isinstance(shape, MeshFile):
        mesh.scale = np.array(shape.scale)
        if Path(shape.path).suffix.lower() in READABLE:
            mesh.file = shape.path
            return
        vertices, faces = read_mesh(shape.path)
    else:
        vertices, faces = shape.vertices, shape.faces
    mesh.uservert = np.asarray(vertices, dtype=np.float64).ravel()
    mesh.userface = np.asarray(faces, dtype=np.int32).ravel()
