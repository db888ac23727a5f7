"""Configurations for a whole clip: feet by contacts, the centre of mass by balance, the rest as given."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wbc.base.numbers import Array
from wbc.core.kinematics.inverse import InverseKinematics
from wbc.core.limits.joint import JointLimits
from wbc.core.robot import Robot
from wbc.motion.kinematics import Soles
from wbc.tasks import CoMTask, OrientationTask, PoseTask, PostureTask

STANCE, SWING, COM, ORIENTATION, JOINTS, LEGS = 1e4, 1e2, 1e3, 1.0, 0.5, 1e-3
"""Weights per squared error: pose of a sole that stands, and of one in the air (m², rad²), centre of mass (m²),
rotation of base and torso, joints outside the legs, and joints of the legs (rad²), on which the feet decide."""

ITERATIONS, SMALL = 12, 1e-6
"""Most steps of a frame, and the error at which it ends, rad and m."""


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
    ik = InverseKinematics(robot.clone(), 0.01)
    robot = ik.robot
    feet = [PoseTask(sole.frame) for sole in robot.soles[:2]]
    trunk = [
        OrientationTask(f, weight=ORIENTATION) for f in dict.fromkeys((robot.base_frame, robot.torso_frame))
    ]
    legs = {robot.joint_names[joint]: LEGS / JOINTS for joint in robot.leg_joints}
    posture = PostureTask(weight=JOINTS, joint_weights=legs)
    balance, limits = CoMTask(weight=COM), JointLimits(margin=margin)
    ik.add(*feet, *trunk, posture, balance, limits)
    for i, reference in enumerate(q):
        ik.update(reference)
        for task in trunk:
            task.target = task.present(robot)
        posture.target, balance.target = reference[7:], com[i]
        for foot, sole, weight in zip(feet, soles[i], weights[i], strict=True):
            foot.target, foot.weight = sole, weight
        np.clip(result[i, 7:], limits.lower, limits.upper, out=result[i, 7:])
        ik.update(result[i])
        result[i] = ik.reach(SMALL, ITERATIONS).configuration
    return result
