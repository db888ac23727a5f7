"""Configurations for a whole clip: feet by contacts, the centre of mass by balance, the rest as given."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from wbc.base.numbers import Array
from wbc.core.kinematics.inverse import InverseKinematics
from wbc.core.limits.joint import JointLimits
from wbc.core.robot import Robot
from wbc.core.trajectories import minimum_jerk
from wbc.motion.kinematics import Soles, moved, offset_between
from wbc.tasks import CoMTask, OrientationTask, PoseTask, PostureTask

# Weights per squared error: feet that stand come first, then the centre of mass, feet in the air, trunk and arms.

STANCE = 1e4
"""Weight of the pose of a sole that stands, 1/m² and 1/rad²."""

SWING = 1e2
"""Weight of the pose of a sole in the air, 1/m² and 1/rad²."""

COM = 1e3
"""Weight of the centre of mass, 1/m²."""

ORIENTATION = 1.0
"""Weight of the rotations of base and torso, 1/rad²."""

JOINTS = 0.5
"""Weight of the joints outside the legs, 1/rad²."""

LEGS = 1e-3
"""Weight of the joints of the legs, on which the feet decide, 1/rad²."""

HELD = 1e3
"""Weight of the base and of all joints that are held while legs alone move, 1/m² and 1/rad²."""

ITERATIONS = 12
"""Most steps of a frame."""

SMALL = 1e-6
"""Error at which a frame ends, rad and m."""


def searching(robot: Robot) -> InverseKinematics:
    """Return inverse kinematics of a copy of a robot, for searches alone: its period has no effect on them."""
    return InverseKinematics(robot.clone(), 0.01)


def inverse_kinematics(
    robot: Robot,
    margin: float,
    q: Array,
    soles: Sequence[Soles],
    standing: Array,
    com: Array,
    start: Array | None = None,
) -> Array:
    """Return configurations near given ones, with placements of both soles and of the centre of mass (T, 3), m.

    Frame by frame, at a margin to the joint limits, rad, half the range at the most. `standing` (T, 2) is 1 where a
    sole stands and 0 in the air; in between the weights change geometrically. The search begins at `start`, or at the
    given configurations; these and the result have shape (T, nq).
    """
    result = (q if start is None else start).copy()
    weights = SWING * (STANCE / SWING) ** standing
    ik = searching(robot)
    robot = ik.robot
    feet = [PoseTask(sole.frame) for sole in robot.soles[:2]]
    trunk = [OrientationTask(frame, weight=ORIENTATION) for frame in robot.trunk_frames]
    legs = {robot.joint_names[joint]: LEGS / JOINTS for joint in robot.leg_joints}
    posture = PostureTask(weight=JOINTS, joint_weights=legs)
    balance, limits = CoMTask(weight=COM), JointLimits(margin=margin)
    ik.add(*feet, *trunk, posture, balance, limits)
    data, frames = robot.model.createData(), [robot.frame_id(frame) for frame in robot.trunk_frames]
    for i, reference in enumerate(q):
        pin.framesForwardKinematics(robot.model, data, reference)
        for task, frame in zip(trunk, frames, strict=True):
            task.target = data.oMf[frame].rotation
        posture.target, balance.target = reference[7:], com[i]
        for side, foot in enumerate(feet):
            if not i or soles[i][side] is not soles[i - 1][side] or weights[i, side] != weights[i - 1, side]:
                foot.target, foot.weight = soles[i][side], weights[i, side]
        np.clip(result[i, 7:], limits.lower, limits.upper, out=result[i, 7:])
        ik.update(result[i])
        result[i] = ik.reach(SMALL, ITERATIONS).configuration
    return result


def planted(robot: Robot, q: Array, soles: Sequence[Soles], standing: Array, fade: int) -> Array:
    """Return configurations whose legs have the soles that stand exactly at their places, shape (T, nq).

    Nothing but the legs moves. In the air a sole keeps its path, but for the frames beside a contact, as many as
    `fade`, in which the correction fades. A leg that cannot reach its place stays as it is.
    """
    result = q.copy()
    ik = searching(robot)
    robot = ik.robot
    feet = [PoseTask(sole.frame) for sole in robot.soles[:2]]
    legs = set(robot.leg_joints)
    held = {name: 0.0 if joint in legs else 1.0 for joint, name in enumerate(robot.joint_names)}
    base, posture = PoseTask(robot.base_frame, weight=HELD), PostureTask(weight=HELD, joint_weights=held)
    ik.add(*feet, base, posture, JointLimits())
    data, frames = robot.model.createData(), [robot.frame_id(sole.frame) for sole in robot.soles[:2]]
    present, corrections = [], np.zeros((len(q), 2, 6))
    for i, given in enumerate(q):
        pin.framesForwardKinematics(robot.model, data, given)
        present.append([data.oMf[frame].copy() for frame in frames])
        for side, (sole, place) in enumerate(zip(present[i], soles[i], strict=True)):
            corrections[i, side] = offset_between(sole, place)
    for side in (0, 1):
        _fade(corrections[:, side], standing[:, side], fade)
    for i in np.flatnonzero(abs(corrections).max(axis=(1, 2)) > 0.1 * SMALL).tolist():
        ik.update(q[i])
        base.target, posture.target = base.present(robot), q[i, 7:]
        for foot, sole, correction in zip(feet, present[i], corrections[i], strict=True):
            foot.target = moved(sole, correction)
        found = ik.reach(SMALL, ITERATIONS)
        if found.reached:
            result[i] = found.configuration
    return result


def _fade(corrections: Array, stands: Array, fade: int) -> None:
    """Take the corrections of a sole in the air, shape (T, 6), from those of the contacts beside.

    They go on with the speed that they have there, so that a sole which rests leaves its place from rest.
    """
    contacts = np.flatnonzero(stands)
    for i in np.flatnonzero(np.logical_not(stands)).tolist():
        after = int(np.searchsorted(contacts, i))
        beside = [int(contacts[k]) for k in (after - 1, after) if 0 <= k < len(contacts)]
        corrections[i] = 0.0
        for contact in beside:
            first, second = (contact + k * (1 if contact > i else -1) for k in (1, 2))
            speed = np.zeros(6)  # away from the contact, per frame
            if (
                min(first, second) >= 0
                and max(first, second) < len(stands)
                and stands[first]
                and stands[second]
            ):
                speed = 1.5 * corrections[contact] - 2.0 * corrections[first] + 0.5 * corrections[second]
            x = min(1.0, abs(i - contact) / fade)
            corrections[i] += (1.0 - minimum_jerk(x)[0]) * corrections[contact]
            corrections[i] += fade * x * (1.0 - x**2 * (6.0 - 8.0 * x + 3.0 * x**2)) * speed
