"""The robot in a compiled MuJoCo model: its bodies, and its joints that move, are fixed, or follow another one."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from typing import NamedTuple, NoReturn

import mujoco
import pinocchio as pin

from wbc.base.errors import InputError, ModelError, choose
from wbc.base.numbers import finite_scalar
from wbc.core.model import Coupling
from wbc.robots.frames import SOLE_NAMES
from wbc.robots.mechanism import placement_of
from wbc.robots.readers.actuators_mjcf import driven, equalities_off

FREE, BALL, SLIDE = (int(getattr(mujoco.mjtJoint, f"mjJNT_{kind}")) for kind in ("FREE", "BALL", "SLIDE"))

SPEED, SLIDE_SPEED = 20.0, 1.0
"""Velocity limits of hinges, rad/s, and slides, m/s: an MJCF has none."""


@dataclass(frozen=True, eq=False)
class Tree:
    """The robot in a compiled model.

    Attributes:
        model: The compiled model.
        root: Body that floats, or the first one of a robot that is bolted to the world.
        bodies: Bodies of the robot, parents first.
        fixed: True for a robot that is bolted to the world.
        joints: Joints of the robot that move, name → number.
        locked: Joints that are fixed, number → position, rad or m; 1 for a ball joint.
        carrier: Body → the body that it is fixed to: the root, or one with a joint that moves.
        coupled: Joints that move with another one, name → coupling.
        ties: Equalities by which they do.
    """

    model: mujoco.MjModel
    root: int
    bodies: list[int]
    fixed: bool
    joints: Mapping[str, int] = field(default_factory=dict)
    locked: Mapping[int, float] = field(default_factory=dict)
    carrier: Mapping[int, int] = field(default_factory=dict)
    coupled: Mapping[str, Coupling] = field(default_factory=dict)
    ties: tuple[int, ...] = ()

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

    def left_out(self) -> list[str]:
        """Return a note on each body of the file with joints that is no part of the robot."""
        model = self.model
        tops = {int(model.body_rootid[b]) for b in range(1, model.nbody) if int(model.body_jntnum[b])}
        return [
            f"body '{self.body_name(top)}' and what hangs on it is left out: no part of the robot"
            for top in sorted(tops - {self.root})
        ]

    def ball_joints(self) -> list[str]:
        """Return the ball joints, which are all fixed."""
        return [self.joint_name(joint) for joint in self.locked if int(self.model.jnt_type[joint]) == BALL]

    def refuse_ball(self, joint: int) -> NoReturn:
        """Raise a `ModelError` for a ball joint that would have to move."""
        raise ModelError(
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
    tree = Tree(model, number, bodies, fixed)
    every = [joint for body in bodies for joint in tree.joints_of(body)]
    known = {tree.joint_name(joint): joint for joint in every if int(model.jnt_type[joint]) != BALL}
    moved = driven(model) & set(every)
    locked: dict[int, float] = {}
    for joint in set(every) - set(known.values()):
        if joint in moved or not moved:
            tree.refuse_ball(joint)
        locked[joint] = 1.0  # a quaternion that turns by nothing
    for name, value in lock.items():
        locked[known[choose("joint", name, known)]] = finite_scalar(f"locked joint '{name}'", value)
    coupled, ties = _find_couplings(tree, known, moved, locked)
    joints = {name: joint for name, joint in known.items() if joint not in locked}
    if not joints:
        raise ModelError(f"the robot at body '{tree.body_name(number)}' has no joint that moves")
    moving = {int(model.jnt_bodyid[joint]) for joint in joints.values()} | {number}
    carrier: dict[int, int] = {}
    for body in bodies:
        carrier[body] = body if body in moving else carrier[int(model.body_parentid[body])]
    return replace(tree, joints=joints, locked=locked, carrier=carrier, coupled=coupled, ties=ties)


class _Tie(NamedTuple):
    """Equality of the first degree: the position of a joint is the ratio times that of another one, plus an offset."""

    number: int
    one: int
    two: int
    ratio: float
    offset: float

    def turned(self) -> _Tie:
        """Return the same equality for the other joint."""
        return _Tie(self.number, self.two, self.one, 1.0 / self.ratio, -self.offset / self.ratio)


def _find_couplings(
    tree: Tree, known: Mapping[str, int], moved: set[int], locked: dict[int, float]
) -> tuple[dict[str, Coupling], tuple[int, ...]]:
    """Return the joints that an equality couples to one that is driven, and these equalities, from the drives outwards.

    Joints that are coupled to a locked one are locked too: `locked` gets them. With both joints of an equality driven,
    or none, it is a force that no description has.
    """
    names, coupled = {number: name for name, number in known.items()}, dict[str, Coupling]()
    leading, ties, waiting = moved | set(locked), list[int](), _ties(tree, names)
    while True:
        left = []
        for each in waiting:
            if (tie := _directed(each, leading, tree.model)) is None:
                left.append(each)
                continue
            ties.append(tie.number)
            leading.add(tie.one)
            if tie.two in locked:
                locked[tie.one] = tie.ratio * locked[tie.two] + tie.offset
                continue
            above = coupled.get(names[tie.two], Coupling(names[tie.two], 1.0, 0.0))
            ratio, offset = tie.ratio * above.ratio, tie.ratio * above.offset + tie.offset
            coupled[names[tie.one]] = Coupling(above.leader, ratio, offset)
        if len(left) == len(waiting):
            return coupled, tuple(ties)
        waiting = left


def _ties(tree: Tree, joints: Collection[int]) -> list[_Tie]:
    """Return the equalities of the first degree between two of some joints that are active at the start."""
    model, found = tree.model, []
    for i in range(0 if equalities_off(model) else model.neq):
        one, two = int(model.eq_obj1id[i]), int(model.eq_obj2id[i])
        kind, poly = int(model.eq_type[i]), model.eq_data[i, :5]
        if kind != mujoco.mjtEq.mjEQ_JOINT or not model.eq_active0[i] or poly[1] == 0.0 or poly[2:].any():
            continue
        if one in joints and two in joints:
            ratio = float(poly[1])
            found.append(
                _Tie(i, one, two, ratio, tree.reference(one) + float(poly[0]) - ratio * tree.reference(two))
            )
    return found


def _directed(tie: _Tie, leading: Collection[int], model: mujoco.MjModel) -> _Tie | None:
    """Return an equality for its joint that follows; None if both or none lead, or the follower carries the leader."""
    if (tie.one in leading) == (tie.two in leading):
        return None
    tie = tie.turned() if tie.one in leading else tie
    return None if _hangs_on(model, tie.two, tie.one) else tie  # a leader comes before what follows it


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
