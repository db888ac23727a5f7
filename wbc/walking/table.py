"""Table of the tasks of a walk: what each task and contact costs, its gains and boxes, for planned and free steps.

The table of planned steps is one of settings, in SI units; that of free steps is one of constants, in units of the
robot, so that the same numbers walk robots of any size.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np

from wbc.base.settings import Positive, settings
from wbc.core.qp.contact import SoleContact
from wbc.core.qp.options import GainOptions
from wbc.core.robot import Robot
from wbc.tasks.balance import BodyGains
from wbc.tasks.motion.com import CoMTask
from wbc.tasks.motion.posture import PostureTask
from wbc.tasks.stabilizer.distribution import DistributionSettings
from wbc.tasks.stabilizer.feet import StabilizedFeet
from wbc.walking.stepping.course import RiseLimit
from wbc.walking.stepping.feet import SteppingFeet, halves
from wbc.walking.stepping.gait import SteppingWalk
from wbc.walking.stepping.settings import RobotSize
from wbc.walking.tasks import TaskTable

# ---- planned steps --------------------------------------------------------------------------------------------------

FREE_FRICTION = 2.0
"""Friction of the contacts in position control: the QP's own wrenches are not commanded there and must not bind."""

SWING_TURN_WEIGHT, CONTACT_RETURN = 1.0, 100.0
"""In torque control: cost of the rotation of the foot in the air, per (rad/s²)² (where a joint of the ankle meets its
limit the foot turns by a hundred rad/s², which the CoM must not pay for); stiffness of a standing foot towards its
place, 1/s²."""

LEGS = 0.01
"""Ratio of the weight of the posture for joints of the legs where moments go by load: soles, CoM and pelvis decide."""


@settings
class TaskGains(BodyGains):
    """Weights and gains of the tasks of planned steps, beside those of `BodyGains`.

    Attributes:
        swing_weight: Cost of the error of the acceleration of the foot in the air, per (m/s²)² and (rad/s²)².
        swing_stiffness: Stiffness of the foot in the air towards its reference, 1/s².
        contact_stiffness: Stiffness of a standing foot towards its corrected pose in position control, 1/s².
        wrench_weight: Cost of the difference of foot wrenches from the desired ones, per N² and (Nm)².
    """

    swing_weight: Positive = 1000.0
    swing_stiffness: Annotated[Positive, "1/s²"] = 400.0
    contact_stiffness: Annotated[Positive, "1/s²"] = 1000.0
    wrench_weight: Positive = 1e-3


def planned_table(
    robot: Robot, gains: TaskGains, distribution: DistributionSettings, *, torque: bool
) -> TaskTable:
    """Return the table of planned steps, on which a stabilizer balances the robot, with the friction of its feet."""
    friction = distribution.friction
    contacts = [
        SoleContact(
            sole.name,
            min_force=0.0,
            margin=0.0,
            ramp=0.0,
            stiffness=CONTACT_RETURN if torque else gains.contact_stiffness,
            friction=friction if torque else FREE_FRICTION,
            even=torque and distribution.by_load,
        )
        for sole in robot.soles
    ]
    by_load, height = distribution.by_load, gains.com_stiffness
    feet = StabilizedFeet(contacts, torque=torque, weight=gains.wrench_weight, by_load=by_load)
    # On torques the feedback gives the horizontal acceleration.
    com = CoMTask(weight=gains.com_weight, stiffness=(0.0, 0.0, height) if torque else height)
    turn = SWING_TURN_WEIGHT if torque else gains.swing_weight
    swing: GainOptions = {
        "weight": np.repeat([gains.swing_weight, turn], 3),
        "stiffness": gains.swing_stiffness,
    }
    trunk: GainOptions = {"weight": gains.orientation_weight, "stiffness": gains.orientation_stiffness}
    weight = np.full(robot.na, gains.posture_weight)
    if by_load:
        weight[robot.leg_joints] *= LEGS
    posture = PostureTask(joints=robot.joint_names, weight=weight, stiffness=gains.posture_stiffness)
    return TaskTable(
        com=com, contacts=contacts, swing=swing, trunk=(trunk, trunk), posture=posture, stabilized=feet
    )


# ---- free steps -----------------------------------------------------------------------------------------------------


class Law(NamedTuple):
    """Law of a task in units of the robot: its cost, its stiffness, ω², and its damping, ω."""

    cost: float
    stiffness: float
    damping: float


# In units of the robot; costs are per (m/s²)², those of rotations per (h rad/s²)² with the height h of the CoM.
COM = 100.0
"""Cost of the CoM's height, on two feet of its place as well."""

SWING, LIFT, SWING_TURN = 20.0, 120.0, Law(5.6, 24.5, 8.9)
"""Costs of the swing foot's place and of its height; law of its rotation. Where hips saturate the foot is to come late,
not to rub: its height costs more."""

PELVIS, PELVIS_YAW = Law(8.3, 7.35, 5.45), 0.83
"""Law of the tilt of the pelvis; cost of its heading."""

TORSO, TORSO_YAW = 1.2, 0.003
"""Costs of tilt and heading of the torso, where it is not the pelvis, with the same gains: what hits a robot high folds
its waist, and nothing else brings it upright again. As much as the pelvis it may not cost: hips that hold both have no
torque left for the swing foot."""

TWIST, TWIST_STIFFNESS = 450.0, 2.0
"""Cost and stiffness, ω², of the torso's heading while the waist turns it, by the joints of the waist alone."""

SLACK = 0.03
"""Distance of the ceiling of the CoM above its height, h: steps over stones need no more."""

POSTURE, LEG_COST, LEG_DAMPING = Law(1.39, 4.9, 3.96), 2.8e-3, 0.5
"""Law of joints that are not in the legs; cost and damping, ω, of those of the legs, which have no stiffness."""

REACHING = 0.03
"""Ratio of the cost of the posture for joints of an arm whose hand has a target, and the inverse of that by which a
gaze costs more: a posture that firm would hold the hand 28 mm back."""

HELD_DAMPING = 5.0
"""Damping of a foot that stands, ω."""

FORCE, MOMENT = 1.1e-3, 2.0
"""Cost of forces on the feet, per (N/kg)², and of moments, per (Nm/(kg h))²; yaw moments are at most the normal force
times half of the width of the sole."""


def free_table(robot: Robot, gait: SteppingWalk) -> TaskTable:
    """Return the table of free steps, which balance the robot."""
    scale, law = gait.scale, gait.constants
    omega, square = scale.omega, scale.omega**2
    turn = scale.height**2  # from (h rad/s²)² to (rad/s²)²
    feet = SteppingFeet(scale, law)
    swing: GainOptions = {
        "weight": np.array([SWING, SWING, LIFT, *[SWING_TURN.cost * turn] * 3]),
        "stiffness": halves(law.swing.swing_gains[0], SWING_TURN.stiffness * square),
        "damping": halves(law.swing.swing_gains[1], SWING_TURN.damping * omega),
    }
    tilt, yaw = PELVIS.cost * turn, PELVIS_YAW * turn
    trunk: GainOptions = {"stiffness": PELVIS.stiffness * square, "damping": PELVIS.damping * omega}
    pelvis: GainOptions = {"weight": (tilt, tilt, yaw), **trunk}
    torso: GainOptions = {"weight": (TORSO * turn, TORSO * turn, TORSO_YAW * turn), **trunk}
    return TaskTable(
        com=CoMTask(weight=COM, stiffness=feet.stand[0], damping=feet.stand[1]),
        contacts=_free_contacts(robot, gait, feet),
        swing=swing,
        trunk=(pelvis, torso),
        posture=_free_posture(robot, gait.scale),
        twist={"weight": TWIST * turn, "stiffness": TWIST_STIFFNESS * square},
        feet=feet,
        rise=RiseLimit(SLACK * scale.height),
        reaching=REACHING,
    )


def _free_contacts(robot: Robot, gait: SteppingWalk, feet: SteppingFeet) -> list[SoleContact]:
    """Return the contacts of the left and of the right sole."""
    scale = gait.scale
    moment = MOMENT / (scale.mass**2 * scale.height**2)
    return [
        SoleContact(
            sole.name,
            friction=gait.settings.friction,
            margin=0.0,
            torsion=scale.sole[1],
            min_force=0.0,
            ramp=0.0,
            stiffness=0.0,
            damping=HELD_DAMPING * scale.omega,
            wrench_weight=halves(FORCE / scale.mass**2, moment),
            motion_weight=feet.firm,
        )
        for sole in robot.soles
    ]


def _free_posture(robot: Robot, scale: RobotSize) -> PostureTask:
    """Return the task of all joints; those of the legs are only damped: soles, CoM and pelvis decide on them."""
    omega, (cost, stiffness, damping) = scale.omega, POSTURE
    values = cost * scale.height**2, stiffness * omega**2, damping * omega
    costs, gains, dampings = (np.full(robot.na, value) for value in values)
    legs = robot.leg_joints
    costs[legs] *= LEG_COST / cost
    gains[legs], dampings[legs] = 0.0, LEG_DAMPING * omega
    return PostureTask(joints=robot.joint_names, weight=costs, stiffness=gains, damping=dampings)
