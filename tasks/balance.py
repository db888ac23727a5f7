"""The balance controller of a standing humanoid, and its gains."""

from __future__ import annotations

from typing import Annotated

from wbc.core.arguments import checked
from wbc.core.limits.rows import JointLimits, TorqueLimits
from wbc.core.qp.contact import SoleContact
from wbc.core.qp.controller import Controller
from wbc.core.qp.solver import SolverSettings
from wbc.core.robot import Robot
from wbc.core.settings import Positive, settings
from wbc.tasks.motion.com import CoMTask
from wbc.tasks.motion.frame import OrientationTask
from wbc.tasks.motion.posture import PostureTask


@settings(kw_only=True)
class BalanceGains:
    """Weights and gains of the balance controller; damping is critical everywhere.

    The defaults were tuned on pushes to the front, left and back of hrp4_class and Talos. Holding pelvis and torso
    upright only loosely lets the robot bend at the hips, which recovers a push about 1.4 times as large as weights of
    10, 1 and 0.1 and a stiffness of 30 do; sensor noise moves the centre of mass no more than with those.

    Attributes:
        com_weight: Centre of mass, cost per (m/s²)².
        com_stiffness: Centre of mass, 1/s².
        orientation_weight: Pelvis and torso, cost per (rad/s²)².
        orientation_stiffness: Pelvis and torso, 1/s².
        posture_weight: All joints, cost per (rad/s²)².
        posture_stiffness: All joints, 1/s².
        friction: Assumed Coulomb coefficient of the soles; 0.7 as in the soft-foot experiments of Frizza et al.,
            2022.
    """

    com_weight: Positive = 1000.0
    com_stiffness: Annotated[Positive, "1/s²"] = 60.0
    orientation_weight: Positive = 0.1
    orientation_stiffness: Annotated[Positive, "1/s²"] = 30.0
    posture_weight: Positive = 0.01
    posture_stiffness: Annotated[Positive, "1/s²"] = 20.0
    friction: Positive = 0.7


@checked
def balance_controller(
    robot: Robot, dt: float, gains: BalanceGains | None = None, *, solver: SolverSettings | None = None
) -> Controller:
    """Return a controller that keeps a robot standing where it stands.

    Its tasks are named "com", "base", "torso" and "posture", its contacts like the robot's soles. Targets are the
    robot's present state; move them, or add tasks, for other motions.

    Args:
        robot: The robot, standing on its soles.
        dt: Control period, s.
        gains: Weights and gains; the defaults when None.
        solver: Settings of the QP solver.

    Returns:
        The controller, with joint and torque limits.

    Raises:
        InputError: A period that is not positive, or a robot without feet.
    """
    robot.needs_feet("the balance controller")
    gains = gains or BalanceGains()
    controller = Controller(robot, dt, settings=solver)
    controller.add(CoMTask(weight=gains.com_weight, stiffness=gains.com_stiffness))
    frames = {"base": robot.base_frame, "torso": robot.torso_frame}
    if frames["torso"] == frames["base"]:
        del frames["torso"]
    for name, frame in frames.items():
        controller.add(
            OrientationTask(
                frame, name=name, weight=gains.orientation_weight, stiffness=gains.orientation_stiffness
            )
        )
    controller.add(PostureTask(weight=gains.posture_weight, stiffness=gains.posture_stiffness))
    for sole in robot.soles:
        controller.add(SoleContact(sole.name, friction=gains.friction))
    controller.add(JointLimits(), TorqueLimits())
    return controller
