"""Hands that go to targets and stay there while the robot stands or walks.

    target  →  reference that moves with bounded speed and acceleration, or on a minimum jerk trajectory
            →  the same in the world, where the frame of the target moves  →  pose task of the hand

A target is given in the world, in the frame of the pelvis, or in that of an object whose pose is told as it moves. The
error of the task is bounded, and the reference waits for a hand that cannot follow. The hand moves its arm alone, and
the task of the centre of mass all joints but those of arms with targets; each counts the motion of the others. So the
balance does not shake the hand, and a hand whose target is out of reach does not disturb the balance. Without
a target an arm is held by the posture, or swings with the opposite foot.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Annotated

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from wbc.base.errors import InputError, choose
from wbc.base.numbers import Array, finite_array
from wbc.base.settings import NonNegative, Positive, settings
from wbc.core.qp.controller import Controller
from wbc.core.qp.move import Move, PoseCoordinates
from wbc.core.qp.task import NEAR, SLOW
from wbc.core.robot import BASE_DOF
from wbc.core.trajectories import Ramp, approach
from wbc.tasks.motion.frame import PoseTask, pose
from wbc.walking.hands.hand import Hand
from wbc.walking.swing import REST, FootMotion
from wbc.walking.tasks import WalkTasks

ARRIVED = 1e-3
"""Distance of the reference from a target, m and rad, from which it counts as there."""

WORLD, PELVIS = "world", "pelvis"
"""Frames of targets that are always there."""


SIDES = {"left_hand": 1.0, "right_hand": -1.0}
"""Hands that swing with the foot of the other side, and the sign of their way while the right foot is ahead."""

LEAST_GAIN = 0.01
"""Displacement of a hand forward per angle of a joint, m/rad, below which the joint cannot swing the arm."""

STIFFNESS, BLEND = 100.0, 0.3
"""Stiffness of the task of a hand, 1/s²; time over which its weight rises and falls, s."""

ERROR_BOUND = (0.05, 0.3)
"""Greatest error of the hand that acts, m, and of its rotation, rad."""

TURN_SPEED, TURN_ACCELERATION = 1.5, 6.0
"""Greatest angular speed, rad/s, and acceleration, rad/s², of the reference."""

LEAD = 0.1
"""Error of the hand at which its reference waits, m (of the rotation, rad)."""


@settings
class ArmSettings:
    """Settings of the arms in a walk.

    Attributes:
        weight: Hand with a target, cost per (m/s²)² and (rad/s²)².
        speed: Greatest speed of the reference of a hand, m/s.
        acceleration: Its greatest acceleration, m/s².
        waist: Hands with targets move the joints of the waist as well.
        swing: Swing of arms without targets, m/m: displacement of a hand forward for each metre that the other side's
            foot is ahead of its own. 0 holds them still.
        fast_swing: The same in a fast walk with free steps, where the arms hold against the turn of the legs.
    """

    weight: Positive = 100.0
    speed: Annotated[Positive, "m/s"] = 0.5
    acceleration: Annotated[Positive, "m/s²"] = 2.0
    waist: bool = False
    swing: Annotated[NonNegative, "m/m"] = 0.0
    fast_swing: Annotated[NonNegative, "m/m"] = 0.4


class Arm:
    """Arm of one hand: a target, and the reference on its way to it.

    Attributes:
        name: Role, such as "left_hand".
        frame: Frame of the robot.
        joints: Joints of the arm, as indices in arrays of shape (na,).
        pressing: The hand where it presses or grips; None where no balance counts its forces.
    """

    pressing: Hand | None = None

    def __init__(
        self,
        controller: Controller,
        name: str,
        dt: float,
        settings: ArmSettings,
        objects: Mapping[str, tuple[pin.SE3, Array]],
    ) -> None:
        """Leave the arm to the posture; `objects` have pose and velocity."""
        self._objects, robot = objects, controller.robot
        self.name, self.frame = name, robot.frames[choose("hand", name, robot.frames)]
        trunk = robot.base_frame if settings.waist else robot.torso_frame
        self.joints = robot.joints_between(self.frame, trunk)
        self._spared = np.setdiff1d(np.arange(robot.nv), np.array(self.joints, dtype=int) + BASE_DOF)
        self._controller, self._robot, self._dt, self._settings = controller, robot, dt, settings
        self._task: PoseTask | None = None  # before the first target
        self._within = WORLD
        self._goal: pin.SE3 | None = None
        self._point = False
        self._reference, self._velocity = pin.SE3.Identity(), np.zeros(6)
        self._move: Move | None = None  # of the reference, where a time or a speed was given
        self._blend = Ramp()  # of the weight: its goal is 1 with a target, 0 without

    @property
    def target(self) -> pin.SE3 | None:
        """Target in its frame; None without one. Of a target that is a point, the rotation means nothing."""
        return None if self._goal is None else self._goal.copy()

    @property
    def active(self) -> bool:
        """True while the hand has a task: from `reach` on until it has been let go."""
        return self._goal is not None or self._blend.value > 0.0

    @property
    def busy(self) -> bool:
        """True while the hand has a task, presses or grips."""
        return self.active or (self.pressing is not None and self.pressing.active)

    def check_own(self) -> None:
        """Raise an `InputError` for an arm that somebody else moves."""
        released = self._controller.released
        if released is not None and self.joints and released.mask[self.joints].all():
            raise InputError(
                f"the arm of '{self.name}' is moved by somebody else; walking.release takes it back"
            )

    @property
    def error(self) -> Array:
        """Target minus hand as it is commanded, position (m) and rotation (rad), shape (6,), in the target's frame.

        The rotation is zero where the target is a point. Without a target all is NaN.
        """
        if self._goal is None:
            return np.full(6, np.nan)
        return self._left(self._here(self._within))

    @property
    def moving(self) -> bool:
        """True while the reference of the hand is on its way to the target."""
        if self._goal is None:
            return False
        if self._move is not None:
            return True
        left = self._left(self._reference)
        return bool(np.linalg.norm(left[:3]) > ARRIVED or np.linalg.norm(left[3:]) > ARRIVED)

    @property
    def speed(self) -> float:
        """Speed of the hand as it is commanded, m/s, in the frame of its target; 0 without one."""
        if self._goal is None:
            return 0.0
        robot, (place, moving, _) = self._robot, self._frame_now(self._within)
        hand = robot.frame_id(self.frame)
        velocity = pin.getFrameVelocity(robot.model, robot.data, hand, pin.LOCAL_WORLD_ALIGNED).linear
        arm = robot.placement(self.frame).translation - place.translation
        return float(np.linalg.norm(velocity - moving[:3] - np.cross(moving[3:], arm)))

    @property
    def reached(self) -> bool:
        """True once the hand is at its target: within 10 mm, of a pose 0.05 rad, and below 0.05 m/s."""
        if self._goal is None or self.moving or self.speed > SLOW["m"]:
            return False
        error = self.error
        return bool(np.linalg.norm(error[:3]) < NEAR["m"] and np.linalg.norm(error[3:]) < NEAR["rad"])

    def reach(
        self,
        target: ArrayLike | pin.SE3,
        frame: str = WORLD,
        *,
        duration: float | None = None,
        speed: ArrayLike | None = None,
        acceleration: ArrayLike | None = None,
    ) -> None:
        """Go to a target and stay there, from the next tick on.

        The hand goes as fast as the settings let it; with a duration or a speed on a minimum jerk trajectory, which
        waits, as the reference always does, for a hand that cannot follow.

        Args:
            target: Point, shape (3,), m, or pose of the hand.
            frame: "world", "pelvis" or the name of an object that `Arms.place` knows.
            duration: Time to the target, s.
            speed: Greatest speed, m/s, or a pair (linear, angular), m/s and rad/s.
            acceleration: Greatest acceleration, as `speed`; reaches that speed in 0.2 s when None and no duration is
                given.

        Raises:
            InputError: Not a point or a pose, or one that is not finite; a hand that presses or grips; a duration or
                limit that is not above zero.
        """
        self.check_own()
        goal, point = self._checked(target, frame), not isinstance(target, pin.SE3)
        if self.pressing is not None and self.pressing.active:
            raise InputError(
                f"target of '{self.name}' must wait until the hand neither presses nor grips: "
                f"hands.release('{self.name}') lets go, got {np.round(goal.translation, 3).tolist()}"
            )
        if acceleration is not None and duration is None and speed is None:
            raise InputError(f"acceleration of '{self.name}' needs a duration or a speed beside it")
        reference, velocity = self._reference, self._velocity
        if frame != self._within or not self.active:  # the reference begins where the hand is
            reference, velocity = self._here(frame), np.zeros(6)
        elif self._point and not point:  # as far as its rotation goes: at a point a hand turns as it likes
            reference = pin.SE3(self._here(frame).rotation, reference.translation)
            velocity = velocity * ([1.0] * 3 + [0.0] * 3)
        if point:
            goal.rotation = reference.rotation
        move = None
        if duration is not None or speed is not None:
            limits = {"duration": duration, "speed": speed, "acceleration": acceleration}
            move = Move(PoseCoordinates(reference, pin.SE3), [goal], (velocity, None), **limits)
        self._within, self._goal, self._point = frame, goal, point
        self._reference, self._velocity, self._move = reference, velocity, move
        if self._blend.goal == 0.0:
            self._blend.to(1.0, BLEND)
        if self._task is None:
            self._task = self._controller.add(self._new_task())

    def _checked(self, target: ArrayLike | pin.SE3, frame: str) -> pin.SE3:
        """Return a target as a pose."""
        choose("frame of a hand's target", frame, (WORLD, PELVIS, *self._objects))
        what = f"target of '{self.name}'"
        if isinstance(target, pin.SE3):
            return pose(what, target)
        return pin.SE3(np.eye(3), finite_array(f"{what} (m)", target, (3,)))

    def release(self) -> None:
        """Let the arm go back to its posture."""
        if self._goal is not None:
            self._goal = self._move = None
            self._blend.to(0.0, BLEND)

    # ---- the tick -----------------------------------------------------------------------------------------------

    def update(self) -> None:
        """Move the reference on and hand it to the task; the hand is active."""
        s, dt = self._settings, self._dt
        task = self._task
        assert task is not None
        self._blend.advance(dt)
        weight = np.full(6, s.weight * self._blend.value)
        if self._point:
            weight[3:] = 0.0
        task.weight = weight
        solution = self._controller.solution
        if solution is not None:
            task.spared_acceleration = solution.accelerations[self._spared]
        error, before, reference = task.error, self._velocity.copy(), self._reference
        behind = [float(np.linalg.norm(error[:3])), float(np.linalg.norm(error[3:]))]
        pace = [min(1.0, max(0.0, 2.0 - 2.0 * off / LEAD)) for off in behind]
        if self._move is not None:  # more slowly where the hand stays behind
            slower = pace[0] if self._point else min(pace)
            self._move.advance(slower * dt)
            self._reference, velocity, push = self._move.now()
            self._velocity = slower * velocity
            if self._move.arrived:
                self._move = None
            self._follow(task, slower * slower * push)
            return
        left = self._left(reference)
        for rows, granted, acceleration in (
            (slice(0, 3), s.speed * pace[0], s.acceleration),
            (slice(3, 6), TURN_SPEED * pace[1], TURN_ACCELERATION),
        ):
            self._velocity[rows] = approach(left[rows], before[rows], granted, acceleration, dt)
        reference.translation = reference.translation + dt * self._velocity[:3]
        reference.rotation = pin.exp3(dt * self._velocity[3:]) @ reference.rotation
        self._follow(task, (self._velocity - before) / dt)

    def _left(self, here: pin.SE3) -> Array:
        """Return displacement and rotation from a pose in the target's frame to the target, shape (6,), m and rad.

        They are zero without a target.
        """
        goal = self._goal
        if goal is None:
            return np.zeros(6)
        turn = np.zeros(3) if self._point else pin.log3(goal.rotation @ here.rotation.T)
        return np.concatenate([goal.translation - here.translation, turn])

    def _follow(self, task: PoseTask, acceleration: Array) -> None:
        """Give the task the reference, which moves on in its frame with an acceleration, shape (6,).

        With the velocity v, ω and the acceleration a, α of that frame at the arm r from its origin, a point that moves
        in it with v′ and a′ has

            velocity v + ω × r + v′,   acceleration a + α × r + ω × (ω × r + 2 v′) + a′.
        """
        if self._within == WORLD:
            task.follow(self._reference.copy(), self._velocity, acceleration)
            return
        place, moving, pushed = self._frame_now(self._within)
        there, turn, spin = place * self._reference, place.rotation, pin.skew(moving[3:])
        arm = there.translation - place.translation
        linear, angular = turn.dot(self._velocity[:3]), turn.dot(self._velocity[3:])
        velocity, rate, carried = moving.copy(), pushed.copy(), spin.dot(arm)
        velocity[:3] += carried + linear
        velocity[3:] += angular
        rate[:3] += (
            pin.skew(pushed[3:]).dot(arm) + spin.dot(carried + 2.0 * linear) + turn.dot(acceleration[:3])
        )
        rate[3:] += spin.dot(angular) + turn.dot(acceleration[3:])
        task.follow(there, velocity, rate)

    def _frame_now(self, frame: str) -> tuple[pin.SE3, Array, Array]:
        """Return pose, velocity and acceleration of a frame of targets, shape (6,) in world axes; not to be written.

        The acceleration of the pelvis is that of the last tick, which the task expects of the joints it spares as well.
        """
        if frame == WORLD:
            return pin.SE3.Identity(), REST, REST
        if frame != PELVIS:
            return *self._objects[frame], REST
        robot, solution = self._robot, self._controller.solution
        base = robot.frame_id(robot.base_frame)
        at = robot.model, robot.data, base, pin.LOCAL_WORLD_ALIGNED
        acceleration = pin.getFrameClassicalAcceleration(*at).vector
        if solution is not None:
            acceleration = acceleration + pin.getFrameJacobian(*at) @ solution.accelerations
        return robot.placement(robot.base_frame), pin.getFrameVelocity(*at).vector, acceleration

    def _here(self, frame: str) -> pin.SE3:
        """Return the pose of the hand, as it is commanded, in a frame of targets."""
        return self._frame_now(frame)[0].actInv(self._robot.placement(self.frame))

    def _new_task(self) -> PoseTask:
        task = PoseTask(
            self.frame,
            name=self.name,
            weight=0.0,
            stiffness=STIFFNESS,
            error_bound=np.repeat(ERROR_BOUND, 3),
        )
        task.spared = self._spared
        task.held_by = f"walking.arms['{self.name}'].reach(…)"
        return task


class Arms:
    """Arms of a robot that walks, one for each of its hands.

        walking.arms["left_hand"].reach([0.4, 0.3, 1.0])              # a point in the world
        walking.arms["right_hand"].reach(pose, "pelvis")
        walking.arms.place("box", box_pose)                             # in every tick in which it has moved
        walking.arms["right_hand"].reach([0.0, -0.1, 0.0], "box")

    Attributes:
        settings: Settings.
    """

    _tasks: WalkTasks  # of the CoM and of all joints now

    def __init__(self, controller: Controller, dt: float, settings: ArmSettings) -> None:
        """Leave the arms to the posture; no task is added before a hand is given a target.

        `follow` says which tasks are those of the CoM and of all joints.
        """
        self.settings, self._controller = settings, controller
        robot = controller.robot
        self._objects: dict[str, tuple[pin.SE3, Array]] = {}
        self._hands = {name: Arm(controller, name, dt, settings, self._objects) for name in robot.frames}
        self._rest = np.array(robot.q[robot.base_nq :])
        self._turns = self._swing_turns()
        self._swung = 0.0  # swing in the last tick, m/m
        self._swings = self._rest  # target of the posture by the swing
        self._spared: tuple[str, ...] = ()
        self._held = np.zeros(robot.na)  # weight of the posture while no hand is active

    def share(self, hands: Mapping[str, Hand]) -> None:
        """Give no targets to hands that press or grip; role → hand."""
        for name, hand in hands.items():
            self._hands[name].pressing = hand

    def follow(self, tasks: WalkTasks) -> None:
        """Go on with these tasks of the CoM and of all joints."""
        if self._spared:
            self._spare(())
        self._tasks = tasks

    def __getitem__(self, name: str) -> Arm:
        """Return a hand by its role."""
        return self._hands[choose("hand", name, self._hands)]

    @property
    def hands(self) -> tuple[Arm, ...]:
        """Hands of the robot."""
        return tuple(self._hands.values())

    def place(self, name: str, where: pin.SE3, velocity: ArrayLike | None = None) -> None:
        """State where an object is; call it again whenever it has moved.

        Args:
            name: Name of the object.
            where: Its pose in the world.
            velocity: Velocity of its origin and angular velocity in world axes, shape (6,), m/s and rad/s; at rest when
                None.
        """
        if name in (WORLD, PELVIS):
            raise InputError(f"the name of an object must not be '{name}'")
        moving = np.zeros(6) if velocity is None else finite_array(f"velocity of '{name}'", velocity, (6,))
        self._objects[name] = pose(f"pose of '{name}'", where), moving

    def update(self, feet: Sequence[FootMotion], yaw: float, haste: float = 0.0) -> None:
        """Move all references by one tick.

        Args:
            feet: Motions of left and right sole.
            yaw: Heading, rad.
            haste: Share from 0 to 1 by which the walk is a fast one.
        """
        active = tuple(name for name, hand in self._hands.items() if hand.active)
        for name in active:
            self._hands[name].update()
        if active or self._spared:
            self._spare(active)
        s = self.settings
        swing = s.swing + haste * (max(s.fast_swing, s.swing) - s.swing)
        if swing > 0.0 or self._swung > 0.0:
            self._swung = swing
            self._swing(feet, yaw, swing)

    def _swing_turns(self) -> Array:
        """Return the turn of the one joint of each arm that moves its hand forward most, rad/m, shape (na,)."""
        robot, turns = self._controller.robot, np.zeros(self._controller.robot.na)
        forward = robot.placement(robot.base_frame).rotation[:, 0]
        for name, sign in SIDES.items():
            if name in self._hands and self._hands[name].joints:
                frame, joints = robot.frame_id(self._hands[name].frame), self._hands[name].joints
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

    def _spare(self, active: tuple[str, ...]) -> None:
        """Keep the balance from using the arms of active hands, and the posture from holding them back."""
        com, posture = self._tasks.com, self._tasks.posture
        if active != self._spared:
            if not self._spared:
                self._held = posture.weight.copy()
            self._spared = active
            joints = [*dict.fromkeys(joint for name in active for joint in self._hands[name].joints)]
            weight = self._held.copy()
            weight[joints] *= self._tasks.reaching
            posture.weight = weight
            com.spared = np.array(joints, dtype=np.intp) + BASE_DOF
        solution = self._controller.solution
        if solution is not None and active:
            com.spared_acceleration = solution.accelerations[com.spared]
