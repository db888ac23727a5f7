"""Gains of the stabilizer in physical units."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated

from wbc.base.settings import NonNegative, Positive, settings
from wbc.core.robot import force_scale

Pair = tuple[float, float]
"""Forward and sideways, in the yaw frame of the robot."""

Gain = NonNegative | tuple[NonNegative, NonNegative]
"""One number for both directions, or a pair; settings hold the pair."""


def pair(value: Pair | float) -> Pair:
    """Return both directions of a gain that may be given as one number."""
    return value if isinstance(value, tuple) else (value, value)


PAIRS = ("dcm_p", "dcm_i", "dcm_d", "com_v", "zmp_d", "cop_admittance")


@settings
class StabilizerGains:
    """Gains, time constants and bounds of the stabilizer. Pairs may be given as one number for both directions.

    Forces are in proportion for a robot below 30 kg: its admittances act on wrenches over `Robot.force_scale`.
    Lengths are bounds of corrections, no sizes: they bind no QP, and hold for soles of 100 mm and more; a smaller robot
    is given its own.

    The defaults walk best on all soles: a quick transfer of load, a CoP admittance that goes with torque
    feed-forward, and filtered wrenches. `mc_rtc` is that library's plain law.

    Attributes:
        dcm_p: Proportional gain on the DCM error, 1/s: the closed-loop pole if the CoP follows without lag.
        dcm_i: Gain on the average DCM error, 1/s.
        dcm_d: Gain on the derivative of the DCM error, without unit. It also feeds back the noise of the measured ZMP,
            which costs more than the damping gives on hard soles.
        com_v: Gain on the CoM velocity error, without unit.
        zmp_d: Time by which the commanded ZMP is ahead of the target, with the velocity of the target, s.
        integrator_time: Time constant of the average of the DCM error, s.
        derivator_time: Time constant of the low-pass whose output is subtracted from the derivative, s.
        cop_admittance: Ankle rotation per CoP torque error, rad/(Nm·s), along x (pitch) and y (roll). None: 0.05, or
            less for a robot of more than 40 kg, see `for_mass`.
        force_difference: Foot height per difference of normal forces, m/(N·s).
        support_height_leak: Decay of the support foot's height on one foot, 1/s.
        wrench_time: Time constant of the low-pass of the measured wrenches before the admittances, s.
        max_average_dcm_error: Bound of the average DCM error, m.
        max_angular_velocity: Bound of the ankle rotation's speed, rad/s. On a stone a foot may have to turn by 10°
            to be carried elsewhere, and the DCM grows e-fold in 0.3 s meanwhile.
        min_force: Normal force of both feet below which the robot is in the air, N; less for a
            light robot (`for_mass`).
    """

    dcm_p: Annotated[Gain, "1/s"] = 4.0
    dcm_i: Annotated[Gain, "1/s"] = 0.0
    dcm_d: Gain = 0.0
    com_v: Gain = 1.0
    zmp_d: Annotated[Gain, "s"] = 0.0
    integrator_time: Annotated[Positive, "s"] = 10.0
    derivator_time: Annotated[Positive, "s"] = 1.0
    cop_admittance: Annotated[Gain, "rad/(Nm·s)"] | None = None
    force_difference: Annotated[NonNegative, "m/(N·s)"] = 5e-4
    support_height_leak: Annotated[NonNegative, "1/s"] = 3.0
    wrench_time: Annotated[NonNegative, "s"] = 0.02
    max_average_dcm_error: Annotated[Positive, "m"] = 0.05
    max_angular_velocity: Annotated[Positive, "rad/s"] = 1.0
    min_force: Annotated[NonNegative, "N"] = 15.0

    def __post_init__(self) -> None:
        for name in PAIRS:
            if (value := getattr(self, name)) is not None:
                object.__setattr__(self, name, pair(value))

    @staticmethod
    def mc_rtc() -> StabilizerGains:
        """Return mc_rtc's plain law with the gains of its HRP-4 family: nothing filtered, nothing adapted."""
        return StabilizerGains(
            dcm_d=0.0,
            cop_admittance=0.01,
            force_difference=1e-4,
            support_height_leak=0.0,
            wrench_time=0.0,
            max_angular_velocity=0.3,
        )

    def for_mass(self, mass: float) -> StabilizerGains:
        """Return the gains with a CoP admittance for the robot's mass where none is given, and its least force.

        A loop that turns an ankle against the ground is as quick as admittance times stiffness, and stiffness grows
        with the weight to be carried: Talos (90 kg) shakes its ankles with the admittance that suits 39 kg, and the ZMP
        is 85 mm off its reference instead of 34.

        Args:
            mass: Mass of the robot, kg.
        """
        admittance = min(0.05, 2.0 / mass) if self.cop_admittance is None else self.cop_admittance
        return replace(self, cop_admittance=admittance, min_force=self.min_force * force_scale(mass))
