"""A robot in an SDF as an `mujoco.MjSpec`: Gazebo's format, which may state closed chains.

The tree grows from the root by the joints in the order of the file. A joint between two links that are in the tree
already closes a chain and becomes a `connect`: the two links keep its point together, and the other joints of the chain
keep its axis. A ball joint in the tree becomes three hinges. Meshes, plugins, sensors and materials are not read.

Source: SDFormat specification, version 1.6, http://sdformat.org/spec.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Mapping
from typing import Any

import mujoco
import numpy as np
import pinocchio as pin

from wbc.base.errors import ModelError
from wbc.base.numbers import Array
from wbc.robots.mechanism import placed
from wbc.robots.readers.tree_mjcf import VELOCITY_LIMIT

STIFF = {"solref": (0.002, 1.0), "solimp": (0.9999, 0.9999, 0.001)}
"""Options of equalities that hardly give."""

ENDLESS = 1e15
"""Limit of a joint from which on it has none: SDF writes 1e16."""

AXES = np.eye(3)


def spec_of(root: ET.Element, where: str) -> mujoco.MjSpec:
    """Return the robot of an `<sdf>` element without drives, its root floating unless a joint ties it to the world."""
    models = root.findall("model") + root.findall("world/model")
    if len(models) != 1:
        raise ModelError(f"{where}: an SDF with one <model> is required, it has {len(models)}")
    return _Reader(models[0], where).spec


class _Reader:
    """One `<model>` on its way into a spec."""

    def __init__(self, model: ET.Element, where: str) -> None:
        self.where = where
        self.spec = mujoco.MjSpec()
        self.spec.modelname = str(model.get("name") or "robot")
        self.spec.compiler.degree = False
        text = (model.findtext("self_collide") or "").strip()
        self.collides = 1 if text in ("1", "true") else 0  # its links with each other
        for kind in ("link", "joint"):
            names = [(each.get("name") or "").strip() for each in model.findall(kind)]
            if len(set(names) - {""}) < len(names):
                wrong = next(name for name in names if not name or names.count(name) > 1)
                raise ModelError(
                    f"{where}: every <{kind}> must have a name of its own, got "
                    + (f"'{wrong}' twice" if wrong else f"none for number {names.index('') + 1}")
                )
        self.links = {str(link.get("name")): link for link in model.findall("link")}
        self.places = {name: self._pose(link) for name, link in self.links.items()}
        if not self.links:
            raise ModelError(f"{where}: the model has no link")
        self.bodies: dict[str, Any] = {}
        joints = {str(joint.get("name")): joint for joint in model.findall("joint")}
        ends = {name: self._ends(name, joint) for name, joint in joints.items()}
        for name, pair in self._grow(joints, ends).items():
            self._close(name, joints[name], pair)

    def _grow(
        self, joints: Mapping[str, ET.Element], ends: Mapping[str, tuple[str, str]]
    ) -> dict[str, tuple[str, str]]:
        """Add all links by the joints that reach them first, and return the ends of the joints that are left."""
        if any("world" in pair for pair in ends.values()):
            self.bodies["world"] = self.spec.worldbody
        else:
            children = {child for _, child in ends.values()}
            start = next((link for link in self.links if link not in children), next(iter(self.links)))
            self._body(start, None).add_freejoint()
        left, found = dict(ends), True
        while found:
            found = False
            for name, (parent, child) in list(left.items()):
                if (parent in self.bodies) != (child in self.bodies):
                    near, far = (parent, child) if parent in self.bodies else (child, parent)
                    self._joint(name, joints[name], near, far, left.pop(name))
                    found = True
        if missing := [name for name in self.links if name not in self.bodies]:
            raise ModelError(
                f"{self.where}: no joint ties link '{missing[0]}' to '{next(iter(self.bodies))}'"
            )
        return left

    def _ends(self, name: str, joint: ET.Element) -> tuple[str, str]:
        ends = tuple((joint.findtext(tag) or "").strip() for tag in ("parent", "child"))
        for end in ends:
            if end not in self.links and end != "world":
                raise ModelError(
                    f"{self.where}: joint '{name}' names link '{end}', which is not in the model"
                )
        return ends[0], ends[1]

    def _numbers(self, text: str | None, count: int, what: str) -> Array:
        try:
            values = np.array([float(word) for word in (text or "0 " * count).split()])
        except ValueError:
            values = np.zeros(0)
        if values.size != count or not np.isfinite(values).all():
            raise ModelError(f"{self.where}: {what} must be {count} finite numbers, got {text!r}")
        return values

    def _pose(self, element: ET.Element, tag: str = "pose") -> pin.SE3:
        what = f"pose of {element.tag} '{element.get('name', '')}'"
        found = element.find(tag)
        if found is not None and (found.get("relative_to") or found.get("frame")):
            raise ModelError(f"{self.where}: {what} must be in the frame of its parent, without relative_to")
        numbers = self._numbers(None if found is None else found.text, 6, what)
        return pin.SE3(pin.rpy.rpyToMatrix(numbers[3:]), numbers[:3])

    def _number(self, element: ET.Element, path: str, default: float) -> float:
        text = element.findtext(path)
        what = f"{path} of {element.tag} '{element.get('name', '')}'"
        return default if text is None else float(self._numbers(text, 1, what)[0])

    def _limit(self, joint: ET.Element, end: str) -> float:
        """Return a limit of a joint, rad, m, rad/s or m/s; infinite where the file gives none, or one without end."""
        sign, text = (-1.0 if end == "lower" else 1.0), (joint.findtext(f"axis/limit/{end}") or "inf").strip()
        if text.lower().lstrip("+-") in ("inf", "infinity"):
            return sign * np.inf
        value = self._number(joint, f"axis/limit/{end}", 0.0)
        return value if abs(value) < ENDLESS else sign * np.inf

    def _body(self, name: str, near: str | None) -> Any:
        """Add a link to another one."""
        link, place = self.links[name], self.places[name]
        onto = self.bodies[near] if near else self.spec.worldbody
        if near and near != "world":
            place = self.places[near].actInv(place)
        body = onto.add_body(name=name, **placed(place))
        middle = self._pose(link, "inertial/pose")
        body.mass, body.explicitinertial = self._number(link, "inertial/mass", 1.0), True
        body.ipos, body.iquat = placed(middle).values()
        entries = (("ixx", 1.0), ("iyy", 1.0), ("izz", 1.0), ("ixy", 0.0), ("ixz", 0.0), ("iyz", 0.0))
        body.fullinertia = [self._number(link, f"inertial/inertia/{key}", value) for key, value in entries]
        for shape in link.findall("collision"):
            self._geom(body, shape)
        self.bodies[name] = body
        return body

    def _geom(self, body: Any, shape: ET.Element) -> None:
        place, kinds = self._pose(shape), mujoco.mjtGeom
        geometry = shape.find("geometry")
        if geometry is None:
            return
        kind: Any = None
        if geometry.find("sphere") is not None:
            kind, size = kinds.mjGEOM_SPHERE, [self._number(geometry, "sphere/radius", 1.0), 0.0, 0.0]
        elif geometry.find("box") is not None:
            kind = kinds.mjGEOM_BOX
            size = [*(0.5 * self._numbers(geometry.findtext("box/size"), 3, "size of a box"))]
        for tag, long in (("cylinder", kinds.mjGEOM_CYLINDER), ("capsule", kinds.mjGEOM_CAPSULE)):
            if geometry.find(tag) is not None:
                radius, length = (self._number(geometry, f"{tag}/{key}", 1.0) for key in ("radius", "length"))
                kind, size = long, [radius, 0.5 * length, 0.0]
        if kind is not None:
            geom = body.add_geom(type=kind, size=size, **placed(place))
            geom.mass, geom.conaffinity = 0.0, self.collides

    def _joint(self, name: str, joint: ET.Element, near: str, far: str, ends: tuple[str, str]) -> None:
        """Add a link by its joint, in whichever direction the file names the two."""
        body = self._body(far, near)
        child = self.places[ends[1]] if ends[1] != "world" else pin.SE3.Identity()
        place = self.places[far].actInv(child * self._pose(joint))
        kind = joint.get("type")
        if kind == "fixed":
            return
        hinges: Mapping[str, Array] = {
            f"{name}_{axis}": place.rotation @ AXES[i] for i, axis in enumerate("xyz")
        }
        if kind != "ball":
            if kind not in ("revolute", "continuous", "prismatic"):
                raise ModelError(
                    f"{self.where}: joint '{name}' is of type '{kind}'; read are revolute, continuous, prismatic, "
                    "ball and fixed"
                )
            axis = self._numbers(joint.findtext("axis/xyz") or "0 0 1", 3, f"axis of joint '{name}'")
            frame = "" if (xyz := joint.find("axis/xyz")) is None else xyz.get("expressed_in", "")
            if frame not in ("", "__model__"):
                raise ModelError(
                    f"{self.where}: axis of joint '{name}' must be in the frame of the joint or in __model__, got "
                    f"expressed_in='{frame}'"
                )
            said = (joint.findtext("axis/use_parent_model_frame") or "").strip()
            in_model = bool(frame) or said in ("1", "true")
            axis = self.places[far].rotation.T @ axis if in_model else place.rotation @ axis
            hinges = {name: axis if far == ends[1] else -axis}
        slides = kind == "prismatic"
        for hinge, direction in hinges.items():
            made = body.add_joint(name=hinge, pos=place.translation, axis=direction)
            made.type = mujoco.mjtJoint.mjJNT_SLIDE if slides else mujoco.mjtJoint.mjJNT_HINGE
            made.damping[0] = self._number(joint, "axis/dynamics/damping", 0.0)
            made.frictionloss = self._number(joint, "axis/dynamics/friction", 0.0)
            if kind == "ball":
                continue
            made.stiffness[0] = self._number(joint, "axis/dynamics/spring_stiffness", 0.0)
            made.springref = self._number(joint, "axis/dynamics/spring_reference", 0.0)
            limits = [self._limit(joint, end) for end in ("lower", "upper")]
            if kind != "continuous" and np.isfinite(limits).any():
                made.range = limits
            if 0.0 < (speed := self._limit(joint, "velocity")) < np.inf:
                self.spec.add_numeric(name=VELOCITY_LIMIT.format(name), data=[speed], size=1)
            if 0.0 < (effort := self._limit(joint, "effort")) < np.inf:
                made.actfrcrange, made.actfrclimited = [-effort, effort], True

    def _close(self, name: str, joint: ET.Element, ends: tuple[str, str]) -> None:
        """Close a chain at the point of a joint."""
        if joint.get("type") not in ("ball", "revolute", "continuous"):
            raise ModelError(
                f"{self.where}: joint '{name}' closes a chain and is of type '{joint.get('type')}'; a chain is closed "
                "by a ball or a revolute joint"
            )
        tie = self.spec.add_equality(
            type=mujoco.mjtEq.mjEQ_CONNECT, objtype=mujoco.mjtObj.mjOBJ_BODY, name=name
        )
        tie.name1, tie.name2 = ends[1], ends[0]
        tie.data[:3] = self._pose(joint).translation
        tie.solref[:2], tie.solimp[:3] = STIFF["solref"], STIFF["solimp"]
