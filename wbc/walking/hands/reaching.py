"""All arms of a robot that stands or walks: their targets, and their swing without one.

A target is given in the world, in the frame of the pelvis or of the feet, or in that of an object whose pose is told as
it moves. A hand moves its arm alone (`wbc.walking.hands.arm`), and the task of the centre of mass all joints but those
of arms with targets; each counts the motion of the others. So the balance does not shake the hand, and a hand whose
target is out of reach does not disturb the balance. Without a target an arm is held by the posture, or swings with the
opposite foot.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from types import MappingProxyType

import numpy as np
import pinocchio as pin

from wbc.base.checked import checked
from wbc.base.errors import InputError, choose
from wbc.base.numbers import Array
from wbc.core.frames import pose
from wbc.core.qp.controller import Controller
from wbc.core.robot import BASE_DOF
from wbc.walking.hands.arm import Arm, ArmSettings
from wbc.walking.hands.frames import FEET, PELVIS, WORLD, TargetFrames
from wbc.walking.plans.footsteps import Footstep
from wbc.walking.plans.swing import FootMotion
from wbc.walking.tasks import WalkTasks

SIGNS = {"left_hand": 1.0, "right_hand": -1.0}
"""Hands that swing with the foot of the other side, and the sign of their way while the right foot is ahead."""

LEAST_GAIN = 0.01
"""Displacement of a hand forward per angle of a joint, m/rad, below which the joint cannot swing the arm."""


class Arms:
    """Arms of a robot that walks, one for each of its hands.

        walking.arms["left_hand"].reach([0.4, 0.3, 1.0])              # a point in the world
        walking.arms["right_hand"].reach(pose, "pelvis")
        walking.arms.place("box", box_pose)                             # in every tick in which it has moved
        walking.arms["right_hand"].reach([0.0, -0.1, 0.0], "box")

    Attributes:
        settings: Its `ArmSettings`.
        all: Role of a hand → its arm.
    """

    def __init__(self, controller: Controller, settings: ArmSettings, tasks: WalkTasks) -> None:
        """Leave the arms to the posture; no task is added before a hand is given a target."""
        self.settings, self._controller, self._tasks = settings, controller, tasks
        robot, self._frames = controller.robot, TargetFrames(controller)
        self.all: Mapping[str, Arm] = MappingProxyType(
            {name: Arm(controller, name, settings, self._frames) for name in robot.frames}
        )
        self._rest = np.array(robot.q[robot.base_nq :])
        self._turns = self._swing_turns()
        self._swung = 0.0  # swing in the last tick, m/m
        self._swings = self._rest  # target of the posture by the swing
        self._spared: tuple[Arm, ...] = ()

    def __iter__(self) -> Iterator[str]:
        return iter(self.all)

    def __getitem__(self, name: str) -> Arm:
        """Return the arm of a hand by its role."""
        return self.all[choose("hand", name, self.all)]

    @checked
    def place(self, name: str, where: pin.SE3 | None) -> None:
        """State where an object is; call it again whenever it has moved.

        Args:
            name: Name of the object.
            where: Its pose in the world; None forgets the object, which is an `InputError` while a hand has its target
                there.
        """
        if name in (WORLD, PELVIS, FEET):
            raise InputError(f"the name of an object must not be '{name}'")
        if where is not None:
            self._frames.objects[name] = pose(f"pose of '{name}'", where)
            return
        bound = [arm.name for arm in self.all.values() if arm.active and arm.within == name]
        if bound:
            raise InputError(
                f"'{name}' is forgotten once no hand goes by it: release {bound[0]}, and wait until it is inactive"
            )
        self._frames.objects.pop(name, None)

    def update(
        self,
        feet: Sequence[FootMotion],
        yaw: float,
        fast_share: float = 0.0,
        upcoming: Sequence[Footstep] | None = None,
    ) -> None:
        """Move all references by one tick.

        Args:
            feet: Motions of left and right sole.
            yaw: Heading, rad.
            fast_share: Share from 0 to 1 by which the walk is a fast one.
            upcoming: Footsteps after which the feet stop; None where they go on.
        """
        active = tuple([arm for arm in self.all.values() if arm.active])
        if active or self._spared:
            solution = self._controller.solution
            accelerations = None if solution is None else solution.accelerations
            self._frames.follow(
                any(arm.within == FEET for arm in active), feet, yaw, self._controller.dt, upcoming
            )
            for arm in active:
                arm.update(accelerations)
            self._spare(active, accelerations)
        swing = fast_share * self.settings.fast_swing
        if swing > 0.0 or self._swung > 0.0:
            self._swung = swing
            self._swing(feet, yaw, swing)

    def _swing_turns(self) -> Array:
        """Return the turn of the one joint of each arm that moves its hand forward most, rad/m, shape (na,)."""
        robot, turns = self._controller.robot, np.zeros(self._controller.robot.na)
        forward = robot.placement(robot.base_frame).rotation[:, 0]
        for name, sign in SIGNS.items():
            if name in self.all and self.all[name].joints:
                frame, joints = robot.frame_id(self.all[name].frame), self.all[name].joints
                rows = pin.getFrameJacobian(robot.model, robot.data, frame, pin.LOCAL_WORLD_ALIGNED)
                gains = [float(forward @ rows[:3, BASE_DOF + joint]) for joint in joints]
                joint, gain = max(zip(joints, gains, strict=True), key=lambda each: abs(each[1]))
                if abs(gain) > LEAST_GAIN:
                    turns[joint] = sign / gain
        return turns

    def _swing(self, feet: Sequence[FootMotion], yaw: float, swing: float) -> None:
        """Let arms follow the feet of the other side, as long as nobody else has moved the posture."""
        ahead = math.cos(yaw), math.sin(yaw)
        (left, right) = feet
        x, y, _ = (right.placement.translation - left.placement.translation).tolist()
        u, v = (right.velocity - left.velocity)[:2].tolist()
        way, speed = ahead[0] * x + ahead[1] * y, ahead[0] * u + ahead[1] * v
        posture, turns = self._tasks.posture, swing * self._turns
        if posture.moving or not np.array_equal(posture.target, self._swings):
            self._swings = self._rest
            return
        self._swings = self._rest + turns * way
        posture.follow(self._swings, turns * speed, np.zeros(posture.dim))

    def _spare(self, active: tuple[Arm, ...], accelerations: Array | None) -> None:
        """Keep the balance from using active arms, and the posture from holding them back."""
        if active != self._spared:
            self._spared = active
            self._tasks.spare([*dict.fromkeys(joint for arm in active for joint in arm.joints)])
        if accelerations is not None and active:
            self._tasks.expect(accelerations)
