"""Held load: its mass and place from the outside wrench, taken over by the models of the robot.

A load that moves with the robot is inertia, no outside force: with the load as a point mass on the hands, the robot's
mass, centre of mass, momentum and gravity torques follow, and the pendulum is that of robot and load,

    M = m + m_L,   C = (m c + m_L p) / M.

The outside wrench r (`wbc.core.estimation.outside`) shows what the model lacks. Of a load at rest,

    m_L = −r_Fz / g,   m_L (p − h) = (r_My, −r_Mx) / g   horizontally,

with the moments about the middle h of the hands; its height is that of the hands. Model and wrench move together: what
is put into the model is taken off the wrench, so that both sum up to the load at any time.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated

import numpy as np
from pydantic import Field

from wbc.core.errors import Array, InputError, choose
from wbc.core.estimation.outside import OutsideWrench, moment_about
from wbc.core.lag import lag_gain
from wbc.core.robot import GRAVITY, Robot
from wbc.core.settings import NonNegative, Positive, Share, settings

SETTLING = 0.5
"""Time after a change of the load until the robot has settled with it, s."""


@settings
class LoadSettings:
    """Settings of the estimate of a held load.

    Attributes:
        hands: Roles or frames of the robot that hold loads, in equal parts; all of its hands when empty.
        lag: Time constant with which mass and place follow the outside wrench, s.
        rest_lag: Time constant once the load has settled, s: sensors are noisy, and the robot sways.
        largest: Greatest mass of the load over the robot's.
        reach: Greatest horizontal distance of the load from the middle of the hands, m.
        dead_band: Mass over the robot's below which it counts as an error of sensors and model, not as a load.
        step: Change of the estimate, over the robot's mass, above which the models are changed.
    """

    hands: tuple[str, ...] = ()
    lag: Annotated[NonNegative, "s"] = 0.1
    rest_lag: Annotated[NonNegative, "s"] = 0.5
    largest: Annotated[float, Field(gt=0.0, le=1.0)] = 0.4
    reach: Annotated[Positive, "m"] = 0.3
    dead_band: Share = 0.01
    step: Annotated[Positive, ""] = 0.0005


class HeldLoad:
    """Estimate of the load in the hands of one robot.

    Attributes:
        settings: Settings.
        frames: Names of the frames that hold the load.
        mass: Mass of the load as estimated, kg.
        applied: Mass of the load in the models, kg.
        offset: Horizontal place of the load from the middle of the hands, in the heading of the robot, shape (2,), m.
    """

    def __init__(self, robot: Robot, settings: LoadSettings | None = None) -> None:
        """Start with empty hands; all clones of the estimated robot carry the load, too.

        Raises `InputError` for a robot without hands, or a frame that does not move.
        """
        self.settings = s = settings or LoadSettings()
        self.frames = hand_frames(robot, s.hands)
        self._robot = robot
        self._hands = [robot.frame_id(frame) for frame in self.frames]
        for hand in self._hands:  # what a control before this one has left in the model
            robot.carry(hand, 0.0)
        self._own = robot.mass
        self._places = [robot.placement(hand) for hand in self._hands]
        self.mass = self.applied = 0.0
        # First moments about the middle of the hands, in the heading, kg m: as estimated, and in the models.
        self._moment: tuple[float, ...] = (0.0, 0.0)
        self._applied_moment: tuple[float, ...] = (0.0, 0.0)
        self._quiet = SETTLING  # time for which the estimate has not changed, s
        self.offset = np.zeros(2)

    @property
    def changing(self) -> bool:
        """True from the first sign of a load that comes or goes until the robot has settled with it."""
        return self._quiet < SETTLING

    @property
    def middle(self) -> Array:
        """Middle of the hands in the world, shape (3,), m."""
        return np.asarray(np.mean([place.translation for place in self._places], axis=0))

    @property
    def place(self) -> Array:
        """Place of the load in the world, at the height of the hands, shape (3,), m."""
        c, s = self._heading()
        x, y = self.offset.tolist()
        return self.middle + (c * x - s * y, s * x + c * y, 0.0)

    def update(self, outside: OutsideWrench, dt: float) -> None:
        """Update the estimate from the outside wrench, and move its changes from the wrench into the models."""
        s, robot = self.settings, self._robot
        if not outside.ready:
            return
        points = [place.translation.tolist() for place in self._places]
        middle = [sum(point[axis] for point in points) / len(points) for axis in range(3)]
        wrench, com = outside.wrench, robot.com.tolist()
        mx, my, _ = moment_about(wrench, com, middle)
        c, n = self._heading()
        gain = lag_gain(dt, s.lag if self.changing else max(s.lag, s.rest_lag))
        mass = self.applied - float(wrench[2]) / GRAVITY
        x = self._applied_moment[0] + (c * my - n * mx) / GRAVITY
        y = self._applied_moment[1] + (-n * my - c * mx) / GRAVITY
        self._quiet += dt
        if abs(mass - self.mass) > s.dead_band * self._own:
            self._quiet = 0.0
        self.mass = mass = min(max(self.mass + gain * (mass - self.mass), 0.0), s.largest * self._own)
        if mass <= s.dead_band * self._own:
            mass = 0.0
        reach = mass * s.reach
        before_x, before_y = self._moment
        self._moment = x, y = tuple(
            min(max(old + gain * (new - old), -reach), reach) for old, new in ((before_x, x), (before_y, y))
        )
        off = abs(mass - self.applied) + math.hypot(x - self._applied_moment[0], y - self._applied_moment[1])
        least = s.step * self._own
        if off >= (least if mass > 0.0 else 1e-9):
            self._apply(outside, mass, (x, y), middle, c, n)

    def release(self) -> None:
        """Take the load off the models at once."""
        for hand in self._hands:
            self._robot.carry(hand, 0.0)
        self.mass = self.applied = 0.0
        self._moment = self._applied_moment = (0.0, 0.0)
        self._quiet = 0.0
        self.offset = np.zeros(2)

    def _apply(
        self,
        outside: OutsideWrench,
        mass: float,
        moment: tuple[float, ...],
        middle: Sequence[float],
        c: float,
        n: float,
    ) -> None:
        """Put a load into the models, and take it off the outside wrench."""
        robot = self._robot
        offset = (moment[0] / mass, moment[1] / mass) if mass > 0.0 else (0.0, 0.0)
        arm = np.array((c * offset[0] - n * offset[1], n * offset[0] + c * offset[1], 0.0))
        for hand, place in zip(self._hands, self._places, strict=True):
            robot.carry(hand, mass / len(self._hands), place.rotation.T.dot(arm))
        # The weight that the models gain, about the CoM.
        gained = mass - self.applied
        dx, dy = (new - old for new, old in zip(moment, self._applied_moment, strict=True))
        x, y, _ = robot.com.tolist()
        first_x = c * dx - n * dy + gained * (middle[0] - x)
        first_y = n * dx + c * dy + gained * (middle[1] - y)
        outside.explain((0.0, 0.0, -gained * GRAVITY, -first_y * GRAVITY, first_x * GRAVITY, 0.0))
        self.applied, self._applied_moment = mass, moment
        self.offset = np.array(offset)

    def _heading(self) -> tuple[float, float]:
        """Cosine and sine of the heading of the base."""
        rotation = self._robot.data.oMi[1].rotation
        c, n = float(rotation[0, 0]), float(rotation[1, 0])
        size = math.hypot(c, n) or 1.0
        return c / size, n / size


def hand_frames(robot: Robot, hands: Sequence[str] = ()) -> tuple[str, ...]:
    """Return the frames of hands by their roles, all hands when empty; a frame's own name stands for itself.

    Raises `UnknownNameError` for what is neither, `InputError` for a robot without hands, or a frame that does not
    move.
    """
    roles = {**robot.frames, "torso": robot.torso_frame, "base": robot.base_frame}
    if not hands and not robot.frames:
        raise InputError(f"robot '{robot.name}' has no hands to hold a load with")
    frames = []
    for hand in hands or tuple(robot.frames):
        if hand not in roles and not robot.model.existFrame(hand):
            choose("hand", hand, (*roles, *(str(each.name) for each in robot.model.frames)))
        frame = roles.get(hand, hand)
        if robot.model.frames[robot.frame_id(frame)].parentJoint == 0:
            raise InputError(f"a load must be on a frame that moves with the robot, '{frame}' does not move")
        frames.append(frame)
    return tuple(frames)
