"""Held load: its mass and place from the outside wrench, taken over by the models of the robot.

A load that moves with the robot is inertia, no outside force: with the load as a point mass on the hands, the robot's
mass, centre of mass, momentum and gravity torques follow, and the pendulum is that of robot and load,

    M = m + m_L,   C = (m c + m_L p) / M.

The outside wrench r (`wbc.core.estimation.wrenches`) shows what the model lacks. Of a load at rest,

    m_L = −r_Fz / g,   m_L (p − h) = (r_My, −r_Mx) / g   horizontally,

with the moments about the middle h of the hands; its height is that of the hands. Model and wrench move together: what
is put into the model is taken off the wrench, so that both sum up to the load at any time.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

import numpy as np
from pydantic import Field

from wbc.base.checked import checked
from wbc.base.errors import InputError
from wbc.base.numbers import Array, lag_gain
from wbc.base.settings import Positive, settings
from wbc.core.estimation.outside import OutsideWrench, moment_about
from wbc.core.frames import direction
from wbc.core.robot import GRAVITY, Robot

SETTLING = 0.5
"""Time after a change of the load until the robot has settled with it, s."""

LAG, REST_LAG = 0.1, 0.5
"""Time constant with which mass and place follow the outside wrench, and that once the load has settled, s: sensors are
noisy, and the robot sways."""

DEAD_BAND, STEP = 0.01, 0.0005
"""Mass over the robot's below which it counts as an error of sensors and model, not as a load; change of the estimate,
over the robot's mass, above which the models are changed."""


@settings
class LoadSettings:
    """Settings of the estimate of a held load.

    Attributes:
        hands: Roles or frames of the hands that hold the load in equal parts; all hands when empty.
        largest: Largest mass of the load, as a share of the robot's mass.
        offset: Largest horizontal distance of the load from the middle of the hands, m.
    """

    hands: tuple[str, ...] = ()
    largest: Annotated[float, Field(gt=0.0, le=1.0)] = 0.4
    offset: Annotated[Positive, "m"] = 0.3


class HeldLoad:
    """Estimate of the load in the hands of one robot.

    Horizontal vectors in the heading of the robot are complex numbers: forward + i left.

    Attributes:
        frames: Names of the frames that hold the load.
        mass: Mass of the load as estimated, kg.
        applied: Mass of the load in the models, kg.
    """

    @checked
    def __init__(self, robot: Robot, outside: OutsideWrench, settings: LoadSettings | None = None) -> None:
        """Start with empty hands, which `outside` observes; an `InputError` for a robot without, or a fixed frame."""
        self.settings = s = settings or LoadSettings()
        if not (s.hands or robot.frames):
            raise InputError(f"robot '{robot.name}' has no hands to hold a load with")
        roles = {**robot.frames, "torso": robot.torso_frame, "base": robot.base_frame}
        self.frames = tuple(roles.get(hand, hand) for hand in s.hands or robot.frames)
        if len({*self.frames}) < len(self.frames):
            raise InputError(f"hands of a load must be different frames, got {', '.join(self.frames)}")
        self._robot, self._hands = robot, [robot.frame_id(frame) for frame in self.frames]
        self._outside, self._places = outside, [robot.placement(hand) for hand in self._hands]
        self.mass = self.applied = 0.0
        # First moment about the middle, as estimated and in the models, kg m.
        self._moment = self._applied_moment = 0j
        self.release()  # what a control before this one has left in the model
        self._own = robot.mass
        self._quiet = SETTLING  # time for which the estimate has not changed, s

    @property
    def changing(self) -> bool:
        """True from the first sign of a load that comes or goes until the robot has settled with it."""
        return self._quiet < SETTLING

    @property
    def middle(self) -> Array:
        """Middle of the hands in the world, shape (3,), m."""
        return np.asarray(sum(place.translation for place in self._places) / len(self._places))

    @property
    def place(self) -> Array:
        """Place of the load in the world, at the height of the hands, shape (3,), m."""
        offset = direction(self._robot.data.oMi[1].rotation) * self._offset
        return self.middle + (offset.real, offset.imag, 0.0)

    @property
    def _offset(self) -> complex:
        return self._applied_moment / self.applied if self.applied > 0.0 else 0j

    def update(self, dt: float) -> None:
        """Update the estimate from the outside wrench, and move its changes from the wrench into the models."""
        s, robot, outside = self.settings, self._robot, self._outside
        if not outside.ready:
            return
        middle = self.middle.tolist()
        wrench, heading = outside.wrench, direction(self._robot.data.oMi[1].rotation)
        mx, my, _ = moment_about(wrench, robot.com.tolist(), middle)
        gain = lag_gain(dt, LAG if self.changing else REST_LAG)
        mass = self.applied - float(wrench[2]) / GRAVITY
        self._quiet += dt
        if abs(mass - self.mass) > DEAD_BAND * self._own:
            self._quiet = 0.0
        self.mass = mass = min(max(self.mass + gain * (mass - self.mass), 0.0), s.largest * self._own)
        if mass <= DEAD_BAND * self._own:
            mass = 0.0
        moment = self._applied_moment + complex(my, -mx) * heading.conjugate() / GRAVITY
        most = mass * s.offset
        moment = self._moment + gain * (moment - self._moment)
        self._moment = complex(*(min(max(part, -most), most) for part in (moment.real, moment.imag)))
        if abs(mass - self.applied) + abs(self._moment - self._applied_moment) >= (
            STEP * self._own if mass > 0.0 else 1e-9
        ):
            self._apply(mass, middle, heading)

    def release(self) -> None:
        """Take the load off the models at once: the hands are empty, and the outside wrench stays as it is."""
        for hand in self._hands:
            self._robot.carry(hand, 0.0)
        self._outside.explain((0.0,) * 6)
        self.mass = self.applied = self._quiet = 0.0
        self._moment = self._applied_moment = 0j

    def _apply(self, mass: float, middle: Sequence[float], heading: complex) -> None:
        """Put the load into the models, and then take what they gain, about the CoM, off the outside wrench."""
        robot, gained = self._robot, mass - self.applied
        moved = heading * (self._moment - self._applied_moment)
        self.applied, self._applied_moment = mass, self._moment
        arm = heading * self._offset
        for hand, place in zip(self._hands, self._places, strict=True):
            lever = place.rotation.T.dot(np.array((arm.real, arm.imag, 0.0)))
            robot.carry(hand, mass / len(self._hands), lever)
        x, y, _ = robot.com.tolist()
        first_x, first_y = moved.real + gained * (middle[0] - x), moved.imag + gained * (middle[1] - y)
        self._outside.explain((0.0, 0.0, -gained * GRAVITY, -first_y * GRAVITY, first_x * GRAVITY, 0.0))
