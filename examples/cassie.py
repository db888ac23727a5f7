"""A robot with springs and closed chains: Cassie stands on bars, and takes a push.

Its MJCF has 26 joints in a tree, of which ten have motors, and four equalities that close chains: in each leg a rod
from the hip to a spring at the heel, and a rod that turns the foot. Two springs in each leg carry it. The description
locks the springs, so that the controller takes them for rigid; in the simulation they give.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pinocchio as pin
from _common import parse, report, upright

import wbc
from wbc.robots import RobotDescription, Sole
from wbc.sim import MujocoLoop
from wbc.tasks import CoMOverFeetTask

FILE = Path(__file__).with_name("cassie.xml")
SAG = {"knee-shin-joint": -0.0406, "tarsus-spring-joint": -0.0307}
"""Spring → what it gives under half of the weight, rad."""
BENT = {
    "knee-op": -0.23,
    "pitch-op": 0.19,
    "shin-tarsus-joint": 0.69,
    "foot-op": -1.75,
    "tarsus-crank-joint": -1.75,
    "crank-rod-joint": 1.75,
}
"""Bent legs, from which the search for a posture begins, rad."""
TOE, HEEL, RADIUS = np.array([-0.0591, 0.1026, 0.0]), np.array([0.0791, -0.0126, 0.0]), 0.0168
"""Ends of the bar of a foot in its link, and its radius, m."""


def both(values: dict[str, float]) -> dict[str, float]:
    """Return values of the joints of one leg for both legs."""
    return {f"{side}-{joint}": value for side in ("left", "right") for joint, value in values.items()}


def sole(robot: wbc.Robot, side: str) -> pin.SE3:
    """Return the frame below the middle of the bar of a foot in its link: x to the toe, z up."""
    across = np.round(robot.placement(f"{side}-foot").rotation.T @ [0.0, 1.0, 0.0])
    forward = (TOE - HEEL) / np.linalg.norm(TOE - HEEL)
    up = np.cross(forward, across)
    return pin.SE3(np.stack([forward, across, up], axis=1), 0.5 * (TOE + HEEL) - RADIUS * up)


def described() -> RobotDescription:
    """Return Cassie on its feet, in a posture in which the chains close."""
    robot = RobotDescription.from_mjcf(FILE, feet=False, lock=both(SAG)).robot()
    ik = wbc.InverseKinematics(robot, dt=0.01)
    ik.update(robot.configuration(both(BENT)))
    ik.add(wbc.JointLimits(), wbc.PostureTask(both(BENT), weight=1e-5), wbc.CoMTask([0.0, 0.0, 0.8]))
    ik.add(wbc.OrientationTask("pelvis", np.eye(3)))
    soles = {}
    for side in ("left", "right"):
        place = sole(robot, side)
        below = (robot.placement(f"{side}-foot") * place).translation * [0.0, 1.0, 0.0]
        ik.add(wbc.PoseTask(f"{side}-foot", pin.SE3(np.eye(3), below) * place.inverse()))
        soles[f"{side}_sole"] = Sole(
            f"{side}_sole",
            f"{side}-foot",
            translation=tuple(place.translation),
            rpy=tuple(pin.rpy.matrixToRpy(place.rotation)),
            name=f"{side}_foot",
            length=float(np.linalg.norm(TOE - HEEL)),
            width=2.0 * RADIUS,
        )
    found = ik.reach(tolerance=1e-3)
    print(found)
    posture = dict(zip(robot.joint_names, found.configuration[robot.base_nq :].tolist(), strict=True))
    return RobotDescription.from_mjcf(FILE, lock=both(SAG), half_sitting=posture, **soles)


def controlled(robot: wbc.Robot, period: float) -> wbc.HybridControl:
    """Return the control of a robot that stands: its CoM over its feet, an upright pelvis, and soft servos."""
    controller = wbc.Controller(robot, period)
    driven = [
        name for name, torque in zip(robot.joint_names, robot.torque_upper, strict=True) if torque > 0.0
    ]
    controller.add(
        CoMOverFeetTask(weight=100.0, stiffness=30.0),
        wbc.OrientationTask(robot.base_frame, weight=10.0, stiffness=30.0),
        wbc.PostureTask(joints=driven, weight=0.1, stiffness=50.0),
        wbc.TorqueLimits(),
    )
    for foot in robot.soles:
        # A bar rolls about its axis: no cost of that motion, and hardly a moment.
        contact = wbc.SoleContact(
            foot.name,
            margin=0.0,
            stiffness=0.0,
            damping=10.0,
            motion_weight=[1e4, 1e4, 1e4, 0.0, 1e4, 1e4],
            wrench_weight=[1e-3, 1e-3, 1e-6, 1e-3, 1e-3, 1e-3],
        )
        controller.add(contact)
        contact.set_box(foot.length, 0.002)
    # The servos damp the springs, which the controller does not know.
    return wbc.HybridControl(controller, kp=0.5 * robot.torque_upper, kd=0.1 * robot.torque_upper)


def main(arguments: Sequence[str] | None = None) -> dict[str, Any]:
    """Run the example."""
    options = parse(__doc__, arguments, seconds=10.0, push=3.0)
    description = described()
    loop = MujocoLoop(description, mujoco.MjModel.from_xml_path(str(FILE)), control_period=0.002)
    control = controlled(description.robot(), loop.control_period)
    start, pushed = loop.truth().com, False
    with options.watch(loop) as view:
        while loop.time < options.seconds:
            if not pushed and loop.time >= 2.0:
                pushed = True
                loop.push("pelvis", [options.push / 0.1, 0.0, 0.0], duration=0.1)
            loop.step(control.command(loop.measure()))
            view.update()
    closures = [each for each in control.controller.contacts if isinstance(each, wbc.LoopClosure)]
    return report(
        upright=upright(loop),
        moved_mm=1e3 * float(np.abs(loop.truth().com - start).max()),
        gap_mm=1e3 * max(each.gap()[0] for each in closures),
    )


if __name__ == "__main__":
    main()
