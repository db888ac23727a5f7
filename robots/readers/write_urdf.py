"""A URDF written link by link, with numbers that read back exactly."""

from __future__ import annotations

from collections.abc import Iterable
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin

from wbc.base.numbers import Array
from wbc.core.robot import Coupling
from wbc.robots.urdf import Element, couple


class UrdfWriter:
    """A URDF under construction."""

    def __init__(self, name: str) -> None:
        self.root: Element = ElementTree.Element("robot", name=name)

    def link(
        self, name: str, mass: float = 0.0, com: Array | None = None, inertia: Array | None = None
    ) -> None:
        """Add a link: mass (kg), centre of mass (m) and inertia about it (3 × 3, kg m²) in its axes, or none."""
        link = ElementTree.SubElement(self.root, "link", name=name)
        if mass == 0.0 or com is None or inertia is None:
            return
        inertial = ElementTree.SubElement(link, "inertial")
        ElementTree.SubElement(inertial, "origin", xyz=text(com), rpy="0 0 0")
        ElementTree.SubElement(inertial, "mass", value=repr(float(mass)))
        entries = {
            f"i{'xyz'[i]}{'xyz'[j]}": repr(float(inertia[i, j])) for i in range(3) for j in range(i, 3)
        }
        ElementTree.SubElement(inertial, "inertia", entries)

    def joint(
        self,
        name: str,
        kind: str,
        parent: str,
        child: str,
        placement: pin.SE3,
        axis: Array | None = None,
        limits: dict[str, float] | None = None,
    ) -> None:
        """Add a joint: "fixed", "revolute", "continuous" or "prismatic", about an axis in its own frame.

        Limits are the known ones of lower, upper, velocity and effort.
        """
        joint = ElementTree.SubElement(self.root, "joint", name=name, type=kind)
        ElementTree.SubElement(joint, "parent", link=parent)
        ElementTree.SubElement(joint, "child", link=child)
        rpy = pin.rpy.matrixToRpy(placement.rotation)
        ElementTree.SubElement(joint, "origin", xyz=text(placement.translation), rpy=text(rpy))
        if axis is not None:
            ElementTree.SubElement(joint, "axis", xyz=text(axis))
            known = {key: repr(float(value)) for key, value in (limits or {}).items()}
            ElementTree.SubElement(joint, "limit", known)

    def couple(self, name: str, coupling: Coupling) -> None:
        """Let a joint that has been added move with another one."""
        couple(next(joint for joint in self.root.findall("joint") if joint.get("name") == name), coupling)


def text(values: Iterable[float]) -> str:
    """Return numbers as an attribute that reads back exactly."""
    return " ".join(repr(float(value)) for value in values)


def about(axis: Array, angle: float) -> pin.SE3:
    """Return the turn by an angle (rad) about an axis of unit length, shape (3,)."""
    return pin.SE3(pin.exp3(np.asarray(axis) * angle), np.zeros(3))


def along(vector: Array) -> pin.SE3:
    """Return the shift by a vector, shape (3,), m."""
    return pin.SE3(np.eye(3), np.asarray(vector, dtype=np.float64))
