"""Tidying of a URDF: what it leaves open, or what MuJoCo and Pinocchio take otherwise, is settled in its records."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
import pinocchio as pin

from wbc.base.errors import ModelError, choose
from wbc.base.numbers import finite_scalar
from wbc.core.robot import UNLIMITED
from wbc.robots.derivation import inertia
from wbc.robots.mechanism import along
from wbc.robots.urdf import ENDLESS, MOVING, Joint, Urdf

TAKEN_RANGE = math.pi
"""Range ± of a revolute joint that has no position limits, rad."""

DEFAULT_VELOCITY = {"revolute": 6.0, "continuous": 6.0, "prismatic": 0.5}
"""Velocity limit of a joint that has none, rad/s and m/s: between Talos (3.9–7) and HRP-4C (4.1–9.8) for legs."""

WORLDS = {"world": "MuJoCo", "universe": "Pinocchio"}
"""Names of the ground, which no link may have → whose they are."""

WAYS_OUT = {
    "floating": "the base alone may float",
    "planar": "write it as two prismatic joints and a continuous one",
    "ball": "write it as three revolute joints with massless links between them",
    "spherical": "write it as three revolute joints with massless links between them",
}
"""Joint type that is refused → what to do instead."""


def tidy(
    robot: Urdf, fixed: bool, positions: Mapping[str, float], repair: bool
) -> tuple[dict[str, float], list[str]]:
    """Settle a URDF in place, fix joints at positions (rad or m), and check inertias, or repair them.

    With `fixed` the root of the robot is bolted to the world, and a root link that stands for the world stays. Returned
    are the positions of all joints that are fixed, and what was changed, one line each.
    """
    notes = _drop_world(robot, fixed)
    _check_tree(robot)
    notes += _rename_world(robot) + robot.notes
    for name, joint in robot.joints.items():
        if joint.kind not in (*MOVING, "fixed"):
            way = WAYS_OUT.get(joint.kind, "")
            raise ModelError(
                f"joint '{name}' is of type '{joint.kind}'; supported: revolute, continuous, prismatic, fixed"
                f"{way and '; ' + way}"
            )
    notes += _settle_couplings(robot)
    if rubbing := sum(joint.rubs for joint in robot.moving.values()):
        notes.append(f"damping and friction that the URDF gives {rubbing} joints are left out")
    for name, joint in robot.moving.items():
        notes += _settle_range(joint)
        if not 0.0 < joint.speed < UNLIMITED:
            joint.speed = DEFAULT_VELOCITY[joint.kind]
            notes.append(f"joint '{name}': no velocity limit given, {joint.speed!r}")
        notes += _soften(joint)
        if not 0.0 < joint.effort < UNLIMITED:
            joint.effort = 0.0  # until the torque rule has seen the model
    locked = lock(robot, positions)
    return locked, notes + inertia.repair_inertias(robot, fixed, repair)


def lock(robot: Urdf, positions: Mapping[str, float], *, bounded: bool = True) -> dict[str, float]:
    """Fix joints at given positions, joint → rad or m, inside their limits if `bounded`.

    Joints that are coupled to one of them are fixed as well; one that is coupled itself is freed of its leader.
    Returned are the positions of all of them.
    """
    with_them = {
        name: coupling.ratio * positions[coupling.leader] + coupling.offset
        for name, coupling in robot.couplings().items()
        if coupling.leader in positions and name not in positions
    }
    fixed = {**positions, **with_them}
    for name, value in fixed.items():
        joint = robot.joints[choose("joint", name, robot.moving)]
        inside = bounded and name not in with_them and joint.low < joint.high
        low, high = (joint.low, joint.high) if inside else (-math.inf, math.inf)
        by = finite_scalar(f"locked joint '{name}'", value, low=low, high=high) * joint.axis
        joint.place *= along(by) if joint.kind == "prismatic" else pin.SE3(pin.exp3(by), np.zeros(3))
        joint.kind, joint.leader = "fixed", None
    return fixed


def _settle_range(joint: Joint) -> list[str]:
    """Settle position limits: without both a hinge turns without end."""
    name, given, low, high = joint.name, joint.limit, joint.low, joint.high
    if joint.kind == "continuous":
        return []
    if not {"lower", "upper"} & given.keys():
        if joint.kind == "prismatic":
            raise ModelError(f"prismatic joint '{name}' has no position limits")
        joint.low, joint.high = -TAKEN_RANGE, TAKEN_RANGE
        return [f"joint '{name}': no position limits given, ±{TAKEN_RANGE:.4f} rad"]
    infinite = [end for end, value in (("lower", low), ("upper", high)) if math.isinf(value)]
    said = ", ".join(f"{end}='{given.get(end)}'" for end in infinite)
    if infinite and (joint.kind == "prismatic" or not low < high):
        raise ModelError(
            f"joint '{name}' of type '{joint.kind}' must have finite position limits, got {said}"
        )
    if not low < high:
        raise ModelError(
            f"joint '{name}' has the empty position range [{given.get('lower')}, {given.get('upper')}]"
        )
    joint.low, joint.high = (
        math.copysign(math.inf, end) if abs(end) > ENDLESS else end for end in (low, high)
    )
    if len(infinite) == 2:
        joint.kind = "continuous"
        return [f"joint '{name}': {said}, turns without end"]
    return [f"joint '{name}': {said}, no limit on this side"] if infinite else []


def _settle_couplings(robot: Urdf) -> list[str]:
    """Let coupled joints follow joints that lead, in place; those of a joint that does not move do not, either."""
    notes = []
    while True:
        still = {}
        for name, joint in robot.moving.items():
            if (leader := joint.leader) is not None:
                choose(f"leader of joint '{name}' (mimic)", leader.leader, robot.joints)
                if not robot.joints[leader.leader].moves or leader.ratio == 0.0:
                    still[name] = leader.offset
        if not still:
            break
        for name, value in still.items():
            robot.joints[name].leader = None
            notes.append(f"joint '{name}': mimic of what does not move, fixed at {value:g}")
            lock(robot, {name: value}, bounded=False)
    for name, coupling in robot.couplings().items():
        robot.joints[name].leader = coupling
    return notes


def _check_tree(robot: Urdf) -> None:
    """Check that every link hangs on the root."""
    parents: dict[str, str] = {}
    for joint in robot.joints.values():
        if joint.child in parents:
            raise ModelError(f"link '{joint.child}' is the child of two joints")
        parents[joint.child] = joint.parent
    for link in parents:
        above, seen = link, set[str]()
        while above in parents:
            if above in seen:
                raise ModelError(f"link '{link}' hangs on itself: its joints form a circle")
            seen.add(above)
            above = parents[above]


def _soften(joint: Joint) -> list[str]:
    """Narrow the range of a joint to its soft limits, of a safety controller or of ros2_control; return notes.

    Beyond them the machine brakes the joint or refuses its commands.
    """
    notes = []
    for what, soft_low, soft_high in joint.soft:
        hard = joint.low, joint.high
        low, high = max(hard[0], soft_low), min(hard[1], soft_high)
        said = f"joint '{joint.name}': {what}, [{soft_low:g}, {soft_high:g}]"
        if low >= high:
            notes.append(f"{said}, leave nothing of [{hard[0]:g}, {hard[1]:g}] and are left out")
        elif (low, high) != hard:
            if not (math.isfinite(low) and math.isfinite(high)):
                notes.append(f"{said}, bound one side of a joint without end alone and are left out")
                continue
            joint.low, joint.high = low, high
            if joint.kind == "continuous":
                joint.kind = "revolute"
            notes.append(f"{said}, are taken as position limits")
    return notes


def _rename_world(robot: Urdf) -> list[str]:
    """Give links another name that are called as the ground of MuJoCo or of Pinocchio."""
    taken = {name: f"{name}_link" for name in sorted(robot.links.keys() & WORLDS.keys())}
    robot.links = {taken.get(name, name): link for name, link in robot.links.items()}
    for joint in robot.joints.values():
        joint.parent, joint.child = (taken.get(end, end) for end in (joint.parent, joint.child))
    robot.shapes = [shape._replace(link=taken.get(shape.link, shape.link)) for shape in robot.shapes]
    return [
        f"link '{name}' has the name of {WORLDS[name]}'s ground: now '{new}'" for name, new in taken.items()
    ]


def _drop_world(robot: Urdf, fixed: bool) -> list[str]:
    """Remove a root link that stands for the world: the robot's root link gets the free-flyer."""
    notes: list[str] = []
    while True:
        root = robot.root
        below = [joint for joint in robot.joints.values() if joint.parent == root]
        if len(below) != 1 or robot.links[root] is not None:
            return notes
        (joint,) = below
        if not (joint.kind == "floating" or (joint.kind == "fixed" and root == "world" and not fixed)):
            return notes
        del robot.links[root], robot.joints[joint.name]
        robot.shapes = [shape for shape in robot.shapes if shape.link != root]
        how = "is bolted there" if fixed else "floats freely"
        notes.append(f"root link '{root}' and joint '{joint.name}' removed: the robot {how}")
