"""Gains of the stabilizer, in physical units: what is too large is clamped and said."""

from __future__ import annotations

import logging
import math
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

from wbc.core.errors import InputError, non_negative, positive, unknown_name

logger = logging.getLogger(__name__)

Pair = tuple[float, float]
"""Forward and sideways, in the yaw frame of the robot."""

LIMITS = {
    "dcm_p": 20.0,
    "dcm_i": 100.0,
    "dcm_d": 5.0,
    "com_v": 10.0,
    "zmp_d": 10.0,
    "height_p": 400.0,
    "height_d": 40.0,
    "cop_admittance": 0.1,
    "force_difference": 2e-3,
    "force_difference_damping": 10.0,
    "com_admittance": 20.0,
}
"""Greatest gains, from mc_rtc's safety thresholds; dcm_d is let up to the range of Frizza et al. (5 instead of 2),
force_difference to 2e-3 instead of 5e-4 m/(N·s), and the height gains, which mc_rtc has not, to a 20 1/s pole."""


def pair(value: Pair | float) -> Pair:
    """Both directions of a gain that may be given as one number."""
    return value if isinstance(value, tuple) else (value, value)


PAIRS = ("dcm_p", "dcm_i", "dcm_d", "com_v", "zmp_d", "cop_admittance", "com_admittance")


@dataclass(frozen=True)
class StabilizerGains:
    """Gains, time constants and bounds. Pairs may be given as one number for both directions.

    The default is what a first walk on all soles worked best with: a quick transfer of load, a CoP admittance
    that goes with torque feed-forward, and filtered wrenches. `legacy` is mc_rtc's plain law.

    Attributes:
        dcm_p: Proportional gain on the DCM error, 1/s: the closed-loop pole if the CoP followed at once.
        dcm_i: Gain on the average DCM error, 1/s.
        dcm_d: Gain on the derivative of the DCM error; it feeds the noise of the measured ZMP back, which on hard soles
            costs more than the damping gives: DCM errors of 8 against 6 mm on flat floor, 17 against 7 mm at 2 ms.
        com_v: Gain on the CoM velocity error.
        zmp_d: Lead of the ZMP's velocity, s.
        height_p: Stiffness of the CoM height in the desired force, 1/s².
        height_d: Damping of the CoM height in the desired force, 1/s.
        integrator_time: Memory of the average, s.
        derivator_time: Below it the derivative is measured or left out, s.
        cop_admittance: Ankle rotation per CoP torque error, rad/(Nm·s), along x (pitch) and y (roll). None: 0.05, or
            less for a robot of more than 40 kg, see `for_mass`.
        force_difference: Foot height per difference of normal forces, m/(N·s).
        force_difference_damping: Decay of the feet's height difference, 1/s.
        height_leak: Decay of the feet's mean height on both feet, 1/s.
        support_height_leak: Decay of the support foot's height on one foot, 1/s.
        rotation_leak: Decay of the ankle rotation, 1/s.
        com_admittance: CoM velocity per ZMP error, 1/s.
        com_admittance_leak: Decay of the CoM's offset, 1/s.
        wrench_time: Low-pass of the measured wrenches before the admittances, s.
        max_average_dcm_error: Bound of the average, m.
        max_com_offset: Bound of the CoM's offset, m.
        max_angular_velocity: Bound of the ankle rotation's speed, rad/s: on a stone a foot may have to turn by 10°
            to be carried elsewhere, and the DCM grows e-fold in 0.3 s meanwhile.
        max_linear_velocity: Bound of the foot's vertical speed, m/s.
        max_rotation: Bound of the ankle rotation, rad.
        max_height: Bound of the foot's height offset, m.
        min_force: Both feet below it means in the air, N.
    """

    dcm_p: Pair | float = 4.0
    dcm_i: Pair | float = 0.0
    dcm_d: Pair | float = 0.0
    com_v: Pair | float = 1.0
    zmp_d: Pair | float = 0.0
    height_p: float = 0.0
    height_d: float = 0.0
    integrator_time: float = 10.0
    derivator_time: float = 1.0
    cop_admittance: Pair | float | None = None
    force_difference: float = 5e-4
    force_difference_damping: float = 0.0
    height_leak: float = 1.0
    support_height_leak: float = 3.0
    rotation_leak: float = 0.0
    com_admittance: Pair | float = 0.0
    com_admittance_leak: float = 0.1
    wrench_time: float = 0.02
    max_average_dcm_error: float = 0.05
    max_com_offset: float = 0.05
    max_angular_velocity: float = 1.0
    max_linear_velocity: float = 0.1
    max_rotation: float = 0.4
    max_height: float = 0.05
    min_force: float = 15.0

    def __post_init__(self) -> None:
        for field in fields(self):
            name, value = field.name, getattr(self, field.name)
            if name == "cop_admittance" and value is None:
                continue
            if name in PAIRS:
                object.__setattr__(self, name, self._pair(name, value))
            elif name in ("integrator_time", "derivator_time"):
                positive(f"{name} (s)", value)
            elif name.startswith("max_"):
                positive(name, value)
            else:
                value = non_negative(name, value)
                limit = LIMITS.get(name, math.inf)
                if value > limit:
                    logger.warning("gain %s of %g clamped to %g", name, value, limit)
                    object.__setattr__(self, name, limit)

    @staticmethod
    def _pair(name: str, value: Pair | float) -> Pair:
        pair = tuple(value) if isinstance(value, Sequence) else (value, value)
        if len(pair) != 2:
            raise InputError(f"gain {name} must be one number or (forward, sideways), got {value!r}")
        limit = LIMITS[name]
        x, y = (non_negative(f"gain {name}", v) for v in pair)
        if max(x, y) > limit:
            logger.warning("gain %s of %g clamped to %g", name, max(x, y), limit)
        return min(x, limit), min(y, limit)

    @staticmethod
    def legacy() -> StabilizerGains:
        """mc_rtc's plain law with the gains of its HRP-4 family: nothing filtered, nothing adapted."""
        return StabilizerGains(
            dcm_d=0.0,
            cop_admittance=0.01,
            force_difference=1e-4,
            support_height_leak=0.0,
            wrench_time=0.0,
            max_angular_velocity=0.3,
        )

    @staticmethod
    def preset(name: str) -> StabilizerGains:
        """Gains by name: "default" or "legacy".

        Raises:
            UnknownNameError: Another name.
        """
        presets = {"default": StabilizerGains, "legacy": StabilizerGains.legacy}
        if name not in presets:
            unknown_name("gain preset", name, presets)
        return presets[name]()

    def for_mass(self, mass: float) -> StabilizerGains:
        """The gains with what depends on the robot's mass filled in.

        A loop that turns an ankle against the ground is as quick as admittance times stiffness, and stiffness grows
        with the weight to be carried: Talos (90 kg) shakes its ankles with the admittance that suits 39 kg, and the ZMP
        is 85 mm off its reference instead of 34.

        Args:
            mass: Of the robot, kg.
        """
        if self.cop_admittance is not None:
            return self
        return replace(self, cop_admittance=min(0.05, 2.0 / positive("mass (kg)", mass)))

    def changed(self, **values: Pair | float) -> StabilizerGains:
        """The gains with some replaced.

        Raises:
            UnknownNameError: A gain that does not exist; the nearest names are given.
            InputError: A value that is negative or not a number.
        """
        names = [field.name for field in fields(self)]
        for name in values:
            if name not in names:
                unknown_name("gain", name, names)
        return replace(self, **values)  # type: ignore[arg-type]
