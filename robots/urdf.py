"""A URDF as records of its links and joints, and their mechanism once `wbc.robots.tidying` has settled them."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin

from wbc.base.errors import InputError, ModelError, choose, shown, shown_path
from wbc.base.files import existing, parse_xml, read_text
from wbc.base.numbers import Array
from wbc.core.frames import yaw_rotation
from wbc.core.model import Coupling
from wbc.robots.mechanism import TURNED, Colour, Geometry, Mechanism, add_joint, free_name
from wbc.robots.notes import listed

Element = ElementTree.Element

ENDLESS = 1e9
"""Position from which on a limit is none, rad."""

LARGEST_COORDINATE = 1e4
"""Largest coordinate of a placement or an axis, m."""

MOST_LINKS = 2000
"""Most links of a robot: time grows with the square of a chain's length."""

HEAVIEST = 1e6
"""Largest mass, kg, and largest moment of inertia, kg m², of a link."""

SHORTEST_AXIS = 1e-9
"""Length of an axis below which it is zero."""

READ = ("link", "joint", "material", "ros2_control")
"""Elements of a <robot> that are read."""

XACRO = "{http://www.ros.org/wiki/xacro}"
"""Beginning of the tags of macros that no parser of URDF knows."""

MOVING = ("revolute", "continuous", "prismatic")
"""Joint types that a robot may have after tidying; all others but "fixed" are refused."""

ENTRIES = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
"""Entries of an inertia, row by row."""


class Inertial(NamedTuple):
    """Mass of a link, kg, and inertia about its centre of mass, in axes of its own, shape (3, 3), kg m²."""

    mass: float
    inertia: Array
    place: pin.SE3  # centre of mass, and these axes, in the link


@dataclass
class Joint:
    """A <joint> of a URDF.

    Attributes:
        name: Its name.
        kind: Its type.
        parent: Link that it hangs on.
        child: Link that it moves.
        place: Its place in the parent.
        axis: Its axis, of unit length.
        limit: Attributes of its <limit> as they are written.
        low: Lower position limit, rad or m; −∞ for none.
        high: Upper position limit, rad or m; ∞ for none.
        speed: Largest speed, rad/s or m/s.
        effort: Largest torque or force, Nm or N; zero where it is not known.
        leader: Joint with which it moves, its ratio and offset; None for a joint of its own.
        soft: Soft position limits and what they are of.
        rubs: True for a joint with damping or dry friction.
    """

    name: str
    kind: str
    parent: str
    child: str
    place: pin.SE3
    axis: Array
    limit: dict[str, str] = field(default_factory=dict)
    low: float = -math.inf
    high: float = math.inf
    speed: float = 0.0
    effort: float = 0.0
    leader: Coupling | None = None
    soft: list[tuple[str, float, float]] = field(default_factory=list)
    rubs: bool = False

    @property
    def moves(self) -> bool:
        """True for a joint that is not fixed."""
        return self.kind != "fixed"


@dataclass
class Urdf:
    """Links and joints of a URDF, in the order of the file.

    Attributes:
        name: Name of the robot.
        links: Link → its inertia, None for a link without one.
        joints: Joint → what the file says of it.
        shapes: Shapes of all links without those of an unknown kind.
        notes: What is not read, or otherwise than it is written, one line each.
        doubtful: Joints that are not read, in one line; empty without any.
    """

    name: str
    links: dict[str, Inertial | None]
    joints: dict[str, Joint]
    shapes: list[Geometry]
    notes: list[str]
    doubtful: tuple[str, ...]

    @property
    def moving(self) -> dict[str, Joint]:
        """Joints that are not fixed."""
        return {name: joint for name, joint in self.joints.items() if joint.moves}

    @property
    def root(self) -> str:
        """Link that hangs on no other one; a `ModelError` if there is not one."""
        children = {joint.child for joint in self.joints.values()}
        roots = [name for name in self.links if name not in children]
        if len(roots) != 1:
            raise ModelError(
                f"the links must form one tree with one root, got {len(roots)} roots: {roots[:5]}"
            )
        return roots[0]

    def couplings(self) -> dict[str, Coupling]:
        """Return the joints that move with another one, joint → its leader, ratio and offset.

        A leader is a joint with a coordinate of its own: a joint that moves with one that moves with a third is coupled
        to the third.
        """
        direct = {name: joint.leader for name, joint in self.moving.items() if joint.leader is not None}
        found = {}
        for name, first in direct.items():
            seen, coupling = [name], first
            while (above := direct.get(coupling.leader)) is not None:
                seen.append(coupling.leader)
                if seen.count(coupling.leader) > 1:
                    raise ModelError(
                        f"joints {', '.join(map(repr, dict.fromkeys(seen)))} are coupled to each other: none of them "
                        "leads; take the coupling of one of them out"
                    )
                ratio, offset = coupling.ratio, coupling.offset
                coupling = Coupling(above.leader, ratio * above.ratio, ratio * above.offset + offset)
            choose(f"leader of joint '{name}'", coupling.leader, self.moving)
            found[name] = coupling
        return found

    def mechanism(self, fixed: bool, turn: float = 0.0) -> Mechanism:
        """Return the links and joints of a tidy URDF, bolted to the world if `fixed`, in Pinocchio's order.

        The joints of a link are in the order of their names. With `turn`, rad, a link is put above the root whose x
        axis points to where the old one has this angle.
        """
        model, own = pin.Model(), dict[str, pin.Inertia]()
        model.name = self.name
        below: dict[str, list[Joint]] = {name: [] for name in self.links}
        for joint in sorted(self.joints.values(), key=lambda joint: joint.name, reverse=True):
            below[joint.parent].append(joint)
        parent, place, frame = 0, pin.SE3.Identity(), 0
        if not fixed:
            parent = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), free_name(self.joints))
            frame = model.addJointFrame(parent, 0)
        if turn:
            above, place = f"{self.root}{TURNED}", pin.SE3(yaw_rotation(-turn), np.zeros(3))
            frame = model.addBodyFrame(above, parent, pin.SE3.Identity(), frame)
            frame = _add_fixed(model, f"{above}_fixed", parent, frame, place)
        hung = [(Joint("", "fixed", "", self.root, pin.SE3.Identity(), np.zeros(3)), parent, place, frame)]
        while hung:  # depth first
            joint, parent, place, frame = hung.pop()
            link, place = joint.child, place * joint.place
            if joint.moves:
                limits = joint.effort, joint.speed, joint.low, joint.high
                slides = joint.kind == "prismatic"
                parent = add_joint(model, parent, place, joint.name, slides, joint.axis, limits)
                frame, place = model.addJointFrame(parent, frame), pin.SE3.Identity()
            elif joint.name:
                frame = _add_fixed(model, joint.name, parent, frame, place)
            frame = model.addBodyFrame(link, parent, place, frame)
            if (inertial := self.links[link]) is not None and inertial.mass > 0.0:
                own[link] = inertial.place.act(pin.Inertia(inertial.mass, np.zeros(3), inertial.inertia))
                model.appendBodyToJoint(parent, own[link], place)
            hung += [(each, parent, place, frame) for each in below[link]]
        return Mechanism(model, own, self.couplings(), tuple(self.shapes))


def _add_fixed(model: pin.Model, name: str, parent: int, frame: int, place: pin.SE3) -> int:
    return int(model.addFrame(pin.Frame(name, parent, frame, place, pin.FrameType.FIXED_JOINT), False))


def read(source: str | Path) -> Urdf:
    """Return the records of a URDF, a path or the XML itself; a `ModelError` for what no robot can have."""
    root, where = _root(source)
    if not (count := len(root.findall("link"))):
        raise ModelError(f"{where} has no links")
    if count > MOST_LINKS:
        raise ModelError(f"{where} may have {MOST_LINKS} links, got {count}")
    links = _by_name(root, "link", where)
    joints = {name: _joint(joint, root) for name, joint in _by_name(root, "joint", where).items()}
    for each in joints.values():
        for end in (each.parent, each.child):
            if end not in links:
                raise ModelError(f"joint '{each.name}' refers to link '{end}', which does not exist")
    notes: list[str] = []
    return Urdf(
        name=str(root.get("name")) if (root.get("name") or "").strip() else "robot",
        links={name: _inertial(link) for name, link in links.items()},
        joints=joints,
        shapes=shapes(root, notes),
        notes=notes + _unread(root),
        doubtful=_unread_joints(root),
    )


def _unread(root: Element) -> list[str]:
    """Return notes on the elements of a <robot> that are not read, and on links and joints that have one twice."""
    left = Counter(str(each.tag).rpartition("}")[2] for each in root if each.tag not in READ)
    notes = ["not read: " + ", ".join(f"{count} <{tag}>" for tag, count in left.items())] if left else []
    return notes + [
        f"{each.tag} '{each.get('name')}': one <{tag}> is read, it has {count}"
        for each in root
        if each.tag in ("link", "joint")
        for tag, count in Counter(str(part.tag) for part in each).items()
        if count > 1 and tag not in ("visual", "collision", "safety_controller")
    ]


def _unread_joints(root: Element) -> tuple[str, ...]:
    """Return a doubt about joints in elements that are not read, such as those that close a chain in Gazebo."""
    others = [each for each in root if each.tag not in (*READ, "transmission")]
    names = [
        str(part.get("name"))
        for other in others
        for part in other.iter()
        if len(part) and part.tag in ("joint", "loop_joint")
    ]
    said = f"joints that are not read: {listed(names)}; if they close a chain, give closures"
    return (said,) if names else ()


def _by_name(root: Element, kind: str, where: str) -> dict[str, Element]:
    """Return the links or the joints of a <robot>, each of a name of its own; those of transmissions are none."""
    found: dict[str, Element] = {}
    for number, element in enumerate(root.findall(kind), 1):
        name = element.get("name") or ""
        if not name.strip():
            which = (
                "from link '{}' to '{}'".format(*_ends(element)) if kind == "joint" else f"number {number}"
            )
            raise ModelError(f"{where}: the <{kind}> {which} has no name: give it one")
        if name in found:
            raise ModelError(f"two {kind}s are called '{name}'")
        found[name] = element
    return found


def _root(source: str | Path) -> tuple[Element, str]:
    """Return the <robot> element of a URDF, a path or the XML itself, and what it is called in messages."""
    if not isinstance(source, (str, Path)):
        raise InputError(f"a URDF must be a path or the XML itself, as text, got {shown(source)}")
    text, where = str(source), "URDF string"
    if is_file(source):
        path = existing(text, "URDF", "a path or the XML itself")
        where, text = shown_path(path), read_text(path, "URDF")
    try:
        root = parse_xml(text)
    except (ElementTree.ParseError, ValueError) as error:
        if "<xacro:" in text:
            raise ModelError(_xacro(where)) from error
        raise ModelError(f"{where} is not well-formed XML: {error}") from error
    if any(str(element.tag).startswith(XACRO) for element in root.iter()):
        raise ModelError(_xacro(where))
    if root.tag != "robot":
        prefix = "; take the prefix of its namespace (xmlns:…) out" if root.tag.endswith("}robot") else ""
        raise ModelError(f"{where} must have a <robot> element at its root, got <{root.tag}>{prefix}")
    return root, where


def _xacro(where: str) -> str:
    return f"{where} is a xacro that is not expanded: run `xacro FILE > robot.urdf`, and give that URDF"


def is_file(source: str | Path) -> bool:
    """Return True if the source of a URDF is a path, False if it is the XML itself."""
    return not str(source).lstrip().startswith("<")


def _joint(joint: Element, root: Element) -> Joint:
    """Return the record of a <joint> of a <robot>."""
    name, kind, axis = str(joint.get("name")), str(joint.get("type")), joint.find("axis")
    given = "1 0 0" if axis is None else axis.get("xyz", "1 0 0")
    direction = _floats(f"joint '{name}': its axis", given)
    length = math.hypot(*direction)
    if kind != "fixed" and length < SHORTEST_AXIS:
        raise ModelError(f"joint '{name}': its axis must not be zero, got '{given}'")
    place = _place(joint, f"joint '{name}': {{}} of its origin")
    made = Joint(name, kind, *_ends(joint), place, direction / max(length, SHORTEST_AXIS))
    if kind not in MOVING:
        return made
    limit = joint.find("limit")
    made.limit = {} if limit is None else dict(limit.attrib)
    if kind != "continuous" and {"lower", "upper"} & made.limit.keys():
        made.low, made.high = (_number(made.limit, end, name) for end in ("lower", "upper"))
    made.speed, made.effort = (_number(made.limit, what, name) for what in ("velocity", "effort"))
    if (mimic := joint.find("mimic")) is not None:
        ratio = _number({"multiplier": "1", **mimic.attrib}, "multiplier", name)
        made.leader = Coupling(str(mimic.get("joint")), ratio, _number(mimic.attrib, "offset", name))
    if (dynamics := joint.find("dynamics")) is not None:
        made.rubs = any(_number(dynamics.attrib, key, name) != 0.0 for key in ("damping", "friction"))
    for safety in joint.findall("safety_controller"):
        low, high = (_number(safety.attrib, f"soft_{side}_limit", name) for side in ("lower", "upper"))
        if low < high:  # both are zero when they are not given
            made.soft.append(("soft limits of its safety_controller", low, high))
    for control in root.findall("ros2_control/joint"):
        for command in (
            control.findall("command_interface[@name='position']") if control.get("name") == name else ()
        ):
            ends = {str(each.get("name")): (each.text or "").strip() for each in command.findall("param")}
            low, high = (
                _number(ends, end, name) if end in ends else sign * math.inf
                for end, sign in (("min", -1), ("max", 1))
            )
            made.soft.append(("range of its ros2_control", low, high))
    return made


def _ends(joint: Element) -> tuple[str, str]:
    """Return the names of the links that a joint connects; a `ModelError` if it names no parent or no child."""
    parent, child = joint.find("parent"), joint.find("child")
    if parent is None or child is None or not parent.get("link") or not child.get("link"):
        raise ModelError(f"joint '{joint.get('name')}' must name a parent link and a child link")
    return str(parent.get("link")), str(child.get("link"))


def _inertial(element: Element) -> Inertial | None:
    """Return the mass and the inertia of a <link>; None for one without."""
    if (inertial := element.find("inertial")) is None:
        return None
    link, mass, inertia = str(element.get("name")), inertial.find("mass"), inertial.find("inertia")
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
    return Inertial(kilograms, matrix, _place(inertial, f"link '{link}': {{}} of the inertial origin"))


def shapes(root: Element, notes: list[str]) -> list[Geometry]:
    """Return the shapes of all links of a `<robot>` in the order of the file, without those of an unknown kind.

    `notes` gets a line for each of these, and for each mesh whose scale is one number.
    """
    named: dict[str, Colour] = {}  # materials that are defined once and used by name
    for material in root.iter("material"):
        if (colour := _colour(material)) is not None and material.get("name"):
            named.setdefault(str(material.get("name")), colour)
    found = []
    for link in root.findall("link"):
        for element in link:
            if element.tag in ("visual", "collision") and (made := _shape(link, element, named, notes)):
                found.append(made)
    return found


def _shape(link: Element, element: Element, named: Mapping[str, Colour], notes: list[str]) -> Geometry | None:
    """Return the shape of a <visual> or <collision>; None for one of another kind."""
    what = f"link '{link.get('name')}': {{}} of a {element.tag}"
    geometry, place, colour = element.find("geometry"), _place(element, what), None
    if geometry is None or not len(geometry):
        return None
    shape = geometry[0]
    if shape.tag == "box":
        size = 0.5 * _floats(what.format("size of a box"), shape.get("size", ""))
    elif shape.tag in ("sphere", "cylinder", "capsule"):
        keys = ("radius",) if shape.tag == "sphere" else ("radius", "length")
        radius, *length = (
            _floats(what.format(f"{key} of a {shape.tag}"), shape.get(key, "0"), (1,)) for key in keys
        )
        size = np.concatenate([radius, *(0.5 * each for each in length)])
    elif shape.tag == "mesh":
        size = _floats(what.format("scale of a mesh"), scale := shape.get("scale", "1 1 1"), (1, 3))
        if not size.all():
            raise ModelError(f"{what.format('scale of a mesh')} must not be zero, got {shown(scale)}")
        if len(size) == 1:
            notes.append(f"link '{link.get('name')}': scale '{scale}' of a mesh is that of all three axes")
        size = np.broadcast_to(size, (3,))
    else:
        notes.append(
            f"{what.format(f'<{shape.tag}>')} is left out: no box, sphere, cylinder, capsule or mesh"
        )
        return None
    if (material := element.find("material")) is not None:
        colour = _colour(material) or named.get(str(material.get("name")))
    file = shape.get("filename", "")
    return Geometry(str(link.get("name")), element.tag, shape.tag, size, place, file, colour)


def _colour(material: Element) -> Colour | None:
    """Return the colour of a material; None where it is no four numbers: no robot is refused for what it looks like."""
    element = material.find("color")
    try:
        values = _floats("rgba", "" if element is None else element.get("rgba", ""), (4,))
    except ModelError:
        return None
    red, green, blue, opacity = np.clip(values, 0.0, 1.0).tolist()
    return red, green, blue, opacity


def _place(element: Element, what: str) -> pin.SE3:
    """Return the <origin> of an element; `what` says of what in an error, with {} for the attribute."""
    origin = element.find("origin")
    given = {} if origin is None else origin.attrib
    if odd := given.keys() - {"xyz", "rpy"}:
        raise ModelError(
            f"{what.format('place')} must be written as xyz and rpy, got {', '.join(sorted(odd))}"
        )
    rpy, xyz = (_floats(what.format(key), given.get(key, "0 0 0")) for key in ("rpy", "xyz"))
    return pin.SE3(pin.rpy.rpyToMatrix(*rpy), xyz)


def _floats(what: str, text: str, counts: tuple[int, ...] = (3,)) -> Array:
    """Return the numbers of an attribute, as many as one of `counts`; a `ModelError` for those that no robot has."""
    try:
        values = np.array([float(part) for part in text.split()])
    except ValueError:
        values = np.zeros(0)
    if len(values) not in counts or not (np.abs(values) <= LARGEST_COORDINATE).all():
        count = " or ".join(map(str, counts))
        raise ModelError(f"{what} must be {count} numbers within ±{LARGEST_COORDINATE:g}, got {shown(text)}")
    return values


def _number(given: Mapping[str, str], attribute: str, joint: str) -> float:
    """Return an attribute of a joint; zero when it is missing, as the URDF specification has it."""
    text = given.get(attribute, "0")
    try:
        value = float(text)
    except ValueError as error:
        raise ModelError(f"joint '{joint}': {attribute}='{text}' is not a number") from error
    if math.isnan(value) or (math.isinf(value) and attribute in ("multiplier", "offset")):
        raise ModelError(f"joint '{joint}': {attribute} must be a number, got '{text}'")
    return value
