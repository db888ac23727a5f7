"""An MJCF as the source of a robot: its bodies alone, and a Pinocchio model of what MuJoCo compiles of them.

A base that floats has a free joint, one that is bolted to the world has none. A position of a joint is
MuJoCo's `qpos`. Velocity limits, which MJCF has not, are the first of the user's numbers of a joint. Geoms of the group
`SHOWN` are visual shapes, the others are collision shapes; meshes are named as in a URDF, with their scale.
"""

from __future__ import annotations

import math
from typing import Any
from xml.etree import ElementTree

import mujoco
import numpy as np
import pinocchio as pin

from wbc.base.errors import ModelError
from wbc.base.numbers import Array
from wbc.core.model import Coupling
from wbc.robots.source import Element, Geometry, Source

WORLD_LINK = "world_link"
"""Root link of a robot that is bolted to the world."""

SHOWN = "2"
"""Group of the geoms that are drawn."""

FREE, HINGE, SLIDE = (int(getattr(mujoco.mjtJoint, f"mjJNT_{kind}")) for kind in ("FREE", "HINGE", "SLIDE"))

_ALIGNED = {
    HINGE: (pin.JointModelRX, pin.JointModelRY, pin.JointModelRZ, pin.JointModelRevoluteUnaligned),
    SLIDE: (pin.JointModelPX, pin.JointModelPY, pin.JointModelPZ, pin.JointModelPrismaticUnaligned),
}
"""Kind of a joint → Pinocchio's joint about x, y, z, and about another axis."""


class Mjcf(Source):
    """A `<mujoco>` element; see `Source`."""

    def tree(self, name: str, fixed: bool) -> pin.Model:
        """See `Source.tree`."""
        try:
            compiled = mujoco.MjModel.from_xml_string(self.without_geometry())
        except ValueError as error:
            said = " ".join(str(error).removeprefix("Error: ").split())
            raise ModelError(f"MuJoCo cannot compile the bodies of '{name}': {said}") from error
        return pinocchio_model(compiled, fixed)

    def couplings(self) -> dict[str, Coupling]:
        """See `Source.couplings`."""
        refs = {name: float(joint.get("ref", "0")) for name, joint in self.joints().items()}
        found = {}
        for tie in self.root.findall("equality/joint"):
            follower, leader = str(tie.get("joint1")), str(tie.get("joint2"))
            offset, ratio = _numbers(tie.get("polycoef", ""))[:2].tolist()
            found[follower] = Coupling(leader, ratio, refs[follower] + offset - ratio * refs[leader])
        return found

    def without_geometry(self) -> str:
        """See `Source.without_geometry`."""
        root = ElementTree.fromstring(self.text)
        for asset in root.findall("asset"):
            root.remove(asset)
        for body in root.iter("body"):
            for geom in body.findall("geom"):
                body.remove(geom)
        return ElementTree.tostring(root, encoding="unicode")

    def shapes(self) -> list[Geometry]:
        """See `Source.shapes`."""
        meshes = {mesh.get("name"): mesh for mesh in self.root.findall("asset/mesh")}
        found = []
        for link, body in self._bodies().items():
            for geom in body.findall("geom"):
                kind, file, size = str(geom.get("type")), "", _numbers(geom.get("size", ""))
                if kind == "mesh":
                    mesh = meshes[geom.get("mesh")]
                    file, size = str(mesh.get("file")), _numbers(str(mesh.get("scale")))
                place = placement_of(_numbers(str(geom.get("pos"))), _numbers(str(geom.get("quat"))))
                role = "visual" if geom.get("group") == SHOWN else "collision"
                red, green, blue, opacity = _numbers(geom.get("rgba", "0 0 0 0")).tolist()
                colour = (red, green, blue, opacity) if geom.get("rgba") else None
                found.append(Geometry(link, role, kind, size, place, file, colour))
        return found

    def joints(self) -> dict[str, Element]:
        """See `Source.joints`."""
        return {str(joint.get("name")): joint for joint in self.root.findall("worldbody//joint")}

    def set_limit(self, joint: Element, what: str, value: Any) -> None:
        """See `Source.set_limit`."""
        keys = {"position": ("range", value), "velocity": ("user", (value,))}
        key, values = keys.get(what) or ("actuatorfrcrange", (-value, value))
        joint.set(key, text(values))

    def turn_root(self, turn: float) -> str:
        """See `Source.turn_root`."""
        world = next(self.root.iter("worldbody"))
        old = next(world.iter("body"))
        new = ElementTree.SubElement(world, "body", name=f"{old.get('name')}_forward")
        new.extend(old.findall("freejoint"))
        for joint in old.findall("freejoint"):
            old.remove(joint)
        world.remove(old)
        new.append(old)
        old.set("quat", text((math.cos(0.5 * turn), 0.0, 0.0, -math.sin(0.5 * turn))))  # it had none
        return str(new.get("name"))

    def _bodies(self) -> dict[str, Element]:
        return {str(body.get("name")): body for body in self.root.iter("body")}


def pinocchio_model(compiled: mujoco.MjModel, fixed: bool) -> pin.Model:
    """Return the Pinocchio model of the compiled bodies of one robot: joints, bodies, sites and inertias.

    The frame of a joint lies at its anchor, in the axes that its body has at position zero.
    """
    names = {str(compiled.joint(i).name) for i in range(compiled.njnt)}
    model, free = pin.Model(), "root_joint"
    while free in names:
        free += "_"
    frame = {0: model.addBodyFrame(WORLD_LINK, 0, pin.SE3.Identity(), 0) if fixed else 0}  # of each body
    at = {0: (0, pin.SE3.Identity())}  # joint that moves each body, and where the body is in its frame
    for body in range(1, compiled.nbody):
        above = int(compiled.body_parentid[body])
        parent, place = at[above]
        place = place * placement_of(compiled.body_pos[body], compiled.body_quat[body])
        inner = frame[above]
        first = int(compiled.body_jntadr[body])
        for joint in range(first, first + int(compiled.body_jntnum[body])):
            if int(compiled.jnt_type[joint]) == FREE:
                parent = model.addJoint(parent, pin.JointModelFreeFlyer(), pin.SE3.Identity(), free)
            else:
                parent = _add_joint(model, compiled, joint, parent, place)
            inner = model.addJointFrame(parent, inner)
            place = along(-compiled.jnt_pos[joint])
        at[body] = parent, place
        frame[body] = model.addBodyFrame(str(compiled.body(body).name), parent, place, inner)
        inertia = pin.Inertia(
            float(compiled.body_mass[body]), np.zeros(3), np.diag(compiled.body_inertia[body])
        )
        model.appendBodyToJoint(
            parent, inertia, place * placement_of(compiled.body_ipos[body], compiled.body_iquat[body])
        )
    for site in range(compiled.nsite):
        body = int(compiled.site_bodyid[site])
        parent, place = at[body]
        place = place * placement_of(compiled.site_pos[site], compiled.site_quat[site])
        name = str(compiled.site(site).name)
        model.addFrame(pin.Frame(name, parent, frame[body], place, pin.FrameType.OP_FRAME), False)
    return model


def _add_joint(model: pin.Model, compiled: mujoco.MjModel, joint: int, parent: int, place: pin.SE3) -> int:
    """Add a joint to a body at a place in the frame of its parent, with its limits; return its number."""
    kind, axis = int(compiled.jnt_type[joint]), np.array(compiled.jnt_axis[joint])
    reference = float(compiled.qpos0[compiled.jnt_qposadr[joint]])
    place = place * along(compiled.jnt_pos[joint])
    if reference:
        place = place * motion(kind, axis, -reference)
    which = next((i for i in range(3) if np.array_equal(axis, np.eye(3)[i])), 3)
    made = _ALIGNED[kind][which](*(() if which < 3 else (axis,)))
    low, high = compiled.jnt_range[joint] if compiled.jnt_limited[joint] else (-np.inf, np.inf)
    limits = (compiled.jnt_actfrcrange[joint][1], compiled.jnt_user[joint][0], low, high)
    return int(
        model.addJoint(
            parent, made, place, str(compiled.joint(joint).name), *(np.array([float(x)]) for x in limits)
        )
    )


def placement_of(position: Array, quaternion: Array) -> pin.SE3:
    """Return a placement from MuJoCo's position (m) and quaternion (wxyz)."""
    w, x, y, z = (float(value) for value in quaternion)
    return pin.SE3(pin.Quaternion(w, x, y, z).normalized().matrix(), np.array(position, dtype=np.float64))


def motion(kind: int, axis: Array, by: float) -> pin.SE3:
    """Return the motion of a hinge or a slide about its axis, of unit length, by an angle (rad) or a way (m)."""
    return along(by * axis) if kind == SLIDE else pin.SE3(pin.exp3(by * axis), np.zeros(3))


def along(vector: Array) -> pin.SE3:
    """Return the shift by a vector, shape (3,), m."""
    return pin.SE3(np.eye(3), np.array(vector, dtype=np.float64))


def placed(place: pin.SE3) -> dict[str, str]:
    """Return a placement as attributes of an element."""
    return {
        "pos": text(place.translation),
        "quat": text(pin.Quaternion(place.rotation).coeffs()[[3, 0, 1, 2]]),
    }


def text(values: Any) -> str:
    """Return numbers as an attribute that reads back exactly."""
    return " ".join(repr(float(value)) for value in values)


def _numbers(words: str) -> Array:
    return np.array([float(word) for word in words.split()])
