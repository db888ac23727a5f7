"""One URDF string for both Pinocchio and MuJoCo: reading, tidying, limits, Pinocchio model.

What the two importers treat differently is settled here, in the string itself, so that they cannot disagree:
continuous joints, mimic joints, a "world" root, missing limits.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin

from wbc.core.errors import Array, InputError, ModelError, choose, finite_scalar, shown, shown_path
from wbc.core.files import read_xml
from wbc.core.robot import GRAVITY, UNLIMITED

Element = ElementTree.Element

CONTINUOUS_RANGE = math.pi
"""Range ± that turns a continuous joint into a revolute one, rad: both importers then give it one coordinate."""

DEFAULT_VELOCITY = {"revolute": 6.0, "prismatic": 0.5}
"""Velocity limit of a joint that has none, rad/s and m/s: between Talos (3.9–7) and HRP-4C (4.1–9.8) for legs."""

LARGEST_COORDINATE = 1e4
"""Largest coordinate of a placement or an axis, m."""

SHORTEST_AXIS = 1e-9
"""Length of an axis below which it is zero."""

XACRO = "{http://www.ros.org/wiki/xacro}"
"""Beginning of the tags of macros that no parser of URDF knows."""

WORLD = "world"
"""Name of MuJoCo's own ground, which no link may have."""

MOVING = ("revolute", "prismatic")
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
        root = ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError) as error:
        if "<xacro:" in text:
            raise ModelError(_xacro(where)) from error
        raise ModelError(f"{where} is not well-formed XML: {error}") from error
    if any(str(element.tag).startswith(XACRO) for element in root.iter()):
        raise ModelError(_xacro(where))
    if root.tag != "robot":
        raise ModelError(f"{where} must have a <robot> element at its root, got <{root.tag}>")
    if root.find("link") is None:
        raise ModelError(f"{where} has no links")
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


def triple(what: str, text: str) -> Array:
    """Return three finite numbers of an attribute that a robot can have, shape (3,); else a `ModelError`."""
    try:
        values = np.array([float(part) for part in text.split()])
    except ValueError:
        values = np.zeros(0)
    if values.shape != (3,) or not (np.abs(values) <= LARGEST_COORDINATE).all():
        raise ModelError(f"{what} must be three numbers within ±{LARGEST_COORDINATE:g}, got {shown(text)}")
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


def pinocchio_model(xml: str, name: str) -> pin.Model:
    """Return the Pinocchio model of a tidied URDF, with a free-flyer root and standard gravity, or a `ModelError`."""
    try:
        model = pin.buildModelFromXML(without_geometry(xml), pin.JointModelFreeFlyer())
    except (ValueError, RuntimeError) as error:
        raise ModelError(f"Pinocchio cannot read the URDF of '{name}': {error}") from error
    model.name = name
    model.gravity.linear = np.array([0.0, 0.0, -GRAVITY])
    return model


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


def tidy(root: Element) -> list[str]:
    """Settle in place what Pinocchio and MuJoCo would read differently; return the changes, one line each."""
    notes = _drop_world(root)
    _check_tree(root)
    notes += _rename_world(root)
    for name, joint in joints(root).items():
        kind = joint.get("type")
        if kind == "continuous":
            joint.set("type", "revolute")
            limit = _limit_of(joint)
            limit.set("lower", repr(-CONTINUOUS_RANGE))
            limit.set("upper", repr(CONTINUOUS_RANGE))
            notes.append(f"joint '{name}': continuous, now revolute within ±{CONTINUOUS_RANGE:.4f} rad")
        elif kind not in (*MOVING, "fixed"):
            raise ModelError(
                f"joint '{name}' is of type '{kind}'; supported: revolute, continuous, prismatic, fixed"
            )
        for mimic in joint.findall("mimic"):
            joint.remove(mimic)
            if kind != "fixed":
                notes.append(f"joint '{name}': mimic of '{mimic.get('joint')}', now an independent joint")
    rubbing = [name for name, joint in joints(root, MOVING).items() if _drop_dynamics(joint)]
    if rubbing:
        notes.append(f"damping and friction that the URDF gives {len(rubbing)} joints are left out")
    for name, joint in joints(root, MOVING).items():
        limit = _limit_of(joint)
        if limit.get("lower") is None and limit.get("upper") is None:
            if joint.get("type") == "prismatic":
                raise ModelError(f"prismatic joint '{name}' has no position limits")
            limit.set("lower", repr(-CONTINUOUS_RANGE))
            limit.set("upper", repr(CONTINUOUS_RANGE))
            notes.append(f"joint '{name}': no position limits given, ±{CONTINUOUS_RANGE:.4f} rad")
        if not _number(limit, "lower", name) < _number(limit, "upper", name):
            raise ModelError(
                f"joint '{name}' has the empty position range [{limit.get('lower')}, {limit.get('upper')}]"
            )
        if not 0.0 < _number(limit, "velocity", name) < UNLIMITED:
            limit.set("velocity", repr(DEFAULT_VELOCITY[str(joint.get("type"))]))
            notes.append(f"joint '{name}': no velocity limit given, {limit.get('velocity')}")
        notes += _soften(root, name, joint)
        # Pinocchio's parser needs the attribute; zero means "not given" until the torque rule has seen the model.
        if not 0.0 < _number(limit, "effort", name) < UNLIMITED:
            limit.set("effort", "0")
    return notes


def lock(root: Element, positions: Mapping[str, float]) -> None:
    """Fix joints of a tidied `<robot>` at given positions, joint → rad or m."""
    for name, value in positions.items():
        moving = joints(root, MOVING)
        joint = moving[choose("joint", name, moving)]
        limit, bounds = joint.find("limit"), (-math.inf, math.inf)
        if limit is not None and joint.get("type") != "continuous":
            lower, upper = (_number(limit, key, name) for key in ("lower", "upper"))
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
        for tag in ("axis", "limit"):
            for old in joint.findall(tag):
                joint.remove(old)


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


def _check_tree(root: Element) -> None:
    """Check that every link hangs on the root, and that placements and axes are numbers."""
    parents: dict[str, str] = {}
    for name, joint in joints(root).items():
        parent, child = parent_and_child(joint)
        if child in parents:
            raise ModelError(f"link '{child}' is the child of two joints")
        parents[child] = parent
        origin, axis = joint.find("origin"), joint.find("axis")
        placement = {} if origin is None else origin.attrib
        for key in ("xyz", "rpy"):
            triple(f"joint '{name}': {key} of its origin", placement.get(key, "0 0 0"))
        if axis is not None:
            direction = triple(f"joint '{name}': its axis", axis.get("xyz", "1 0 0"))
            if joint.get("type") != "fixed" and math.hypot(*direction) < SHORTEST_AXIS:
                raise ModelError(f"joint '{name}': its axis must not be zero, got '{axis.get('xyz')}'")
    for link in parents:
        above, seen = link, set[str]()
        while above in parents:
            if above in seen:
                raise ModelError(f"link '{link}' hangs on itself: its joints form a circle")
            seen.add(above)
            above = parents[above]


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
            _limit_of(moving[name]).set("effort" if what == "torque" else what, repr(float(value)))
    for name, (lower, upper) in (position or {}).items():
        choose("joint", name, moving)
        if not (math.isfinite(lower) and math.isfinite(upper) and lower < upper):
            raise InputError(
                f"position limits of joint '{name}' must be finite with lower < upper, got {lower}, {upper}"
            )
        _limit_of(moving[name]).set("lower", repr(float(lower)))
        _limit_of(moving[name]).set("upper", repr(float(upper)))


def joints_without_torque_limit(root: Element) -> list[str]:
    """Return the moving joints of a tidied URDF that have no torque limit."""
    return [name for name, j in joints(root, MOVING).items() if _number(_limit_of(j), "effort", name) == 0.0]


def _soften(root: Element, name: str, joint: Element) -> list[str]:
    """Narrow the range of a joint to its soft limits, of a safety controller or of ros2_control; return notes.

    Beyond them the machine brakes the joint or refuses its commands.
    """
    bounds: list[tuple[str, float, float]] = []
    for safety in joint.findall("safety_controller"):
        low, high = (_number(safety, f"soft_{side}_limit", name) for side in ("lower", "upper"))
        if low < high:  # both are zero when they are not given
            bounds.append(("soft limits of its safety_controller", low, high))
        joint.remove(safety)
    for control in root.findall("ros2_control/joint"):
        if control.get("name") == name:
            for command in control.findall("command_interface[@name='position']"):
                given = {str(each.get("name")): each.text or "" for each in command.findall("param")}
                ends = {key: text.strip() for key, text in given.items() if key in ("min", "max")}
                params = ElementTree.Element("param", ends)
                low = _number(params, "min", name) if "min" in ends else -math.inf
                high = _number(params, "max", name) if "max" in ends else math.inf
                bounds.append(("range of its ros2_control", low, high))
    notes, limit = [], _limit_of(joint)
    for what, soft_low, soft_high in bounds:
        hard = _number(limit, "lower", name), _number(limit, "upper", name)
        low, high = max(hard[0], soft_low), min(hard[1], soft_high)
        said = f"joint '{name}': {what}, [{soft_low:g}, {soft_high:g}]"
        if low >= high:
            notes.append(f"{said}, leave nothing of [{hard[0]:g}, {hard[1]:g}] and are left out")
        elif (low, high) != hard:
            limit.set("lower", repr(low))
            limit.set("upper", repr(high))
            notes.append(f"{said}, are taken as position limits")
    return notes


def _drop_dynamics(joint: Element) -> bool:
    """Remove damping and friction, which MuJoCo would simulate and the controller does not model."""
    dropped = False
    for dynamics in joint.findall("dynamics"):
        dropped |= any(
            _number(dynamics, key, str(joint.get("name"))) != 0.0 for key in ("damping", "friction")
        )
        joint.remove(dynamics)
    return dropped


def _limit_of(joint: Element) -> Element:
    limit = joint.find("limit")
    return ElementTree.SubElement(joint, "limit") if limit is None else limit


def _number(element: Element, attribute: str, joint: str) -> float:
    """Return a limit attribute; zero when it is missing, as the URDF specification has it."""
    text = element.get(attribute, "0")
    try:
        value = float(text)
    except ValueError as error:
        raise ModelError(f"joint '{joint}': {attribute}='{text}' is not a number") from error
    if math.isnan(value):
        raise ModelError(f"joint '{joint}': {attribute} is NaN")
    return value


def _rename_world(root: Element) -> list[str]:
    """Give a link that is called as MuJoCo's ground another name."""
    if not any(link.get("name") == WORLD for link in root.findall("link")):
        return []
    for element in root.iter():
        if element.tag == "link" and element.get("name") == WORLD:
            element.set("name", f"{WORLD}_link")
        elif element.tag in ("parent", "child") and element.get("link") == WORLD:
            element.set("link", f"{WORLD}_link")
    return [f"link '{WORLD}' has the name of MuJoCo's ground: now '{WORLD}_link'"]


def _drop_world(root: Element) -> list[str]:
    """Remove a root link that stands for the world: the robot's root link gets the free-flyer."""
    notes: list[str] = []
    while True:
        for kind in ("joint", "link"):
            names = [str(each.get("name")) for each in root.findall(kind)]
            if len(set(names)) != len(names):
                raise ModelError(f"two {kind}s are called '{next(n for n in names if names.count(n) > 1)}'")
        pairs = {name: parent_and_child(joint) for name, joint in joints(root).items()}
        for name, ends in pairs.items():
            for end in ends:
                if end not in names:
                    raise ModelError(f"joint '{name}' refers to link '{end}', which does not exist")
        children = {child for _, child in pairs.values()}
        roots = [name for name in names if name not in children]
        if len(roots) != 1:
            raise ModelError(
                f"the links must form one tree with one root, got {len(roots)} roots: {roots[:5]}"
            )
        below = [name for name, (parent, _) in pairs.items() if parent == roots[0]]
        link = next(link for link in root.findall("link") if link.get("name") == roots[0])
        if len(below) != 1 or link.find("inertial") is not None:
            return notes
        joint = joints(root)[below[0]]
        if not (joint.get("type") == "floating" or (joint.get("type") == "fixed" and roots[0] == "world")):
            return notes
        root.remove(link)
        root.remove(joint)
        notes.append(f"root link '{roots[0]}' and joint '{below[0]}' removed: the robot floats freely")
