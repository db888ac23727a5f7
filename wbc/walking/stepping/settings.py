"""Settings of the stepping walk, in units of the robot: the same numbers walk robots of any size.

Lengths are in heights h of the CoM, times in 1/ω with ω² = g/h, forces in weights. `SteppingSettings.in_si` multiplies
them out for one robot.
"""

from __future__ import annotations

import dataclasses
import math
from typing import Annotated, TypeVar

import numpy as np
import pinocchio as pin

from wbc.base.errors import InputError
from wbc.base.settings import NonNegative, Positive, in_units, settings
from wbc.core.robot import GRAVITY, Robot
from wbc.walking.plans.reach import SPANS, Leg

QUICKEST_SWING = 0.455
"""Least time of a step, 1/ω: its swing ends at 0.88 of it (`SteppingConstants.touch`) and has two pieces of 0.2/ω each
(`piece`)."""

LONGEST = 1.1
"""Longest step of a velocity over the longest planned one, which both soles stand flat after."""


@dataclasses.dataclass(frozen=True, slots=True)
class RobotSize:
    """Size of a robot, by which the settings are multiplied."""

    height: float  # height h of the CoM over the soles while it steps, m
    leg: float  # length of a straight leg from the hip to the ankle, m
    mass: float  # mass, kg
    sole: tuple[float, float]  # half length and half width of a sole, m
    ankle: float  # place of the ankle ahead of the centre of the sole, m
    stride: float  # longest step that the legs reach, m
    swing: float  # acceleration of a foot by the whole torque of its hip, m/s²

    @property
    def omega(self) -> float:
        """Natural frequency ω of the pendulum, 1/s."""
        return math.sqrt(GRAVITY / self.height)

    @property
    def weight(self) -> float:
        """Weight m g, N."""
        return self.mass * GRAVITY

    @staticmethod
    def of(robot: Robot, bend: float, height: float | None = None) -> RobotSize:
        """Measure a robot with its CoM at a height (m), else `bend` leg lengths down, as far as knees carry it."""
        if len(robot.soles) != 2:
            raise InputError(f"a stepping walk needs two feet, got a robot with {len(robot.soles)} soles")
        model, data = robot.model, robot.model.createData()
        legs = [robot.joints_between(sole.frame, robot.base_frame) for sole in robot.soles]
        straight = np.array(robot.half_sitting)
        straight[[7 + joint for leg in legs for joint in leg]] = 0.0
        pin.framesForwardKinematics(model, data, straight)
        sole = data.oMf[robot.frame_id(robot.soles[0].frame)]
        com = float(pin.centerOfMass(model, data, straight)[2] - sole.translation[2])
        joints = [data.oMi[robot.joint_numbers[joint]].translation for joint in legs[0]]
        heights = [float(at[2]) for at in joints]
        leg_length = max(heights) - min(heights)
        ankle = float(sole.actInv(data.oMi[robot.joint_numbers[legs[0][-1]]]).translation[0])
        leg = Leg(robot)
        height = max(com - bend * leg_length, leg.carried_height()) if height is None else height
        return RobotSize(
            height=height,
            leg=leg_length,
            mass=robot.mass,
            sole=(0.5 * robot.soles[0].length, 0.5 * robot.soles[0].width),
            ankle=ankle,
            stride=LONGEST * (SPANS * leg.span(height)),
            swing=leg_length * leg.hip_acceleration(),
        )


T = TypeVar("T")


@settings
class SteppingSettings:
    """Settings of free steps, in units of the robot; the constants of the law are in `wbc.walking.stepping.law`.

    h is the height of the CoM, ω its natural frequency √(g / h), and g the gravity, 9.81 m/s².

    Attributes:
        bend: Distance by which the CoM is lower than on straight legs, leg lengths.
        step_time: Time T of a step at low speed on feet that are supported at one point, 1/ω.
        slow_time: Time T of a step at low speed on soles that are supported across their width, 1/ω.
        shortest: Shortest time of a step, 1/ω.
        longest: Longest time of a step, and longest wait after an early contact, as a multiple of T.
        width: Distance w between the feet without disturbances, h; larger if the width of the soles requires it.
        gap: Smallest distance between the inner edges of the soles, h.
        widest: Largest distance between the feet, h.
        reach: Largest length of a step, forward or back, h.
        swing_height: Height of the swing above the lift-off or the landing, whichever is higher, h.
        friction: Coulomb coefficient of the ground.
        acceleration: Largest rate of the walking velocity, g.
        effort: Share of the torque of a hip that swings the leg in a fast walk.
        fastest_back: Largest velocity back, hω.
        fastest_aside: Largest velocity to the side, hω; smaller if the feet are close together.
        fastest_turn: Largest turn rate, ω.
        cruise: Velocity to a goal, hω.
    """

    bend: Annotated[NonNegative, "leg"] = 0.162
    step_time: Annotated[Positive, "1/ω"] = 1.65
    slow_time: Annotated[Positive, "1/ω"] = 2.9
    shortest: Annotated[Positive, "1/ω"] = 0.81
    longest: Positive = 1.22
    width: Annotated[Positive, "h"] = 0.367
    gap: Annotated[NonNegative, "h"] = 0.10
    widest: Annotated[Positive, "h"] = 1.25
    reach: Annotated[Positive, "h"] = 1.0
    swing_height: Annotated[Positive, "h"] = 0.183
    friction: Positive = 0.7
    acceleration: Annotated[Positive, "g"] = 0.08
    effort: Positive = 0.6
    fastest_back: Annotated[Positive, "hω"] = 0.16
    fastest_aside: Annotated[Positive, "hω"] = 0.165
    fastest_turn: Annotated[Positive, "ω"] = 0.25
    cruise: Annotated[Positive, "hω"] = 0.12

    def in_si(self, scale: RobotSize) -> SteppingSettings:
        """Return the settings for one robot in SI units; raise an `InputError` if such steps cannot be walked."""
        si = in_si(self, scale)
        inside = 2.0 * scale.sole[1] + si.gap  # distance of the feet whose soles are a gap apart
        si = dataclasses.replace(si, width=max(si.width, 1.25 * inside), gap=inside)
        self._check(si, scale)
        return si

    def _check(self, si: SteppingSettings, scale: RobotSize) -> None:
        """Refuse steps that cannot be walked, by the settings in SI units."""
        if not si.shortest <= si.step_time <= si.slow_time:
            raise InputError(
                f"shortest ≤ step_time ≤ slow_time must hold, got {self.shortest:g}, {self.step_time:g} and "
                f"{self.slow_time:g} in 1/ω ({si.shortest:.3f}, {si.step_time:.3f} and {si.slow_time:.3f} s)"
            )
        if si.longest < 1.0:
            raise InputError(f"longest is a ratio of the time of a step, of 1 at least, got {si.longest:g}")
        least = max(2.0 * self.swing_height, QUICKEST_SWING)
        if self.shortest < least:
            raise InputError(
                f"a step must last as long as a swing of its height, {least:.3g}/ω ({least / scale.omega:.3f} s) for "
                f"swing_height {self.swing_height:g} h; got shortest {self.shortest:g}/ω ({si.shortest:.3f} s)"
            )
        if si.widest <= si.width:
            raise InputError(
                f"feet must stand further apart than the soles are wide ({si.gap:.3f} m with the gap) and nearer than "
                f"widest; got width {si.width:.3f} m and widest {si.widest:.3f} m"
            )


def in_si(values: T, scale: RobotSize) -> T:
    """Return a dataclass of numbers in units of a robot, which its annotations name, in metres, seconds and newtons."""
    h, omega, (half_length, half_width) = scale.height, scale.omega, scale.sole
    units: dict[str, float | tuple[float, ...]] = {
        **{"1/ω": 1.0 / omega, "ω": omega, "ω²": omega**2, "h": h, "1/h": 1.0 / h, "hω": h * omega},
        **{"g": GRAVITY, "mg": scale.weight, "leg": scale.leg, "ankle": scale.ankle},
        "sole": (2.0 * half_length, 2.0 * half_width),
    }
    return in_units(values, units)
