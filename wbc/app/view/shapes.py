"""What a robot looks like: simple shapes and mesh files on its links, read from its description."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin

from wbc.core.errors import Array
from wbc.robots import RobotDescription
from wbc.robots.frames import carrier_link
from wbc.robots.urdf import moving_link_of

Colour = tuple[float, float, float, float]
"""Red, green, blue, opacity, each from 0 to 1."""

PLAIN: Colour = (0.78, 0.80, 0.83, 1.0)
"""Colour of what has none."""

MESH_FORMATS = (".stl", ".obj", ".dae")
"""Mesh files that the viewer's page can read."""


@dataclass(frozen=True)
class VisualBox:
    """A box of the given full extents, m."""

    size: tuple[float, float, float]


@dataclass(frozen=True)
class VisualEllipsoid:
    """An ellipsoid of the given semi-axes, m; a sphere when they are equal."""

    semi_axes: tuple[float, float, float]


@dataclass(frozen=True)
class VisualCylinder:
    """A cylinder along z, m; with round ends beyond its length, a capsule."""

    radius: float
    length: float
    round_ends: bool = False


@dataclass(frozen=True)
class MeshFile:
    """A mesh in a file, scaled."""

    path: str
    scale: tuple[float, float, float] = (1.0, 1.0, 1.0)


@dataclass(frozen=True, eq=False)
class Surface:
    """Triangles: vertices of shape (n, 3), m; faces of shape (m, 3); colours of the vertices, shape (n, 3), or None."""

    vertices: Array
    faces: np.ndarray[tuple[int, int], np.dtype[np.uint32]]
    colours: Array | None = None


Shape = VisualBox | VisualEllipsoid | VisualCylinder | MeshFile | Surface


@dataclass(frozen=True, eq=False)
class Part:
    """A shape on a body.

    Attributes:
        body: Link (or body of the simulator) that carries it.
        shape: The shape.
        colour: Its colour.
        placement: In the frame of the body, homogeneous, shape (4, 4), m.
    """

    body: str
    shape: Shape
    colour: Colour
    placement: Array


def robot_parts(description: RobotDescription) -> list[Part]:
    """Everything there is to draw of a robot.

    A link that moves shows its visual shapes; if none of them can be drawn (no visuals, a mesh that is not found),
    its collision shapes; if these cannot be drawn either, a stick figure of its joints.

    Args:
        description: The robot.

    Returns:
        Parts, at least one for each link that moves.
    """
    root = ElementTree.fromstring(description.urdf)
    colours = _named_colours(root)
    directories = tuple(Path(directory) for directory in description.package_dirs)
    moving = moving_link_of(root)
    parts: dict[str, list[Part]] = {body: [] for body in moving.values()}
    for tag in ("visual", "collision"):
        bare = [body for body, found in parts.items() if not found]
        for link in root.findall("link"):
            body = moving[str(link.get("name"))]
            if body in bare:
                for element in link.findall(tag):
                    parts[body] += _parts(str(link.get("name")), element, colours, directories)
    sticks = _sticks(description)
    return [part for body, found in parts.items() for part in found or sticks[body]]


def homogeneous(placement: pin.SE3) -> Array:
    """Return a placement as a matrix of shape (4, 4)."""
    return np.array(placement.homogeneous)


def sphere(radius: float) -> VisualEllipsoid:
    """Return a sphere."""
    return VisualEllipsoid((radius, radius, radius))


def _parts(
    link: str, element: ElementTree.Element, colours: dict[str, Colour], directories: tuple[Path, ...]
) -> list[Part]:
    """Return the part that a <visual> or <collision> describes, nothing if it cannot be drawn."""
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
    return [Part(link, shape, colour, _origin(element))]


def _shape(element: ElementTree.Element, directories: tuple[Path, ...]) -> Shape | None:
    if element.tag == "box":
        x, y, z = _numbers(element.get("size", "0 0 0"))
        return VisualBox((x, y, z))
    if element.tag == "sphere":
        return sphere(float(element.get("radius", "0")))
    if element.tag in ("cylinder", "capsule"):
        radius, length = float(element.get("radius", "0")), float(element.get("length", "0"))
        return VisualCylinder(radius, length, round_ends=element.tag == "capsule")
    if element.tag == "mesh":
        path = _find(element.get("filename", ""), directories)
        if path is not None and path.suffix.lower() in MESH_FORMATS:
            x, y, z = _numbers(element.get("scale", "1 1 1"))
            return MeshFile(str(path), (x, y, z))
    return None


def _find(filename: str, directories: tuple[Path, ...]) -> Path | None:
    """Return the file behind a URDF's name for it; None if it is not there."""
    name = filename.removeprefix("package://").removeprefix("file://")
    tail = name.split("/", 1)[-1]
    candidates = [Path(name), *(directory / part for directory in directories for part in (name, tail))]
    return next((path for path in candidates if path.is_file()), None)


def _named_colours(root: ElementTree.Element) -> dict[str, Colour]:
    """Colours of materials that are defined once and used by name."""
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
    values = [min(max(value, 0.0), 1.0) for value in _numbers(element.get("rgba", ""))]
    return (values[0], values[1], values[2], values[3]) if len(values) == 4 else None


def _origin(element: ElementTree.Element) -> Array:
    origin = element.find("origin")
    if origin is None:
        return np.eye(4)
    rotation = pin.rpy.rpyToMatrix(*_numbers(origin.get("rpy", "0 0 0")))
    return homogeneous(pin.SE3(rotation, np.array(_numbers(origin.get("xyz", "0 0 0")))))


def _numbers(text: str) -> list[float]:
    return [float(part) for part in text.split()]


def _sticks(description: RobotDescription) -> dict[str, list[Part]]:
    """A ball at the joint of each moving link, a rod to each joint below it, and the soles as plates."""
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
                parts.append(
                    Part(
                        body, VisualBox((sole.length, sole.width, 0.8 * thickness)), PLAIN, homogeneous(plate)
                    )
                )
        parts += [_rod(body, end, thickness) for end in ends if np.linalg.norm(end) > thickness]
        sticks[body] = parts
    return sticks


def _rod(body: str, end: Array, thickness: float) -> Part:
    length = float(np.linalg.norm(end))
    turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), end / length).matrix()
    return Part(body, VisualCylinder(thickness, length), PLAIN, homogeneous(pin.SE3(turn, 0.5 * end)))
