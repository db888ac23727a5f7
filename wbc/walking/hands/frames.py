"""Frames in which hands have their targets: the world, the pelvis, the middle of the feet, and objects that move."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from wbc.base.numbers import ROUNDING, Array, lag_gain
from wbc.core.frames import heading, pose_of, yaw_rotation
from wbc.core.qp.controller import Controller
from wbc.core.robot import SIDES
from wbc.core.trajectories import Follower
from wbc.walking.plans.footsteps import Footstep
from wbc.walking.plans.swing import REST, FootMotion

WORLD, PELVIS, FEET = "world", "pelvis", "feet"
"""Frames that are always there. That of the feet is in the middle of both planned feet, as high as the lower one,
smoothed: it does not sway as the pelvis does, nor rise with a foot that swings."""

FOLLOW = 0.25
"""Time constant T of the three low-passes with which the frame of the feet follows the middle of them, s,

    (1 + 3 T s) / (1 + T s)³ :

at a constant speed it stays behind by nothing, and by 3 T² a where they accelerate by a; two low-passes alone would
leave hands that push a cart 0.16 m behind a robot that walks at 0.33 m/s. Two of the low-passes follow a goal that is
2 T of the way ahead of the feet, and at most as far as the footsteps still lead. Without this bound the frame would run
on by 0.84 T of their speed where they stop, and come back: hands that have pulled a cart would then push it."""

FrameMotion = tuple[pin.SE3, Array, Array]
"""Pose, velocity and acceleration in world axes, shape (6,), m/s, rad/s, m/s², rad/s²."""


class TargetFrames:
    """Frames of one robot and of the objects about it.

    Attributes:
        objects: Name → pose of an object; `Arms.place` says where it is.
    """

    def __init__(self, controller: Controller) -> None:
        self._controller, self._robot = controller, controller.robot
        self._base = self._robot.frame_id(self._robot.base_frame)
        self._pelvis = self._robot.placement(self._base)
        self.objects: dict[str, pin.SE3] = {}
        # Point and heading, and the low-passed middle of the feet, while they are used.
        self._feet: tuple[Follower[Array], Follower[float]] | None = None
        self._lagging = np.zeros(3)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all frames."""
        return (WORLD, PELVIS, FEET, *self.objects)

    def begin(self, name: str) -> None:
        """Let the frame of this name begin to follow what it belongs to, if it does not yet."""
        if name == FEET and self._feet is None:
            at, _, _ = self.now(FEET)
            self._feet = Follower(FOLLOW, at.translation), Follower(FOLLOW, heading(at.rotation))
            self._lagging = at.translation.copy()

    def follow(
        self,
        used: bool,
        feet: Sequence[FootMotion],
        yaw: float,
        dt: float,
        upcoming: Sequence[Footstep] | None = None,
    ) -> None:
        """Let the frame of the feet follow their planned motions and the heading, rad, as long as it is used.

        The feet stop after the footsteps that are upcoming; None where they go on.
        """
        if not used:
            self._feet = None
        elif self._feet is not None:
            point, turn = self._feet
            middle = _between(*(motion.placement.translation for motion in feet))
            self._lagging += lag_gain(dt, FOLLOW) * (middle - self._lagging)
            ahead = 2.0 * (middle - self._lagging)
            if upcoming is not None:
                far = float(np.linalg.norm(ahead))
                ahead *= _way(feet, upcoming, far) / max(far, ROUNDING)
            point.follow(middle + ahead - point.value, dt)
            turn.follow(math.remainder(yaw - turn.value, math.tau), dt)

    def now(self, name: str) -> FrameMotion:
        """Return the motion of a frame in the world; its arrays must not be written to.

        The acceleration of the pelvis is that of the last tick, which tasks expect of the joints they spare as well.
        """
        robot, solution = self._robot, self._controller.solution
        if name == WORLD:
            return pin.SE3.Identity(), REST, REST
        if name == PELVIS:
            at = robot.model, robot.data, self._base, pin.LOCAL_WORLD_ALIGNED
            acceleration = pin.getFrameClassicalAcceleration(*at).vector
            if solution is not None:
                acceleration = acceleration + pin.getFrameJacobian(*at) @ solution.accelerations
            return self._pelvis, pin.getFrameVelocity(*at).vector, acceleration
        if name != FEET:
            return self.objects[name], REST, REST
        if self._feet is None:
            middle = _between(*(robot.placement(sole.frame).translation for sole in robot.soles))
            return pose_of(yaw_rotation(heading(self._pelvis.rotation)), middle), REST, REST
        point, turn = self._feet
        return (
            pose_of(yaw_rotation(turn.value), point.value),
            np.array((*point.velocity, 0.0, 0.0, turn.velocity)),
            np.array((*point.acceleration, 0.0, 0.0, turn.acceleration)),
        )


def _between(left: Array, right: Array) -> Array:
    """Return the middle between two feet, as high as the lower one, shape (3,), m."""
    middle: Array = 0.5 * (left + right)
    middle[2] = min(left[2], right[2])
    return middle


def _way(feet: Sequence[FootMotion], steps: Sequence[Footstep], most: float) -> float:
    """Return the way that the middle of the feet still goes in these steps, at most a length, m."""
    way, at = 0.0, {side: foot.placement.translation for side, foot in zip(SIDES, feet, strict=True)}
    for step in steps:
        if way >= most:
            break
        way += 0.5 * float(np.linalg.norm(step.placement.translation - at[step.side]))
        at[step.side] = step.placement.translation
    return min(way, most)


def carried(frame: FrameMotion, place: pin.SE3, velocity: Array, acceleration: Array) -> FrameMotion:
    """Return the motion in the world of what moves in a frame that moves.

    With the velocity v, ω and the acceleration a, α of the frame at the arm r from its origin, a point that moves in it
    with v′ and a′ has

        velocity v + ω × r + v′,   acceleration a + α × r + ω × (ω × r + 2 v′) + a′.
    """
    at, moving, pushed = frame
    there, turn, spin = at * place, at.rotation, pin.skew(moving[3:])
    arm = there.translation - at.translation
    linear, angular = turn.dot(velocity[:3]), turn.dot(velocity[3:])
    speed, rate, swept = moving.copy(), pushed.copy(), spin.dot(arm)
    speed[:3] += swept + linear
    speed[3:] += angular
    rate[:3] += pin.skew(pushed[3:]).dot(arm) + spin.dot(swept + 2.0 * linear) + turn.dot(acceleration[:3])
    rate[3:] += spin.dot(angular) + turn.dot(acceleration[3:])
    return there, speed, rate
