"""The MJCF of a robot alone, written from the arrays of a compiled MuJoCo model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin

from wbc.base.errors import ModelError
from wbc.base.numbers import Array
from wbc.core.model import Closure
from wbc.robots.readers.chains_mjcf import Chain
from wbc.robots.readers.source_mjcf import SLIDE, Mjcf, along, motion, placed, placement_of, text
from wbc.robots.readers.tree_mjcf import Tree
from wbc.robots.source import Element

SPEED = 20.0
"""Velocity limit of every hinge, rad/s, since an MJCF gives none."""

SLIDE_SPEED = 1.0
"""Velocity limit of every slide joint, m/s."""


def write(
    tree: Tree, name: str, torque: Mapping[str, float], chains: Sequence[Chain]
) -> tuple[Mjcf, tuple[Closure, ...]]:
    """Return bodies, joints, sites and couplings of a robot, without shapes, and its closures, whose ends are sites.

    Joints that are locked are a part of the placement of their body. `torque` is joint → largest torque or force, Nm or
    N, where it is known.
    """
    model, root = tree.model, ElementTree.Element("mujoco", model=name)
    ElementTree.SubElement(root, "compiler", angle="radian", autolimits="true", inertiafromgeom="false")
    ElementTree.SubElement(root, "size", nuser_jnt="1")
    elements = {0: ElementTree.SubElement(root, "worldbody")}
    for body in tree.bodies:
        above, floats = int(model.body_parentid[body]), body == tree.root and not tree.fixed
        place = pin.SE3.Identity() if floats else placement_of(model.body_pos[body], model.body_quat[body])
        link, place, moving = tree.body_name(body), *_motions(tree, body, place)
        carrier = elements[above]
        anchor = moving[-1][1] if moving else np.zeros(3)
        if anchor.any():  # a link has the frame of its joint: the body is fixed to one that has it
            behind = f"{link}_{tree.joint_name(moving[-1][0])}"
            carrier = _element("body", carrier, behind, place * along(anchor))
            place = along(-anchor)
        elements[body] = element = _element("body", carrier, link, place)
        if floats:
            ElementTree.SubElement(element, "freejoint")
        for joint, at, axis in moving:
            own = carrier if anchor.any() else element
            own.append(_joint(tree, joint, at - anchor, axis, torque))
        if model.body_mass[body] != 0.0:
            inertial = {"pos": text(model.body_ipos[body]), "quat": text(model.body_iquat[body])}
            inertial |= {
                "mass": repr(float(model.body_mass[body])),
                "diaginertia": text(model.body_inertia[body]),
            }
            ElementTree.SubElement(element, "inertial", inertial)
    taken = {*map(tree.body_name, tree.bodies), *tree.sites()}
    for frame, site in tree.sites().items():
        place = placement_of(model.site_pos[site], model.site_quat[site])
        _element("site", elements[int(model.site_bodyid[site])], frame, place)
    ties = ElementTree.SubElement(root, "equality")
    for follower, coupling in tree.coupled.items():
        one, two = (_reference(tree, joint) for joint in (follower, coupling.leader))
        poly = coupling.offset - one + coupling.ratio * two, coupling.ratio, 0.0, 0.0, 0.0
        ElementTree.SubElement(ties, "joint", joint1=follower, joint2=coupling.leader, polycoef=text(poly))
    closures = []
    for chain in chains:
        ends = [f"{chain.name}_{side}" for side in (1, 2)]
        for end, body, place in zip(ends, chain.ends, chain.places, strict=True):
            if end in taken:
                raise ModelError(f"closure '{chain.name}': a body is called '{end}', as its end would be")
            taken.add(end)
            _element("site", elements[body], end, place)
        closures.append(Closure(chain.name, ends[0], ends[1], chain.rotation))
    return Mjcf(root), tuple(closures)


def _motions(tree: Tree, body: int, place: pin.SE3) -> tuple[pin.SE3, list[tuple[int, Array, Array]]]:
    """Return the placement of a body with joints that are locked, and the joints that move: number, anchor and axis.

    What a locked joint moves, the joints before it carry along: in the axes of the body they lie elsewhere.
    """
    model, moving = tree.model, list[tuple[int, Array, Array]]()
    for joint in tree.joints_of(body):
        anchor, axis = np.array(model.jnt_pos[joint]), np.array(model.jnt_axis[joint])
        if joint not in tree.locked:
            moving.append((joint, anchor, axis))
        elif by := tree.locked[joint] - float(model.qpos0[model.jnt_qposadr[joint]]):
            shift = along(anchor) * motion(int(model.jnt_type[joint]), axis, by) * along(-anchor)
            place = place * shift
            moving = [(each, shift.actInv(at), shift.rotation.T @ about) for each, at, about in moving]
    return place, moving


def _joint(tree: Tree, joint: int, anchor: Array, axis: Array, torque: Mapping[str, float]) -> Element:
    model, name, slides = tree.model, tree.joint_name(joint), int(tree.model.jnt_type[joint]) == SLIDE
    made = ElementTree.Element("joint", name=name, type="slide" if slides else "hinge", pos=text(anchor))
    made.attrib.update(axis=text(axis), user=text((SLIDE_SPEED if slides else SPEED,)))
    if reference := float(model.qpos0[model.jnt_qposadr[joint]]):
        made.set("ref", repr(reference))
    if model.jnt_limited[joint]:
        made.set("range", text(model.jnt_range[joint]))
    if name in torque:
        made.set("actuatorfrcrange", text((-torque[name], torque[name])))
    return made


def _reference(tree: Tree, joint: str) -> float:
    return float(tree.model.qpos0[tree.model.jnt_qposadr[tree.joints[joint]]])


def _element(tag: str, parent: Element, name: str, place: pin.SE3) -> Element:
    """Add a body or a site to a body."""
    return ElementTree.SubElement(parent, tag, {"name": name, **placed(place)})
