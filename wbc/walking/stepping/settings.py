"""Settings and constants of the stepping walk, in units of the robot: the same numbers walk robots of any size.

Lengths are in heights h of the CoM, times in 1/ω with ω² = g/h, forces in weights. `SteppingSettings.in_si` multiplies
them out for one robot.
"""

from __future__ import annotations

import dataclasses
import math
from typing import Annotated, NamedTuple, TypeVar

import numpy as np
import pinocchio as pin

from wbc.base.errors import InputError
from wbc.base.settings import NonNegative, Number, Positive, Ratio, Share, in_units, settings
from wbc.base.settings import units as units_of
from wbc.core.robot import GRAVITY, Robot
from wbc.walking.plans.gait import SwingShape
from wbc.walking.plans.leg import Leg
from wbc.walking.plans.reach import SPANS

Pair = tuple[NonNegative, NonNegative]
Length = Annotated[NonNegative, "h"]
Lengths = Annotated[Pair, "h"]
Time = Annotated[NonNegative, "1/ω"]
Speed = Annotated[NonNegative, "hω"]
Rate = Annotated[NonNegative, "ω"]
Force = Annotated[NonNegative, "mg"]
Angle = Annotated[NonNegative, "rad"]
Box = Annotated[tuple[Positive, Positive], "sole"]
Gains = tuple[Annotated[NonNegative, "ω²"], Annotated[NonNegative, "ω"]]

LARGEST = {
    **{
        "1/ω": 50.0,
        "ω": 50.0,
        "h": 10.0,
        "hω": 10.0,
        "g": 50.0,
        "mg": 10.0,
        "leg": 1.0,
        "ankle": 10.0,
        "sole": 1.0,
    },
    "rad": math.tau,
}
"""Largest number of each unit: what is beyond it is in newtons, millimetres, milliseconds or degrees."""

APART = 1.25
"""Least distance between the feet without disturbances, over that of soles a gap apart."""

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
        robot.needs_feet("a stepping walk")
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


@settings
class TimeConstants:
    """Time of a step."""

    brisk: Annotated[Positive, "hω"] = 0.23  # speed about which steps begin to take longer
    quick: Annotated[Positive, "hω"] = 0.21  # speed from which on the torque of the hips sets their time
    plan_time: Time = 2.2  # time T of a step along footsteps on soles that are supported across their width
    time_lag: Time = 0.111  # low-pass of the time of a step: noise of ξ would move it by more than 10 ms
    later: NonNegative = 1.15  # greatest time of a step when it begins, over the nominal time
    outer_cop: Length = 0.008  # distance of ξ past the outer CoP bound from which on a step ends at once
    stretch: Length = 0.09  # distance of ξ ahead of its orbit that ends a step which waits for ξ aside
    pace_gain: Share = 0.2  # weight of the last step in the mean time of steps
    period: Time = 0.021  # period of the program


@settings
class AreaConstants:
    """Contact of the foot that stands: its centre of pressure, and the area of the sole that is supported."""

    # Carrying point, ahead of the centre of the sole: between centre and ankle either of them can hold a moment.
    carrying: Annotated[Number, "ankle"] = 0.57
    cop_lag: Time = 0.081  # low-pass of the measured centre of pressure: force sensors ring at impacts
    box: Box = (0.035, 0.067)  # of the centre of pressure about the commanded one: one stone gives no moment
    standing_box: Box = (0.59, 0.67)  # of the centre of pressure on both feet: what a sole holds on stones
    margin: Length = 0.026  # distance of the greatest area from the edges of the sole
    trusted: Lengths = (0.045, 0.065)  # half widths of soles with no area, and all of it, on rough ground
    even: Lengths = (0.01, 0.03)  # heights between the feet up to which ground is level, and from which rough
    area_growth: Speed = 0.09  # growth of each edge on rough ground: the whole sole within a step
    level_growth: NonNegative = 4.0  # growth of the area that level ground adds, over that on rough ground
    inside: Length = 0.0064  # distance of an edge over which the foot turns from the centre of pressure
    still: Rate = 0.07  # greatest rate of a foot that stands
    turning: Rate = 0.14  # least rate of a foot that turns over an edge
    spin_lag: Time = 0.044  # low-pass of the rates of the foot
    carries: Force = 0.3  # normal force from which on the centre of pressure shows where a foot holds
    cop_speed: Speed = 0.36  # greatest speed of the commanded centre of pressure: moments do not jump
    cop_error: Length = 0.038  # greatest difference of measured and commanded centre of pressure that counts
    next_area: Share = 0.3  # share of the half sole that the next foot is expected to hold on stones
    caught: Share = 0.7  # share of the next sole that holds what a landing along footsteps leaves
    slow_width: Annotated[Positive, "h"] = 0.04  # half of the supported width from which on steps are slow
    held_gain: tuple[Share, Share] = (0.8, 0.3)  # weight of the last step in this width, if less and if more


@settings
class TouchConstants:
    """Contact of the foot in the air, the foot that takes over, and the forces of both."""

    patience: Positive = 1.5  # offset of ξ over that of the orbit up to which the next step is long enough
    # The same along footsteps: a step that begins early leaves ξ behind its plan and outside of it.
    patience_of_plans: Positive = 1.0
    wait: NonNegative = 0.2  # time ahead for which waiting is judged, 1/ω; it stays in this unit
    share: Force = 0.3  # greatest force of a foot that waits: more would move the contact point
    unload: Time = 0.20  # time in which the foot that has carried gives up its load
    most_force: Force = 1.4  # greatest force of a foot: with twice the weight robots jump to gain yaw moment
    least_force: Force = 0.061  # from which on a foot is in contact, and least force of both together
    # Least force of a foot that carries alone. Where ξ is far aside, an upward force has a moment about the CoM: the QP
    # would give up this force rather than let the trunk turn; but a trunk comes upright again, and a fall does not.
    carried: Force = 0.5
    early: Share = 0.5  # share of the step before which a force is that of a foot that rubs
    pushed_speed: Speed = 1.2  # of a swing foot from which on it is pushed, beside twice the walk's velocity
    pushed_time: Time = 0.4  # for which the force of a pushed foot is no contact, and its place costs less
    kicked: Speed = 0.2  # speed of a foot without load in a stand from which on it has been kicked away
    landed: Time = 1.15  # time since a landing up to which a robot on both feet counts as walking
    drifted: Length = 0.033  # change of a standing foot's height from which on its estimate has moved
    low: NonNegative = 1.1  # height over the ground, in heights of a swing, above which a force is no contact
    rubs: NonNegative = 1.3  # viability of the landing over that of where the foot rubs, if the foot goes on
    met: Force = 0.122  # force from which on the foot has met the ground
    lost: Force = 0.015  # force below which the foot has lost the ground again
    held: Force = 0.18  # of the other foot, which must hold while a foot loses the ground: else both fly
    lost_time: Time = 0.12  # time for which the foot must have lost the ground


@settings
class SwingConstants:
    """Motion of the foot in the air, and the ground that it is to meet; shares are of the time of the step."""

    apex: Share = 0.42  # share at which the foot is highest
    touch: Ratio = 0.88  # share at which the foot meets the expected ground: a late foot fells robots
    late_touch: Ratio = 0.95  # `touch` in a walk of twice the velocity `quick`: long steps need the time
    touch_of_plans: Ratio = 0.92  # `touch` along footsteps
    level: Share = 0.3  # share at which the sole is level: one that is still tilted rubs at edges
    swing_push: Annotated[NonNegative, "g"] = 6.5  # greatest acceleration over the ground
    swing_gains: Gains = (30.6, 9.9)  # stiffness and damping of the task of the swing foot's place
    # Distances of a landing from the wanted one at which the swing foot begins to go before the trunk, and fully does.
    urgent: Lengths = (0.2, 0.5)
    lift_speed: Speed = 0.206  # speed at which the foot leaves the ground
    lift: Annotated[Positive, "g"] = 4.0  # greatest acceleration upwards: hips have no torque for more
    landing_speed: Speed = 0.103  # speed of a landing on level ground
    landing_gain: Rate = 4.3  # speed of a landing that each height between the feet in the last steps adds
    hardest: Speed = 0.25  # greatest speed of a landing
    search: Length = 0.20  # depth of the search for the ground, at which a leg is still not straight
    search_time: Annotated[Positive, "1/ω"] = 1.21  # time of the search for the ground
    piece: Annotated[Positive, "1/ω"] = 0.2  # least time of a piece of the swing's motion
    level_lag: Time = 1.01  # low-pass of the height of the feet that carry: no stone need lift the CoM
    ground_share: Share = 0.75  # share of an unexpected height that the next landing expects
    stair: Length = 0.1  # height of a landing that is seen, from either foot, from which on it is a stair
    balance_cost: Length = 3.0  # cost of a landing away from the program's on seen ground, over its own in h²
    choice: Share = 0.15  # share from which on a place on seen ground is chosen
    again: Length = 0.03  # move of the program's landing from which on another place is chosen

    @property
    def quickest(self) -> float:
        """Least time of a step, whose swing has two pieces up to the earliest share at which a foot touches down."""
        return 2.0 * self.piece / min(self.touch, self.late_touch, self.touch_of_plans)


@settings
class StandConstants:
    """Stand on both feet, and the shift of the weight before the first step."""

    shift_time: Annotated[Positive, "1/ω"] = 2.83  # time of the shift
    # The same before footsteps, which begin nearer to the foot that stands: ξ must not leave the soles on the way.
    shift_to_plans: Annotated[Positive, "1/ω"] = 4.2
    shift: NonNegative = 1.3  # place of ξ at its end, in b_y of a step in place: the first step begins late
    shift_gains: Gains = (2.45, 3.2)  # stiffness and damping of the CoM's place in the shift and in steps
    rest: Time = 0.6  # least time of a stand, and rest after the shift
    stand_gain: NonNegative = 0.74  # feedback gain of ξ in a stand
    stop_speed: Speed = 0.02  # greatest speed at which the robot stands again
    stop_length: Length = 0.6  # greatest distance between the feet of a stand: wide ones hold no push aside
    stop_box: NonNegative = 0.9  # box in which ξ must be where the robot stands again, over the standing box


@settings
class PathConstants:
    """Steering: the way to a goal and along a path."""

    near: Length = 0.8  # distance within which a goal is walked to without being faced: turns cost steps
    astray: Angle = 0.8  # from the line to a far goal to the goal, from which on a new line is begun
    goal_time: Annotated[Positive, "1/ω"] = 4.0  # time of the approach to a near goal: some two steps
    arrived: Length = 0.15  # distance at which a goal is reached: what steps reach that serve the balance
    arrived_turn: Angle = 0.15  # turn at which a goal is reached
    slow_turn: Annotated[Positive, "ω"] = 0.05  # turn rate from which on steps become quick
    path_lag: Time = 2.0  # low-pass of the path behind a robot that walks sideways or turns
    speed_lag: Annotated[Positive, "1/ω"] = 8.0  # low-pass of the velocity by which the robot falls short
    speed_bias: Speed = 0.08  # greatest such velocity, twice in a fast walk: carrying points are uncertain
    drift_gain: Rate = 0.124  # gain of the way back to the path
    drift_speed: Speed = 0.041  # greatest velocity of the way back to the path
    pelvis_turn: Angle = 0.35  # greatest angle of the pelvis from the heading: a push may turn it


@settings
class SteppingConstants:
    """Constants of the law by part, in units of the robot; docs/measured_walks.md has what parts of it are worth."""

    time: TimeConstants = TimeConstants()
    area: AreaConstants = AreaConstants()
    touch: TouchConstants = TouchConstants()
    swing: SwingConstants = SwingConstants()
    stand: StandConstants = StandConstants()
    path: PathConstants = PathConstants()

    def in_si(self, scale: RobotSize) -> ConstantsInSI:
        """Return the constants for one robot in SI units; an `InputError` for a number that is in SI units already."""
        names = [part.name for part in dataclasses.fields(self)]
        return SteppingConstants(**{name: multiplied_out(getattr(self, name), scale) for name in names})


ConstantsInSI = SteppingConstants
"""Constants of the law for one robot, in SI units."""

T = TypeVar("T")


@settings
class SteppingSettings:
    """Settings of free steps, in units of the robot; the constants of the law are in `SteppingConstants`.

    h is the height of the CoM, ω its natural frequency √(g / h), and g the gravity.

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
        friction: Coulomb coefficient between the soles and the ground.
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

    def in_si(self, scale: RobotSize) -> SettingsInSI:
        """Return the settings for one robot in SI units; raise an `InputError` if such steps cannot be walked."""
        si = multiplied_out(self, scale)
        inside = 2.0 * scale.sole[1] + si.gap  # distance of the feet whose soles are a gap apart
        si = dataclasses.replace(si, width=max(si.width, APART * inside), gap=inside)
        if not si.shortest <= si.step_time <= si.slow_time:
            raise InputError(
                f"shortest ≤ step_time ≤ slow_time must hold, got {self.shortest:g}, {self.step_time:g} and "
                f"{self.slow_time:g} in 1/ω ({si.shortest:.3f}, {si.step_time:.3f} and {si.slow_time:.3f} s)"
            )
        if si.longest < 1.0:
            raise InputError(f"longest is a ratio of the time of a step, of 1 at least, got {si.longest:g}")
        if si.widest <= si.width:
            raise InputError(
                f"feet must stand further apart than the soles are wide ({si.gap:.3f} m with the gap) and nearer than "
                f"widest; got width {si.width:.3f} m and widest {si.widest:.3f} m"
            )
        return si


SettingsInSI = SteppingSettings
"""Settings of free steps for one robot, in SI units."""


class GaitValues(NamedTuple):
    """Values that all parts of one walk share, in SI units."""

    settings: SettingsInSI
    constants: ConstantsInSI
    scale: RobotSize
    dt: float  # control period, s

    @staticmethod
    def of(
        settings: SteppingSettings, constants: SteppingConstants, scale: RobotSize, dt: float
    ) -> GaitValues:
        """Return the values of settings and constants in units of a robot; an `InputError` for impossible steps."""
        values = GaitValues(settings.in_si(scale), constants.in_si(scale), scale, dt)
        least = max(2.0 * settings.swing_height, constants.swing.quickest)  # up and down at hω on average
        if settings.shortest < least:
            raise InputError(
                f"a step must last as long as a swing of its height, {least:.3g}/ω ({least / scale.omega:.3f} s) for "
                f"swing_height {settings.swing_height:g} h; got shortest {settings.shortest:g}/ω "
                f"({values.settings.shortest:.3f} s)"
            )
        return values


def multiplied_out(values: T, scale: RobotSize) -> T:
    """Return a dataclass of numbers in units of a robot, which its annotations name, in metres, seconds and newtons.

    A number above the largest one of its unit (`LARGEST`) is an `InputError`.
    """
    for name, unit in units_of(type(values)).items():
        most, given = LARGEST.get(unit, math.inf), getattr(values, name)
        if np.max(np.abs(given)) > most:
            raise InputError(
                f"{name} of {type(values).__name__} is in units of the robot ({unit}) and at most {most:g}, got {given}"
            )
    h, omega, (half_length, half_width) = scale.height, scale.omega, scale.sole
    units: dict[str, float | tuple[float, ...]] = {
        **{"1/ω": 1.0 / omega, "ω": omega, "ω²": omega**2, "h": h, "hω": h * omega},
        **{"g": GRAVITY, "mg": scale.weight, "leg": scale.leg, "ankle": scale.ankle},
        "sole": (2.0 * half_length, 2.0 * half_width),
    }
    return in_units(values, units)


def swing_shape(settings: SettingsInSI, constants: ConstantsInSI) -> SwingShape:
    """Return the shape of a swing on level ground."""
    c = constants.swing
    return SwingShape(
        settings.swing_height,
        apex=c.apex / c.touch,
        takeoff_time=0.0,
        landing_time=0.0,
        landing_speed=c.landing_speed,
        landing_height=0.0,
        search_depth=c.search,
        search_time=c.search_time,
        lift_speed=c.lift_speed,
        edge=0.0,
        heel=0.0,
        quickest=0.5,
        level=c.level,
        lift=c.lift,
        piece=c.piece,
    )
