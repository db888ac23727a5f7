"""The kinematic tree of a robot in a compiled MuJoCo model, written as a URDF.

A MuJoCo body becomes a link of its name. A joint whose anchor is not the origin of its body, and the first of several
joints of one body, get a link of their own. q of the URDF means MuJoCo's `qpos`: a reference other than zero goes into
the placement of the joint.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import mujoco
import numpy as np
import pinocchio as pin

from wbc.base.errors import InputError, ModelError, choose
from wbc.base.numbers import Array, finite_scalar
from wbc.core.robot import Coupling
from wbc.robots.readers.actuators_mjcf import actuators, equalities_off
from wbc.robots.readers.write_urdf import UrdfWriter, about, along

SPEED = 20.0
"""Velocity limit of every hinge, rad/s, since an MJCF gives none."""

SLIDE_SPEED = 1.0
"""Velocity limit of every slide joint, m/s."""

BETWEEN = 1e-9
"""Mass, kg, of the link between two joints of one body, and a thousand times its inertia, kg m²."""

WORLD_LINK = "world_link"
"""Root link of a robot that is bolted to the world."""

HINGE, SLIDE = int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE)
FREE, BALL = int(mujoco.mjtJoint.mjJNT_FREE), int(mujoco.mjtJoint.mjJNT_BALL)


@dataclass
class Tree:
    """The robot in a compiled model."""

    model: mujoco.MjModel
    root: int  # body that floats, or the first one of a robot that is bolted to the world
    bodies: list[int]  # bodies of the robot, parents first
    joints: dict[str, int]  # joints of the robot that move, name → number
    locked: dict[int, float]  # joints that are fixed, number → position, rad or m
    carrier: dict[int, int]  # body → the body that it is fixed to: the root, or one with a joint that moves
    coupled: dict[str, Coupling] = field(default_factory=dict)  # joints that move with another one
    fixed: bool = False  # True for a robot that is bolted to the world
    ties: list[int] = field(default_factory=list)  # equalities by which they do
    notes: list[str] = field(default_factory=list)  # remarks on the reading

    def body_name(self, body: int) -> str:
        """Return the name of the link of a body."""
        return str(self.model.body(body).name) or f"body_{body}"

    def joint_name(self, joint: int) -> str:
        """Return the name of a joint."""
        if name := str(self.model.joint(joint).name):
            return name
        body = int(self.model.jnt_bodyid[joint])
        number = joint - int(self.model.body_jntadr[body])
        return f"{self.body_name(body)}_joint{number or ''}"

    def joints_of(self, body: int) -> list[int]:
        """Return the joints of a body; none for a root that floats, whose joints the floating base replaces."""
        first, count = int(self.model.body_jntadr[body]), int(self.model.body_jntnum[body])
        if count == 0 or (body == self.root and not self.fixed):
            return []
        return [j for j in range(first, first + count) if int(self.model.jnt_type[j]) != FREE]


def find_tree(
    model: mujoco.MjModel, root: str | None, lock: Mapping[str, float], fixed: bool = False
) -> Tree:
    """Return the robot in a compiled model.

    `root` is the body that floats; the one with a free joint and other joints below it when None. `lock` is joint →
    position at which it is fixed, rad or m. With `fixed` the robot is bolted to the world; a free joint is left out.
    """
    number = _root(model, root, fixed)
    bodies = [b for b in range(1, model.nbody) if int(model.body_rootid[b]) == number]
    tree = Tree(model, number, bodies, {}, {}, {}, fixed=fixed)
    tops = {int(model.body_rootid[b]) for b in range(1, model.nbody) if int(model.body_jntnum[b])} - {number}
    tree.notes += [
        f"body '{tree.body_name(top)}' and what hangs on it is left out: no part of the robot"
        for top in sorted(tops)
    ]
    known: dict[str, int] = {}
    for body in bodies:
        for joint in tree.joints_of(body):
            name = tree.joint_name(joint)
            if int(model.jnt_type[joint]) == BALL:
                raise ModelError(
                    f"joint '{name}' is a ball joint; joints of one coordinate are required: write three hinges in its "
                    f"body in place of it, or fix it by three that are locked"
                )
            known[name] = joint
    for name, value in lock.items():
        tree.locked[known[choose("joint", name, known)]] = finite_scalar(f"locked joint '{name}'", value)
    _find_couplings(tree, known)
    tree.joints = {name: joint for name, joint in known.items() if joint not in tree.locked}
    moving = {int(model.jnt_bodyid[joint]) for joint in tree.joints.values()}
    for body in bodies:
        tree.carrier[body] = (
            body if body == number or body in moving else tree.carrier[int(model.body_parentid[body])]
        )
    if not tree.joints:
        raise ModelError(f"the robot at body '{tree.body_name(number)}' has no joint that moves")
    return tree


def _find_couplings(tree: Tree, known: Mapping[str, int]) -> None:
    """Find the joints that an equality of the first degree couples to one that is driven; the others stay as they are.

    With both driven, or none, the equality is a force that no description has.
    """
    model, names = tree.model, {number: name for name, number in known.items()}
    driven = {each.joint for each in actuators(model) if each.gear != 0.0 and each.on}
    waiting = {}
    for i in range(0 if equalities_off(model) else model.neq):
        ends = int(model.eq_obj1id[i]), int(model.eq_obj2id[i])
        kind, poly = int(model.eq_type[i]), model.eq_data[i, :5]
        if kind != mujoco.mjtEq.mjEQ_JOINT or not model.eq_active0[i] or poly[1] == 0.0 or poly[2:].any():
            continue
        if ends[0] in names and ends[1] in names:
            zero = [float(model.qpos0[model.jnt_qposadr[end]]) for end in ends]
            ratio = float(poly[1])
            waiting[i] = (*ends, ratio, zero[0] + float(poly[0]) - ratio * zero[1])
    leading = set(driven) | set(tree.locked)
    found = True
    while found:  # from the drives outwards
        found = False
        for i, (one, two, ratio, offset) in list(waiting.items()):
            if (one in leading) == (two in leading):
                continue
            if _hangs_on(model, one, two) if one in leading else _hangs_on(model, two, one):
                continue  # a leader comes before what follows it
            follower, leader, factor, shift = one, two, ratio, offset
            if one in leading:
                follower, leader, factor, shift = two, one, 1.0 / ratio, -offset / ratio
            del waiting[i]
            leading.add(follower)
            tree.ties.append(i)
            if leader in tree.locked:
                tree.locked[follower] = factor * tree.locked[leader] + shift
                continue
            above = tree.coupled.get(names[leader], Coupling(names[leader], 1.0, 0.0))
            tree.coupled[names[follower]] = Coupling(
                above.leader, factor * above.ratio, factor * above.offset + shift
            )
            found = True


def _hangs_on(model: mujoco.MjModel, joint: int, other: int) -> bool:
    """Return True if a joint is moved by another one."""
    body, above = int(model.jnt_bodyid[joint]), int(model.jnt_bodyid[other])
    if body == above:
        return joint > other
    while body not in (0, above):
        body = int(model.body_parentid[body])
    return body == above


def _root(model: mujoco.MjModel, root: str | None, fixed: bool) -> int:
    names = {str(model.body(b).name) or f"body_{b}": b for b in range(1, model.nbody)}
    if root is not None:
        number = names[choose("body", root, names)]
        if int(model.body_parentid[number]) != 0:
            top = str(model.body(int(model.body_rootid[number])).name)
            raise InputError(f"root '{root}' must be a body of the world, it hangs on '{top}'")
        return number
    floating, standing = [], []
    for name, body in names.items():
        if int(model.body_parentid[body]) != 0:
            continue
        below = [b for b in range(1, model.nbody) if int(model.body_rootid[b]) == body]
        jointed = sum(int(model.body_jntnum[b]) for b in below)
        first = int(model.body_jntadr[body])
        free = first >= 0 and int(model.jnt_type[first]) == FREE
        if free and jointed > 1:
            floating.append(name)
        elif not free and jointed:
            standing.append((jointed, name))
    if fixed and len(standing) + len(floating) > 0:
        return names[max(standing)[1] if standing else floating[0]]
    if len(floating) == 1:
        return names[floating[0]]
    if floating:
        raise ModelError(
            f"the MJCF holds {len(floating)} robots, at bodies {', '.join(map(repr, floating))}; choose one with root"
        )
    if standing:
        name = max(standing)[1]
        raise ModelError(
            f"no body with joints below it has a free joint; root='{name}' replaces the joints of that body by one, "
            "base='fixed' bolts it to the world"
        )
    raise ModelError("the MJCF holds no robot: no body has joints below it")


def placement_of(position: Array, quaternion: Array) -> pin.SE3:
    """Return a placement from MuJoCo's position (m) and quaternion (wxyz)."""
    w, x, y, z = (float(value) for value in quaternion)
    return pin.SE3(pin.Quaternion(w, x, y, z).normalized().matrix(), np.array(position, dtype=np.float64))


def write(tree: Tree, name: str, torque: Mapping[str, float]) -> UrdfWriter:
    """Return the URDF of a robot; `torque` is joint → largest torque or force, Nm or N, where it is known."""
    model = tree.model
    urdf = UrdfWriter(name)
    for body in tree.bodies:
        link = tree.body_name(body)
        inertial = placement_of(model.body_ipos[body], model.body_iquat[body])
        rotation = inertial.rotation
        inertia = rotation @ np.diag(model.body_inertia[body]) @ rotation.T
        if body == tree.root and tree.fixed:
            urdf.link(WORLD_LINK)
        elif body == tree.root:
            urdf.link(link, float(model.body_mass[body]), inertial.translation, inertia)
            continue
        above = int(model.body_parentid[body])
        parent = tree.body_name(above) if above else WORLD_LINK
        place = placement_of(model.body_pos[body], model.body_quat[body])
        joints = tree.joints_of(body)
        for joint in joints:
            anchor, axis = np.array(model.jnt_pos[joint]), np.array(model.jnt_axis[joint])
            slides = int(model.jnt_type[joint]) == SLIDE
            offset = tree.locked.get(joint, 0.0) - float(model.qpos0[model.jnt_qposadr[joint]])
            # A turn about the anchor; a shift along the axis is the same wherever the anchor lies.
            place = place * along(anchor)
            if offset:
                place = place * (along(axis * offset) if slides else about(axis, offset))
            if joint in tree.locked:
                place = place * along(-anchor)
                continue
            last = joint == [each for each in joints if each not in tree.locked][-1]
            own = (
                link
                if last and not anchor.any() and joint == joints[-1]
                else f"{link}_{tree.joint_name(joint)}"
            )
            if own != link:
                between = (
                    {}
                    if last
                    else {"mass": BETWEEN, "com": np.zeros(3), "inertia": 1e-3 * BETWEEN * np.eye(3)}
                )
                urdf.link(own, **between)  # type: ignore[arg-type]
            _write_joint(tree, urdf, joint, parent, own, place, axis, torque)
            parent, place = own, along(-anchor)
        urdf.link(link, float(model.body_mass[body]), inertial.translation, inertia)
        if parent != link:
            urdf.joint(f"{link}_fixed", "fixed", parent, link, place)
    for follower, coupling in tree.coupled.items():
        urdf.couple(follower, coupling)
    return urdf


def _write_joint(
    tree: Tree,
    urdf: UrdfWriter,
    joint: int,
    parent: str,
    child: str,
    place: pin.SE3,
    axis: Array,
    torque: Mapping[str, float],
) -> None:
    model, name = tree.model, tree.joint_name(joint)
    slides = int(model.jnt_type[joint]) == SLIDE
    limits = {"velocity": SLIDE_SPEED if slides else SPEED}
    if model.jnt_limited[joint]:
        limits["lower"], limits["upper"] = (float(value) for value in model.jnt_range[joint])
    if name in torque:
        limits["effort"] = torque[name]
    kind = "prismatic" if slides else "revolute" if model.jnt_limited[joint] else "continuous"
    urdf.joint(name, kind, parent, child, place, axis, limits)
