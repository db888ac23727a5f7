"""Fall of a robot by its estimate: the state that nothing recovers from.

A robot that is caught again, by its ankles or by a step, keeps its centre of mass over a foot or near one, whatever its
trunk does. It has fallen once the centre of mass is farther beside every foot than above it: the DCM is then more than
twice as far away as a step reaches. The rule has no length, no mass and no posture in it: squats, bows, stairs and
robots of any size are no falls.
"""

from __future__ import annotations

import enum
import math

import numpy as np

from wbc.core.robot import GRAVITY, Robot

SLOPE = 1.0
"""Horizontal distance of the centre of mass from a foot over its height above that foot from which the robot falls for
good. A DCM at 0.48 was caught by steps; the centre of mass is never farther away than the DCM when a robot falls."""

LASTING = 0.2
"""Time for which that must last, times √(height of the centre of mass / gravity): 0.05 s for a robot of 1.3 m."""

SPEED = 100.0
"""Speed of a joint or of the base beyond that of any robot: simulation or estimate has diverged, rad/s and m/s."""


class FallReason(enum.Enum):
    """Reason of a fall: a control finds the first three by its estimate, and a simulation the other two."""

    DIVERGED = "the simulation diverged"
    SOLVER = "the QP failed"
    DOWN = "the centre of mass is farther beside the feet than above them"
    HEIGHT = "the robot dropped"
    TILT = "the pelvis tilted"


class FallDetector:
    """Fall detector of one robot, by its estimate.

    Attributes:
        reason: Reason of the fall; None before a fall. It stays until `reset`.
    """

    def __init__(self, robot: Robot, dt: float) -> None:
        """Take the soles of a robot; dt is the control period, s."""
        self._robot, self._dt = robot, dt
        self._soles = [robot.placement(sole.frame).translation for sole in robot.soles]  # views
        self._lasting = LASTING * math.sqrt(max(robot.com_height, 0.0) / GRAVITY)
        self.reset()

    def reset(self) -> None:
        """Forget a fall."""
        self.reason: FallReason | None = None
        self._since = 0.0

    def update(self) -> FallReason | None:
        """Look at the present state of the robot; return the reason of a fall, or None."""
        if self.reason is not None:
            return self.reason
        q, v = self._robot.q, self._robot.v
        # NaN fails every comparison. No speed exceeds the norm of all, which is quicker to compute.
        slow = v.dot(v) < SPEED**2 or np.abs(v).max() < SPEED
        if not (slow and math.isfinite(q.dot(q))):
            self.reason = FallReason.DIVERGED
            return self.reason
        x, y, z = self._robot.com.tolist()
        for sole in self._soles:
            a, b, c = sole.tolist()
            if math.hypot(x - a, y - b) < SLOPE * (z - c):
                self._since = 0.0
                return None
        self._since += self._dt
        if self._since > self._lasting:
            self.reason = FallReason.DOWN
        return self.reason
