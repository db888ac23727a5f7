"""Robots of solid primitive shapes, written as URDF: mass and inertia of each link are those of its shapes."""

from __future__ import annotations

import functools
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias
from xml.etree import ElementTree

import numpy as np

from wbc.core.errors import Array
from wbc.robots.frames import Triple

Axis: TypeAlias = Literal["x", "y", "z"]

WHITE, GREY, DARK = "0.92 0.93 0.95 1", "0.55 0.58 0.62 1", "0.15 0.17 0.20 1"


@dataclass(frozen=True)
class Solid:
    """A solid of uniform density.

    Attributes:
        kind: "box", "cylinder" or "sphere".
        size: Edges x, y, z; radius and length; or radius; m.
        at: Centre in the link frame, m.
        axis: Axis of a cylinder, "x", "y" or "z".
        colour: Red, green, blue, alpha.
    """

    kind: Literal["box", "cylinder", "sphere"]
    size: tuple[float, ...]
    at: Triple = (0.0, 0.0, 0.0)
    axis: Axis = "z"
    colour: str = WHITE

    @property
    def volume(self) -> float:
        """Volume, m³."""
        if self.kind == "box":
            return math.prod(self.size)
        if self.kind == "cylinder":
            return math.pi * self.size[0] ** 2 * self.size[1]
        return 4.0 / 3.0 * math.pi * self.size[0] ** 3

    @property
    def variances(self) -> Array:
        """Second moments about the centre per unit of mass, along x, y, z of the link, shape (3,), m²."""
        if self.kind == "box":
            return np.array(self.size) ** 2 / 12.0
        if self.kind == "cylinder":
            along = ["x", "y", "z"].index(self.axis)
            values = np.full(3, self.size[0] ** 2 / 4.0)
            values[along] = self.size[1] ** 2 / 12.0
            return values
        return np.full(3, self.size[0] ** 2 / 5.0)


box = functools.partial(Solid, "box")
cylinder = functools.partial(Solid, "cylinder")
sphere = functools.partial(Solid, "sphere")


class Link:
    """A link: its share of the mass, kg, spread evenly over its shapes."""

    def __init__(self, name: str, mass: float, *shapes: Solid) -> None:
        self.name, self.mass, self.shapes = name, mass, shapes


@dataclass(frozen=True)
class Joint:
    """A revolute joint between links.

    Attributes:
        name: Its name.
        parent: Parent link.
        child: Child link.
        at: Origin in the parent frame, m.
        axis: "x", "y" or "z".
        range: Lower and upper position limit, degrees.
        velocity: Largest speed, rad/s.
        torque: Largest torque, Nm.
    """

    name: str
    parent: str
    child: str
    at: Triple
    axis: Axis
    range: tuple[float, float]
    velocity: float
    torque: float


def serial_chain(
    side: str, parent: str, *rows: tuple[str, str, Triple, Axis, tuple[float, float], float, float]
) -> list[Joint]:
    """Return joints in series from a parent link on, each fixed to the child of the one before; rows are as `Joint`."""
    joints = []
    for name, child, at, axis, span, velocity, torque in rows:
        joints.append(Joint(f"{side}_{name}", parent, f"{side}_{child}", at, axis, span, velocity, torque))
        parent = f"{side}_{child}"
    return joints


def to_urdf(name: str, links: Sequence[Link], joints: Iterable[Joint], mass: float) -> str:
    """Return a robot as URDF, without meshes; the masses of its links are scaled so that they sum up to `mass`, kg."""
    scale = mass / sum(link.mass for link in links)
    root = ElementTree.Element("robot", name=name)
    for link in links:
        _add_link(root, link, scale)
    for joint in joints:
        element = ElementTree.SubElement(root, "joint", name=joint.name, type="revolute")
        ElementTree.SubElement(element, "parent", link=joint.parent)
        ElementTree.SubElement(element, "child", link=joint.child)
        ElementTree.SubElement(element, "origin", xyz=_text(joint.at), rpy="0 0 0")
        ElementTree.SubElement(element, "axis", xyz=_text([float(axis == joint.axis) for axis in "xyz"]))
        low, high = np.radians(joint.range)
        ElementTree.SubElement(
            element,
            "limit",
            lower=f"{low:.6g}",
            upper=f"{high:.6g}",
            velocity=f"{joint.velocity:g}",
            effort=f"{joint.torque:g}",
        )
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode")


def _add_link(root: ElementTree.Element, link: Link, scale: float) -> None:
    """Add a link with the mass, centre of mass and inertia of its shapes."""
    mass = link.mass * scale
    volumes = np.array([shape.volume for shape in link.shapes])
    masses = mass * volumes / volumes.sum()
    centres = np.array([shape.at for shape in link.shapes])
    com = masses @ centres / mass
    arms = centres - com
    moments = np.diag(masses @ np.array([shape.variances for shape in link.shapes]))
    moments += np.einsum("k,ki,kj->ij", masses, arms, arms)
    inertia = np.trace(moments) * np.eye(3) - moments

    element = ElementTree.SubElement(root, "link", name=link.name)
    inertial = ElementTree.SubElement(element, "inertial")
    ElementTree.SubElement(inertial, "origin", xyz=_text(com), rpy="0 0 0")
    ElementTree.SubElement(inertial, "mass", value=f"{mass:.9g}")
    entries = {f"i{'xyz'[i]}{'xyz'[j]}": f"{inertia[i, j]:.9g}" for i in range(3) for j in range(i, 3)}
    ElementTree.SubElement(inertial, "inertia", entries)
    turned = {"x": "0 1.5707963267948966 0", "y": "1.5707963267948966 0 0", "z": "0 0 0"}
    for tag in ("visual", "collision"):
        for shape in link.shapes:
            outer = ElementTree.SubElement(element, tag)
            ElementTree.SubElement(outer, "origin", xyz=_text(shape.at), rpy=turned[shape.axis])
            geometry = ElementTree.SubElement(outer, "geometry")
            if shape.kind == "box":
                ElementTree.SubElement(geometry, "box", size=_text(shape.size))
            elif shape.kind == "cylinder":
                radius, length = shape.size
                ElementTree.SubElement(geometry, "cylinder", radius=f"{radius:g}", length=f"{length:g}")
            else:
                ElementTree.SubElement(geometry, "sphere", radius=f"{shape.size[0]:g}")
            if tag == "visual":
                # Viewers share materials by name: one name for each colour.
                colour_name = {WHITE: "white", GREY: "grey", DARK: "dark"}[shape.colour]
                material = ElementTree.SubElement(outer, "material", name=colour_name)
                ElementTree.SubElement(material, "color", rgba=shape.colour)


def _text(values: Array | list[float] | tuple[float, ...]) -> str:
    return " ".join(f"{float(value):.9g}" for value in values)
