"""One URDF string for both Pinocchio and MuJoCo: reading, couplings, limits, Pinocchio model.

What the two importers treat differently is settled by `wbc.robots.tidying`, in the string itself, so that they cannot
disagree: coupled joints, a "world" root, missing limits.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin

from wbc.base.errors import InputError, ModelError, choose, shown, shown_path
from wbc.base.files import parse_xml, read_xml
from wbc.base.numbers import Array, finite_scalar
from wbc.core.robot import GRAVITY, UNLIMITED, Coupling

Element = ElementTree.Element

ENDLESS = 1e9
"""Position from which on a limit is none, rad. A joint that turns without end is read with limits beyond it, so that it
has one coordinate, not cosine and sine."""

LARGEST_COORDINATE = 1e4
"""Largest coordinate of a placement or an axis, m."""

MOST_LINKS = 2000
"""Most links of a robot: time grows with the square of a chain's length."""

MOST_JOINTS = 256
"""Most joints with a coordinate of their own: memory of Pinocchio's data grows with the cube of their number."""

XACRO = "{http://www.ros.org/wiki/xacro}"
"""Beginning of the tags of macros that no parser of URDF knows."""

MOVING = ("revolute", "continuous", "prismatic")
"""Joint types that a robot may have after tidying; all others but "fixed" are refused."""


def read(source: str | Path) -> Element:
    """Parse a URDF, a path or the XML itself, and return its `<robot>` element."""
    if not isinstance(source, (str, Path)):
        raise InputError(f"a URDF must be a path or the XML itself, as text, got {shown(source)}")
    text = str(source)
    where = "URDF string"
    if is_file(source):
        path = existing(text, "URDF", "a path or the XML itself")
        where, text = shown_path(path), read_xml(path, "URDF")
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
    if not (root.get("name") or "").strip():
        root.set("name", "robot")
    links, found = root.findall("link"), root.findall("joint")
    if not links:
        raise ModelError(f"{where} has no links")
    if len(links) > MOST_LINKS:
        raise ModelError(f"{where} may have {MOST_LINKS} links, got {len(links)}")
    for number, link in enumerate(links, 1):
        if not (link.get("name") or "").strip():
            raise ModelError(
                f'{where}: the <link> number {number} has no name: give it one, as in <link name="head">'
            )
    for joint in found:
        if not (joint.get("name") or "").strip():
            parent, child = parent_and_child(joint)
            raise ModelError(
                f"{where}: the <joint> from link '{parent}' to '{child}' has no name: give it one, as in "
                f'<joint name="{child}_joint">'
            )
    return root


def existing(name: str, kind: str, choices: str) -> Path:
    """Return the path of a file of a kind such as "URDF"; without one an `InputError` with the choices."""
    path = Path(name).expanduser() if name.isprintable() else Path(shown(name))
    try:
        known = path.is_file()
    except OSError:  # a name that is too long
        known = False
    if not known:
        raise InputError(f"no {kind} file {shown_path(path)}; give {choices}")
    return path


def _xacro(where: str) -> str:
    return f"{where} is a xacro that is not expanded: run `xacro FILE > robot.urdf`, and give that URDF"


def triple(what: str, text: str, counts: tuple[int, ...] = (3,)) -> Array:
    """Return the finite numbers of an attribute that a robot can have, shape (3,) or another; else a `ModelError`."""
    try:
        values = np.array([float(part) for part in text.split()])
    except ValueError:
        values = np.zeros(0)
    if len(values) not in counts or not (np.abs(values) <= LARGEST_COORDINATE).all():
        most = (
            "three numbers" if counts == (3,) else "one number" if counts == (1,) else "one number or three"
        )
        raise ModelError(f"{what} must be {most} within ±{LARGEST_COORDINATE:g}, got {shown(text)}")
    return values


def is_file(source: str | Path) -> bool:
    """Return True if the source of a URDF is a path, False if it is the XML itself."""
    return not str(source).lstrip().startswith("<")


def to_string(root: Element) -> str:
    """Return a URDF as text."""
    return ElementTree.tostring(root, encoding="unicode")


def without_geometry(urdf: str) -> str:
    """Return the links, inertias and joints of a URDF alone, which MuJoCo reads without any file."""
    root = ElementTree.fromstring(urdf)
    for child in list(root):
        if child.tag not in ("link", "joint"):
            root.remove(child)
    for link in root.findall("link"):
        for child in list(link):
            if child.tag != "inertial":
                link.remove(child)
    return to_string(root)


def pinocchio_model(xml: str, name: str, fixed: bool = False) -> pin.Model:
    """Return the Pinocchio model of a tidied URDF, with standard gravity, or a `ModelError`.

    Its root is a free-flyer, or, with `fixed`, the world. Joints that mimic another one are coupled to it.
    """
    root = ElementTree.fromstring(without_geometry(xml))
    coupled = couplings(root)
    if not 0 < (count := len(joints(root, MOVING).keys() - coupled.keys())) <= MOST_JOINTS:
        raise ModelError(
            f"'{name}' must have 1 to {MOST_JOINTS} joints that move, got {count}: lock, or free, some"
        )
    order = _order(root, coupled) if coupled else {}
    for each, joint in joints(root, MOVING).items():
        for mimic in joint.findall("mimic"):
            joint.remove(mimic)
        if joint.get("type") == "continuous":
            joint.set("type", "revolute")
            limit_of(joint).attrib.update(lower=repr(-10.0 * ENDLESS), upper=repr(10.0 * ENDLESS))
        joint.set("name", order.get(each, each))
    free = "root_joint"
    while any(each.get("name") == free for each in root):
        free += "_"  # a joint of the robot has this name
    given = () if fixed else (pin.JointModelFreeFlyer(), free)
    try:
        model = pin.buildModelFromXML(to_string(root), *given)
        for number, ordered in enumerate(list(model.names)):
            model.names[number] = next((own for own, key in order.items() if key == ordered), ordered)
        for frame in model.frames:
            if frame.type in (pin.FrameType.JOINT, pin.FrameType.FIXED_JOINT):
                frame.name = next((own for own, key in order.items() if key == frame.name), frame.name)
        for follower, coupling in coupled.items():
            leading, following = model.getJointId(coupling.leader), model.getJointId(follower)
            if leading > following:
                raise ModelError(
                    f"joint '{follower}' is coupled to '{coupling.leader}', which hangs on it: give the coupling the "
                    "other way round, or lock one of them"
                )
            model = pin.transformJointIntoMimic(model, leading, following, coupling.ratio, coupling.offset)
    except (ValueError, RuntimeError) as error:
        if isinstance(error, ModelError):
            raise
        raise ModelError(f"Pinocchio cannot read the URDF of '{name}': {error}") from error
    model.name = name
    model.gravity.linear = np.array([0.0, 0.0, -GRAVITY])
    for limits in (model.lowerPositionLimit, model.upperPositionLimit):
        limits[np.abs(limits) > ENDLESS] = np.copysign(np.inf, limits[np.abs(limits) > ENDLESS])
    return model


def couplings(root: Element) -> dict[str, Coupling]:
    """Return the joints of a `<robot>` that move with another one, joint → its leader, ratio and offset.

    A leader is a joint with a coordinate of its own: a joint that moves with one that moves with a third is coupled to
    the third.
    """
    moving = joints(root, MOVING)
    direct: dict[str, Coupling] = {}
    for name, joint in moving.items():
        for mimic in joint.findall("mimic"):
            leader = str(mimic.get("joint"))
            ratio = number(mimic, "multiplier", name) if mimic.get("multiplier") is not None else 1.0
            direct[name] = Coupling(leader, ratio, number(mimic, "offset", name))
    found = {}
    for name, first in direct.items():
        seen, coupling = [name], first
        while coupling.leader in direct:
            seen.append(coupling.leader)
            if seen.count(coupling.leader) > 1:
                if len(set(seen)) == 1:
                    raise ModelError(f"joint '{name}' is coupled to itself; name another joint as its leader")
                raise ModelError(
                    f"joints {', '.join(map(repr, dict.fromkeys(seen)))} are coupled to each other: none of them "
                    "leads; take the coupling of one of them out"
                )
            above = direct[coupling.leader]
            coupling = Coupling(
                above.leader, coupling.ratio * above.ratio, coupling.ratio * above.offset + coupling.offset
            )
        choose(f"leader of joint '{name}'", coupling.leader, moving)
        found[name] = coupling
    return found


def couple(joint: Element, coupling: Coupling) -> None:
    """Let a joint move with another one."""
    for mimic in joint.findall("mimic"):
        joint.remove(mimic)
    ElementTree.SubElement(
        joint,
        "mimic",
        joint=coupling.leader,
        multiplier=repr(float(coupling.ratio)),
        offset=repr(float(coupling.offset)),
    )


def _order(root: Element, coupled: Mapping[str, Coupling]) -> dict[str, str]:
    """Return joint → name by whose order Pinocchio numbers leaders before the joints that are coupled to them.

    Pinocchio visits the joints of a link by their names; where a leader comes later, its branch is visited first.
    """
    below: dict[str, list[str]] = {}
    ends = {name: parent_and_child(joint) for name, joint in joints(root).items()}
    for name, (parent, _) in sorted(ends.items()):
        below.setdefault(parent, []).append(name)

    def branch(name: str) -> list[str]:
        return [name] + [other for each in below.get(ends[name][1], []) for other in branch(each)]

    followed = {coupling.leader for coupling in coupled.values()}
    start = next(parent for parent in below if parent not in {child for _, child in ends.values()})
    visited: list[str] = []

    def visit(link: str) -> None:
        waiting = list(below.get(link, []))
        while waiting:
            ready = [
                each
                for each in waiting
                if not any(
                    name in coupled
                    and any(coupled[name].leader in branch(other) for other in waiting if other != each)
                    for name in branch(each)
                )
            ]
            chosen = (ready or waiting)[0]
            waiting.remove(chosen)
            visited.append(chosen)
            visit(ends[chosen][1])

    if not followed:
        return {}
    visit(start)
    return {name: f"{i:06d}" for i, name in enumerate(visited)}


def joints(root: Element, types: tuple[str, ...] | None = None) -> dict[str, Element]:
    """Return the joints by name, of the given types or all."""
    # Transmissions and ros_control blocks hold <joint> elements too: only direct children are joints.
    named = {str(joint.get("name")): joint for joint in root.findall("joint")}
    return {name: joint for name, joint in named.items() if types is None or joint.get("type") in types}


def parent_and_child(joint: Element) -> tuple[str, str]:
    """Return the names of the links that a joint connects; a `ModelError` if it names no parent or no child."""
    parent, child = joint.find("parent"), joint.find("child")
    if parent is None or child is None or not parent.get("link") or not child.get("link"):
        raise ModelError(f"joint '{joint.get('name')}' must name a parent link and a child link")
    return str(parent.get("link")), str(child.get("link"))


def moving_link_of(root: Element) -> dict[str, str]:
    """Return for every link the link that it is rigidly fixed to: the root, or the child of a moving joint."""
    fixed_to = {child: parent for parent, child in map(parent_and_child, joints(root, ("fixed",)).values())}
    result = {}
    for link in root.findall("link"):
        name = str(link.get("name"))
        while name in fixed_to:
            name = fixed_to[name]
        result[str(link.get("name"))] = name
    return result


def lock(root: Element, positions: Mapping[str, float], *, bounded: bool = True) -> dict[str, float]:
    """Fix joints of a tidied `<robot>` at given positions, joint → rad or m, inside their limits if `bounded`.

    Joints that are coupled to one of them are fixed as well; one that is coupled itself is freed of its leader.
    Returned are the positions of all of them.
    """
    coupled = couplings(root)
    with_them = {
        name: coupling.ratio * positions[coupling.leader] + coupling.offset
        for name, coupling in coupled.items()
        if coupling.leader in positions and name not in positions
    }
    fixed = {**positions, **with_them}
    for name, value in fixed.items():
        moving = joints(root, MOVING)
        joint = moving[choose("joint", name, moving)]
        limit, bounds = joint.find("limit"), (-math.inf, math.inf)
        if bounded and name not in with_them and limit is not None and joint.get("type") != "continuous":
            lower, upper = (number(limit, key, name) for key in ("lower", "upper"))
            bounds = (lower, upper) if lower < upper else bounds
        shift = finite_scalar(f"locked joint '{name}'", value, low=bounds[0], high=bounds[1])
        origin = joint.find("origin")
        if origin is None:
            origin = ElementTree.SubElement(joint, "origin")
        axis_element = joint.find("axis")
        axis = np.array([1.0, 0.0, 0.0])
        if axis_element is not None:
            axis = triple(f"joint '{name}': its axis", axis_element.get("xyz", "1 0 0"))
        axis = axis / max(float(np.linalg.norm(axis)), 1e-12)
        xyz, rpy = (triple(f"joint '{name}': its origin", origin.get(key, "0 0 0")) for key in ("xyz", "rpy"))
        place = pin.SE3(pin.rpy.rpyToMatrix(*rpy), xyz)
        slides = joint.get("type") == "prismatic"
        place *= pin.SE3(np.eye(3), axis * shift) if slides else pin.SE3(pin.exp3(axis * shift), np.zeros(3))
        origin.set("xyz", " ".join(repr(float(x)) for x in place.translation))
        origin.set("rpy", " ".join(repr(float(x)) for x in pin.rpy.matrixToRpy(place.rotation)))
        joint.set("type", "fixed")
        for tag in ("axis", "limit", "mimic"):
            for old in joint.findall(tag):
                joint.remove(old)
    return fixed


def turn_root(root: Element, turn: float) -> str:
    """Put a link above the root whose x axis points to where the old one has `turn` (rad); return its name."""
    children = {child for _, child in map(parent_and_child, joints(root).values())}
    links = [str(link.get("name")) for link in root.findall("link")]
    old = next(name for name in links if name not in children)
    new = f"{old}_forward"
    root.insert(0, ElementTree.Element("link", name=new))
    joint = ElementTree.SubElement(root, "joint", name=f"{new}_fixed", type="fixed")
    ElementTree.SubElement(joint, "parent", link=new)
    ElementTree.SubElement(joint, "child", link=old)
    ElementTree.SubElement(joint, "origin", xyz="0 0 0", rpy=f"0 0 {-turn!r}")
    return new


def set_limits(
    root: Element,
    *,
    position: Mapping[str, tuple[float, float]] | None = None,
    velocity: Mapping[str, float] | None = None,
    torque: Mapping[str, float] | None = None,
) -> None:
    """Write limits into the joints of a tidied `<robot>`.

    By joint: position (lower, upper), rad or m; velocity, rad/s or m/s; torque, Nm or N.
    """
    moving = joints(root, MOVING)
    for what, values in (("velocity", velocity), ("torque", torque)):
        for name, value in (values or {}).items():
            choose("joint", name, moving)
            if not 0.0 < value < UNLIMITED:
                raise InputError(
                    f"{what} limit of joint '{name}' must be above zero and below {UNLIMITED:g}, got {value}"
                )
            limit_of(moving[name]).set("effort" if what == "torque" else what, repr(float(value)))
    for name, (lower, upper) in (position or {}).items():
        choose("joint", name, moving)
        if not (math.isfinite(lower) and math.isfinite(upper) and lower < upper):
            raise InputError(
                f"position limits of joint '{name}' must be finite with lower < upper, got {lower}, {upper}"
            )
        if moving[name].get("type") == "continuous":
            moving[name].set("type", "revolute")
        limit_of(moving[name]).set("lower", repr(float(lower)))
        limit_of(moving[name]).set("upper", repr(float(upper)))


def joints_without_torque_limit(root: Element) -> list[str]:
    """Return the moving joints of a tidied URDF that have no torque limit; those that are coupled need none."""
    moving = {name: joint for name, joint in joints(root, MOVING).items() if joint.find("mimic") is None}
    return [name for name, joint in moving.items() if number(limit_of(joint), "effort", name) == 0.0]


def limit_of(joint: Element) -> Element:
    """Return the <limit> of a joint, a new one where it has none."""
    limit = joint.find("limit")
    return ElementTree.SubElement(joint, "limit") if limit is None else limit


def number(element: Element, attribute: str, joint: str) -> float:
    """Return a limit attribute; zero when it is missing, as the URDF specification has it."""
    text = element.get(attribute, "0")
    try:
        value = float(text)
    except ValueError as error:
        raise ModelError(f"joint '{joint}': {attribute}='{text}' is not a number") from error
    if math.isnan(value) or (math.isinf(value) and attribute in ("multiplier", "offset")):
        raise ModelError(f"joint '{joint}': {attribute} must be a number, got '{text}'")
    return value
