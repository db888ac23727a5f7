"""The robot in a compiled MuJoCo model: its bodies, and its joints that move, are fixed, or follow another one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import mujoco
import pinocchio as pin

from wbc.base.errors import InputError, ModelError, choose
from wbc.base.numbers import finite_scalar
from wbc.core.model import Coupling
from wbc.robots.derivation.complete import Notes
from wbc.robots.frames import SOLE_NAMES
from wbc.robots.mechanism import placement_of
from wbc.robots.readers.actuators_mjcf import actuators, equalities_off
from wbc.robots.report import listed

FREE, BALL, SLIDE = (int(getattr(mujoco.mjtJoint, f"mjJNT_{kind}")) for kind in ("FREE", "BALL", "SLIDE"))

VELOCITY_LIMIT = "velocity limit of {}"
"""Name of the custom number of an MJCF with the velocity limit of a joint, which has no attribute for it."""

SPEED, SLIDE_SPEED = 20.0, 1.0
"""Velocity limits of hinges, rad/s, and slides, m/s, for which a file gives none."""


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
    notes: Notes = field(default_factory=Notes)

    def body_name(self, body: int) -> str:
        """Return the name of the link of a body; one that is called as Pinocchio's world is has another."""
        name = str(self.model.body(body).name) or f"body_{body}"
        return f"{name}_link" if name == "universe" else name

    def joint_name(self, joint: int) -> str:
        """Return the name of a joint."""
        if name := str(self.model.joint(joint).name):
            return name
        body = int(self.model.jnt_bodyid[joint])
        number = joint - int(self.model.body_jntadr[body])
        return f"{self.body_name(body)}_joint{number or ''}"

    def balls(self) -> list[str]:
        """Return the ball joints, which are all fixed."""
        return [self.joint_name(joint) for joint in self.locked if int(self.model.jnt_type[joint]) == BALL]

    def ball(self, joint: int) -> ModelError:
        """Return the error of a ball joint that would have to move."""
        return ModelError(
            f"joint '{self.joint_name(joint)}' is a ball joint; joints of one coordinate are required: write three "
            "hinges in its body in place of it, or fix it by three that are locked"
        )

    def sites(self) -> dict[str, int]:
        """Return the named sites of the robot by the names of their frames.

        The name of a link, a joint or a sole means these: a site that is called so has `_site` behind its name.
        """
        model, found = self.model, {}
        taken = {*map(self.body_name, self.bodies), *self.joints, *SOLE_NAMES}
        for site in range(model.nsite):
            if int(model.site_bodyid[site]) in self.carrier and (name := str(model.site(site).name)):
                found[f"{name}_site" if name in taken else name] = site
        return found

    def site_place(self, site: int) -> tuple[int, pin.SE3]:
        """Return the body of a site, and its place there."""
        model = self.model
        return int(model.site_bodyid[site]), placement_of(model.site_pos[site], model.site_quat[site])

    def slides(self, joint: int) -> bool:
        """Return True for a slide, False for a hinge."""
        return int(self.model.jnt_type[joint]) == SLIDE

    def speeds(self) -> dict[str, float]:
        """Return the velocity limits that the file gives, joint → rad/s or m/s."""
        given = {name: VELOCITY_LIMIT.format(name) for name in self.joints}
        known = {self.model.numeric(i).name: i for i in range(self.model.nnumeric)}
        return {n: float(self.model.numeric(known[g]).data[0]) for n, g in given.items() if g in known}

    def note_speeds(self) -> None:
        """Note the joints whose velocity limit is the default, because the file gives none."""
        given = self.speeds()
        if without := [name for name in self.joints if name not in given]:
            whose = "" if len(without) == len(self.joints) else f" of {listed(without)}"
            self.notes.append(
                f"velocity limits{whose}: an MJCF has none; {SPEED:g} rad/s (slides {SLIDE_SPEED:g} m/s)"
            )

    def reference(self, joint: int) -> float:
        """Return the position of a joint in which the file shows the robot, rad or m."""
        return float(self.model.qpos0[self.model.jnt_qposadr[joint]])

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
    every = [joint for body in bodies for joint in tree.joints_of(body)]
    known = {tree.joint_name(joint): joint for joint in every if int(model.jnt_type[joint]) != BALL}
    driven = {each.joint for each in actuators(model) if each.gear != 0.0 and each.on} & set(every)
    for joint in set(every) - set(known.values()):
        if joint in driven or not driven:
            raise tree.ball(joint)
        tree.locked[joint] = 1.0  # a quaternion that turns by nothing
    for name, value in lock.items():
        tree.locked[known[choose("joint", name, known)]] = finite_scalar(f"locked joint '{name}'", value)
    _find_couplings(tree, known, driven)
    tree.joints = {name: joint for name, joint in known.items() if joint not in tree.locked}
    moving = {int(model.jnt_bodyid[joint]) for joint in tree.joints.values()}
    for body in bodies:
        tree.carrier[body] = (
            body if body == number or body in moving else tree.carrier[int(model.body_parentid[body])]
        )
    if not tree.joints:
        raise ModelError(f"the robot at body '{tree.body_name(number)}' has no joint that moves")
    return tree


def _find_couplings(tree: Tree, known: Mapping[str, int], driven: set[int]) -> None:
    """Find the joints that an equality of the first degree couples to one that is driven; the others stay as they are.

    With both driven, or none, the equality is a force that no description has.
    """
    model, names = tree.model, {number: name for name, number in known.items()}
    waiting = {}
    for i in range(0 if equalities_off(model) else model.neq):
        ends = int(model.eq_obj1id[i]), int(model.eq_obj2id[i])
        kind, poly = int(model.eq_type[i]), model.eq_data[i, :5]
        if kind != mujoco.mjtEq.mjEQ_JOINT or not model.eq_active0[i] or poly[1] == 0.0 or poly[2:].any():
            continue
        if ends[0] in names and ends[1] in names:
            zero = [tree.reference(end) for end in ends]
            ratio = float(poly[1])
            waiting[i] = (*ends, ratio, zero[0] + float(poly[0]) - ratio * zero[1])
    leading = driven | set(tree.locked)
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
            found = True
            if leader in tree.locked:
                tree.locked[follower] = factor * tree.locked[leader] + shift
                continue
            above = tree.coupled.get(names[leader], Coupling(names[leader], 1.0, 0.0))
            tree.coupled[names[follower]] = Coupling(
                above.leader, factor * above.ratio, factor * above.offset + shift
            )


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
