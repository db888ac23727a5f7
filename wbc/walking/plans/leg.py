"""Leg of a robot: its lengths, measured in half-sitting, what its joints give, and what a step asks of them."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from wbc.base.errors import InputError
from wbc.base.numbers import Array, finite_scalar
from wbc.core.model import joints_to
from wbc.core.robot import BASE_DOF, GRAVITY, Robot
from wbc.walking.plans.footsteps import Footstep
from wbc.walking.plans.gait import StepGait
from wbc.walking.plans.swing import RISE, SwingFoot

STRETCHED = 0.98
"""Ratio of its length to which a leg may stretch in a step: further, the knee hardly moves the foot."""

STANDING = 0.979
"""Ratio of its length to which a standing leg may stretch: a straight leg can take no step."""

CARRIED = 0.8
"""Share of the knee's torque limit that carries a robot on one leg; the rest is for its steps."""

ROOM = 0.12
"""Distance that an ankle keeps to the end of its range on a standing leg, rad: the foot behind bends it further."""

STRAIGHT = 0.95
"""Ratio of its length from which a leg in half-sitting is too straight for long steps."""

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


class Leg:
    """Left leg of a robot, measured in half-sitting; its two longest bars are thigh and shank.

    Attributes:
        length: Thigh and shank together, m.
        shank: Knee to ankle, m.
        knee: Index of the knee in arrays of joints, shape (na,).
        shortest: Hip to ankle with the knee bent by 120°, m.
        ankle_height: Ankle over the sole, m.
        hip_height: Height of the hip over the ankle, m.
        com_height: Height of the CoM over the sole, m.
        spacing: Lateral distance between the centres of both soles, m.
    """

    def __init__(self, robot: Robot) -> None:
        """Measure a robot; an `InputError` for a sole that does not hang on a leg with a knee."""
        self._robot, model = robot, robot.model
        self._data = data = model.createData()
        pin.centerOfMass(model, data, robot.half_sitting)
        pin.computeJointJacobians(model, data, robot.half_sitting)
        pin.updateFramePlacements(model, data)
        chain = joints_to(model, robot.frame_id(robot.soles[0].frame))
        places = [data.oMi[joint].translation for joint in chain]
        bars = [float(np.linalg.norm(b - a)) for a, b in zip(places, places[1:], strict=False)]
        if len(bars) < 2:
            raise InputError(f"sole '{robot.soles[0].name}' of {robot!r} does not hang on a leg with a knee")
        first, second = sorted(sorted(range(len(bars)), key=lambda i: bars[i])[-2:])
        hip, ankle = places[first], places[second + 1]
        left, right = (data.oMf[robot.frame_id(sole.frame)].translation for sole in robot.soles[:2])
        thigh, self.shank = bars[first], bars[second]
        self.length, bend = thigh + self.shank, math.radians(120.0)
        self.shortest = math.sqrt(thigh**2 + self.shank**2 + 2.0 * thigh * self.shank * math.cos(bend))
        self.knee = model.joints[chain[second]].idx_v - BASE_DOF
        self._above = chain[:second]  # joints from the base to the knee, without it
        self._ankle = max(chain[second + 1 :], key=lambda joint: abs(self._pitch(joint)))
        self.ankle_height, self.hip_height = float(ankle[2]) - float(left[2]), float(hip[2] - ankle[2])
        self.com_height = float(data.com[0][2]) - float(left[2])
        # Height of the hip over the ankle less that of the CoM over the sole, for an upright trunk.
        self._offset = float(hip[2]) - float(data.com[0][2]) - self.ankle_height
        self.spacing = float(np.linalg.norm(left[:2] - right[:2]))

    def _pitch(self, joint: int) -> float:
        """Return the part of the axis of a joint that is to the left."""
        return float(self._data.J[4, self._robot.model.joints[joint].idx_v])

    def hips(self, com_height: float | None) -> float:
        """Return the height of the hips over the ankles, m, for a CoM height over the soles; half-sitting when None."""
        robot = self._robot
        low, high = self.shortest - self._offset, STANDING * self.length - self._offset
        if com_height is None:
            if self.hip_height > STANDING * self.length:
                raise InputError(
                    f"the legs of '{robot.name}' are too straight in half-sitting to take a step; give a CoM height "
                    f"from {low:.3f} to {high:.3f} m"
                )
            return self.hip_height
        what = f"CoM height (m) of '{robot.name}' (half-sitting: {self.com_height:.3f} m)"
        return finite_scalar(what, com_height, low=low, high=high) + self._offset

    def span(self, com_height: float | None) -> float:
        """Return how far an ankle gets from below its hip, m, for a CoM height over the soles; see `hips`."""
        return math.sqrt((STRETCHED * self.length) ** 2 - self.hips(com_height) ** 2)

    def carried_height(self) -> float:
        """Return the least CoM height over the soles, m, at which one leg carries a robot that steps.

        With the hip above the ankle the shank tilts by α, and the knee, whose torque is m g b sin α for a shank of
        length b, may take `CARRIED` of its limit; the ankle must keep `ROOM` to the end of its range. Half-sitting is
        carried.
        """
        robot, shank, thigh = self._robot, self.shank, self.length - self.shank
        knee = CARRIED * float(robot.torque_limit[self.knee]) / (robot.mass * GRAVITY * shank)
        ankle = robot.model.joints[self._ankle].idx_v - BASE_DOF
        bent = float(robot.half_sitting[robot.base_nq + ankle])
        # A foot that turns forward lets the shank stand up.
        end = float((robot.position_lower if self._pitch(self._ankle) > 0.0 else robot.position_upper)[ankle])
        now = (self.hip_height**2 + shank**2 - thigh**2) / (2.0 * self.hip_height * shank)
        tilt = math.acos(min(1.0, now)) + max(0.0, abs(end - bent) - ROOM)
        tilt = min(tilt, math.asin(min(1.0, knee)), math.asin(min(1.0, thigh / shank)))
        hip = shank * math.cos(tilt) + math.sqrt(thigh**2 - (shank * math.sin(tilt)) ** 2)
        return min(hip, self.hip_height) - self._offset

    def bent_height(self, stretch: float) -> float:
        """Return the CoM height over the soles of a driven robot, m: straight legs bend to a ratio of their length."""
        if self.hip_height <= STRAIGHT * self.length:
            return self.com_height
        return self.com_height - max(0.0, self.hip_height - max(stretch * self.length, self.shortest))

    @property
    def _hip(self) -> int:
        """Index of the hip's pitch in velocities."""
        return int(
            self._robot.model.joints[max(self._above, key=lambda joint: abs(self._pitch(joint)))].idx_v
        )

    def hip_acceleration(self) -> float:
        """Return the angular acceleration of the leg by the whole torque of its hip, rad/s²."""
        robot, hip = self._robot, self._hip
        inertia = pin.crba(robot.model, robot.model.createData(), robot.half_sitting)
        return float(robot.torque_limit[hip - BASE_DOF]) / float(inertia[hip, hip])

    def swing(self, com_height: float | None) -> SwingLeg:
        """Return the leg that swings below the hips of a CoM height over the soles, m; see `hips`."""
        hip, knee = (float(self._robot.velocity_limit[joint]) for joint in (self._hip - BASE_DOF, self.knee))
        push = self.length * self.hip_acceleration()
        return SwingLeg(self.length - self.shank, self.shank, self.hips(com_height), hip, knee, push)


def outward_turn(robot: Robot) -> float:
    """Return the smaller of the outward ranges of the hips' yaw, rad; 0 if no leg joint turns about the vertical."""
    ranges = []
    for sole, outward in zip(robot.soles[:2], (1.0, -1.0), strict=True):
        found = vertical_joint(robot, sole.frame, pin.neutral(robot.model))
        if found is None:
            return 0.0
        joint, up = found
        ends = robot.position_upper if up * outward > 0.0 else -robot.position_lower
        ranges.append(float(ends[joint]))
    return min(ranges)


def vertical_joint(robot: Robot, frame: str, configuration: Array) -> tuple[int, float] | None:
    """Return the first joint from the base to a frame that turns about the vertical, and its axis upwards, if any.

    The joint is an index in arrays of shape (na,), the axis is between −1 and 1.
    """
    data = robot.model.createData()
    pin.computeJointJacobians(robot.model, data, configuration)
    for joint in robot.joints_between(frame, robot.base_frame):
        up = float(data.J[5, BASE_DOF + joint])
        if abs(up) > 0.9:
            return joint, up
    return None


@lru_cache(maxsize=256)
def swing_effort(leg: SwingLeg, gait: StepGait, begin: float, end: float, aside: float) -> float:
    """Return what a swing on level ground asks of hip and knee in its time over what they have, for a full step.

    A leg of two bars takes the foot along its swing below a hip that moves on with the mean speed of the step. The foot
    lifts at a place ahead of the one that stands, m, and lands at another, with a way to the side, m. The answer is

        max(hip / HIP, knee / KNEE, acceleration / PUSH),

    with the speeds of the joints and the acceleration of the foot over those that the leg has.
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
