"""Joints of a policy in those of a robot: their columns, their targets, and the servos in the commands."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from wbc.base.errors import InputError, unknown_name
from wbc.base.numbers import Array
from wbc.core.robot import Robot
from wbc.core.signals import Measurement
from wbc.policy.description import PolicyDescription

DIFFERENT = 0.1
"""Share of a gain of the machine by which that of a policy may differ."""


class PolicyJoints:
    """Joints of a robot by a policy: the policy moves some, and the servos of the robot hold the others.

    Attributes:
        columns: Columns of the policy's joints, in its order, in arrays of the robot's joints.
        default: Positions of these joints in the policy's default posture, in its order, rad.
        kp: Stiffness of all servos in the commands, shape (na,), Nm/rad.
        kd: Damping of all servos in the commands, shape (na,), Nms/rad.
        target: Targets of all servos, shape (na,), rad; half-sitting for joints that the policy does not move.
    """

    def __init__(self, robot: Robot, description: PolicyDescription) -> None:
        """Find the joints of a description in a robot; an `InputError` where one is not there, or is twice."""
        self._robot, self._description = robot, description
        self.columns = columns = policy_columns(robot, description.joints)
        self.default = np.array(description.default)
        self._scale = np.broadcast_to(np.asarray(description.action_scale), (len(columns),))
        servos = robot.servos
        gains = (0.0, 0.0) if servos is None else (servos.kp, servos.kd)
        self.kp, self.kd = (np.zeros(robot.na) + each for each in gains)
        self.kp[columns], self.kd[columns] = description.kp, description.kd
        self._rest = robot.half_sitting[robot.base_nq :]
        self.target = np.array(self._rest)

    @property
    def posture(self) -> Array:
        """Default posture of all joints, shape (na,), rad: half-sitting of those that the policy does not move."""
        posture: Array = np.array(self._rest)
        posture[self.columns] = self.default
        return posture

    def begin(self) -> None:
        """Begin anew: the targets are half-sitting until the first action."""
        self.target[:] = self._rest

    def give_up(self, index: NDArray[np.intp]) -> None:
        """Leave joints to the QP, by their columns: their servos have no gains."""
        self.kp[index] = self.kd[index] = 0.0

    def aim(self, action: Array) -> None:
        """Take the targets of an action, in the policy's order."""
        self.target[self.columns] = self.default + self._scale * action

    def torques(self, measurement: Measurement) -> Array:
        """Return the torques that the servos make where the joints are measured, shape (na,), Nm."""
        torque: Array = self.kp * (self.target - measurement.joint_position)
        torque -= self.kd * measurement.joint_velocity
        return torque

    def doubts(self) -> list[str]:
        """Return which gains differ from those that the robot's description states, and defaults beyond stops."""
        robot, about, columns, servos = self._robot, self._description, self.columns, self._robot.servos
        names, found = [robot.joint_names[column] for column in columns], []
        if servos is not None:
            for what, unit, asked, has in (
                ("stiffness", "Nm/rad", about.kp, servos.kp),
                ("damping", "Nms/rad", about.kd, servos.kd),
            ):
                found += [
                    f"{what} of {name} is {wanted:g} {unit}, and that of the machine {own:g}"
                    for name, wanted, own in zip(names, asked, has[columns], strict=True)
                    if name in servos.given and abs(wanted - own) > DIFFERENT * own
                ]
        low, high = robot.position_lower[columns], robot.position_upper[columns]
        beyond = ((self.default < low) | (self.default > high)).nonzero()[0]
        return found + [
            f"default of {names[k]}, {self.default[k]:g} rad, is beyond its stops" for k in beyond
        ]


def policy_columns(robot: Robot, joints: Sequence[str]) -> NDArray[np.intp]:
    """Return the columns of joints by name, with or without the ending "_joint", in the order of a policy.

    Raises:
        UnknownNameError: A joint that the robot has not.
        InputError: Two names of one joint.
    """
    names = list(robot.joint_names)
    short = [name.removesuffix("_joint").lower() for name in names]
    columns = []
    for joint in joints:
        if joint in names:
            columns.append(names.index(joint))
        elif (key := joint.removesuffix("_joint").lower()) in short:
            columns.append(short.index(key))
        else:
            unknown_name("joint of the robot", joint, names)
        if columns[-1] in columns[:-1]:
            raise InputError(
                f"joints of a policy must be different, '{joint}' is '{names[columns[-1]]}' again"
            )
    return np.array(columns, dtype=np.intp)
