"""Impedance: a frame that yields to the wrench error like a mass on a spring and a damper."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from wbc.core.errors import Array
from wbc.tasks.force.compliance import ComplianceTask, six
from wbc.tasks.motion.axes import POSE_AXES

SMOOTHING = 0.05
"""Time constant of the low-pass on the wrench error, s: cut-off period of mc_rtc's ImpedanceTask."""

VELOCITY_BOUND = (1.0, 3.0)
"""Clamp of the compliance velocity, m/s and rad/s; ours: the speed of a hand, beyond what a spring should do."""

SPRING = (1000.0, 100.0)
"""N/m and Nm/rad; ours: 10 N move the frame by 1 cm, 10 Nm turn it by 0.1 rad."""

MASS = (10.0, 1.0)
"""kg and kg m²; ours: with the springs, 10 rad/s undamped in all axes."""

DAMPER = (100.0, 10.0)
"""Ns/m and Nms/rad of the first-order law; ours: with the springs, a time constant of 0.1 s."""


class FirstOrderImpedanceTask(ComplianceTask):
    """Yield to the wrench error like a spring and a damper side by side.

        damper ∘ velocity + spring ∘ offset = wrench gain ∘ (measured − target wrench)

    The offset settles at wrench error · gain / spring, with the time constant damper / spring, and goes back to
    zero when nothing pushes any more.

    Source: the law is that of mc_rtc's FirstOrderImpedanceTask (jrl-umi3218/mc_rtc), integrated implicitly, so that
    no choice of damper and control period is unstable by itself.
    """

    _kind = "first-order impedance"

    def __init__(
        self,
        frame: str,
        target: pin.SE3 | None = None,
        *,
        spring: ArrayLike = SPRING,
        damper: ArrayLike = DAMPER,
        wrench_gain: ArrayLike = (1.0, 1.0),
        target_wrench: ArrayLike | None = None,
        time_constant: float = SMOOTHING,
        velocity_bound: ArrayLike = VELOCITY_BOUND,
        offset_bound: ArrayLike | None = None,
        axes: Sequence[str] = POSE_AXES,
        joints: Sequence[str] | None = None,
        name: str | None = None,
        weight: ArrayLike = 10.0,
        stiffness: ArrayLike = 100.0,
        damping: ArrayLike | None = None,
        hard: bool = False,
    ) -> None:
        """Describe the task.

        Args:
            frame: Frame of the robot, or the name of a sole.
            target: Pose in the world when nothing pushes; the present one when None.
            spring: Along the axes of the frame, shape (6,) or a pair (linear, angular), N/m and Nm/rad, ≥ 0.
            damper: Same, Ns/m and Nms/rad, above zero.
            wrench_gain: Share of the wrench error that is felt, shape (6,) or a pair, ≥ 0.
            target_wrench: What the surroundings shall do to the robot, [force; moment] in the frame, shape (6,), N and
                Nm; zero when None.
            time_constant: Of the low-pass on the wrench error, s; none when 0.
            velocity_bound: Clamp of the compliance velocity, shape (6,) or a pair, m/s and rad/s.
            offset_bound: Greatest offset of the reference, shape (6,) or a pair, m and rad; none when None.
            axes: Axes of the frame that matter, out of x, y, z, roll, pitch, yaw.
            joints: Joints that may be used, "base" for the floating base; all of them when None.
            name: Name of the task; made from the frame when None.
            weight: Cost per (m/s²)² and (rad/s²)².
            stiffness: Of the way the frame follows its reference, 1/s².
            damping: Same, 1/s; critical when None.
            hard: Make it a constraint.

        Raises:
            InputError: An unknown axis, or a value out of range.
        """
        name = name or f"{frame} {self._kind}"
        self._spring = six(name, "spring (N/m, Nm/rad)", spring)
        self._damper = six(name, "damper (Ns/m, Nms/rad)", damper, above_zero=True)
        self._wrench_gain = six(name, "wrench gain", wrench_gain)
        super().__init__(
            frame,
            target,
            target_wrench,
            time_constant=time_constant,
            velocity_bound=velocity_bound,
            offset_bound=offset_bound,
            axes=axes,
            joints=joints,
            name=name,
            weight=weight,
            stiffness=stiffness,
            damping=damping,
            hard=hard,
        )

    @property
    def spring(self) -> Array:
        """Shape (6,), N/m and Nm/rad; assign that or a pair (linear, angular)."""
        return self._spring

    @spring.setter
    def spring(self, value: ArrayLike) -> None:
        self._spring = six(self.name, "spring (N/m, Nm/rad)", value)

    @property
    def damper(self) -> Array:
        """Shape (6,), Ns/m and Nms/rad; assign that or a pair (linear, angular)."""
        return self._damper

    @damper.setter
    def damper(self, value: ArrayLike) -> None:
        self._damper = six(self.name, "damper (Ns/m, Nms/rad)", value, above_zero=True)

    @property
    def wrench_gain(self) -> Array:
        """Share of the wrench error that is felt, shape (6,); assign that or a pair (linear, angular)."""
        return self._wrench_gain

    @wrench_gain.setter
    def wrench_gain(self, value: ArrayLike) -> None:
        self._wrench_gain = six(self.name, "wrench gain", value)

    def comply(self, error: Array, rate: Array, dt: float) -> tuple[Array, Array]:
        """Solve the law for the velocity at the end of the period; see `ComplianceTask.comply`."""
        force = self._wrench_gain * error - self._spring * self.offset_vector()
        velocity = force / (self._damper + dt * self._spring)
        return velocity, (self._wrench_gain * rate - self._spring * velocity) / self._damper


class ImpedanceTask(FirstOrderImpedanceTask):
    """Yield to the wrench error like a mass on a spring and a damper.

        mass ∘ acceleration + damper ∘ velocity + spring ∘ offset = wrench gain ∘ (measured − target wrench)

    On surroundings of stiffness K the loop through the low-pass is stable for damper > time constant · K (Routh's
    criterion, sufficient): on stiff ones take a shorter time constant, more damping or `FirstOrderImpedanceTask`, which
    is always stable.

    Source: the law is that of mc_rtc's ImpedanceTask (jrl-umi3218/mc_rtc), integrated implicitly, so that no choice of
    mass, damper and control period is unstable by itself.
    """

    _kind = "impedance"

    def __init__(
        self,
        frame: str,
        target: pin.SE3 | None = None,
        *,
        mass: ArrayLike = MASS,
        spring: ArrayLike = SPRING,
        damper: ArrayLike | None = None,
        wrench_gain: ArrayLike = (1.0, 1.0),
        target_wrench: ArrayLike | None = None,
        time_constant: float = SMOOTHING,
        velocity_bound: ArrayLike = VELOCITY_BOUND,
        offset_bound: ArrayLike | None = None,
        axes: Sequence[str] = POSE_AXES,
        joints: Sequence[str] | None = None,
        name: str | None = None,
        weight: ArrayLike = 10.0,
        stiffness: ArrayLike = 100.0,
        damping: ArrayLike | None = None,
        hard: bool = False,
    ) -> None:
        """Describe the task; the arguments are those of `FirstOrderImpedanceTask`, and these.

        Args:
            frame: Frame of the robot, or the name of a sole.
            target: Pose in the world when nothing pushes; the present one when None.
            mass: Along the axes of the frame, shape (6,) or a pair (linear, angular), kg and kg m², above zero.
            spring: Same, N/m and Nm/rad, ≥ 0.
            damper: Same, Ns/m and Nms/rad, above zero; critical, 2·√(mass · spring), when None.
            wrench_gain: Share of the wrench error that is felt.
            target_wrench: Wrench at which nothing yields.
            time_constant: Of the low-pass on the wrench error, s.
            velocity_bound: Clamp of the compliance velocity.
            offset_bound: Greatest offset of the reference.
            axes: Axes of the frame that matter.
            joints: Joints that may be used.
            name: Name of the task.
            weight: Cost per (m/s²)² and (rad/s²)².
            stiffness: Of the way the frame follows its reference, 1/s².
            damping: Same, 1/s; critical when None.
            hard: Make it a constraint.

        Raises:
            InputError: An unknown axis, or a value out of range; a spring of zero without a damper.
        """
        label = name or f"{frame} {self._kind}"
        self._mass = six(label, "mass (kg, kg m²)", mass, above_zero=True)
        if damper is None:
            damper = 2.0 * np.sqrt(self._mass * six(label, "spring (N/m, Nm/rad)", spring))
        super().__init__(
            frame,
            target,
            spring=spring,
            damper=damper,
            wrench_gain=wrench_gain,
            target_wrench=target_wrench,
            time_constant=time_constant,
            velocity_bound=velocity_bound,
            offset_bound=offset_bound,
            axes=axes,
            joints=joints,
            name=name,
            weight=weight,
            stiffness=stiffness,
            damping=damping,
            hard=hard,
        )

    @property
    def mass(self) -> Array:
        """Shape (6,), kg and kg m²; assign that or a pair (linear, angular)."""
        return self._mass

    @mass.setter
    def mass(self, value: ArrayLike) -> None:
        self._mass = six(self.name, "mass (kg, kg m²)", value, above_zero=True)

    def comply(self, error: Array, rate: Array, dt: float) -> tuple[Array, Array]:
        """Solve the law for velocity and offset at the end of the period; see `ComplianceTask.comply`."""
        force = self._wrench_gain * error - self._spring * self.offset_vector()
        mass = self._mass
        velocity = (mass * self._velocity + dt * force) / (mass + dt * self._damper + dt * dt * self._spring)
        return velocity, (velocity - self._velocity) / dt
