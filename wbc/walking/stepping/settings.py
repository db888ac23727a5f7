"""Settings of the stepping walk, in units of the robot: the same numbers walk robots of any size.

Lengths are in heights h of the CoM, times in 1/ω with ω² = g/h, forces in weights. `SteppingSettings.in_si` multiplies
them out for one robot.
"""

from __future__ import annotations

import dataclasses
import math
import typing
from typing import Annotated

import numpy as np
import pinocchio as pin

from wbc.core.errors import InputError
from wbc.core.robot import GRAVITY, Robot
from wbc.core.settings import NonNegative, Positive, Share, settings


@dataclasses.dataclass(frozen=True, slots=True)
class Scale:
    """Size of a robot, by which the settings are multiplied.

    Attributes:
        height: Height h of the CoM over the soles while it steps, m.
        leg: Length of a straight leg from the hip to the ankle, m.
        mass: Mass, kg.
        sole: Half length and half width of a sole, m.
        ankle: Place of the ankle ahead of the centre of the sole, m.
    """

    height: float
    leg: float
    mass: float
    sole: tuple[float, float]
    ankle: float

    @property
    def omega(self) -> float:
        """Natural frequency ω of the pendulum, 1/s."""
        return math.sqrt(GRAVITY / self.height)

    @property
    def weight(self) -> float:
        """Weight m g, N."""
        return self.mass * GRAVITY

    @staticmethod
    def of(robot: Robot, bend: float, height: float | None = None) -> Scale:
        """Measure a robot with a left and a right sole; its state stays as it is.

        The CoM is at a height over the soles, m, else `bend`, in leg lengths, below its height on straight legs. Legs
        that hang together with both soles are an `InputError`.
        """
        if len(robot.soles) != 2:
            raise InputError(f"a stepping walk needs two feet, got a robot with {len(robot.soles)} soles")
        model, data = robot.model, robot.model.createData()
        legs = [robot.joints_between(sole.frame, robot.base_frame) for sole in robot.soles]
        straight = np.array(robot.half_sitting)
        straight[[7 + joint for leg in legs for joint in leg]] = 0.0
        pin.framesForwardKinematics(model, data, straight)
        sole = data.oMf[robot.frame_id(robot.soles[0].frame)]
        com = float(pin.centerOfMass(model, data, straight)[2] - sole.translation[2])
        joints = [data.oMi[joint + 2].translation for joint in legs[0]]  # 0 is the world, 1 the base
        heights = [float(at[2]) for at in joints]
        leg_length = max(heights) - min(heights)
        ankle = float(sole.actInv(data.oMi[legs[0][-1] + 2]).translation[0])
        return Scale(
            height=com - bend * leg_length if height is None else height,
            leg=leg_length,
            mass=robot.mass,
            sole=(0.5 * robot.soles[0].length, 0.5 * robot.soles[0].width),
            ankle=ankle,
        )


@settings
class SteppingSettings:
    """Settings of the stepping walk; docs/stepping.md says where each comes from and what it is worth.

    Attributes:
        bend: Distance of the CoM below its height on straight legs, leg lengths.
        step_time: Time T of a step while nothing disturbs it, 1/ω.
        shortest: Shortest time of a step, 1/ω.
        longest: Longest time of a step, and longest wait after an early contact, 1/ω.
        time_lag: Low-pass of the time of the step, 1/ω.
        width: Distance w between the feet while nothing disturbs them, h; greater where the soles need it.
        gap: Least distance between the inner edges of the soles, h.
        widest: Greatest distance between the feet, h.
        reach: Greatest length of a step, forward or back, h.
        acceleration: Greatest change of the walking velocity, g.
        brisk: Velocity from which a step takes longer, hω.
        stride: Longest step that a velocity may ask for: legs that swing further lack torque, leg lengths.
        fastest: Greatest velocity forward, hω; less where the stride ends before.
        fastest_back: Greatest velocity back, hω.
        fastest_aside: Greatest velocity to the side, hω; less where the feet stand close.
        fastest_turn: Greatest turn, ω.
        cruise: Velocity to a goal, hω.
        near: Distance from a goal within which it is walked to without being faced, h.
        goal_time: Time constant with which a near goal is approached, 1/ω.
        arrived: Distance from a goal at which the robot stops, h.
        arrived_turn: Error of the heading at a goal at which the robot stops, rad.
        path_lag: Time constant with which the path follows a robot that walks sideways or turns, 1/ω.
        speed_lag: Integral time of the velocity by which the robot falls short of what is asked for, 1/ω.
        speed_bias: Greatest velocity that this integral adds, hω.
        drift_gain: Velocity back towards the path for each metre beside it, ω.
        drift_speed: Greatest velocity back towards the path, hω.
        cop_lag: Low-pass of the measured centre of pressure, 1/ω.
        over: Distance of the DCM beyond the stance foot from which the robot closes up at once, h.
        foothold: Point of the sole that carries: its distance from the centre over that of the point below the ankle.
        box: Size of the box of the centre of pressure around that point, in lengths and widths of the sole.
        standing_box: The same while the robot stands, sole sizes.
        friction: Coulomb coefficient of the ground.
        swing_height: Height of the swing above the higher of foot and ground, h.
        apex: Time over the step time at which the foot is highest.
        lift_speed: Speed with which the foot lifts off, hω.
        touch: Time over the step time at which the foot meets the expected ground.
        landing_speed: Speed with which it meets level ground, hω.
        haste: Speed that is added for uneven ground, over the greatest height between the feet in the last steps, ω.
        hardest: Greatest speed with which it meets the ground, hω.
        memory: Ratio of the unevenness that is remembered from step to step.
        search_speed: Speed with which the foot sinks on where it finds no ground, hω.
        search: Greatest depth below the expected ground to which the foot sinks, h.
        settle: Time over the step time from which the foot follows its landing instead of planning a quintic to it.
        follow: Time constant with which the foot then follows its landing, 1/ω.
        early: Time over the step time from which a force is a contact.
        contact: Force from which a swing foot has met the ground, mg.
        lost: Force below which it has lost it again, mg.
        held: Force on the other foot above which a lost contact is no flight, mg.
        lost_time: Time after a contact in which it is not lost, 1/ω.
        patience: Lateral offset of the DCM, over that of the orbit, at which a foot in contact takes over.
        stretch: Offset of the DCM over that of the orbit, ahead or behind, that ends a step at once, half a wait, h.
        stretch_side: Greatest lateral offset with which it ends a wait, h.
        share: Greatest force of a foot that is in contact and waits, mg.
        unload: Time over which the foot that has stood is unloaded, 1/ω.
        most_force: Greatest force of a foot, mg.
        least_force: Least force of the foot that stands, mg.
        ground_lag: Low-pass of the height of the ground, 1/ω.
        shift_time: Time in which the weight is shifted before the first step, 1/ω.
        shift: Place of the DCM at the end of the shift, in lateral offsets at the end of a step.
        rest: Time from the shift to the first step, and least time of a stand, 1/ω.
        stand_gain: Feedback of the DCM while the robot stands.
        stop_speed: Walking velocity below which the robot may stop, hω.
        stop_length: Greatest distance between the feet after the last step, h: a wide stand holds no push to the side.
        stop_box: Ratio of the standing box within which the DCM must be to stop.
    """

    bend: Annotated[NonNegative, "leg"] = 0.162
    step_time: Annotated[Positive, "1/ω"] = 1.65
    shortest: Annotated[Positive, "1/ω"] = 0.81
    longest: Annotated[Positive, "1/ω"] = 2.02
    time_lag: Annotated[NonNegative, "1/ω"] = 0.12
    width: Annotated[Positive, "h"] = 0.367
    gap: Annotated[NonNegative, "h"] = 0.10
    widest: Annotated[Positive, "h"] = 0.90
    reach: Annotated[Positive, "h"] = 0.667
    acceleration: Annotated[Positive, "g"] = 0.03
    brisk: Annotated[Positive, "hω"] = 0.23
    stride: Annotated[Positive, "leg"] = 0.56
    fastest: Annotated[Positive, "hω"] = 0.2
    fastest_back: Annotated[Positive, "hω"] = 0.12
    fastest_aside: Annotated[Positive, "hω"] = 0.08
    fastest_turn: Annotated[Positive, "ω"] = 0.15
    cruise: Annotated[Positive, "hω"] = 0.12
    near: Annotated[Positive, "h"] = 0.8
    goal_time: Annotated[Positive, "1/ω"] = 4.0
    arrived: Annotated[Positive, "h"] = 0.15
    arrived_turn: Annotated[Positive, "rad"] = 0.15
    path_lag: Annotated[Positive, "1/ω"] = 2.0
    speed_lag: Annotated[Positive, "1/ω"] = 8.0
    speed_bias: Annotated[NonNegative, "hω"] = 0.08
    drift_gain: Annotated[NonNegative, "ω"] = 0.124
    drift_speed: Annotated[NonNegative, "hω"] = 0.041
    cop_lag: Annotated[NonNegative, "1/ω"] = 0.081
    over: Annotated[NonNegative, "h"] = 0.008
    foothold: Annotated[float, "ankle"] = 0.57
    box: Annotated[tuple[Positive, Positive], "sole"] = (0.035, 0.067)
    standing_box: Annotated[tuple[Positive, Positive], "sole"] = (0.59, 0.67)
    friction: Positive = 0.5
    swing_height: Annotated[Positive, "h"] = 0.183
    apex: Share = 0.42
    lift_speed: Annotated[NonNegative, "hω"] = 0.206
    touch: Share = 0.88
    landing_speed: Annotated[NonNegative, "hω"] = 0.103
    haste: Annotated[NonNegative, "ω"] = 4.3
    hardest: Annotated[Positive, "hω"] = 0.25
    memory: Share = 0.9
    search_speed: Annotated[Positive, "hω"] = 0.165
    search: Annotated[NonNegative, "h"] = 0.20
    settle: Share = 0.92
    follow: Annotated[Positive, "1/ω"] = 0.162
    early: Share = 0.5
    contact: Annotated[Positive, "mg"] = 0.122
    lost: Annotated[NonNegative, "mg"] = 0.015
    held: Annotated[NonNegative, "mg"] = 0.18
    lost_time: Annotated[NonNegative, "1/ω"] = 0.12
    patience: Annotated[Positive, ""] = 1.5
    stretch: Annotated[Positive, "h"] = 0.09
    stretch_side: Annotated[Positive, "h"] = 0.233
    share: Annotated[Positive, "mg"] = 0.3
    unload: Annotated[Positive, "1/ω"] = 0.20
    most_force: Annotated[Positive, "mg"] = 1.4
    least_force: Annotated[NonNegative, "mg"] = 0.061
    ground_lag: Annotated[NonNegative, "1/ω"] = 1.01
    shift_time: Annotated[Positive, "1/ω"] = 2.83
    shift: Annotated[Positive, ""] = 1.3
    rest: Annotated[NonNegative, "1/ω"] = 0.6
    stand_gain: Annotated[NonNegative, ""] = 0.74
    stop_speed: Annotated[NonNegative, "hω"] = 0.02
    stop_length: Annotated[Positive, "h"] = 0.6
    stop_box: Share = 0.9

    def in_si(self, scale: Scale) -> SteppingSettings:
        """Return the settings of one robot in metres, seconds and newtons; ratios and angles stay.

        Steps that cannot be walked, shorter than a swing or within the other foot, are an `InputError`.
        """
        h, omega = scale.height, scale.omega
        units = {
            "1/ω": 1.0 / omega,
            "h": h,
            "hω": h * omega,
            "g": GRAVITY,
            "mg": scale.weight,
            "leg": scale.leg,
        }
        units |= {"ω": omega, "ankle": scale.ankle}
        changes: dict[str, typing.Any] = {}
        for name, hint in typing.get_type_hints(type(self), include_extras=True).items():
            unit = next((part for part in getattr(hint, "__metadata__", ()) if isinstance(part, str)), "")
            value = getattr(self, name)
            if unit == "sole":
                (length, width), (half_length, half_width) = value, scale.sole
                changes[name] = (2.0 * length * half_length, 2.0 * width * half_width)
            elif unit in units:
                changes[name] = value * units[unit]
        inside = 2.0 * scale.sole[1] + self.gap * h  # distance of the feet whose soles are a gap apart
        changes["width"] = max(self.width * h, 1.25 * inside)
        self._check(changes, inside, scale)
        changes["gap"] = inside
        return dataclasses.replace(self, **changes)

    def _check(self, si: dict[str, typing.Any], inside: float, scale: Scale) -> None:
        """Refuse steps that cannot be walked, by the settings in SI units and the least distance of the feet, m."""
        if not si["shortest"] <= si["step_time"] <= si["longest"]:
            raise InputError(
                f"shortest ≤ step_time ≤ longest must hold, got {self.shortest:g}, {self.step_time:g} and "
                f"{self.longest:g} in 1/ω ({si['shortest']:.3f}, {si['step_time']:.3f} and {si['longest']:.3f} s)"
            )
        if self.least_force >= min(self.share, self.most_force):
            raise InputError(
                f"least_force must be below share and most_force, got {self.least_force:g}, {self.share:g} and "
                f"{self.most_force:g} m g"
            )
        if self.apex >= self.touch:
            raise InputError(
                "a foot is at its highest before it meets the ground, apex < touch; "
                f"got {self.apex:g} and {self.touch:g}"
            )
        least = 2.0 * si["swing_height"] / (scale.height * scale.omega)
        if si["shortest"] < least:
            raise InputError(
                f"a step must last as long as a swing of its height, {least * scale.omega:.3g}/ω ({least:.3f} s) for "
                f"swing_height {self.swing_height:g} h; got shortest {self.shortest:g}/ω ({si['shortest']:.3f} s)"
            )
        if si["widest"] <= si["width"]:
            raise InputError(
                f"feet must stand further apart than the soles are wide ({inside:.3f} m with the gap) and nearer than "
                f"widest; got width {si['width']:.3f} m and widest {si['widest']:.3f} m"
            )
