"""Links and joints of a robot, and its closed chains, made of MuJoCo's compiled arrays.

A chain is closed by an equality that ties two of its bodies at a point or rigidly.

A position of a joint is MuJoCo's `qpos`. The frame of a joint lies at its anchor, in the axes that its body has at
position zero.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
import pinocchio as pin

from wbc.base.errors import ModelError
from wbc.base.numbers import Array
from wbc.core.frames import yaw_rotation
from wbc.core.model import Closure
from wbc.robots.mechanism import (
    TURNED,
    WORLD_LINK,
    Geometry,
    Mechanism,
    add_joint,
    along,
    free_name,
    placement_of,
)
from wbc.robots.readers.actuators_mjcf import equalities_off
from wbc.robots.readers.tree_mjcf import BALL, SLIDE_SPEED, SPEED, Tree


@dataclass(frozen=True)
class Chain:
    """A closed chain.

    Attributes:
        number: Number of its equality.
        name: Name of the equality.
        ends: The two bodies that it ties.
        places: Place of the closure in each of them.
        rotation: True for a weld, which ties the orientations as well.
    """

    number: int
    name: str
    ends: tuple[int, int]
    places: tuple[pin.SE3, pin.SE3]
    rotation: bool


def find_chains(tree: Tree) -> list[Chain]:
    """Return the closed chains of a robot; an equality that is not active at the start closes none."""
    model, kinds, found = tree.model, mujoco.mjtEq, []
    for i in range(0 if equalities_off(model) else model.neq):
        kind, one, two = int(model.eq_type[i]), int(model.eq_obj1id[i]), int(model.eq_obj2id[i])
        if not model.eq_active0[i] or kind not in (kinds.mjEQ_CONNECT, kinds.mjEQ_WELD):
            continue
        data, weld = model.eq_data[i], kind == kinds.mjEQ_WELD
        if int(model.eq_objtype[i]) == mujoco.mjtObj.mjOBJ_SITE:
            (one, first), (two, second) = tree.site_place(one), tree.site_place(two)
            places = first, second
        elif weld:
            places = placement_of(data[3:6], data[6:10]), pin.SE3(np.eye(3), np.array(data[:3]))
        else:
            places = tuple(pin.SE3(np.eye(3), np.array(data[k : k + 3])) for k in (0, 3))
        carrier = {**tree.carrier, 0: 0} if tree.fixed else tree.carrier
        ends = carrier.get(one), carrier.get(two)
        if ends[0] is not None and ends[1] is not None and ends[0] != ends[1]:
            name = str(model.equality(i).name) or f"equality_{i}"
            found.append(Chain(i, name, (one, two), (places[0], places[1]), weld))
    return found


def joints_between(tree: Tree, chains: list[Chain]) -> set[str]:
    """Return the joints between the ends of closed chains; a ball joint there, which cannot be fixed, is refused."""
    found = set[int]()
    for chain in chains:
        sides = []
        for body in chain.ends:
            side, above = set[int](), body
            while above:
                side |= set(tree.joints_of(above))
                above = int(tree.model.body_parentid[above])
            sides.append(side)
        found |= sides[0] ^ sides[1]
    for joint in found:
        if int(tree.model.jnt_type[joint]) == BALL:
            tree.refuse_ball(joint)
    return {name for name, joint in tree.joints.items() if joint in found}


def mechanism(
    tree: Tree,
    torque: Mapping[str, float],
    chains: Sequence[Chain],
    shapes: tuple[Geometry, ...],
    turn: float,
) -> Mechanism:
    """Return the links, joints, sites and couplings of a robot, with the ends of closed chains as frames.

    Joints that are locked are a part of the placement of their body. `torque` is joint → largest torque or force, Nm or
    N, where it is known. With `turn`, rad, a link is put above the root whose x axis points to where the old one has
    this angle.
    """
    compiled, model = tree.model, pin.Model()
    # Body → joint that moves it, its place in that joint's frame, its own frame.
    at = {0: (0, pin.SE3.Identity(), 0)}
    inertias: dict[str, pin.Inertia] = {}
    if tree.fixed:
        at[0] = 0, pin.SE3.Identity(), model.addBodyFrame(WORLD_LINK, 0, pin.SE3.Identity(), 0)
    for body in tree.bodies:
        link = tree.body_name(body)
        parent, place, frame = at[int(compiled.body_parentid[body])]
        if body == tree.root and not tree.fixed:
            parent = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), free_name(tree.joints))
            frame, own = model.addJointFrame(parent, 0), pin.SE3(yaw_rotation(-turn), np.zeros(3))
            if turn:
                frame = model.addBodyFrame(f"{link}{TURNED}", parent, pin.SE3.Identity(), frame)
            moving: list[tuple[int, Array, Array]] = []
        else:
            own, moving = _motions(tree, body)
        place = place * own
        for joint, anchor, axis in moving:
            name, slides = tree.joint_name(joint), tree.slides(joint)
            inside = along(anchor)
            if reference := tree.reference(joint):
                inside = inside * _motion(tree, joint, axis, -reference)
            low, high = compiled.jnt_range[joint] if compiled.jnt_limited[joint] else (-np.inf, np.inf)
            limits = torque.get(name, 0.0), SLIDE_SPEED if slides else SPEED, low, high
            parent = add_joint(model, parent, place * inside, name, slides, axis, limits)
            frame, place = model.addJointFrame(parent, frame), along(-anchor)
        if moving and moving[-1][1].any():  # a link has the frame of its joint: the body is fixed to one
            behind = f"{link}_{tree.joint_name(moving[-1][0])}"
            frame = model.addBodyFrame(behind, parent, pin.SE3.Identity(), frame)
        at[body] = parent, place, model.addBodyFrame(link, parent, place, frame)
        if mass := float(compiled.body_mass[body]):
            inertia = pin.Inertia(mass, np.zeros(3), np.diag(compiled.body_inertia[body]))
            inertias[link] = placement_of(compiled.body_ipos[body], compiled.body_iquat[body]).act(inertia)
            model.appendBodyToJoint(parent, inertias[link], place)
    for name, body, inside in _frames(tree, chains):
        parent, place, frame = at[body]
        model.addFrame(pin.Frame(name, parent, frame, place * inside, pin.FrameType.OP_FRAME), False)
    return Mechanism(model, inertias, dict(tree.coupled), shapes)


def _frames(tree: Tree, chains: Sequence[Chain]) -> Iterator[tuple[str, int, pin.SE3]]:
    """Yield the sites of a robot and the ends of its closed chains: name, body, and place in the body."""
    for name, site in tree.sites().items():
        yield name, *tree.site_place(site)
    for chain in chains:
        yield from zip(_ends(chain), chain.ends, chain.places, strict=True)


def closures(tree: Tree, chains: Sequence[Chain]) -> tuple[Closure, ...]:
    """Return the closures of a robot, whose ends are frames of its mechanism."""
    taken, found = {*map(tree.body_name, tree.bodies), *tree.sites()}, []
    for chain in chains:
        one, two = _ends(chain)
        for end in (one, two):
            if end in taken:
                raise ModelError(f"closure '{chain.name}': a body is called '{end}', as its end would be")
            taken.add(end)
        found.append(Closure(chain.name, one, two, chain.rotation))
    return tuple(found)


def _ends(chain: Chain) -> tuple[str, str]:
    return f"{chain.name}_1", f"{chain.name}_2"


def _motions(tree: Tree, body: int) -> tuple[pin.SE3, list[tuple[int, Array, Array]]]:
    """Return the placement of a body with joints that are locked, and the joints that move: number, anchor and axis.

    What a locked joint moves, the joints before it carry along: in the axes of the body they lie elsewhere.
    """
    model, moving = tree.model, list[tuple[int, Array, Array]]()
    place = placement_of(model.body_pos[body], model.body_quat[body])
    for joint in tree.joints_of(body):
        anchor, axis = np.array(model.jnt_pos[joint]), np.array(model.jnt_axis[joint])
        if joint not in tree.locked:
            moving.append((joint, anchor, axis))
        elif by := tree.locked[joint] - tree.reference(joint):
            shift = along(anchor) * _motion(tree, joint, axis, by) * along(-anchor)
            place = place * shift
            moving = [(each, shift.actInv(at), shift.rotation.T @ about) for each, at, about in moving]
    return place, moving


def _motion(tree: Tree, joint: int, axis: Array, by: float) -> pin.SE3:
    """Return the motion of a hinge or a slide about its axis, of unit length, by an angle (rad) or a way (m)."""
    return along(by * axis) if tree.slides(joint) else pin.SE3(pin.exp3(by * axis), np.zeros(3))
