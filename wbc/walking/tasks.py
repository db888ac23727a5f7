"""Tasks and contacts of a walk in the whole-body controller, and the targets that a tick gives them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from wbc.base.numbers import Array
from wbc.core.limits.joint import JointLimits
from wbc.core.limits.torque import TorqueLimits
from wbc.core.qp.contact import SoleContact
from wbc.core.qp.controller import Controller
from wbc.core.qp.task import GainOptions, Task
from wbc.tasks.motion.com import CoMTask
from wbc.tasks.motion.frame import OrientationTask, PoseTask
from wbc.tasks.motion.posture import PostureTask
from wbc.tasks.stabilizer.lean import UPRIGHT, LeanMotion
from wbc.tasks.stabilizer.task import StabilizerTask
from wbc.walking.body import UNTWISTED, Twist
from wbc.walking.contact import GaitPhase
from wbc.walking.plans.footsteps import heading
from wbc.walking.source import Reference, WholeBody
from wbc.walking.stepping.rise import RiseLimit
from wbc.walking.stepping.settings import SteppingConstants

TURNED = 0.3
"""Greatest difference of heading of pelvis or torso that is turned back at once, rad."""

UP = np.array([0.0, 0.0, 1.0])
"""Vertical."""

UNLOADED = 1e-3
"""Least bound of the force of a foot in contact, over the greatest force of a foot."""

ONE_FOOT, BOTH_FEET = np.array([0.0, 0.0, 1.0]), np.ones(3)
"""Ratios by which the weight of the CoM acts in steps that balance: its height alone, and its place as well."""

GAINS = ("weight", "stiffness", "damping")
"""Gains of a task that a user may set at any tick."""


class TaskTable(NamedTuple):
    """Tasks and contacts of one kind of steps, with their costs and gains; see `wbc.walking.table`.

    Attributes:
        com: Task of the centre of mass, and where a stabilizer balances the robot that of the wrenches on the feet.
        contacts: Contacts of the left and of the right sole.
        swing: Gains of the pose of a foot in the air.
        trunk: Gains of the rotation of the pelvis, and of the torso where it is another link.
        posture: Task of all joints.
        twist: Gains of the torso's heading while the waist turns it; None where those of the trunk hold it.
        stance: How feet carry that no stabilizer loads; None with one.
        rise: Limit on the rise of the centre of mass; None without.
        reaching: Ratio of the cost of the posture for joints of an arm whose hand has a target.
        torque: True under torques, where the feedback's acceleration is about that of the pendulum.
    """

    com: CoMTask
    contacts: Sequence[SoleContact]
    swing: GainOptions
    trunk: tuple[GainOptions, GainOptions]
    posture: PostureTask
    twist: GainOptions | None = None
    stance: StanceContacts | None = None
    rise: RiseLimit | None = None
    reaching: float = 1.0
    torque: bool = True


class WalkTasks:
    """CoM, swing feet, trunk, posture, contacts and limits of one walk, by the table of a kind of steps.

    Attributes:
        contacts: Contacts of the left and of the right sole.
        com: Task of the centre of mass, and where a stabilizer balances the robot that of the wrenches on the feet.
        posture: Task of all joints.
        reaching: Ratio of the cost of the posture for joints of an arm whose hand has a target.
    """

    def __init__(self, controller: Controller, table: TaskTable) -> None:
        """Add all to a controller."""
        robot, self._controller = controller.robot, controller
        com, contacts, swing, trunk, posture, twist, self._stance, rise, self.reaching, self._torque = table
        self.contacts, self.com, self.posture, self._rise = list(contacts), com, posture, rise
        self._urgency, self._swing_scale = 0.0, np.ones(6)
        self._swings = [PoseTask(sole.frame, **_named(f"{sole.name} swing", swing)) for sole in robot.soles]
        parts = [("pelvis", robot.base_frame), ("torso", robot.torso_frame)]
        if robot.torso_frame == robot.base_frame:
            parts.pop()
        self._trunk = [
            OrientationTask(frame, **_named(name, gains))
            for (name, frame), gains in zip(parts, trunk, strict=False)
        ]
        waist = [robot.joint_names[j] for j in robot.joints_between(robot.torso_frame, robot.base_frame)]
        self._twist: OrientationTask | None = None
        if twist is not None and waist:
            self._twist = OrientationTask(
                robot.torso_frame, axes=("yaw",), joints=waist, **_named("torso turn", twist)
            )
            self._twist.scale = 0.0
        limits = [JointLimits(), TorqueLimits(), *(() if rise is None else (rise,))]
        turning = () if self._twist is None else (self._twist,)
        self._all: list[Any] = [
            com, *self._swings, *self._trunk, *turning, posture, *limits, *self.contacts
        ]  # fmt: skip
        first, *others = self._all
        controller.add(first, *others)
        forward = _yaw_rotation(-heading(robot.placement(robot.base_frame).rotation))
        self._trunk_tilts = [forward @ task.target for task in self._trunk]
        self._trunk_yaws = [heading(tilt) for tilt in self._trunk_tilts]
        self._trunk_target: tuple[float | None, LeanMotion] = (None, UPRIGHT)  # heading and lean
        self._tuned = *self._swings, *self._trunk, self.posture
        self._own_gains = {
            task.name: {gain: np.array(getattr(task, gain)) for gain in GAINS} for task in (com, *self._tuned)
        }
        for swing_task in self._swings:
            swing_task.scale = 0.0
        com.held_by = (
            "walking.body.com_height for its height, walking.velocity or walking.go_to for its place"
        )
        for foot in self._swings:
            foot.held_by = "walking.velocity, walking.go_to or a plan of footsteps"
        for task in (*self._trunk, *turning):
            task.held_by = "walking.body.lean and walking.body.turn"

    def leave(self) -> None:
        """Take all out of the controller."""
        self._controller.remove(*self._all)

    def enter(self, before: WalkTasks | None) -> None:
        """Put all back, on both feet, and go on with what a user has set of the tasks that have left, if any have.

        That is the posture, with a move that is under way, the gains of swings, trunk and posture, and the weight of
        the CoM, whose other gains mean another law.
        """
        for contact in self.contacts:
            contact.active = True
        for swing in self._swings:
            swing.scale = 0.0
        if self._stance is not None:
            self._stance.forget()
        self._trunk_target = (None, UPRIGHT)
        first, *others = self._all
        self._controller.add(first, *others)
        if before is None:
            return
        self.posture.go_on_from(before.posture)
        for task, other in zip(self._tuned, before._tuned, strict=True):
            for gain in GAINS:
                if before._is_set(other, gain):
                    setattr(task, gain, getattr(other, gain))
        if before._is_set(before.com, "weight"):
            self.com.weight = before.com.weight

    def _is_set(self, task: Task, gain: str) -> bool:
        """Return True if a user has set a gain of a task."""
        return not np.array_equal(getattr(task, gain), self._own_gains[task.name][gain])

    def hold_com(self, scale: Array, stiffness: Array, damping: Array) -> None:
        """Let the weight of the CoM act by a ratio, with gains of this phase where the user has set none."""
        self.com.scale = scale
        set_ = [self._is_set(self.com, gain) for gain in GAINS[1:]]
        for gain, value, is_set in zip(GAINS[1:], (stiffness, damping), set_, strict=True):
            if not is_set:
                setattr(self.com, gain, value)
                self._own_gains[self.com.name][gain] = value

    def switch(self, side: int, contact: bool) -> None:
        """Put a foot (0 left, 1 right) on the ground, or take it off."""
        self.contacts[side].active = contact
        self._swings[side].scale = 0.0 if contact else self._swing_scale

    def swing(self, side: int) -> None:
        """Let a foot follow its motion in the air that still carries a part of its load."""
        self._swings[side].scale = self._swing_scale

    def hurry(self, urgency: float, urgent: Array, hurled: float) -> None:
        """Let the swing foot cost more, by ratios of shape (6,) for an urgency of 1, or less by a ratio for −1."""
        if urgency == self._urgency:
            return
        self._urgency = urgency
        self._swing_scale = hurled * np.ones(6) if urgency < 0.0 else 1.0 + urgency * (urgent - 1.0)
        for swing in self._swings:
            if not swing.idle:
                swing.scale = self._swing_scale

    def follow(self, reference: Reference, lean: LeanMotion = UPRIGHT, twist: Twist = UNTWISTED) -> None:
        """Set all targets of a tick, after the stabilizer's; `UPRIGHT` itself is no lean, `UNTWISTED` no twist."""
        pendulum, body = reference.pendulum, reference.body
        if self._stance is not None:
            self._stance.switch(self, reference)
        if self._rise is not None:
            self._rise.height = float(pendulum.com[2])
        for side, (motion, stands) in enumerate(zip(reference.feet, reference.contact, strict=True)):
            if not stands or side == reference.swing:
                self._swings[side].follow(*motion)
        if body is not None:
            self._follow_body(reference, body, lean)
            return
        if isinstance(self.com, StabilizerTask):
            places = [motion.placement for motion in reference.feet]
            self.com.apply(pendulum, reference.contact, places)
        else:
            self.com.follow(pendulum.com, pendulum.com_velocity, pendulum.com_acceleration)
        self._turn_trunk(reference.heading, lean, twist)

    def _follow_body(self, reference: Reference, body: WholeBody, lean: LeanMotion) -> None:
        """Set the targets of a source that gives the motion of all joints."""
        com, pendulum, beyond = self.com, reference.pendulum, (0.0, 0.0)
        assert isinstance(com, StabilizerTask)
        if self._torque:  # the feedback's acceleration is about that of the pendulum
            x, y = (body.com_acceleration[:2] - pendulum.com_acceleration[:2]).tolist()
            beyond = x, y
        pendulum = pendulum._replace(com_acceleration=body.com_acceleration)
        com.apply(pendulum, reference.contact, [motion.placement for motion in reference.feet], beyond)
        for task, (rotation, velocity, acceleration) in zip(self._trunk, body.trunk, strict=True):
            task.follow(
                lean.rotation.dot(rotation), velocity + lean.velocity, acceleration + lean.acceleration
            )
        self.posture.follow(body.position, body.velocity, body.acceleration)

    def _turn_trunk(self, yaw: float, lean: LeanMotion, twist: Twist) -> None:
        """Turn pelvis and torso to a heading (rad), twist them and let them lean.

        A trunk that is turned far from there is brought upright as it turns back: a rotation that is large about the
        vertical has parts about the level axes that are no tilt, so the heading of the target stays near the trunk's.
        """
        turns, still = (UNTWISTED if twist.by_waist else twist, twist), twist is UNTWISTED
        off = [
            math.remainder(yaw + turn.angle + own - heading(task.rotation), math.tau)
            for task, turn, own in zip(self._trunk, turns, self._trunk_yaws, strict=False)
        ]
        far = max(off) > TURNED or min(off) < -TURNED
        if not far and still and yaw == self._trunk_target[0] and lean is self._trunk_target[1]:
            return
        self._trunk_target = (yaw, lean) if not far and still else (None, UPRIGHT)
        for task, tilt, turn, error in zip(self._trunk, self._trunk_tilts, turns, off, strict=False):
            towards = yaw + turn.angle
            if far:
                towards += min(max(error, -TURNED), TURNED) - error
            task.follow(
                lean.rotation.dot(_yaw_rotation(towards)).dot(tilt),
                lean.velocity + turn.rate * UP,
                lean.acceleration + turn.acceleration * UP,
            )
        if self._twist is not None:
            self._turn_waist(self._twist, twist)

    def _turn_waist(self, task: OrientationTask, turn: Twist) -> None:
        """Let the waist turn the torso where the gains of the trunk leave its heading free."""
        if turn.by_waist == task.idle:
            task.scale = float(turn.by_waist)
        if turn.by_waist:
            target: Array = self._trunk[1].target
            task.follow(target, np.array([turn.rate]), np.array([turn.acceleration]))


@dataclass(frozen=True, slots=True)
class StanceContacts:
    """Contacts of feet that steps balance: costs of their motion, boxes of their pressure, forces; in SI units."""

    urgent: Array  # ratio of the costs of a swing foot that goes before the trunk, shape (6,)
    hurled: float  # the same of one that a push has hurled
    held: Array  # cost of the motion of a foot that stands, shape (6,)
    firm: Array  # the same on both feet
    yielding: float  # ratio of these costs for a foot that is unloaded, or waits to take over
    # Stiffness and damping of the CoM, shape (3,) each, while the weight shifts, and in a stand.
    shift: tuple[Array, Array]
    stand: tuple[Array, Array]
    law: SteppingConstants  # boxes of the centre of pressure, their place, and forces
    _state: list[object] = field(default_factory=list)  # of the last tick

    def forget(self) -> None:
        """Write all anew in the next tick."""
        self._state.clear()

    def switch(self, tasks: WalkTasks, reference: Reference) -> None:
        """Switch contacts, and the weights that go with them, where they change."""
        tasks.hurry(reference.urgency, self.urgent, self.hurled)
        phase, law = reference.phase, self.law
        balanced, standing = phase is not GaitPhase.SINGLE, phase is GaitPhase.STANDING
        stance = reference.stance
        state = [balanced, standing, reference.contact, reference.most_force, stance, reference.swing]
        if state != self._state:
            self._write(tasks, reference, balanced, standing)
            self._state[:] = state
        if not balanced:
            ahead, aside = reference.cop
            tasks.contacts[stance].centre_box((law.carrying + ahead, aside))

    def _write(self, tasks: WalkTasks, reference: Reference, balanced: bool, standing: bool) -> None:
        """Write all of a state of the feet, with the boxes about their carrying points."""
        most, stance, law = reference.most_force, reference.stance, self.law
        if self._state[:2] != [balanced, standing]:
            tasks.hold_com(BOTH_FEET if balanced else ONE_FOOT, *(self.stand if standing else self.shift))
            length, width = law.standing_box if balanced else law.box
            for contact in tasks.contacts:
                contact.set_box(length, width, (0.0 if standing else law.carrying, 0.0))
        both = all(reference.contact)
        for side, contact in enumerate(tasks.contacts):
            on = reference.contact[side]
            tasks.switch(side, on)
            if side == reference.swing:
                tasks.swing(side)
            if not on:
                continue
            full = balanced or side == stance
            if not full:
                contact.centre_box((law.carrying, 0.0))
            weight = self.firm if balanced else self.held
            contact.motion_weight = weight if full else self.yielding * weight
            contact.min_force = 0.0  # first: a foot that was unloading may have less than it must carry now
            contact.max_force = max(most[side], UNLOADED * law.most_force)
            if full:
                contact.min_force = 0.2 * law.least_force if both else law.carried


def _named(name: str, gains: GainOptions) -> GainOptions:
    return {**gains, "name": name}


def _yaw_rotation(yaw: float) -> Array:
    """Rotation about the vertical, shape (3, 3)."""
    return np.asarray(pin.rpy.rpyToMatrix(0.0, 0.0, yaw))
