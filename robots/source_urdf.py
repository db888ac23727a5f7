"""A URDF as the source of a robot; Pinocchio's own reader makes its model."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin

from wbc.base.errors import ModelError, shown
from wbc.base.numbers import Array
from wbc.core.robot import Coupling
from wbc.robots import tidying, urdf
from wbc.robots.source import Element, Geometry, Inertial, Source, checked_limits
from wbc.robots.urdf import ENDLESS, MOVING

HEAVIEST = 1e6
"""Largest mass, kg, and largest moment of inertia, kg m², of a link."""

ENTRIES = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
"""Entries of an inertia, row by row."""

Colour = tuple[float, float, float, float]


class Urdf(Source):
    """A `<robot>` element; see `Source`."""

    def tidy(self, fixed: bool, lock: Mapping[str, float]) -> tuple[dict[str, float], list[str]]:
        """See `Source.tidy`."""
        notes = tidying.tidy(self.root, fixed)
        return urdf.lock(self.root, lock), notes

    def tree(self, name: str, fixed: bool) -> pin.Model:
        """See `Source.tree`."""
        root = _bare(self.root)
        for joint in urdf.joints(root, MOVING).values():
            for mimic in joint.findall("mimic"):
                joint.remove(mimic)
            if joint.get("type") == "continuous":
                joint.set("type", "revolute")
                urdf.limit_of(joint).attrib.update(lower=repr(-10.0 * ENDLESS), upper=repr(10.0 * ENDLESS))
        free = "root_joint"
        while any(each.get("name") == free for each in root):
            free += "_"  # a joint of the robot has this name
        text = ElementTree.tostring(root, encoding="unicode")
        try:
            model = pin.buildModelFromXML(text, *(() if fixed else (pin.JointModelFreeFlyer(), free)))
        except (ValueError, RuntimeError) as error:
            raise ModelError(f"Pinocchio cannot read the URDF of '{name}': {error}") from error
        for limits in (model.lowerPositionLimit, model.upperPositionLimit):
            limits[np.abs(limits) > ENDLESS] = np.copysign(np.inf, limits[np.abs(limits) > ENDLESS])
        return model

    def couplings(self) -> dict[str, Coupling]:
        """See `Source.couplings`."""
        return urdf.couplings(self.root)

    def without_geometry(self) -> str:
        """See `Source.without_geometry`."""
        return ElementTree.tostring(_bare(self.root), encoding="unicode")

    def shapes(self) -> list[Geometry]:
        """See `Source.shapes`."""
        named: dict[str, Colour] = {}  # materials that are defined once and used by name
        for material in self.root.iter("material"):
            if (colour := _colour(material)) is not None and material.get("name"):
                named.setdefault(str(material.get("name")), colour)
        found = []
        for link in self.root.findall("link"):
            for element in link:
                if element.tag in ("visual", "collision") and (made := _shape(link, element, named)):
                    found.append(made)
        return found

    def inertials(self) -> dict[str, Inertial]:
        """See `Source.inertials`."""
        found = {}
        for link in self.root.findall("link"):
            if (inertial := link.find("inertial")) is not None:
                name = str(link.get("name"))
                found[name] = _inertial(name, inertial)
        return found

    def set_inertial(self, link: str, inertial: Inertial | None) -> None:
        """See `Source.set_inertial`; the place of the centre of mass and the axes stay."""
        element = next(each for each in self.root.findall("link") if each.get("name") == link)
        old = element.find("inertial")
        new = ElementTree.SubElement(element, "inertial") if old is None else old
        if inertial is None:
            element.remove(new)
            return
        for part in [*new.findall("mass"), *new.findall("inertia")]:
            new.remove(part)
        ElementTree.SubElement(new, "mass", value=repr(float(inertial.mass)))
        values = inertial.inertia[np.triu_indices(3)].tolist()
        ElementTree.SubElement(new, "inertia", dict(zip(ENTRIES, map(repr, values), strict=True)))

    def carriers(self, fixed: bool) -> dict[str, str]:
        """See `Source.carriers`."""
        children = {child for _, child in map(urdf.parent_and_child, urdf.joints(self.root).values())}
        ends = map(urdf.parent_and_child, urdf.joints(self.root, ("fixed",)).values())
        fixed_to = {child: parent for parent, child in ends}
        found = {}
        for link in self.root.findall("link"):
            carrier = name = str(link.get("name"))
            while carrier in fixed_to:
                carrier = fixed_to[carrier]
            if not fixed or carrier in children:
                found[name] = carrier
        return found

    def unlimited(self) -> list[str]:
        """See `Source.unlimited`."""
        return [
            name
            for name, joint in urdf.joints(self.root, MOVING).items()
            if joint.find("mimic") is None and urdf.number(urdf.limit_of(joint), "effort", name) == 0.0
        ]

    def set_limits(
        self,
        position: Mapping[str, tuple[float, float]] | None = None,
        velocity: Mapping[str, float] | None = None,
        torque: Mapping[str, float] | None = None,
    ) -> None:
        """See `Source.set_limits`."""
        moving = urdf.joints(self.root, MOVING)
        for name, values in checked_limits(moving, position, velocity, torque).items():
            if "lower" in values and moving[name].get("type") == "continuous":
                moving[name].set("type", "revolute")
            urdf.limit_of(moving[name]).attrib.update({key: repr(value) for key, value in values.items()})

    def turn_root(self, turn: float) -> str:
        """See `Source.turn_root`."""
        children = {child for _, child in map(urdf.parent_and_child, urdf.joints(self.root).values())}
        links = [str(link.get("name")) for link in self.root.findall("link")]
        old = next(name for name in links if name not in children)
        self.root.insert(0, ElementTree.Element("link", name=(new := f"{old}_forward")))
        _fix(self.root, new, old, f"0 0 {-turn!r}", joint=f"{new}_fixed")
        return new

    def add_mass(self, name: str, link: str, inertia: pin.Inertia) -> None:
        """See `Source.add_mass`."""
        inertial = ElementTree.SubElement(ElementTree.SubElement(self.root, "link", name=name), "inertial")
        ElementTree.SubElement(
            inertial, "origin", xyz=" ".join(f"{value!r}" for value in inertia.lever.tolist())
        )
        self.set_inertial(name, Inertial(inertia.mass, inertia.inertia))
        _fix(self.root, link, name, joint=f"{name}_fixed")


def _inertial(link: str, inertial: Element) -> Inertial:
    mass, inertia, origin = (inertial.find(tag) for tag in ("mass", "inertia", "origin"))
    if mass is None or inertia is None:
        raise ModelError(f"link '{link}': <inertial> must have <mass> and <inertia>")
    try:
        kilograms = float(mass.get("value", "nan"))
        ixx, ixy, ixz, iyy, iyz, izz = (float(inertia.get(entry, "0")) for entry in ENTRIES)
    except ValueError as error:
        given = {"mass": mass.get("value"), **inertia.attrib}
        raise ModelError(f"link '{link}': mass and inertia must be numbers, got {shown(given)}") from error
    matrix = np.array([[ixx, ixy, ixz], [ixy, iyy, iyz], [ixz, iyz, izz]])
    if not (np.isfinite(kilograms) and np.isfinite(matrix).all()):
        raise ModelError(f"link '{link}': mass and inertia must be finite")
    if abs(kilograms) > HEAVIEST or np.abs(matrix).max() > HEAVIEST:
        raise ModelError(
            f"link '{link}': mass (kg) and inertia (kg m²) must be at most {HEAVIEST:g}, got {kilograms:g} and "
            f"{np.abs(matrix).max():g}"
        )
    # The URDF parser drops the whole inertia if it cannot read the origin.
    placement = {} if origin is None else origin.attrib
    for key in ("xyz", "rpy"):
        urdf.triple(f"link '{link}': {key} of the inertial origin", placement.get(key, "0 0 0"))
    return Inertial(kilograms, matrix)


def _bare(root: Element) -> Element:
    """Return links, inertias and joints alone, as a copy."""
    bare = ElementTree.Element(root.tag, root.attrib)
    bare.extend(copy.deepcopy(child) for child in root if child.tag in ("link", "joint"))
    for link in bare.findall("link"):
        for child in list(link):
            if child.tag != "inertial":
                link.remove(child)
    return bare


def _shape(link: Element, element: Element, named: Mapping[str, Colour]) -> Geometry | None:
    """Return the shape of a <visual> or <collision>; None for one of another kind."""
    geometry = element.find("geometry")
    if geometry is None or not len(geometry):
        return None
    shape, origin, colour = geometry[0], element.find("origin"), None
    place = {} if origin is None else origin.attrib
    rpy, xyz = (_numbers(place.get(key, "0 0 0")) for key in ("rpy", "xyz"))
    if shape.tag == "box":
        size = 0.5 * _numbers(shape.get("size", "0 0 0"))
    elif shape.tag == "sphere":
        size = _numbers(shape.get("radius", "0"))
    elif shape.tag in ("cylinder", "capsule"):
        size = np.array([float(shape.get("radius", "0")), 0.5 * float(shape.get("length", "0"))])
    elif shape.tag == "mesh":
        size = _numbers(shape.get("scale", "1 1 1"))
    else:
        return None
    if (material := element.find("material")) is not None:
        colour = _colour(material) or named.get(str(material.get("name")))
    return Geometry(
        str(link.get("name")),
        element.tag,
        shape.tag,
        size,
        pin.SE3(pin.rpy.rpyToMatrix(*rpy), xyz),
        shape.get("filename", ""),
        colour,
    )


def _colour(material: Element) -> Colour | None:
    element = material.find("color")
    values = [] if element is None else np.clip(_numbers(element.get("rgba", "")), 0.0, 1.0).tolist()
    return (values[0], values[1], values[2], values[3]) if len(values) == 4 else None


def _fix(root: Element, parent: str, child: str, rpy: str = "0 0 0", *, joint: str) -> None:
    """Add a fixed joint between two links."""
    element = ElementTree.SubElement(root, "joint", name=joint, type="fixed")
    ElementTree.SubElement(element, "parent", link=parent)
    ElementTree.SubElement(element, "child", link=child)
    ElementTree.SubElement(element, "origin", xyz="0 0 0", rpy=rpy)


def _numbers(text: str) -> Array:
    return np.array([float(part) for part in text.split()])
