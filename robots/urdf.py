"""A URDF that both Pinocchio and MuJoCo read: reading, couplings, limits, shapes, Pinocchio model.

What the two importers treat differently is settled by `wbc.robots.tidying`, in the elements themselves, so that they
cannot disagree: coupled joints, a "world" root, missing limits.
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
from wbc.core.model import Coupling
from wbc.robots.source import Element

ENDLESS = 1e9
"""Position from which on a limit is none, rad. A joint that turns without end is read with limits beyond it, so that it
has one coordinate, not cosine and sine."""

LARGEST_COORDINATE = 1e4
"""Largest coordinate of a placement or an axis, m."""

MOST_LINKS = 2000
"""Most links of a robot: time grows with the square of a chain's length."""

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
        low, high = range_of(name, joint) if bounded and name not in with_them else (0.0, 0.0)
        low, high = (low, high) if low < high else (-math.inf, math.inf)
        shift = finite_scalar(f"locked joint '{name}'", value, low=low, high=high)
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


def limit_of(joint: Element) -> Element:
    """Return the <limit> of a joint, a new one where it has none."""
    limit = joint.find("limit")
    return ElementTree.SubElement(joint, "limit") if limit is None else limit


def range_of(name: str, joint: Element) -> tuple[float, float]:
    """Return the position limits of a joint, infinite for one that turns without end."""
    if joint.get("type") == "continuous":
        return -math.inf, math.inf
    return number(limit_of(joint), "lower", name), number(limit_of(joint), "upper", name)


def set_range(joint: Element, low: float, high: float) -> None:
    """Give a joint other position limits."""
    joint.set("type", str(joint.get("type")).replace("continuous", "revolute"))
    limit_of(joint).attrib.update(lower=repr(low), upper=repr(high))


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
