"""Impedance: a task on a frame that yields to the wrench error like a mass on a spring and a damper."""

from __future__ import annotations

from typing import Unpack

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from wbc.base.checked import checked
from wbc.base.numbers import Array, read_only
from wbc.tasks.force.compliance import ComplianceOptions, ComplianceTask, six

SMOOTHING = 0.05
"""Time constant of the low-pass on the wrench error, s: cut-off period of mc_rtc's ImpedanceTask."""

VELOCITY_BOUND = (1.0, 3.0)
"""Clamp of the compliance velocity, m/s and rad/s; ours: the speed of a hand, beyond what a spring should do."""

SPRING = (1000.0, 100.0)
"""N/m and Nm/rad; ours: 10 N move the frame by 1 cm, 10 Nm turn it by 0.1 rad."""

MASS = (10.0, 1.0)
"""kg and kg m²; ours: with the springs, 10 rad/s undamped in all axes."""


class ImpedanceTask(ComplianceTask):
    """Task whose frame yields to the wrench error like a mass on a spring and a damper.

        mass ∘ acceleration + damper ∘ velocity + spring ∘ offset = measured − target wrench

    The offset converges to wrench error / spring, and back to zero when the wrench error ends. Without a mass its time
    constant is damper / spring. By default the time constant of the low-pass is 0.05 s, and the velocity bound is 1 m/s
    and 3 rad/s.

    In contact with surroundings of stiffness K the loop through the low-pass is stable if damper > time constant · K (a
    sufficient condition, by Routh's criterion). For stiff surroundings choose a shorter time constant, more damping, or
    no mass: without a mass the loop is always stable.

    Source: the law is that of mc_rtc's ImpedanceTask (jrl-umi3218/mc_rtc), without a mass that of its
    FirstOrderImpedanceTask, integrated implicitly, so that no choice of mass, damper and control period is unstable by
    itself.
    """

    __slots__ = ("_damper", "_mass", "_spring")
    law = "impedance"

    @checked
    def __init__(
        self,
        frame: str,
        target: pin.SE3 | None = None,
        *,
        mass: ArrayLike = MASS,
        spring: ArrayLike = SPRING,
        damper: ArrayLike | None = None,
        **options: Unpack[ComplianceOptions],
    ) -> None:
        """Describe the task.

        Args:
            frame: Frame of the robot, or the name of a sole.
            target: Pose in the world without an offset; the present pose when None.
            mass: Mass along the axes of the frame, shape (6,) or a pair (linear, angular), kg and kg m², ≥ 0. With zero
                the frame yields like a spring and a damper in parallel.
            spring: Stiffness along the same axes, shape (6,) or a pair, N/m and Nm/rad, ≥ 0.
            damper: Damping along the same axes, shape (6,) or a pair, Ns/m and Nms/rad, > 0; critical, 2·√(mass ·
                spring), when None.
            **options: See `ComplianceOptions`.
        """
        options = {"time_constant": SMOOTHING, "velocity_bound": VELOCITY_BOUND, **options}
        super().__init__(frame, target, **options)
        self.mass, self.spring = mass, spring
        self.damper = 2.0 * np.sqrt(self._mass * self._spring) if damper is None else damper

    @property
    def mass(self) -> Array:
        """Mass, shape (6,), kg and kg m²; assign an array of this shape or a pair (linear, angular)."""
        return read_only(self._mass)

    @mass.setter
    def mass(self, value: ArrayLike) -> None:
        self._mass = six(self.name, "mass (kg, kg m²)", value)

    @property
    def spring(self) -> Array:
        """Stiffness, shape (6,), N/m and Nm/rad; assign an array of this shape or a pair (linear, angular)."""
        return read_only(self._spring)

    @spring.setter
    def spring(self, value: ArrayLike) -> None:
        self._spring = six(self.name, "spring (N/m, Nm/rad)", value)

    @property
    def damper(self) -> Array:
        """Damping, shape (6,), Ns/m and Nms/rad; assign an array of this shape or a pair (linear, angular)."""
        return read_only(self._damper)

    @damper.setter
    def damper(self, value: ArrayLike) -> None:
        self._damper = six(self.name, "damper (Ns/m, Nms/rad)", value, above_zero=True)

    def comply(self, error: Array, rate: Array, dt: float) -> tuple[Array, Array]:
        """Solve the law for velocity and offset at the end of the period; see `ComplianceTask.comply`."""
        mass, spring, damper = self._mass, self._spring, self._damper
        force = error - spring * self.offset_vector()
        velocity = (mass * self._velocity + dt * force) / (mass + dt * damper + dt * dt * spring)
        massless = (rate - spring * velocity) / damper
        return velocity, np.where(mass > 0.0, (velocity - self._velocity) / dt, massless)
