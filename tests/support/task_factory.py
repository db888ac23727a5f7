"""Every task, on every built-in robot: what the tests on tasks run over."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
import pinocchio as pin

from wbc.base.numbers import Array
from wbc.core.qp.contact import SoleContact
from wbc.core.qp.controller import Controller
from wbc.core.qp.task import Task
from wbc.core.robot import Robot
from wbc.robots import RobotDescription, load
from wbc.tasks import (
    AdmittanceTask,
    CoMOverFeetTask,
    CoMTask,
    ImpedanceTask,
    LookAtTask,
    MomentumTask,
    OrientationTask,
    PoseTask,
    PositionTask,
    PostureTask,
    RelativeFrameTask,
    VectorOrientationTask,
)

ROBOTS = ("hrp4_class", "talos", "g1")
ADMITTANCE = (1e-3, 1e-1)


@dataclass(frozen=True)
class Case:
    """A task to test.

    Attributes:
        make: Makes it for a robot, without a target.
        feasible: True if a standing robot can give it any small acceleration.
        in_frame: True if its rows are along the axes of the frame that it moves, instead of fixed ones.
        selects: True if it may use some joints only: its velocity is then not that of the frame.
    """

    make: Callable[[Robot], Task]
    feasible: bool = True
    in_frame: bool = False
    selects: bool = False


def arm(robot: Robot) -> list[str]:
    """Joints between the root and the left hand, nearest to the hand last."""
    joint = robot.model.frames[robot.frame_id(left_hand(robot))].parentJoint
    return [robot.model.names[i] for i in robot.model.supports[joint] if i > 1][-4:]


def left_hand(robot: Robot) -> str:
    return robot.frames["left_hand"]


def right_hand(robot: Robot) -> str:
    return robot.frames["right_hand"]


MOTION_TASKS: dict[str, Case] = {
    "com": Case(lambda r: CoMTask()),
    "com xy": Case(lambda r: CoMTask(axes=("x", "y"))),
    "com without arm": Case(
        lambda r: CoMTask(joints=["base", *(j for j in r.joint_names if j not in arm(r))]),
        feasible=False,
        selects=True,
    ),
    "position": Case(lambda r: PositionTask(left_hand(r))),
    "position z": Case(lambda r: PositionTask(left_hand(r), axes=("z",))),
    "position by arm": Case(
        lambda r: PositionTask(left_hand(r), joints=arm(r)), feasible=False, selects=True
    ),
    "orientation": Case(lambda r: OrientationTask(r.torso_frame)),
    "orientation roll yaw": Case(lambda r: OrientationTask(right_hand(r), axes=("roll", "yaw"))),
    "pose": Case(lambda r: PoseTask(right_hand(r))),
    "pose z pitch": Case(lambda r: PoseTask(right_hand(r), axes=("z", "pitch"))),
    "pose of sole": Case(lambda r: PoseTask(r.soles[0].frame), feasible=False),
    "relative": Case(lambda r: RelativeFrameTask(left_hand(r), right_hand(r))),
    "relative to torso": Case(lambda r: RelativeFrameTask(left_hand(r), r.torso_frame, axes=("x", "y", "z"))),
    "relative orientation": Case(
        lambda r: RelativeFrameTask(right_hand(r), r.base_frame, axes=("roll", "yaw"))
    ),
    "direction": Case(lambda r: VectorOrientationTask(left_hand(r), axis=(0.3, 0.0, -1.0)), feasible=False),
    "gaze": Case(lambda r: LookAtTask(r.torso_frame, joints=("base", *r.joint_names)), feasible=False),
    "com over feet": Case(lambda r: CoMOverFeetTask()),
    "momentum": Case(lambda r: MomentumTask()),
    "angular momentum": Case(lambda r: MomentumTask(axes=("roll", "pitch", "yaw"))),
    "admittance": Case(lambda r: AdmittanceTask(left_hand(r), admittance=ADMITTANCE), in_frame=True),
    "impedance": Case(lambda r: ImpedanceTask(left_hand(r)), in_frame=True),
}


@cache
def description(name: str) -> RobotDescription:
    return load(name)


def make_robot(name: str) -> Robot:
    """A robot with a state of its own, in half-sitting."""
    return description(name).robot()


def random_state(robot: Robot, rng: np.random.Generator, speed: float = 1.0) -> tuple[Array, Array]:
    """A configuration anywhere in the world with joints inside their limits, and a velocity."""
    q = np.array(robot.half_sitting)
    q[:3] = rng.normal(size=3)
    q[3:7] = pin.Quaternion(pin.exp3(rng.normal(size=3))).coeffs()
    share = rng.uniform(0.2, 0.8, robot.na)
    q[7:] = robot.position_lower + share * (robot.position_upper - robot.position_lower)
    return q, speed * rng.normal(size=robot.nv)


def near_half_sitting(
    robot: Robot, rng: np.random.Generator, spread: float = 0.05, speed: float = 0.1
) -> tuple[Array, Array]:
    """A configuration and a velocity near half-sitting at rest; the soles leave the ground a little."""
    q = pin.integrate(robot.model, robot.half_sitting, spread * rng.normal(size=robot.nv))
    q[7:] = np.clip(q[7:], robot.position_lower + 0.01, robot.position_upper - 0.01)
    return q, speed * rng.normal(size=robot.nv)


def rows_of(task: Task, robot: Robot) -> tuple[Array, Array, Array]:
    """Jacobian, error and drift at the present state of the robot."""
    return task.evaluated()


def standing(name: str, dt: float = 0.002, posture: bool = True) -> Controller:
    """A controller with two soles on the ground, which cost next to nothing, and a faint posture."""
    controller = Controller(make_robot(name), dt)
    for foot in ("left_foot", "right_foot"):
        controller.add(SoleContact(foot, wrench_weight=1e-11))
    if posture:
        controller.add(PostureTask(weight=1e-2))
    return controller


def integrate(controller: Controller, q: Array, v: Array, acceleration: Array) -> tuple[Array, Array]:
    """State one control period later under constant acceleration."""
    dt = controller.dt
    return pin.integrate(
        controller.robot.model, q, v * dt + 0.5 * dt * dt * acceleration
    ), v + dt * acceleration
