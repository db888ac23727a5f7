"""Balance of a robot that something else holds in part: from the first touch until it carries itself."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin

from wbc.base.numbers import Array
from wbc.core.drive.control import Control
from wbc.core.drive.torque import TorqueControl
from wbc.core.frames import yaw_rotation
from wbc.core.robot import Robot
from wbc.core.signals import Command, Measurement
from wbc.core.trajectories import minimum_jerk
from wbc.machine.loads import SoleLoads
from wbc.robots import RobotDescription
from wbc.tasks.balance import BalanceGains, balance_controller

SETTLE = 1.5
"""Time in which trunk and pelvis turn from where the robot was caught to upright, s."""

STEP = 0.05
"""Distance of the centre of mass's target from where it is, at most, m."""

GAINS = BalanceGains(
    orientation_weight=20.0, orientation_stiffness=60.0, posture_weight=0.1, posture_stiffness=60.0
)
"""Stiff trunk and posture: feet with little load cannot move the CoM, and a body that bends for it swings."""


class Stand:
    """Balance of a robot that a crane, a band or a hand still holds in part.

    Torques of the balance controller, under the damping of the motors. What holds the robot besides the ground
    (`SoleLoads.outside`) enters the dynamics of the QP, so that the feet press with what is theirs.

    Attributes:
        control: The balance, by torques.
    """

    def __init__(
        self, description: RobotDescription, period: float, loads: SoleLoads, damping: Array
    ) -> None:
        """Make the balance controller, and run it on a robot at rest, so that no later tick loads code.

        `period` is that of the control, s; `damping` is kd of the motors, shape (na,), Nms/rad.
        """
        robot = description.robot()
        self._loads, self._damping, self._zero = loads, damping, np.zeros(robot.na)
        self.control = TorqueControl(balance_controller(robot, period, GAINS))
        task: Callable[[str], Any] = self.control.controller.task
        self._com = task("com")
        self._com_goal = np.array(self._com.target)
        self._upright = [task(name) for name in ("base", "torso")[: len(robot.trunk_frames)]]
        self._turns: list[tuple[Array, Array]] = []
        self._ends = [np.array(task.target) for task in self._upright]
        self._elapsed = 0.0
        warm_up(self.control, robot, period, forces=True)

    def begin(self, measurement: Measurement) -> None:
        """Start from a measurement that the loads have seen, its soles where those of half-sitting are."""
        robot = self.control.controller.robot
        self.control.reset(standing(robot, self._loads.posture(measurement)))
        self._elapsed = 0.0
        caught = [np.array(robot.placement(task.frame).rotation) for task in self._upright]
        self._turns = [
            (first, pin.log3(first.T @ last)) for first, last in zip(caught, self._ends, strict=True)
        ]

    def command(self, measurement: Measurement) -> Command:
        """Return the command of a tick."""
        wrench = np.array(self._loads.wrenches(measurement, self.control.observer.measured_state))
        state = self.control.estimate(replace(measurement, sole_wrench=wrench))
        self._aim(state.robot)
        torque = self.control.act(state).joint_torque
        return Command(torque, measurement.joint_position, self._zero, kp=self._zero, kd=self._damping)

    def _aim(self, robot: Robot) -> None:
        """Set the targets: the centre of mass goes home, trunk and pelvis turn upright."""
        controller = self.control.controller
        controller.outside = self._loads.outside
        com = np.array(robot.com)
        self._com.target = com + np.clip(self._com_goal - com, -STEP, STEP)
        self._elapsed += controller.dt
        s = min(1.0, self._elapsed / SETTLE)
        part, _ = minimum_jerk(s)
        for task, (first, turn) in zip(self._upright, self._turns, strict=False):
            task.target = first @ pin.exp3(part * turn)


def standing(robot: Robot, q: Array) -> Array:
    """Return a configuration with its soles, in the mean, where those of half-sitting are, shape (nq,)."""
    data = robot.model.createData()

    def middle(q: Array) -> tuple[Array, float]:
        pin.framesForwardKinematics(robot.model, data, q)
        soles = [data.oMf[robot.frame_id(sole.frame)] for sole in robot.soles]
        ahead = sum(sole.rotation[:2, 0] for sole in soles)
        return sum(sole.translation for sole in soles) / len(soles), float(np.arctan2(ahead[1], ahead[0]))

    place, heading = middle(np.array(robot.half_sitting))
    q = np.array(q)
    turn = pin.Quaternion(yaw_rotation(heading - middle(q)[1]))
    q[3:7] = (turn * pin.Quaternion(q[3:7])).coeffs()
    q[:3] += place - middle(q)[0]
    return q


def warm_up(control: Control, robot: Robot, period: float, *, forces: bool) -> None:
    """Run some ticks on a robot at rest where it is, so that the first real ones do not load code and memory.

    A control that cannot be reset afterwards is left alone; `forces` tells whether the robot has force sensors.
    """
    if not control.restarts:
        return
    control.reset()  # it may have run before
    resting = Measurement.resting(robot)
    for i in range(20):
        wrench = resting.sole_wrench if forces else None
        control.command(replace(resting, time=i * period, sole_wrench=wrench))
    control.reset()
