"""Tasks and contacts of a walk in the whole-body controller, and the targets that a tick gives them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from wbc.base.numbers import Array
from wbc.core.frames import heading, yaw_rotation
from wbc.core.limits.joint import JointLimits, TorqueLimits
from wbc.core.qp.contact import SoleContact
from wbc.core.qp.controller import Controller
from wbc.core.qp.options import GainOptions
from wbc.core.robot import BASE_DOF
from wbc.tasks.motion.com import CoMTask
from wbc.tasks.motion.frame import OrientationTask, PoseTask
from wbc.tasks.motion.posture import PostureTask
from wbc.tasks.stabilizer.feet import StabilizedFeet
from wbc.tasks.stabilizer.lean import UPRIGHT, LeanMotion
from wbc.tasks.stabilizer.stabilizer import StabilizerOutput
from wbc.walking.body import UNTWISTED, Twist
from wbc.walking.contact import GaitPhase
from wbc.walking.source import Reference, WholeBody
from wbc.walking.stepping.course import RiseLimit
from wbc.walking.stepping.feet import PhaseGains, SteppingFeet

TURNED = 0.3
"""Greatest difference of heading of pelvis or torso that is turned back at once, rad."""

UP = np.array([0.0, 0.0, 1.0])
"""Vertical."""

GAINS = ("stiffness", "damping")
"""Gains of the CoM that change with the phase, where the user has set none."""


class TaskTable(NamedTuple):
    """Tasks and contacts of planned or free steps, with their costs and gains; see `wbc.walking.table`.

    Attributes:
        com: Task of the centre of mass.
        contacts: Contacts of the left and of the right sole.
        swing: Gains of the pose of a foot in the air.
        trunk: Gains of the rotation of the pelvis, and of the torso where it is another link.
        posture: Task of all joints.
        twist: Gains of the torso's heading while the waist turns it; None where those of the trunk hold it.
        feet: Feet of steps that balance the robot; None where a stabilizer balances it.
        stabilized: Feet that a stabilizer loads; None where steps balance the robot.
        rise: Limit of the centre of mass.
        reaching: Ratio of the cost of the posture for joints of an arm whose hand has a target.
    """

    com: CoMTask
    contacts: Sequence[SoleContact]
    swing: GainOptions
    trunk: tuple[GainOptions, GainOptions]
    posture: PostureTask
    twist: GainOptions | None = None
    feet: SteppingFeet | None = None
    stabilized: StabilizedFeet | None = None
    rise: RiseLimit | None = None
    reaching: float = 1.0


class TrunkLink(NamedTuple):
    """Task of the pelvis or of the torso, and the rotation that it holds, seen in the heading of the robot."""

    task: OrientationTask
    tilt: Array  # rotation matrix
    yaw: float  # heading of the tilt, rad


class WalkTasks:
    """CoM, swing feet, trunk, posture, contacts and limits of one walk, by the table of its steps.

    Attributes:
        table: Its `TaskTable`.
        contacts: Contacts of the left and of the right sole.
        com: Task of the centre of mass.
        posture: Task of all joints.
    """

    def __init__(self, controller: Controller, table: TaskTable) -> None:
        robot, self.table = controller.robot, table
        self.contacts, self.com, self.posture = table.contacts, table.com, table.posture
        self._urgency, self._swing_scale = 0.0, np.ones(6)
        # State of the feet that balance the robot, and their greatest forces, N, as they were written last.
        self._stand: tuple[object, ...] = ()
        self._most_force: tuple[float, ...] = ()
        swing = table.swing
        self._swings = [PoseTask(sole.frame, **_named(f"{sole.name} swing", swing)) for sole in robot.soles]
        trunk = [
            OrientationTask(frame, **_named(name, gains))
            for name, frame, gains in zip(("pelvis", "torso"), robot.trunk_frames, table.trunk, strict=False)
        ]
        waist = [robot.joint_names[j] for j in robot.joints_between(robot.torso_frame, robot.base_frame)]
        self._twist: OrientationTask | None = None
        if table.twist is not None and waist:
            turn = _named("torso turn", table.twist)
            self._twist = OrientationTask(robot.torso_frame, axes=("yaw",), joints=waist, **turn)
            self._twist.scale = 0.0
        limits = [JointLimits(), TorqueLimits(), *(() if table.rise is None else (table.rise,))]
        turning = () if self._twist is None else (self._twist,)
        wrenches = () if table.stabilized is None else table.stabilized.parts
        controller.add(self.com, *wrenches, *self._swings, *trunk, *turning)
        controller.add(self.posture, *limits, *self.contacts)
        forward = yaw_rotation(-heading(robot.placement(robot.base_frame).rotation))
        tilts = [forward @ task.target for task in trunk]
        self._trunk = [TrunkLink(task, tilt, heading(tilt)) for task, tilt in zip(trunk, tilts, strict=True)]
        self._trunk_target: tuple[float | None, LeanMotion] = (None, UPRIGHT)  # heading and lean
        self._own_gains = {gain: np.array(getattr(self.com, gain)) for gain in GAINS}
        place = "walking.velocity or walking.go_to for its place"
        self.com.held_by = f"walking.body.com_height for its height, {place}"
        for foot in self._swings:
            foot.scale, foot.held_by = 0.0, "walking.velocity, walking.go_to or a plan of footsteps"
        for task in (*trunk, *turning):
            task.held_by = "walking.body.lean and walking.body.turn"

    def begin(self) -> None:
        """Begin anew on both feet."""
        for contact in self.contacts:
            contact.active = True
        for swing in self._swings:
            swing.scale = 0.0
        self._stand = self._most_force = ()
        self._trunk_target = (None, UPRIGHT)

    def spare(self, joints: Sequence[int]) -> None:
        """Leave joints to hands with targets: the CoM expects their motion, and the posture holds them less.

        They are indices in arrays of shape (na,), and no others are left to hands.
        """
        scale, spared = np.ones(self.posture.dim), np.array(joints, dtype=np.intp)
        scale[spared] = self.table.reaching
        self.posture.scale, self.com.spared = scale, spared + BASE_DOF

    def expect(self, accelerations: Array) -> None:
        """Expect joints that are left to hands to accelerate as the QP has had it, shape (nv,), rad/s²."""
        self.com.spared_acceleration = accelerations[self.com.spared]

    def _hold_com(self, gains: PhaseGains) -> None:
        """Let the weight of the CoM act by a ratio, with gains of this phase; a gain that the user has set stays."""
        com, own = self.com, self._own_gains
        com.scale = gains.scale
        for gain in [gain for gain in GAINS if np.array_equal(getattr(com, gain), own[gain])]:
            own[gain] = getattr(gains, gain)
            setattr(com, gain, own[gain])

    def _switch(self, side: int, *, contact: bool, swings: bool) -> None:
        """Put a foot (0 left, 1 right) on the ground or take it off; one that swings follows its motion."""
        self.contacts[side].active = contact
        swing = self._swings[side]
        if swings == swing.idle:
            swing.scale = self._swing_scale if swings else 0.0

    def _load(self, reference: Reference, feet: SteppingFeet) -> None:
        """Write what feet that balance the robot cost and bear, where it changes."""
        progress, before, most = reference.progress, self._stand, reference.most_force
        phase, stance, air = progress.phase, progress.stance, progress.air
        if reference.urgency != self._urgency:
            self._urgency, self._swing_scale = reference.urgency, feet.swing(reference.urgency)
            for swing in self._swings:
                if not swing.idle:
                    swing.scale = self._swing_scale
        now = phase, progress.contact, stance, air
        changed = now != before
        if changed:
            self._stand = now
            if not before or before[0] is not phase:
                gains = feet.gains(phase)
                self._hold_com(gains)
                for contact in self.contacts:
                    contact.set_box(*gains.box)
        if changed or most != self._most_force:
            self._most_force = most
            for side, on in enumerate(progress.contact):
                if changed:
                    self._switch(side, contact=on, swings=not on or side == air)
                if on:
                    contact, load = self.contacts[side], feet.load(side, reference)
                    if changed:
                        contact.centre_box(feet.centre(side, reference))
                        contact.motion_weight = load.cost
                    contact.bear(load.least, load.most)
        if phase is GaitPhase.SINGLE:
            self.contacts[stance].centre_box(feet.centre(stance, reference))

    def follow(
        self,
        reference: Reference,
        lean: LeanMotion = UPRIGHT,
        twist: Twist = UNTWISTED,
        output: StabilizerOutput | None = None,
    ) -> None:
        """Set all targets of a tick, with the `output` of the stabilizer for these references where there is one.

        `UPRIGHT` itself is no lean, `UNTWISTED` no twist.
        """
        pendulum, body, progress = reference.pendulum, reference.body, reference.progress
        contact, air, table = progress.contact, progress.air, self.table
        if table.feet is not None:
            self._load(reference, table.feet)
        else:
            for side, on in enumerate(contact):
                if on != self.contacts[side].active:
                    self._switch(side, contact=on, swings=not on)
        if table.rise is not None:
            table.rise.height = float(pendulum.com[2])
        for side, (motion, stands) in enumerate(zip(reference.feet, contact, strict=True)):
            if not stands or side == air:
                self._swings[side].follow(*motion)
        if body is None:
            acceleration = pendulum.com_acceleration
            self._turn_trunk(progress.heading, lean, twist)
        else:
            acceleration = body.com_acceleration
            self._follow_body(body, lean, twist)
        if table.stabilized is not None and output is not None:
            table.stabilized.follow(output, contact, [motion.placement for motion in reference.feet])
            acceleration = table.stabilized.com_acceleration(output, pendulum, acceleration)
        self.com.follow(pendulum.com, pendulum.com_velocity, acceleration)

    def _follow_body(self, body: WholeBody, lean: LeanMotion, twist: Twist) -> None:
        """Set the targets of a source that gives the motion of all joints; its trunk is twisted, and leans."""
        for link, turn, (rotation, velocity, acceleration) in zip(
            self._trunk, twist.links[: len(self._trunk)], body.trunk, strict=True
        ):
            link.task.follow(
                lean.rotation.dot(yaw_rotation(turn.angle)).dot(rotation),
                velocity + lean.velocity + turn.rate * UP,
                acceleration + lean.acceleration + turn.acceleration * UP,
            )
        if self._twist is not None:
            self._turn_waist(self._twist, twist)
        self.posture.follow(body.position, body.velocity, body.acceleration)

    def _turn_trunk(self, yaw: float, lean: LeanMotion, twist: Twist) -> None:
        """Turn pelvis and torso to a heading (rad), twist them and let them lean.

        A trunk that is turned far from there is brought upright as it turns back: a rotation that is large about the
        vertical has parts about the level axes that are no tilt, so the heading of the target stays near the trunk's.
        """
        links, still = list(zip(self._trunk, twist.links, strict=False)), twist is UNTWISTED
        off = [
            math.remainder(yaw + turn.angle + link.yaw - heading(link.task.rotation), math.tau)
            for link, turn in links
        ]
        far = max(off) > TURNED or min(off) < -TURNED
        if not far and still and yaw == self._trunk_target[0] and lean is self._trunk_target[1]:
            return
        self._trunk_target = (yaw, lean) if not far and still else (None, UPRIGHT)
        rotation, turned = lean.rotation, math.nan
        rates = lean.velocity, lean.acceleration
        for (link, turn), error in zip(links, off, strict=True):
            towards = yaw + turn.angle
            if far:
                towards += min(max(error, -TURNED), TURNED) - error
            if towards != turned:  # pelvis and torso turn together as a rule
                rotation, turned = lean.rotation.dot(yaw_rotation(towards)), towards
            if not still:
                rates = lean.velocity + turn.rate * UP, lean.acceleration + turn.acceleration * UP
            link.task.follow(rotation.dot(link.tilt), *rates)
        if self._twist is not None:
            self._turn_waist(self._twist, twist)

    def _turn_waist(self, task: OrientationTask, turn: Twist) -> None:
        """Let the waist turn the torso where the gains of the trunk leave its heading free."""
        if turn.by_waist == task.idle:
            task.scale = float(turn.by_waist)
        if turn.by_waist:
            target: Array = self._trunk[1].task.target
            task.follow(target, np.array([turn.rate]), np.array([turn.acceleration]))


def _named(name: str, gains: GainOptions) -> GainOptions:
    return {**gains, "name": name}
