"""Course of the centre of mass in free steps: in a shift of weight, in a step, and the limit on its rise."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from wbc.base.numbers import Array
from wbc.base.vectors import Point, Vector
from wbc.core.limits.base import Limit
from wbc.core.robot import GRAVITY, Robot
from wbc.core.trajectories import Follower
from wbc.tasks.stabilizer.pendulum import Pendulum
from wbc.walking.plans.swing import REST
from wbc.walking.stepping.felt import BodyState
from wbc.walking.stepping.settings import RobotSize

CoMMotion = tuple[float, float, float, float, float, float]
"""Place, m, velocity, m/s, and acceleration, m/s², over the ground."""


class PhaseReference(NamedTuple):
    """References of one tick of a stand, of a shift of weight or of a step."""

    motion: CoMMotion  # planned motion of the centre of mass
    feet_height: float  # height of the feet over which it is held, m
    most_force: tuple[float, float]  # greatest normal force of each foot of a robot that holds no load, N
    cop: Point = (0.0, 0.0)  # shift of the centre of pressure of the foot that stands; see `Reference`
    urgency: float = 0.0  # of the swing foot; see `Reference`


class HeightCourse:
    """Height of the centre of mass over the feet, from that of the first tick to that of the steps."""

    def __init__(self, scale: RobotSize, dt: float) -> None:
        """Begin at the height that the robot has in the first tick."""
        self._height, self._omega, self._square, self._dt = scale.height, scale.omega, scale.omega**2, dt
        self._high: Follower[float] | None = None  # height over the feet, m

    def rise(self, now: float) -> Point:
        """Return the height over the feet and its rate: from that now, m, it moves to that of the steps."""
        if self._high is None:
            self._high = Follower(1.0 / self._omega, now)
        self._high.follow(self._height - self._high.value, self._dt)
        return self._high.value, self._high.velocity

    def pendulum(self, motion: CoMMotion, height: Point, ground: float) -> Pendulum:
        """Return the pendulum of a motion, with the height of the CoM and its rate, over a ground at a height, m."""
        x, y, u, v, a, b = motion
        arm = 1.0 / self._square
        # One array and its parts: making an array costs more than a slice.
        parts = np.array((x, y, height[0], u, v, height[1], a, b, 0.0, x - arm * a, y - arm * b, ground))
        return Pendulum(parts[:3], parts[3:6], parts[6:9], parts[9:], REST[:3], self._omega)


class FallCourse:
    """Motion of the centre of mass over the foot that stands, as planned since the step was decided last."""

    def __init__(self, scale: RobotSize, dt: float) -> None:
        """Begin from what is measured."""
        self._square, self._dt = scale.omega**2, dt
        self._planned: CoMMotion | None = None  # None in the tick in which the step is decided

    def restart(self) -> None:
        """Begin the next planned motion from what is measured: the step has been decided."""
        self._planned = None

    def fall(self, state: BodyState, zmp: Vector) -> CoMMotion:
        """Return the motion as planned: from the state in which the step was decided that of the pendulum."""
        square, dt, (zx, zy, _) = self._square, self._dt, zmp
        if self._planned is None:
            (x, y, _), (u, v, _) = state.com, state.velocity
        else:
            x, y, u, v, a, b = self._planned
            x, y, u, v = x + dt * (u + 0.5 * dt * a), y + dt * (v + 0.5 * dt * b), u + dt * a, v + dt * b
        self._planned = x, y, u, v, square * (x - zx), square * (y - zy)
        return self._planned


def shifted(start: Point, goal: Point, elapsed: float, duration: float) -> CoMMotion:
    """Return the motion of a weight that shifts from rest to rest; its acceleration is left to the feedback."""
    share = min(1.0, elapsed / duration)
    rise, rate = share * share * (3.0 - 2.0 * share), 6.0 * (share - share * share) / duration
    u, v = goal[0] - start[0], goal[1] - start[1]
    return start[0] + rise * u, start[1] + rise * v, rate * u, rate * v, 0.0, 0.0


RISE_SHARE, RISE_TIME, RECOVERY = 0.5, 0.02, 0.1
"""Share α of gravity by which the rise is slowed down; time t in which the speed is brought within the bound, s; time
constant of the way back from beyond the ceiling, s."""


class RiseLimit(Limit):
    """Limit on the rise of the centre of mass: no foot that stands presses so hard that the robot leaves the ground.

    A robot whose hips have no torque left can lift its swing foot by stretching the leg that stands, and a robot that
    a push has lifted goes on upwards. Feet cannot pull: gravity g slows the centre of mass down from its speed upwards
    ż, by a share α of it at most, so that the room d up to a ceiling bounds the speed,

        ż⁺ ≤ √(2 α g d),        z̈ ≤ (ż⁺ − ż) / t,        z̈ ≥ −α g.

    Below the ceiling the limit leaves everything else as it is; beyond it, 1 − α of the weight stays on the feet.

    Attributes:
        height: Height about which the centre of mass is held, in the world, m; set in every tick.
        slack: Distance of the ceiling above it, m.
    """

    def __init__(self, slack: float) -> None:
        """Leave a slack, m."""
        self.name, self.dim = "rise of the CoM", 1
        self.slack, self.height = slack, math.inf

    def bind(self, robot: Robot) -> None:
        """Take views of the robot."""
        self._robot, self._base_rotation = robot, robot.data.oMi[1].rotation

    def write(self, dt: float, rows: Array, lower: Array, upper: Array) -> None:
        """Fill the row; see `Limit.write`."""
        robot = self._robot
        lower[0] = -np.inf
        if not math.isfinite(self.height):
            rows[0], upper[0] = 0.0, np.inf
            return
        room, speed = self.height + self.slack - robot.com.item(2), robot.com_velocity.item(2)
        most = math.sqrt(2.0 * RISE_SHARE * GRAVITY * room) if room > 0.0 else room / RECOVERY
        bound = max((most - speed) / RISE_TIME, -RISE_SHARE * GRAVITY)
        # Acceleration of the CoM at zero generalised acceleration: the force on the base rows of the bias, less weight.
        drift = float(self._base_rotation[2].dot(robot.bias[:3])) / robot.mass - GRAVITY
        rows[0] = robot.com_jacobian[2]
        upper[0] = bound - drift
