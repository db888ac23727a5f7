"""Tidying of a URDF: what Pinocchio and MuJoCo would read differently is settled in the elements themselves."""

from __future__ import annotations

import math
from xml.etree import ElementTree

from wbc.base.errors import ModelError, choose
from wbc.core.robot import UNLIMITED
from wbc.robots.source import Element
from wbc.robots.urdf import (
    ENDLESS,
    MOVING,
    couple,
    couplings,
    joints,
    limit_of,
    lock,
    number,
    parent_and_child,
    range_of,
    set_range,
    triple,
)

TAKEN_RANGE = math.pi
"""Range ± of a revolute joint that has no position limits, rad."""

DEFAULT_VELOCITY = {"revolute": 6.0, "continuous": 6.0, "prismatic": 0.5}
"""Velocity limit of a joint that has none, rad/s and m/s: between Talos (3.9–7) and HRP-4C (4.1–9.8) for legs."""

SHORTEST_AXIS = 1e-9
"""Length of an axis below which it is zero."""

WORLDS = {"world": "MuJoCo", "universe": "Pinocchio"}
"""Names of the ground, which no link may have → whose they are."""

WAYS_OUT = {
    "floating": "the base alone may float",
    "planar": "write it as two prismatic joints and a continuous one",
    "ball": "write it as three revolute joints with massless links between them",
    "spherical": "write it as three revolute joints with massless links between them",
}
"""Joint type that is refused → what to do instead."""


def tidy(root: Element, fixed: bool = False) -> list[str]:
    """Settle in place what Pinocchio and MuJoCo would read differently; return the changes, one line each.

    With `fixed` the root of the robot is bolted to the world, and a root link that stands for the world stays.
    """
    notes = _drop_world(root, fixed)
    _check_tree(root)
    notes += _rename_world(root) + _settle_scales(root)
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
        limit = limit_of(joint)
        notes += _settle_range(name, joint)
        if not 0.0 < number(limit, "velocity", name) < UNLIMITED:
            limit.set("velocity", repr(DEFAULT_VELOCITY[str(joint.get("type"))]))
            notes.append(f"joint '{name}': no velocity limit given, {limit.get('velocity')}")
        notes += _soften(root, name, joint)
        # Pinocchio's parser needs the attribute; zero means "not given" until the torque rule has seen the model.
        if not 0.0 < number(limit, "effort", name) < UNLIMITED:
            limit.set("effort", "0")
    return notes


def _settle_range(name: str, joint: Element) -> list[str]:
    """Write position limits as both parsers read them: without both a hinge turns without end."""
    limit, kind = limit_of(joint), joint.get("type")
    if kind == "continuous":
        for end in ("lower", "upper"):
            limit.attrib.pop(end, None)
        return []
    if limit.get("lower") is None and limit.get("upper") is None:
        if kind == "prismatic":
            raise ModelError(f"prismatic joint '{name}' has no position limits")
        set_range(joint, -TAKEN_RANGE, TAKEN_RANGE)
        return [f"joint '{name}': no position limits given, ±{TAKEN_RANGE:.4f} rad"]
    low, high = range_of(name, joint)
    infinite = [end for end, value in (("lower", low), ("upper", high)) if math.isinf(value)]
    given = ", ".join(f"{end}='{limit.get(end)}'" for end in infinite)
    if infinite and (kind == "prismatic" or not low < high):
        raise ModelError(f"joint '{name}' of type '{kind}' must have finite position limits, got {given}")
    if not low < high:
        raise ModelError(
            f"joint '{name}' has the empty position range [{limit.get('lower')}, {limit.get('upper')}]"
        )
    if len(infinite) == 2:
        joint.set("type", "continuous")
        return [f"joint '{name}': {given}, turns without end", *_settle_range(name, joint)]
    if not infinite:
        return []
    set_range(joint, max(low, -10.0 * ENDLESS), min(high, 10.0 * ENDLESS))
    return [f"joint '{name}': {given}, no limit on this side"]


def _settle_scales(root: Element) -> list[str]:
    """Give a mesh with one number as its scale this number in all axes."""
    notes = []
    for link in root.findall("link"):
        for mesh in link.iter("mesh"):
            if len((scale := mesh.get("scale", "")).split()) == 1:
                mesh.set("scale", " ".join(3 * scale.split()))
                notes.append(
                    f"link '{link.get('name')}': scale '{scale}' of a mesh is that of all three axes"
                )
    return notes


def _settle_couplings(root: Element) -> list[str]:
    """Let coupled joints follow joints that lead, in place; those of a joint that does not move do not, either."""
    notes, all_joints = [], joints(root)
    while True:
        still = {}
        for name, joint in joints(root, MOVING).items():
            for mimic in joint.findall("mimic"):
                leader = str(mimic.get("joint"))
                choose(f"leader of joint '{name}' (mimic)", leader, all_joints)
                ratio = number(mimic, "multiplier", name) if mimic.get("multiplier") is not None else 1.0
                if all_joints[leader].get("type") == "fixed" or ratio == 0.0:
                    still[name] = number(mimic, "offset", name)
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


def _soften(root: Element, name: str, joint: Element) -> list[str]:
    """Narrow the range of a joint to its soft limits, of a safety controller or of ros2_control; return notes.

    Beyond them the machine brakes the joint or refuses its commands.
    """
    bounds: list[tuple[str, float, float]] = []
    for safety in joint.findall("safety_controller"):
        low, high = (number(safety, f"soft_{side}_limit", name) for side in ("lower", "upper"))
        if low < high:  # both are zero when they are not given
            bounds.append(("soft limits of its safety_controller", low, high))
        joint.remove(safety)
    for control in root.findall("ros2_control/joint"):
        if control.get("name") == name:
            for command in control.findall("command_interface[@name='position']"):
                given = {str(each.get("name")): each.text or "" for each in command.findall("param")}
                ends = {key: text.strip() for key, text in given.items() if key in ("min", "max")}
                params = ElementTree.Element("param", ends)
                low = number(params, "min", name) if "min" in ends else -math.inf
                high = number(params, "max", name) if "max" in ends else math.inf
                bounds.append(("range of its ros2_control", low, high))
    notes = []
    for what, soft_low, soft_high in bounds:
        hard = range_of(name, joint)
        low, high = max(hard[0], soft_low), min(hard[1], soft_high)
        said = f"joint '{name}': {what}, [{soft_low:g}, {soft_high:g}]"
        if low >= high:
            notes.append(f"{said}, leave nothing of [{hard[0]:g}, {hard[1]:g}] and are left out")
        elif (low, high) != hard:
            if not (math.isfinite(low) and math.isfinite(high)):
                notes.append(f"{said}, bound one side of a joint without end alone and are left out")
                continue
            set_range(joint, low, high)
            notes.append(f"{said}, are taken as position limits")
    return notes


def _drop_dynamics(joint: Element) -> bool:
    """Remove damping and friction, which MuJoCo would simulate and the controller does not model."""
    dropped = False
    for dynamics in joint.findall("dynamics"):
        dropped |= any(
            number(dynamics, key, str(joint.get("name"))) != 0.0 for key in ("damping", "friction")
        )
        joint.remove(dynamics)
    return dropped


def _rename_world(root: Element) -> list[str]:
    """Give links another name that are called as the ground of MuJoCo or of Pinocchio."""
    taken = {str(link.get("name")) for link in root.findall("link")} & {*WORLDS}
    for element in root.iter():
        key = "name" if element.tag == "link" else "link"
        if element.tag in ("link", "parent", "child") and element.get(key) in taken:
            element.set(key, f"{element.get(key)}_link")
    return [
        f"link '{name}' has the name of {WORLDS[name]}'s ground: now '{name}_link'" for name in sorted(taken)
    ]


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
