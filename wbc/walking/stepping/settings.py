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
from wbc.core.robot import GRAVITY, Robot
from wbc.walking.plans.gait import SwingShape
from wbc.walking.plans.leg import Leg
from wbc.walking.plans.reach import SPANS

Pair = tuple[NonNegative, NonNegative]

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
class SteppingConstants:
    """Constants of the law, in units of the robot; docs/measured_walks.md has what parts of it are worth."""

    # ---- Time and place of a step.
    # Velocity about which steps begin to take longer, because longer steps need more time; velocity from which on they
    # take as little time as the torque of the hips lets them.
    brisk: Annotated[Positive, "hω"] = 0.23
    quick: Annotated[Positive, "hω"] = 0.21
    # Time T of a step along footsteps on soles that are supported across their width.
    plan_time: Annotated[NonNegative, "1/ω"] = 2.2
    # Low-pass of the time of a step: noise of ξ would move it by more than 10 ms.
    time_lag: Annotated[NonNegative, "1/ω"] = 0.111
    # Greatest time of a step when it begins, over the nominal time.
    later: NonNegative = 1.15
    # Distance of the DCM past the outer CoP bound from which on the step ends as soon as it can.
    outer_cop: Annotated[NonNegative, "h"] = 0.008
    # Distance of ξ ahead of its orbit that ends a step which would otherwise wait for ξ aside.
    stretch: Annotated[NonNegative, "h"] = 0.09
    # Weight of the last step in the mean time of steps.
    pace_gain: Share = 0.2
    # ---- Contact of the foot that stands.
    # Carrying point, ahead of the centre of the sole: between centre and ankle either of them can hold a moment.
    carrying: Annotated[Number, "ankle"] = 0.57
    # Low-pass of the measured centre of pressure: force sensors ring at impacts.
    cop_lag: Annotated[NonNegative, "1/ω"] = 0.081
    # Size of the box of the centre of pressure about the commanded one: one stone gives no moment.
    box: Annotated[Pair, "sole"] = (0.035, 0.067)
    # The same on both feet: what a sole holds on stones.
    standing_box: Annotated[Pair, "sole"] = (0.59, 0.67)
    # ---- Supported area of the foot that stands, and the centre of pressure in it.
    # Distance of the greatest area from the edges of the sole.
    margin: Annotated[NonNegative, "h"] = 0.026
    # Half width of a sole whose area counts for nothing on rough ground, and of one whose area counts in full.
    trusted: Annotated[Pair, "h"] = (0.045, 0.065)
    # Height between the feet up to which the ground counts as level, and from which on as rough.
    even: Annotated[Pair, "h"] = (0.01, 0.03)
    # Growth of each edge on rough ground: the whole sole within a step.
    area_growth: Annotated[NonNegative, "hω"] = 0.09
    # The part of the growth that level ground adds, over that on rough ground.
    level_growth: NonNegative = 4.0
    # Distance of the edge of an area from the measured centre of pressure, where the foot turns over this edge.
    inside: Annotated[NonNegative, "h"] = 0.0064
    # Greatest rate of a foot that stands; least rate of a foot that turns over an edge; low-pass of both rates.
    still: Annotated[NonNegative, "ω"] = 0.07
    turning: Annotated[NonNegative, "ω"] = 0.14
    spin_lag: Annotated[NonNegative, "1/ω"] = 0.044
    # Normal force from which on the centre of pressure shows where a foot holds.
    carries: Annotated[NonNegative, "mg"] = 0.3
    # Greatest speed of the commanded centre of pressure: moments do not jump.
    cop_speed: Annotated[NonNegative, "hω"] = 0.36
    # Greatest difference of measured and commanded centre of pressure that counts.
    cop_error: Annotated[NonNegative, "h"] = 0.038
    # Part of the half sole that the next foot is expected to hold: stones hold less than all.
    next_area: Share = 0.3
    # Part of the next sole that holds what a landing along footsteps leaves: its area has to grow first.
    caught: Share = 0.7
    # Period of the program.
    period: Annotated[NonNegative, "1/ω"] = 0.021
    # Half of the supported width in the last steps from which on steps are slow.
    slow_width: Annotated[Positive, "h"] = 0.04
    # Weight of the last step in this width, where it is less and where it is more.
    held_gain: tuple[Share, Share] = (0.8, 0.3)
    # ---- The foot that has landed takes over.
    # Offset of ξ over that of the orbit up to which the next step is long enough.
    patience: Positive = 1.5
    # The same along footsteps: a step that begins early leaves ξ behind its plan and outside of it.
    patience_of_plans: Positive = 1.0
    # Time ahead for which waiting is judged, in 1/ω, which stays its unit.
    wait: NonNegative = 0.2
    # Greatest force of a foot that waits: more would move the contact point.
    share: Annotated[NonNegative, "mg"] = 0.3
    # Time in which the foot that has carried gives up its load.
    unload: Annotated[NonNegative, "1/ω"] = 0.20
    # Greatest force of a foot: with twice the weight robots jump to gain yaw moment.
    most_force: Annotated[NonNegative, "mg"] = 1.4
    # Force from which on a foot is in contact, and the least one of both feet together.
    least_force: Annotated[NonNegative, "mg"] = 0.061
    # Least force of a foot that carries alone. Where ξ is far aside a force up has a moment about the CoM, and the QP
    # would rather give up the force than let the trunk turn; but a trunk comes upright again, and a fall does not.
    carried: Annotated[NonNegative, "mg"] = 0.5
    # ---- Swing, over the time of the step.
    apex: Share = 0.42
    # Time at which the foot meets the expected ground: a foot that comes late fells robots.
    touch: Ratio = 0.88
    # The same in a walk of twice the velocity `quick`, whose long steps need the time.
    late_touch: Ratio = 0.95
    # The same along footsteps.
    touch_of_plans: Ratio = 0.92
    # Time at which the sole is level: one that is still tilted rubs at edges.
    level: Share = 0.3
    # Greatest acceleration over the ground: a long step takes its time.
    swing_push: Annotated[NonNegative, "g"] = 6.5
    # Stiffness and damping of the task of the swing foot's place.
    swing_gains: tuple[Annotated[NonNegative, "ω²"], Annotated[NonNegative, "ω"]] = (30.6, 9.9)
    # Distance of a landing from the one that was asked for, from which on the swing foot goes before the trunk, and at
    # which it does so in full.
    urgent: Annotated[Pair, "h"] = (0.2, 0.5)
    lift_speed: Annotated[NonNegative, "hω"] = 0.206
    # Greatest acceleration upwards: hips lack torque for more in a short step.
    lift: Annotated[Positive, "g"] = 4.0
    # Speed of a landing: soft on level ground, quicker by `landing_gain` for each height between the feet in the last
    # steps, and at most as the third one says.
    landing_speed: Annotated[NonNegative, "hω"] = 0.103
    landing_gain: Annotated[NonNegative, "ω"] = 4.3
    hardest: Annotated[NonNegative, "hω"] = 0.25
    # Depth of the search for the ground, at which a leg is still not straight, and its time.
    search: Annotated[NonNegative, "h"] = 0.20
    search_time: Annotated[Positive, "1/ω"] = 1.21
    # Least time of a piece of the swing's motion.
    piece: Annotated[Positive, "1/ω"] = 0.2
    # ---- Contact of the foot in the air.
    # Part of the step before which a force is that of a foot that rubs.
    early: Share = 0.5
    # Speed of a swing foot, beside twice the velocity of the walk, from which on it is a pushed foot; time for which
    # its force is no contact then, and for which it goes after the trunk.
    pushed_speed: Annotated[NonNegative, "hω"] = 1.2
    pushed_time: Annotated[NonNegative, "1/ω"] = 0.4
    # Speed of a foot without load in a stand from which on it has been kicked away.
    kicked: Annotated[NonNegative, "hω"] = 0.2
    # Time since a landing up to which a robot on both feet is on its way, where the gait begins anew.
    landed: Annotated[NonNegative, "1/ω"] = 1.15
    # Change of the height of a foot that stands from which on its estimate has moved, and not the foot.
    drifted: Annotated[NonNegative, "h"] = 0.033
    # Height of the swing foot over the ground, in heights of a swing, above which its force is no contact.
    low: NonNegative = 1.1
    # Viability of the planned landing over that of a place where the foot rubs, from which on the foot goes on.
    rubs: NonNegative = 1.3
    # Force from which on the foot has met the ground; below which it has lost it again; of the other foot, which must
    # hold meanwhile, or it is a flight; time for which that must last.
    met: Annotated[NonNegative, "mg"] = 0.122
    lost: Annotated[NonNegative, "mg"] = 0.015
    held: Annotated[NonNegative, "mg"] = 0.18
    lost_time: Annotated[NonNegative, "1/ω"] = 0.12
    # ---- Height.
    # Low-pass of the height of the feet that carry: the CoM need not follow each stone.
    level_lag: Annotated[NonNegative, "1/ω"] = 1.01
    # Part of an unexpected height that the next landing expects.
    ground_share: Share = 0.75
    # Height of a landing that is seen, over either foot or under it, from which on it is a stair.
    stair: Annotated[NonNegative, "h"] = 0.1
    # ---- Choice of a place on ground that is seen.
    # Cost of a landing away from the program's, over the program's own cost in h².
    balance_cost: Annotated[NonNegative, "h"] = 3.0
    # Part of the step's time from which on a place is chosen.
    choice: Share = 0.15
    # Move of the program's landing from which on another place is chosen.
    again: Annotated[NonNegative, "h"] = 0.03
    # ---- Both feet.
    shift_time: Annotated[Positive, "1/ω"] = 2.83
    # The same before footsteps, which begin nearer to the foot that stands: ξ must not leave the soles on the way.
    shift_to_plans: Annotated[Positive, "1/ω"] = 4.2
    # Place of ξ when the shift ends, in b_y of a step in place: the first step begins late.
    shift: NonNegative = 1.3
    shift_gains: tuple[Annotated[NonNegative, "ω²"], Annotated[NonNegative, "ω"]] = (2.45, 3.2)
    rest: Annotated[NonNegative, "1/ω"] = 0.6
    stand_gain: NonNegative = 0.74
    # Greatest speed, and greatest distance between the feet, at which the robot stands again: a wide stand holds no
    # push to the side. Size of the box in which ξ must be, over the standing box.
    stop_speed: Annotated[NonNegative, "hω"] = 0.02
    stop_length: Annotated[NonNegative, "h"] = 0.6
    stop_box: NonNegative = 0.9
    # ---- Steering.
    # Distance within which a goal is walked to without being faced: turns cost steps.
    near: Annotated[NonNegative, "h"] = 0.8
    # Angle from the line to a far goal to the goal from which on a new line is begun: ground turned the robot aside.
    astray: Annotated[NonNegative, "rad"] = 0.8
    # Time of the approach to a near goal: some two steps.
    goal_time: Annotated[Positive, "1/ω"] = 4.0
    # Distance and turn at which a goal is reached: what steps reach, as landings serve the balance.
    arrived: Annotated[NonNegative, "h"] = 0.15
    arrived_turn: Annotated[NonNegative, "rad"] = 0.15
    # Turn from which on steps become quick: headings turn as a foot stands.
    slow_turn: Annotated[Positive, "ω"] = 0.05
    # Low-pass of the path behind a robot that walks sideways or turns.
    path_lag: Annotated[NonNegative, "1/ω"] = 2.0
    # Low-pass of the velocity by which the robot falls short, and its greatest value, twice in a fast walk: where feet
    # carry is known to centimetres.
    speed_lag: Annotated[Positive, "1/ω"] = 8.0
    speed_bias: Annotated[NonNegative, "hω"] = 0.08
    # Gain and greatest velocity of the way back to the path.
    drift_gain: Annotated[NonNegative, "ω"] = 0.124
    drift_speed: Annotated[NonNegative, "hω"] = 0.041
    # Greatest angle of the pelvis from the heading: a push may turn it.
    pelvis_turn: Annotated[NonNegative, "rad"] = 0.35

    def __post_init__(self) -> None:
        """Refuse pairs that do not grow."""
        for name in ("trusted", "even", "urgent"):
            low, high = getattr(self, name)
            if low >= high:
                raise InputError(
                    f"the second number of {name} must be above the first one, got {low:g} and {high:g}"
                )

    @property
    def quickest_swing(self) -> float:
        """Least time of a step, whose swing has two pieces up to the earliest share at which a foot touches down."""
        return 2.0 * self.piece / min(self.touch, self.late_touch, self.touch_of_plans)

    def check(self) -> None:
        """Refuse boxes of the centre of pressure, in parts of the sole, that are larger than the sole."""
        for name in ("box", "standing_box"):
            if not all(0.0 < size <= 1.0 for size in getattr(self, name)):
                raise InputError(
                    f"{name} of SteppingConstants is a part of the sole in each direction, above 0 and at most 1, got "
                    f"{getattr(self, name)}"
                )


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

    def in_si(self, scale: RobotSize) -> SteppingSettings:
        """Return the settings for one robot in SI units; raise an `InputError` if such steps cannot be walked."""
        si = in_si(self, scale)
        inside = 2.0 * scale.sole[1] + si.gap  # distance of the feet whose soles are a gap apart
        si = dataclasses.replace(si, width=max(si.width, APART * inside), gap=inside)
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
        if si.widest <= si.width:
            raise InputError(
                f"feet must stand further apart than the soles are wide ({si.gap:.3f} m with the gap) and nearer than "
                f"widest; got width {si.width:.3f} m and widest {si.widest:.3f} m"
            )


class GaitValues(NamedTuple):
    """Values that all parts of one walk share, in SI units."""

    settings: SteppingSettings
    constants: SteppingConstants
    scale: RobotSize
    dt: float  # control period, s

    @staticmethod
    def of(
        settings: SteppingSettings, constants: SteppingConstants, scale: RobotSize, dt: float
    ) -> GaitValues:
        """Return the values of settings and constants in units of a robot; an `InputError` for impossible steps."""
        constants.check()
        values = GaitValues(settings.in_si(scale), in_si(constants, scale), scale, dt)
        least = max(2.0 * settings.swing_height, constants.quickest_swing)  # up and down at hω on average
        if settings.shortest < least:
            raise InputError(
                f"a step must last as long as a swing of its height, {least:.3g}/ω ({least / scale.omega:.3f} s) for "
                f"swing_height {settings.swing_height:g} h; got shortest {settings.shortest:g}/ω "
                f"({values.settings.shortest:.3f} s)"
            )
        return values


def in_si(values: T, scale: RobotSize) -> T:
    """Return a dataclass of numbers in units of a robot, which its annotations name, in metres, seconds and newtons."""
    h, omega, (half_length, half_width) = scale.height, scale.omega, scale.sole
    units: dict[str, float | tuple[float, ...]] = {
        **{"1/ω": 1.0 / omega, "ω": omega, "ω²": omega**2, "h": h, "hω": h * omega},
        **{"g": GRAVITY, "mg": scale.weight, "leg": scale.leg, "ankle": scale.ankle},
        "sole": (2.0 * half_length, 2.0 * half_width),
    }
    return in_units(values, units)


def swing_shape(settings: SteppingSettings, constants: SteppingConstants) -> SwingShape:
    """Return the shape of a swing on level ground, by settings and constants in SI units."""
    c = constants
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
