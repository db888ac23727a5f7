"""Closed chains of a robot in a compiled MuJoCo model: equalities that tie two of its bodies at a point or rigidly."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
import pinocchio as pin

from wbc.robots.mechanism import placement_of
from wbc.robots.readers.actuators_mjcf import equalities_off
from wbc.robots.readers.tree_mjcf import BALL, Tree


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


def joints_of(tree: Tree, chains: list[Chain]) -> set[str]:
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
