"""Shapes of a robot's links: those by which it is drawn, which touch nothing, and those with which it touches a scene.

A link is drawn by its visual shapes; if none of them can be read (no visuals, a mesh that is not found), by its
collision shapes; if these cannot be read either, as a stick figure of its joints.
"""

from __future__ import annotations

import logging
from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin

from wbc.base.numbers import Array
from wbc.core.robot import Robot
from wbc.feet.soles.build_mjcf import VISUAL_GROUP
from wbc.robots.derivation.link_shapes import link_shapes
from wbc.robots.description import RobotDescription
from wbc.robots.frames import carrier_link
from wbc.robots.mechanism import Colour, Geometry, along, placed
from wbc.robots.mesh_files import read_mesh, resolve
from wbc.sim.scenes.base import GEOMS
from wbc.sim.terrain.render import FLOOR

_log = logging.getLogger(__name__)

PLAIN: Colour = (0.78, 0.80, 0.83, 1.0)
"""Colour of links without one."""

MESH = "visual:"
"""Beginning of the names of the robot's meshes, after the prefix of a robot among others."""

SHAPE_GROUP = 3
"""Geom group of these shapes: viewers do not show it, and range sensors do not see it."""

SHELL = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
"""Inertia of meshes whose surfaces need not be closed."""

HAND_RADIUS = 0.03
"""Radius of the ball at a hand without geometry, m."""

STL_HEADER, STL_TRIANGLE = 84, 50
"""Bytes of a binary STL before its triangles, and of each."""


def add_visuals(spec: mujoco.MjSpec, description: RobotDescription, robot: Robot) -> None:
    """Add the visual geoms of a robot to its bodies; robots of the same meshes share them."""
    model = robot.model
    moving = {str(f.name): f.parentJoint for f in model.frames if f.type == pin.FrameType.BODY}
    drawn: set[int] = set()
    shapes = description.mechanism.shapes
    for role in ("visual", "collision"):
        bare = {*moving.values()} - drawn
        for shape in shapes:
            body = spec.body(shape.link)
            if shape.role != role or moving[shape.link] not in bare or body is None:
                continue
            if _add_shape(spec, body, shape, description.package_dirs):
                drawn.add(moving[shape.link])
    _add_sticks(spec, description, robot, drawn)


def add_stage(spec: mujoco.MjSpec) -> None:
    """Add sky and lamp, and tiles on the floor."""
    kinds, patterns = mujoco.mjtTexture, mujoco.mjtBuiltin
    for name, kind, pattern, one, other in (
        ("sky", kinds.mjTEXTURE_SKYBOX, patterns.mjBUILTIN_GRADIENT, [0.95, 0.97, 1.0], [0.72, 0.78, 0.84]),
        ("tiles", kinds.mjTEXTURE_2D, patterns.mjBUILTIN_CHECKER, [0.80, 0.82, 0.83], [0.86, 0.875, 0.885]),
    ):
        spec.add_texture(name=name, type=kind, builtin=pattern, rgb1=one, rgb2=other, width=256, height=256)
    tiles = spec.add_material(name="tiles", texuniform=True, texrepeat=[1.0, 1.0])  # of 0.5 m
    tiles.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = "tiles"
    floor = spec.geom(FLOOR)
    floor.material, floor.rgba = "tiles", (0.85, 0.87, 0.88, 1.0)
    spec.worldbody.add_light(
        type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL,
        pos=[0.0, -3.0, 6.0],
        dir=[0.1, 0.4, -1.0],
        diffuse=[0.45] * 3,
        castshadow=True,
    )
    lamp = spec.visual.headlight
    lamp.ambient, lamp.diffuse, lamp.specular = [0.35] * 3, [0.45] * 3, [0.1] * 3
    quality = spec.visual.quality
    quality.shadowsize, quality.numslices, quality.numstacks = 2048, 16, 10
    spec.visual.map.zfar = 40.0


def add_body_shapes(spec: mujoco.MjSpec, description: RobotDescription, robot: Robot) -> None:
    """Let all links but the feet touch things and the ground, not each other; each hand has a site in the model."""
    feet = {description.attachment(sole.frame)[0] for sole in description.soles}
    shaped = set()
    for shape in link_shapes(description.mechanism, description.package_dirs):
        body = spec.body(shape.link)
        if body is None or description.attachment(shape.link)[0] in feet:
            continue
        shaped.add(description.attachment(shape.link)[0])
        _add_body_shape(spec, body, shape)
    for role, frame in robot.frames.items():
        if description.attachment(frame)[0] not in shaped:
            site = spec.site(f"{role} site")
            ball = Geometry(frame, "collision", "sphere", np.array([HAND_RADIUS]), along(site.pos))
            _add_body_shape(spec, site.parent, ball)


def _add_body_shape(spec: mujoco.MjSpec, body: mujoco.MjsBody, shape: Geometry) -> None:
    """Add a shape that touches things: of a mesh its convex hull, and the box around it where it is flat."""
    clear = (0.0, 0.0, 0.0, 0.0)
    if shape.corners is None:
        geom = add_visual(body, GEOMS[shape.kind], shape.size.tolist(), shape.place, clear)
    else:
        name = f"hull:{len(spec.meshes)}"
        spec.add_mesh(name=name, uservert=shape.corners.ravel(), inertia=SHELL)
        geom = add_visual(body, mujoco.mjtGeom.mjGEOM_MESH, (), pin.SE3.Identity(), clear)
        geom.meshname = name
    geom.group, geom.conaffinity = SHAPE_GROUP, 1  # not with each other


def drop_meshes(spec: mujoco.MjSpec) -> bool:
    """Take the visual meshes of files away; False if there are none."""
    named = [mesh for mesh in spec.meshes if MESH in mesh.name]
    for geom in [geom for geom in spec.geoms if MESH in geom.meshname]:
        spec.delete(geom)
    for mesh in named:
        spec.delete(mesh)
    return bool(named)


def _add_shape(
    spec: mujoco.MjSpec, body: mujoco.MjsBody, shape: Geometry, package_dirs: tuple[str, ...]
) -> bool:
    """Add the geom of a shape; False if it cannot be read."""
    colour = shape.colour or PLAIN
    if shape.kind == "mesh":
        path = resolve(shape.file, package_dirs)
        mesh = None if path is None else _mesh(spec, path, shape.size)
        if mesh is None:
            return False
        add_visual(body, mujoco.mjtGeom.mjGEOM_MESH, (), shape.place, colour).meshname = mesh
        return True
    if not (shape.size > 0.0).all():
        return False
    add_visual(body, GEOMS[shape.kind], shape.size.tolist(), shape.place, colour)
    return True


def add_visual(
    body: mujoco.MjsBody,
    kind: mujoco.mjtGeom,
    size: tuple[float, ...] | list[float],
    place: pin.SE3,
    colour: Colour,
) -> mujoco.MjsGeom:
    """Add a geom that touches nothing to a body: MuJoCo's kind and half sizes, place in the body, colour."""
    return body.add_geom(
        type=kind,
        size=[*size, *[0.0] * (3 - len(size))],
        **placed(place),
        mass=0.0,
        group=VISUAL_GROUP,
        contype=0,
        conaffinity=0,
        rgba=colour,
    )


def _mesh(spec: mujoco.MjSpec, path: Path, scale: Array) -> str | None:
    """Return the name of a mesh asset of a file, added once for each scale; None for a file that cannot be read."""
    name = f"{MESH}{path}:{' '.join(map(str, scale))}"
    if spec.mesh(name) is not None:
        return name
    options = {"scale": scale, "inertia": SHELL}
    if path.suffix.lower() == ".obj" or _binary_stl(path):
        spec.add_mesh(name=name, file=str(path.resolve()), **options)
    elif (found := read_mesh(path)) is not None:  # a format that MuJoCo does not read
        vertices, mesh = found
        faces = [[each[k] for k in range(3)] for each in map(mesh.tri_indices, range(mesh.num_tris))]
        spec.add_mesh(
            name=name, uservert=vertices.ravel(), userface=np.ravel(faces).astype(np.int32), **options
        )
    else:
        _log.warning("%s is not drawn: it cannot be read", path)
        return None
    return name


def _binary_stl(path: Path) -> bool:
    """Return true for the STL that MuJoCo reads."""
    if path.suffix.lower() != ".stl":
        return False
    with path.open("rb") as file:
        count = int.from_bytes(file.read(STL_HEADER)[-4:], "little")
    return path.stat().st_size == STL_HEADER + STL_TRIANGLE * count


def _add_sticks(spec: mujoco.MjSpec, description: RobotDescription, robot: Robot, drawn: set[int]) -> None:
    """Add to each link that is not drawn a ball at its joint, a rod to each joint below, and the soles as plates."""
    model, kinds = robot.model, mujoco.mjtGeom
    thickness = 0.03 * float(robot.com[2])
    for joint in range(1, model.njoints):
        name = carrier_link(model, joint)
        body = spec.body(name)
        if joint in drawn or body is None:
            continue
        ends = [np.array(model.jointPlacements[child].translation) for child in model.children[joint]]
        add_visual(body, kinds.mjGEOM_SPHERE, [1.3 * thickness], pin.SE3.Identity(), PLAIN)
        for sole in description.soles:
            frame = model.frames[model.getFrameId(sole.frame)]
            if frame.parentJoint == joint:
                ends.append(np.array(frame.placement.translation))
                plate = frame.placement * pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.4 * thickness]))
                size = [0.5 * sole.length, 0.5 * sole.width, 0.4 * thickness]
                add_visual(body, kinds.mjGEOM_BOX, size, plate, PLAIN)
        for end in ends:
            length = float(np.linalg.norm(end))
            if length > thickness:
                turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), end / length).matrix()
                size = [thickness, 0.5 * length]
                add_visual(body, kinds.mjGEOM_CYLINDER, size, pin.SE3(turn, 0.5 * end), PLAIN)
