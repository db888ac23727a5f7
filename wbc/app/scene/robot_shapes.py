"""Shapes of a robot's links: simple shapes and mesh files from its URDF, or a stick figure."""

from __future__ import annotations

from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin

from wbc.app.scene.colours import PLAIN
from wbc.app.scene.shapes import Colour, MeshFile, Part, Shape, box, cylinder, sphere
from wbc.core.errors import Array
from wbc.robots import RobotDescription
from wbc.robots.derivation.soles import numbers, origin_of
from wbc.robots.frames import carrier_link
from wbc.robots.urdf import moving_link_of

MESH_FORMATS = (".stl", ".obj", ".dae")
"""Mesh formats that the viewer's page can read."""


def robot_parts(description: RobotDescription) -> list[Part]:
    """Return the shapes of a robot, at least one for each moving link.

    A link has its visual shapes; if none of them can be drawn (no visuals, a mesh that is not found), its collision
    shapes; if these cannot be drawn either, a stick figure of its joints.
    """
    root = ElementTree.fromstring(description.urdf)
    colours = _named_colours(root)
    directories = tuple(Path(directory) for directory in description.package_dirs)
    moving = moving_link_of(root)
    parts: dict[str, list[Part]] = {body: [] for body in moving.values()}
    for tag in ("visual", "collision"):
        bare = [body for body, shapes in parts.items() if not shapes]
        for link in root.findall("link"):
            body = moving[str(link.get("name"))]
            if body in bare:
                for element in link.findall(tag):
                    parts[body] += _parts(str(link.get("name")), element, colours, directories)
    sticks = _sticks(description)
    return [part for body, shapes in parts.items() for part in shapes or sticks[body]]


def read_mesh(path: str) -> tuple[Array, Any]:
    """Return vertices and triangles of a mesh file of any format that assimp reads."""
    import coal  # noqa: PLC0415 - for COLLADA alone

    model = coal.MeshLoader().load(path, np.ones(3))
    faces = [[model.tri_indices(i)[k] for k in range(3)] for i in range(model.num_tris)]
    return np.array(model.vertices()), np.array(faces)


def _parts(
    link: str, element: ElementTree.Element, colours: dict[str, Colour], directories: tuple[Path, ...]
) -> list[Part]:
    """Return the part in a <visual> or <collision>; empty if it cannot be drawn."""
    geometry = element.find("geometry")
    if geometry is None or not len(geometry):
        return []
    shape = _shape(geometry[0], directories)
    if shape is None:
        return []
    material = element.find("material")
    colour = PLAIN
    if material is not None:
        colour = _colour(material) or colours.get(str(material.get("name")), PLAIN)
    return [Part(link, shape, colour, np.array(origin_of(element).homogeneous))]


def _shape(element: ElementTree.Element, directories: tuple[Path, ...]) -> Shape | None:
    if element.tag == "box":
        x, y, z = numbers(element.get("size", "0 0 0"))
        return box(x, y, z)
    if element.tag == "sphere":
        return sphere(float(element.get("radius", "0")))
    if element.tag in ("cylinder", "capsule"):
        radius, length = float(element.get("radius", "0")), float(element.get("length", "0"))
        return cylinder(radius, length, round_ends=element.tag == "capsule")
    if element.tag == "mesh":
        path = _find(element.get("filename", ""), directories)
        if path is not None and path.suffix.lower() in MESH_FORMATS:
            x, y, z = numbers(element.get("scale", "1 1 1"))
            return MeshFile(str(path), (x, y, z))
    return None


def _find(filename: str, directories: tuple[Path, ...]) -> Path | None:
    """Return the file with a name in a URDF; None if it does not exist."""
    name = filename.removeprefix("package://").removeprefix("file://")
    tail = name.split("/", 1)[-1]
    candidates = [Path(name), *(directory / part for directory in directories for part in (name, tail))]
    return next((path for path in candidates if path.is_file()), None)


def _named_colours(root: ElementTree.Element) -> dict[str, Colour]:
    """Return the colours of materials that are defined once and used by name."""
    named: dict[str, Colour] = {}
    for material in root.iter("material"):
        colour = _colour(material)
        if colour is not None and material.get("name"):
            named.setdefault(str(material.get("name")), colour)
    return named


def _colour(material: ElementTree.Element) -> Colour | None:
    element = material.find("color")
    if element is None:
        return None
    values = [min(max(value, 0.0), 1.0) for value in numbers(element.get("rgba", ""))]
    return (values[0], values[1], values[2], values[3]) if len(values) == 4 else None


def _sticks(description: RobotDescription) -> dict[str, list[Part]]:
    """Return a ball at the joint of each moving link, a rod to each joint below it, and the soles as plates."""
    model = description.pinocchio_model()
    robot = description.robot()
    thickness = 0.03 * float(robot.com[2])
    sticks: dict[str, list[Part]] = {}
    for joint in range(1, model.njoints):
        body = carrier_link(model, joint)
        ends = [np.array(model.jointPlacements[child].translation) for child in model.children[joint]]
        parts = [Part(body, sphere(1.3 * thickness), PLAIN, np.eye(4))]
        for sole in description.soles:
            frame = model.frames[model.getFrameId(sole.frame)]
            if frame.parentJoint == joint:
                ends.append(np.array(frame.placement.translation))
                plate = frame.placement * pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.4 * thickness]))
                shape = box(sole.length, sole.width, 0.8 * thickness)
                parts.append(Part(body, shape, PLAIN, np.array(plate.homogeneous)))
        parts += [_rod(body, end, thickness) for end in ends if np.linalg.norm(end) > thickness]
        sticks[body] = parts
    return sticks


def _rod(body: str, end: Array, thickness: float) -> Part:
    length = float(np.linalg.norm(end))
    turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), end / length).matrix()
    placement = np.array(pin.SE3(turn, 0.5 * end).homogeneous)
    return Part(body, cylinder(thickness, length), PLAIN, placement)
