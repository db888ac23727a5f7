"""A URDF as the source of a robot; Pinocchio's own reader makes its model."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin

from wbc.base.errors import ModelError, shown
from wbc.base.numbers import Array
from wbc.core.model import Coupling
from wbc.robots import tidying, urdf
from wbc.robots.derivation import inertia
from wbc.robots.source import Colour, Element, Geometry, Source
from wbc.robots.urdf import ENDLESS, MOVING, triple


class Urdf(Source):
    """A `<robot>` element; see `Source`."""

    def tidy(
        self, fixed: bool, lock: Mapping[str, float], repair: bool
    ) -> tuple[dict[str, float], list[str]]:
        """See `Source.tidy`."""
        self.shapes()  # whose numbers are checked so
        notes = tidying.tidy(self.root, fixed)
        locked = urdf.lock(self.root, lock)
        return locked, notes + inertia.settle(self.root, fixed, repair)

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

    def joints(self) -> dict[str, Element]:
        """See `Source.joints`."""
        return urdf.joints(self.root, MOVING)

    def set_limit(self, joint: Element, what: str, value: Any) -> None:
        """See `Source.set_limit`."""
        if what == "position":
            urdf.set_range(joint, *value)
        else:
            urdf.limit_of(joint).set("effort" if what == "torque" else what, repr(value))

    def turn_root(self, turn: float) -> str:
        """See `Source.turn_root`."""
        children = {child for _, child in map(urdf.parent_and_child, urdf.joints(self.root).values())}
        links = [str(link.get("name")) for link in self.root.findall("link")]
        old = next(name for name in links if name not in children)
        self.root.insert(0, ElementTree.Element("link", name=(new := f"{old}_forward")))
        _fix(self.root, new, old, f"0 0 {-turn!r}", joint=f"{new}_fixed")
        return new


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
    what, origin = f"link '{link.get('name')}': {{}} of a {element.tag}", element.find("origin")
    place = {} if origin is None else origin.attrib
    rpy, xyz = (triple(what.format(key), place.get(key, "0 0 0")) for key in ("rpy", "xyz"))
    geometry, colour = element.find("geometry"), None
    if geometry is None or not len(geometry):
        return None
    shape = geometry[0]
    if shape.tag == "box":
        size = 0.5 * triple(what.format("size of a box"), shape.get("size", ""))
    elif shape.tag in ("sphere", "cylinder", "capsule"):
        keys = ("radius",) if shape.tag == "sphere" else ("radius", "length")
        radius, *length = (
            triple(what.format(f"{key} of a {shape.tag}"), shape.get(key, "0"), (1,)) for key in keys
        )
        size = np.concatenate([radius, *(0.5 * each for each in length)])
    elif shape.tag == "mesh":
        size = triple(what.format("scale of a mesh"), scale := shape.get("scale", "1 1 1"), (1, 3))
        if not size.all():
            raise ModelError(f"{what.format('scale of a mesh')} must not be zero, got {shown(scale)}")
    else:
        return None
    if (material := element.find("material")) is not None:
        colour = _colour(material) or named.get(str(material.get("name")))
    pose = pin.SE3(pin.rpy.rpyToMatrix(*rpy), xyz)
    file = shape.get("filename", "")
    return Geometry(str(link.get("name")), element.tag, shape.tag, size, pose, file, colour)


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
