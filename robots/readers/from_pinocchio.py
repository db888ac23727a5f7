"""A Pinocchio model written as a URDF."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin

from wbc.core.errors import Array, ModelError
from wbc.core.robot import UNLIMITED
from wbc.robots.readers.write_urdf import UrdfWriter


def write(model: pin.Model, name: str) -> tuple[UrdfWriter, dict[str, dict[str, float]]]:
    """Return the URDF of a model, and armature, damping and friction as joint → value, where any is not zero.

    Raises `ModelError` without a free-flyer, or for a joint of several degrees of freedom.
    """
    if model.njoints < 2 or model.joints[1].shortname() != "JointModelFreeFlyer":
        raise ModelError(
            f"Pinocchio model '{model.name}' has no free-flyer as its first joint; build it with "
            "pin.JointModelFreeFlyer() as the root joint"
        )
    urdf, names = UrdfWriter(name), list(model.names)
    for joint, called in zip(list(model.joints)[2:], names[2:], strict=True):
        if joint.nv != 1:
            raise ModelError(
                f"joint '{called}' is a {joint.shortname()} of {joint.nv} degrees of freedom; joints of one are "
                "required"
            )
    data = model.createData()
    pin.computeJointJacobians(model, data, pin.neutral(model))
    links = [_link_of(model, joint) for joint in range(model.njoints)]
    used = set(links)
    for number in range(1, model.njoints):
        inertia = model.inertias[number]
        urdf.link(links[number], float(inertia.mass), inertia.lever, inertia.inertia)
        if number > 1:
            _write_joint(urdf, model, data, number, links)
    for frame in model.frames:
        if frame.parentJoint == 0 or frame.name in used or frame.type == pin.FrameType.JOINT:
            continue
        used.add(frame.name)
        urdf.link(frame.name)
        urdf.joint(f"{frame.name}_fixed", "fixed", links[frame.parentJoint], frame.name, frame.placement)
    losses = {
        "armature": _by_joint(model, model.armature),
        "damping": _by_joint(model, model.damping),
        "frictionloss": _by_joint(model, model.upperDryFrictionLimit),
    }
    return urdf, losses


def _link_of(model: pin.Model, joint: int) -> str:
    for frame in model.frames:
        here = frame.parentJoint == joint and frame.type == pin.FrameType.BODY
        if here and frame.placement.isApprox(pin.SE3.Identity(), 1e-12):
            return str(frame.name)
    return f"{model.names[joint]}_link"


def _write_joint(urdf: UrdfWriter, model: pin.Model, data: pin.Data, number: int, links: list[str]) -> None:
    joint = model.joints[number]
    motion = pin.getJointJacobian(model, data, number, pin.LOCAL)[:, joint.idx_v]
    turns = bool(np.linalg.norm(motion[3:]) > 0.5)
    i, v = joint.idx_q, joint.idx_v
    limits = {}
    low, high = float(model.lowerPositionLimit[i]), float(model.upperPositionLimit[i])
    if joint.nq == 1 and abs(low) < UNLIMITED and abs(high) < UNLIMITED:
        limits = {"lower": low, "upper": high}
    for key, value in (("velocity", model.upperVelocityLimit[v]), ("effort", model.upperEffortLimit[v])):
        if 0.0 < value < UNLIMITED:
            limits[key] = float(value)
    kind = ("revolute" if joint.nq == 1 else "continuous") if turns else "prismatic"
    axis = motion[3:] if turns else motion[:3]
    parent = links[model.parents[number]]
    placement = model.jointPlacements[number]
    urdf.joint(str(model.names[number]), kind, parent, links[number], placement, axis, limits)


def _by_joint(model: pin.Model, values: Array) -> dict[str, float]:
    names = list(model.names)
    found = {names[j]: float(values[model.joints[j].idx_v]) for j in range(2, model.njoints)}
    return found if any(np.isfinite(value) and value > 0.0 for value in found.values()) else {}


def fields(model: Any, name: str | None, armature: Any) -> tuple[UrdfWriter, dict[str, Any]]:
    """Return the URDF of a model and the arguments that its armature, damping and friction make.

    An armature that is given takes the place of the model's. Raises `ModelError` for what no description can be made
    of.
    """
    if not isinstance(model, pin.Model):
        raise ModelError(f"a pinocchio.Model is needed, got {type(model).__name__}")
    urdf, losses = write(model, name or str(model.name) or "robot")
    if armature is None:
        armature = losses["armature"] or None
    return urdf, {"armature": armature, "damping": losses["damping"], "frictionloss": losses["frictionloss"]}
