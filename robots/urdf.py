"""One URDF string for both Pinocchio and MuJoCo: reading, tidying, limits, Pinocchio model.

What the two importers treat differently is settled here, in the string itself, so that they cannot disagree:
coupled joints, a "world" root, missing limits.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin

from wbc.base.errors import InputError, ModelError, choose, shown, shown_path
from wbc.base.files import read_xml
from wbc.base.numbers import Array, finite_scalar
from wbc.core.robot import GRAVITY, UNLIMITED, Coupling

Element = ElementTree.Element

TAKEN_RANGE = math.pi
"""Range ± of a revolute joint that has no position limits, rad."""

ENDLESS = 1e9
"""Position from which on a limit is none, rad. A joint that turns without end is read with limits beyond it, so that it
has one coordinate, not cosine and sine."""

DEFAULT_VELOCITY = {"revolute": 6.0, "continuous": 6.0, "prismatic": 0.5}
"""Velocity limit of a joint that has none, rad/s and m/s: between Talos (3.9–7) and HRP-4C (4.1–9.8) for legs."""

LARGEST_COORDINATE = 1e4
"""Largest coordinate of a placement or an axis, m."""

SHORTEST_AXIS = 1e-9
"""Length of an axis below which it is zero."""

XACRO = "{http://www.ros.org/wiki/xacro}"
"""Beginning of the tags of macros that no parser of URDF knows."""

WORLD = "world"
"""Name of MuJoCo's own ground, which no link may have."""

MOVING = ("revolute", "continuous", "prismatic")
"""Joint types that a robot may have after tidying; all others but "fixed" are refused."""

WAYS_OUT = {
    "floating": "the base alone may float",
    "planar": "write it as two prismatic joints and a continuous one",
    "ball": "write it as three revolute joints with massless links between them",
    "spherical": "write it as three revolute joints with massless links between them",
}
"""Joint type that is refused → what to do instead."""


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


def pinocchio_model(xml: str, name: str, fixed: bool = False) -> pin.Model:
    """Return the Pinocchio model of a tidied URDF, with standard gravity, or a `ModelError`.

    Its root is a free-flyer, or, with `fixed`, the world. Joints that mimic another one are coupled to it.
    """
    root = ElementTree.fromstring(without_geometry(xml))
    coupled = couplings(root)
    order = _order(root, coupled) if coupled else {}
    for each, joint in joints(root, MOVING).items():
        for mimic in joint.findall("mimic"):
            joint.remove(mimic)
        if joint.get("type") == "continuous":
            joint.set("type", "revolute")
            _limit_of(joint).attrib.update(lower=repr(-10.0 * ENDLESS), upper=repr(10.0 * ENDLESS))
        joint.set("name", order.get(each, each))
    given = () if fixed else (pin.JointModelFreeFlyer(),)
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
            ratio = _number(mimic, "multiplier", name) if mimic.get("multiplier") is not None else 1.0
            direct[name] = Coupling(leader, ratio, _number(mimic, "offset", name))
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


def tidy(root: Element, fixed: bool = False) -> list[str]:
    """Settle in place what Pinocchio and MuJoCo would read differently; return the changes, one line each.

    With `fixed` the root of the robot is bolted to the world, and a root link that stands for the world stays.
    """
    notes = _drop_world(root, fixed)
    _check_tree(root)
    notes += _rename_world(root)
    for name, joint in joints(root).items():
        kind = joint.get("type")
        if kind not in (*MOVING, "fixed"):
            way = WAYS_OUT.get(str(kind), "")
            raise ModelError(
                f"joint '{name}' is of type '{kind}'; supported: revolute, continuous, prismatic, fixed"
                f"{way and '; ' + way}"
            )
        for mimic in joint.findall("mimic") if kind == "fixed" else ():
            joint.remove(mimic)
    notes += _settle_couplings(root)
    rubbing = [name for name, joint in joints(root, MOVING).items() if _drop_dynamics(joint)]
    if rubbing:
        notes.append(f"damping and friction that the URDF gives {len(rubbing)} joints are left out")
    for name, joint in joints(root, MOVING).items():
        limit = _limit_of(joint)
        if joint.get("type") == "continuous":
            for end in ("lower", "upper"):
                limit.attrib.pop(end, None)
        elif limit.get("lower") is None and limit.get("upper") is None:
            if joint.get("type") == "prismatic":
                raise ModelError(f"prismatic joint '{name}' has no position limits")
            limit.set("lower", repr(-TAKEN_RANGE))
            limit.set("upper", repr(TAKEN_RANGE))
            notes.append(f"joint '{name}': no position limits given, ±{TAKEN_RANGE:.4f} rad")
        if joint.get("type") != "continuous" and not _number(limit, "lower", name) < _number(
            limit, "upper", name
        ):
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
    return notes + _narrow_leaders(root)


def _settle_couplings(root: Element) -> list[str]:
    """Let coupled joints follow joints that lead, in place; those of a joint that does not move do not, either."""
    notes, all_joints = [], joints(root)
    while True:
        still = {}
        for name, joint in joints(root, MOVING).items():
            for mimic in joint.findall("mimic"):
                leader = str(mimic.get("joint"))
                choose(f"leader of joint '{name}' (mimic)", leader, all_joints)
                ratio = _number(mimic, "multiplier", name) if mimic.get("multiplier") is not None else 1.0
                if all_joints[leader].get("type") == "fixed" or ratio == 0.0:
                    still[name] = _number(mimic, "offset", name)
        if not still:
            break
        for name, value in still.items():
            for mimic in all_joints[name].findall("mimic"):
                all_joints[name].remove(mimic)
            notes.append(f"joint '{name}': mimic of what does not move, fixed at {value:g}")
            lock(root, {name: value}, bounded=False)
    for name, coupling in couplings(root).items():
        couple(all_joints[name], coupling)
    return notes


def _narrow_leaders(root: Element) -> list[str]:
    """Narrow position and velocity limits of leaders to what the joints that are coupled to them allow, in place."""
    notes, moving = [], joints(root, MOVING)
    for name, coupling in couplings(root).items():
        limit, own = _limit_of(moving[coupling.leader]), _limit_of(moving[name])
        if moving[name].get("type") != "continuous":
            ends = sorted(
                (_number(own, end, name) - coupling.offset) / coupling.ratio for end in ("lower", "upper")
            )
            endless = moving[coupling.leader].get("type") == "continuous"
            before = (
                (-math.inf, math.inf)
                if endless
                else tuple(_number(limit, end, coupling.leader) for end in ("lower", "upper"))
            )
            low, high = max(ends[0], before[0]), min(ends[1], before[1])
            if not low < high:
                raise ModelError(
                    f"joint '{name}', coupled to '{coupling.leader}', leaves it no range: "
                    f"[{ends[0]:g}, {ends[1]:g}] of [{before[0]:g}, {before[1]:g}]"
                )
            if max(low - before[0], before[1] - high) > 1e-6:
                moving[coupling.leader].set(
                    "type", str(moving[coupling.leader].get("type")).replace("continuous", "revolute")
                )
                limit.set("lower", repr(low))
                limit.set("upper", repr(high))
                notes.append(
                    f"joint '{coupling.leader}': [{low:g}, {high:g}], for the range of '{name}', coupled to it"
                )
        fastest = _number(own, "velocity", name) / abs(coupling.ratio)
        if fastest < _number(limit, "velocity", coupling.leader) * (1.0 - 1e-9):
            limit.set("velocity", repr(fastest))
            notes.append(
                f"joint '{coupling.leader}': at most {fastest:g} a second, for '{name}', coupled to it"
            )
    return notes


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
        if moving[name].get("type") == "continuous":
            moving[name].set("type", "revolute")
        _limit_of(moving[name]).set("lower", repr(float(lower)))
        _limit_of(moving[name]).set("upper", repr(float(upper)))


def joints_without_torque_limit(root: Element) -> list[str]:
    """Return the moving joints of a tidied URDF that have no torque limit; those that are coupled need none."""
    moving = {name: joint for name, joint in joints(root, MOVING).items() if joint.find("mimic") is None}
    return [name for name, joint in moving.items() if _number(_limit_of(joint), "effort", name) == 0.0]


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
        endless = joint.get("type") == "continuous"
        hard = (
            (-math.inf, math.inf)
            if endless
            else (_number(limit, "lower", name), _number(limit, "upper", name))
        )
        low, high = max(hard[0], soft_low), min(hard[1], soft_high)
        said = f"joint '{name}': {what}, [{soft_low:g}, {soft_high:g}]"
        if low >= high:
            notes.append(f"{said}, leave nothing of [{hard[0]:g}, {hard[1]:g}] and are left out")
        elif (low, high) != hard:
            if not (math.isfinite(low) and math.isfinite(high)):
                notes.append(f"{said}, bound one side of a joint without end alone and are left out")
                continue
            joint.set("type", str(joint.get("type")).replace("continuous", "revolute"))
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


def _drop_world(root: Element, fixed: bool) -> list[str]:
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
        stands = joint.get("type") == "fixed" and roots[0] == "world" and not fixed
        if not (joint.get("type") == "floating" or stands):
            return notes
        root.remove(link)
        root.remove(joint)
        how = "is bolted there" if fixed else "floats freely"
        notes.append(f"root link '{roots[0]}' and joint '{below[0]}' removed: the robot {how}")
