"""The balance controller of a standing humanoid, and its gains."""

from __future__ import annotations

from typing import Annotated

from wbc.base.checked import checked
from wbc.base.settings import Period, Positive, settings
from wbc.core.limits.joint import JointLimits, TorqueLimits
from wbc.core.qp.contact import SoleContact
from wbc.core.qp.controller import Controller
from wbc.core.qp.solving.solver import SolverSettings
from wbc.core.robot import Robot
from wbc.tasks.motion.com import CoMTask
from wbc.tasks.motion.frame import OrientationTask
from wbc.tasks.motion.posture import PostureTask


@settings(kw_only=True)
class BodyGains:
    """Weights and gains of the tasks that every humanoid has; damping is critical.

    Those of a stand (`BalanceGains`) and of a walk (`TaskGains`) differ by 10 and 100; docs/tasks.md has them side by
    side with reasons. The weights of a stand walk as well: four walks of 1 m by hrp4_class, on flat ground and on
    stones of 20 mm, have ZMP errors of 25 to 33 mm with them and of 23 to 37 mm with their own.

    Attributes:
        com_weight: Cost of the error of the acceleration of the centre of mass, per (m/s²)².
        com_stiffness: Stiffness of the centre of mass towards its reference, 1/s².
        orientation_weight: Cost of the error of the angular accelerations of pelvis and torso, per (rad/s²)².
        orientation_stiffness: Stiffness of pelvis and torso towards their orientations, 1/s².
        posture_weight: Cost of the error of the acceleration of each joint, per (rad/s²)².
        posture_stiffness: Stiffness of the joints towards the posture, 1/s².
    """

    com_weight: Positive = 100.0
    com_stiffness: Annotated[Positive, "1/s²"] = 100.0
    orientation_weight: Positive = 10.0
    orientation_stiffness: Annotated[Positive, "1/s²"] = 100.0
    posture_weight: Positive = 0.1
    posture_stiffness: Annotated[Positive, "1/s²"] = 20.0


@settings(kw_only=True)
class BalanceGains(BodyGains):
    """Weights and gains of the balance controller: those of `BodyGains`, and the friction.

    They were tuned on pushes to the front, left and back of hrp4_class and Talos, against weights of 10, 1 and 0.1 and
    a stiffness of 30; sensor noise moves the centre of mass no more than with those.

    Attributes:
        friction: Assumed Coulomb coefficient of the soles; 0.7 as in the soft-foot experiments of Frizza et al.,
            2022.
    """

    com_weight: Positive = 1000.0
    com_stiffness: Annotated[Positive, "1/s²"] = 60.0
    orientation_weight: Positive = 0.1
    orientation_stiffness: Annotated[Positive, "1/s²"] = 30.0
    posture_weight: Positive = 0.01
    friction: Positive = 0.7


@checked
def balance_controller(
    robot: Robot, dt: Period, gains: BalanceGains | None = None, *, solver: SolverSettings | None = None
) -> Controller:
    """Return a controller, with joint and torque limits, that keeps a robot standing where it stands.

    Its tasks are named "com", "base", "torso" and "posture", its contacts like the robot's soles. Targets are the
    robot's present state; move them, or add tasks, for other motions.

    Args:
        robot: The robot, standing on its soles.
        dt: Control period, s.
        gains: Weights and gains; the defaults when None.
        solver: Settings of the QP solver.
    """
    robot.needs_feet("the balance controller")
    gains = gains or BalanceGains()
    controller = Controller(robot, dt, settings=solver)
    controller.add(CoMTask(weight=gains.com_weight, stiffness=gains.com_stiffness))
    weight, stiffness = gains.orientation_weight, gains.orientation_stiffness
    for name, frame in zip(("base", "torso"), robot.trunk_frames, strict=False):
        controller.add(OrientationTask(frame, name=name, weight=weight, stiffness=stiffness))
    controller.add(PostureTask(weight=gains.posture_weight, stiffness=gains.posture_stiffness))
    for sole in robot.soles:
        controller.add(SoleContact(sole.name, friction=gains.friction))
    controller.add(JointLimits(), TorqueLimits())
    return controller
