"""Tasks and contacts of a walk in the whole-body controller, and the targets that a tick gives them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

import numpy as np
import pinocchio as pin

from wbc.core.errors import Array
from wbc.core.limits.rows import JointLimits, TorqueLimits
from wbc.core.qp.contact import SoleContact
from wbc.core.qp.controller import Controller
from wbc.core.robot import Robot
from wbc.core.settings import Positive, settings
from wbc.tasks.balance import BodyGains
from wbc.tasks.motion.com import CoMTask
from wbc.tasks.motion.frame import OrientationTask, PoseTask
from wbc.tasks.stabilizer.distribution import DistributionSettings
from wbc.tasks.stabilizer.gains import StabilizerGains
from wbc.tasks.stabilizer.lean import UPRIGHT, LeanMotion
from wbc.tasks.stabilizer.task import StabilizerTask
from wbc.walking.body import Twist
from wbc.walking.planning.footsteps import heading
from wbc.walking.source import Reference

FREE_FRICTION = 2.0
"""Friction of the contacts in position control: the QP's own wrenches are not commanded there and must not bind."""


@settings
class TaskGains(BodyGains):
    """Weights and gains of the tasks of a walk: those of `wbc.tasks.balance.BodyGains`, and these.

    Attributes:
        swing_weight: Pose of the foot in the air, cost per (m/s²)² and (rad/s²)².
        swing_turn_weight: Rotation of the foot in the air in torque control, cost per (rad/s²)²: where a joint of the
            ankle meets its limit the foot turns by a hundred rad/s², which the CoM must not pay for.
        swing_stiffness: 1/s².
        contact_stiffness: Stiffness of a standing foot towards its corrected pose in position control, 1/s².
        contact_return: Stiffness of a standing foot towards its place in torque control, 1/s².
        wrench_weight: Desired foot wrenches in torque control, cost per N² and (Nm)².
        moment_by_load: Weigh the moments of the desired wrenches of two feet by the inverse square of each foot's load
            over the sum: at equal weights the CoP of the foot with less load is at the edge, and it turns.
        leg_weight: Joints of the legs, cost per (rad/s²)²; that of all joints when None.
        even_soles: Bound yaw moments of soles in torque control as under even pressure, not at their corners alone.
    """

    swing_weight: Positive = 1000.0
    swing_turn_weight: Positive = 1.0
    swing_stiffness: Annotated[Positive, "1/s²"] = 400.0
    contact_stiffness: Annotated[Positive, "1/s²"] = 1000.0
    contact_return: Annotated[Positive, "1/s²"] = 100.0
    wrench_weight: Positive = 1e-3
    moment_by_load: bool = False
    leg_weight: Positive | None = None
    even_soles: bool = False


class WalkTasks:
    """CoM, swing feet, pelvis and torso, posture, contacts and, in torque control, wrenches of one walk.

    Attributes:
        contacts: Contacts of the left and of the right sole.
        com: Task of the centre of mass and of the wrenches on the feet: the stabilizer.
        posture: Task of all joints.
    """

    def __init__(
        self,
        controller: Controller,
        gains: TaskGains,
        stabilizer: StabilizerGains,
        distribution: DistributionSettings,
        estimate: Robot,
        *,
        torque: bool,
    ) -> None:
        """Add all tasks, contacts and limits to a controller of a robot that stands at the start.

        Contacts have the friction of the distribution in torque control; it is position control when `torque` is False.
        """
        robot, friction = controller.robot, distribution.friction
        self._torque = torque
        turn = gains.swing_turn_weight if torque else gains.swing_weight
        self._swing_weight = np.repeat([gains.swing_weight, turn], 3)
        self.contacts = [
            SoleContact(
                sole.name,
                min_force=0.0,
                margin=0.0,
                ramp=0.0,
                stiffness=gains.contact_return if torque else gains.contact_stiffness,
                friction=friction if torque else FREE_FRICTION,
                even=torque and gains.even_soles,
            )
            for sole in robot.soles
        ]
        self.com = controller.add(
            StabilizerTask(
                self.contacts,
                drives="torque" if torque else "position",
                gains=stabilizer,
                distribution=distribution,
                estimate=estimate,
                wrench_weight=gains.wrench_weight,
                moment_by_load=gains.moment_by_load,
                weight=gains.com_weight,
                stiffness=gains.com_stiffness,
            )
        )
        self._swings = [
            controller.add(
                PoseTask(sole.frame, name=f"{sole.name} swing", weight=0.0, stiffness=gains.swing_stiffness)
            )
            for sole in robot.soles
        ]
        self._trunk, self.posture = gains.add_trunk_and_posture(controller, "pelvis")
        if gains.leg_weight is not None:
            weight = np.full(robot.na, gains.posture_weight)
            weight[robot.leg_joints] = gains.leg_weight
            self.posture.weight = weight
        forward = _yaw_rotation(-heading(robot.placement(robot.base_frame).rotation))
        self._trunk_tilts = [forward @ task.target for task in self._trunk]
        self._trunk_target: tuple[float | None, LeanMotion] = (None, UPRIGHT)  # heading and lean
        controller.add(JointLimits())
        for contact in self.contacts:
            controller.add(contact)
        controller.add(TorqueLimits())
        leave_to_walk(self.com, self._swings, self._trunk)

    def switch(self, side: int, contact: bool) -> None:
        """Put a foot (0 left, 1 right) on the ground, or take it off."""
        self.contacts[side].active = contact
        self._swings[side].weight = 0.0 if contact else self._swing_weight

    def follow(self, reference: Reference, lean: LeanMotion = UPRIGHT, twist: Twist | None = None) -> None:
        """Set all targets of a tick, after the stabilizer's; `UPRIGHT` itself is no lean, None no twist."""
        pendulum, beyond, body, places = reference.pendulum, reference.reaction, reference.body, []
        for motion, stands, swing in zip(reference.feet, reference.contact, self._swings, strict=True):
            places.append(motion.placement)
            if not stands:
                swing.follow(*motion)
        if body is None:
            self.com.apply(pendulum, reference.contact, places, beyond)
            self._turn_trunk(reference.heading, lean, twist)
            return
        if self._torque:  # the feedback's acceleration is about that of the pendulum
            x, y = (body.com_acceleration[:2] - pendulum.com_acceleration[:2]).tolist()
            beyond = x, y
        pendulum = pendulum._replace(com_acceleration=body.com_acceleration)
        self.com.apply(pendulum, reference.contact, places, beyond)
        for task, (rotation, velocity, acceleration) in zip(self._trunk, body.trunk, strict=True):
            task.follow(
                lean.rotation.dot(rotation), velocity + lean.velocity, acceleration + lean.acceleration
            )
        self.posture.follow(body.position, body.velocity, body.acceleration)

    def _turn_trunk(self, yaw: float, lean: LeanMotion, twist: Twist | None) -> None:
        """Turn pelvis and torso to a heading (rad) and let them lean."""
        if yaw == self._trunk_target[0] and lean is self._trunk_target[1]:
            return
        self._trunk_target = yaw, lean
        turn = lean.rotation.dot(_yaw_rotation(yaw))
        for task, tilt in zip(self._trunk, self._trunk_tilts, strict=True):
            task.follow(turn.dot(tilt), lean.velocity, lean.acceleration)
        if twist is not None:
            turn, up = lean.rotation.dot(_yaw_rotation(yaw + twist.angle)), np.array([0.0, 0.0, 1.0])
            first = 1 if twist.by_waist else 0
            for task, tilt in list(zip(self._trunk, self._trunk_tilts, strict=True))[first:]:
                task.follow(
                    turn.dot(tilt),
                    lean.velocity + twist.rate * up,
                    lean.acceleration + twist.acceleration * up,
                )


def leave_to_walk(com: CoMTask, swings: Sequence[PoseTask], trunk: Sequence[OrientationTask]) -> None:
    """Name, for those who assign a target that a walk sets at every tick, what they may set instead."""
    com.set_by("walking.body.com_height for its height, walking.velocity or walking.go_to for its place")
    for swing in swings:
        swing.set_by("walking.velocity, walking.go_to or a plan of footsteps")
    for task in trunk:
        task.set_by("walking.body.lean and walking.body.turn")


def _yaw_rotation(yaw: float) -> Array:
    """Rotation about the vertical, shape (3, 3)."""
    return np.asarray(pin.rpy.rpyToMatrix(0.0, 0.0, yaw))
