"""Filter of a policy: the torques that it asks for, as near to them as the limits of the robot allow.

    min Σ |(τ − τ_policy) / τ_max|²  over the arms,    τ_policy = kp (q* − q) − kd v

    subject to the equations of `wbc.policy.arms`, and to limits of joints, torques, collisions and obstacles

The arms alone may pay for a collision. Filters that let legs and waist pay made the robot fall, whatever they knew of
the contacts of the feet. Each joint of legs and waist is braked at its stops by itself,

    τ ≤ τ_max ((q_max − q) − t v) / d,    and so below.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

import numpy as np

from wbc.base.checked import checked
from wbc.base.errors import names_in
from wbc.base.numbers import Array
from wbc.base.settings import NonNegative, Ratio
from wbc.core.limits.base import Limit
from wbc.core.limits.joint import JointLimits
from wbc.core.limits.torque import TorqueLimits
from wbc.core.qp.controller import Controller
from wbc.core.qp.solving.solver import SolverSettings
from wbc.core.robot import Robot
from wbc.core.signals import Measurement
from wbc.policy.arms import PolicyArms
from wbc.tasks import JointTorqueTask

REGULARISATION, RELAXATION = 1e-10, 1e4
"""Cost of accelerations, which must change no torque, 1/(rad/s²)², and of violated constraints: limits that contradict
each other give way."""

REACH, AHEAD = 0.1, 0.05
"""Distance d from a stop of legs and waist at which they are braked, rad, and time t that they look ahead, s."""


class PolicyFilter:
    """Settings of a filter of a policy.

        hands = CollisionLimit("all", shapes=description.collision_shapes(), recovery=100.0, influence=0.5)
        policy = PolicyControl(robot, "policy.onnx", dt, filter=PolicyFilter(robot.joint_names[15:], [hands]))

    Attributes:
        arms: Names of joints whose torques give way.
        limits: Further limits, such as a `CollisionLimit`.
    """

    @checked
    def __init__(
        self,
        arms: Sequence[str],
        limits: Sequence[Limit] = (),
        *,
        speed: Ratio = 0.25,
        margin: Annotated[NonNegative, "rad"] = 0.03,
    ) -> None:
        """Choose what is kept.

        Args:
            arms: Names of joints whose torques give way; not of a leg.
            limits: Further limits; those of joints and torques are there already. A `CollisionLimit` brakes fast arms
                in time with recovery=100 and influence=0.5.
            speed: Greatest speed of the arms over that of the model. Collision limits do not stop faster arms in time.
            margin: Distance that the arms keep from their stops, rad.
        """
        self.arms, self.limits = tuple(names_in("arms of a filter", arms)), tuple(limits)
        self._speed, self._margin = speed, margin

    def controller(self, robot: Robot, dt: float) -> Controller:
        """Return a new controller for the filter, which changes nothing that no limit asks for."""
        settings = SolverSettings(relaxation=RELAXATION)
        return Controller(robot, dt, regularisation=REGULARISATION, settings=settings)

    def bind(self, controller: Controller) -> FilteredArms:
        """Add the filter to a controller."""
        joint_limits = JointLimits(velocity_ratio=self._speed, margin=self._margin)
        return FilteredArms(controller, self.arms, (joint_limits, TorqueLimits(), *self.limits))


class FilteredArms(PolicyArms):
    """Arms whose torques are those of a policy, as near as limits allow."""

    def __init__(self, controller: Controller, joints: Sequence[str], limits: Sequence[Limit]) -> None:
        """Add task and limits."""
        super().__init__(controller, joints)
        robot = controller.robot
        weight = 1.0 / np.square(robot.torque_limit[self.index])
        self._wish = controller.add(JointTorqueTask(joints=list(joints), weight=weight))
        controller.add(*limits)
        self._slope = robot.torque_limit / REACH

    def near(self, measurement: Measurement, asked: Array) -> Array:
        """Return the torques of all joints nearest to those of the policy, both of shape (na,), Nm.

        Where the QP has no solution the torques are those of the policy, within their limits, as of joints by
        themselves.
        """
        robot = self.controller.robot
        least, most = robot.torque_lower, robot.torque_upper
        within = np.minimum(np.maximum(asked, least), most)
        ahead = robot.q[robot.base_nq :] + AHEAD * robot.v[robot.base_dof :]
        torques = np.minimum(within, self._slope * (robot.position_upper - ahead))
        np.maximum(torques, self._slope * (robot.position_lower - ahead), out=torques)
        np.minimum(np.maximum(torques, least, out=torques), most, out=torques)
        self._wish.target = torques[self.index]
        arms = self.torques(measurement)
        if arms is not None:
            torques[self.index] = arms
        return torques
