"""Damping and admittance: a frame that moves at a speed proportional to the wrench error."""

from __future__ import annotations

from collections.abc import Sequence

import pinocchio as pin
from numpy.typing import ArrayLike

from wbc.core.errors import Array
from wbc.tasks.force.compliance import ComplianceTask, six
from wbc.tasks.motion.axes import POSE_AXES

VELOCITY_BOUND = (0.1, 0.3)
"""Clamp of the compliance velocity, m/s and rad/s: the bounds of mc_rtc's walking stabilizer on CoP tasks."""

SMOOTHING = 0.02
"""Time constant of the low-pass on the wrench error, s: mc_rtc's admittance keeps 0.8 of the last value each 5 ms."""


class AdmittanceTask(ComplianceTask):
    """Yield at a speed proportional to the wrench error, and stay where that has led.

        velocity = admittance ∘ (measured − target wrench),   the reference pose is moved by it

    On surroundings of stiffness K, N/m or Nm/rad, the wrench error decays at admittance · K, 1/s, without overshoot
    if that is at most 1 / (4 · time constant). Where there is nothing to push, the frame moves on at the clamped speed
    until there is: that is how a touch-down is sought. The reference can be held within `offset_bound` of the target.

    Source: the rate form is that of mc_rtc's AdmittanceTask (jrl-umi3218/mc_rtc), with the low-pass as a time
    constant, and acceleration and velocity of the reference fed forward exactly.
    """

    _kind = "admittance"

    def __init__(
        self,
        frame: str,
        target: pin.SE3 | None = None,
        *,
        admittance: ArrayLike,
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
            admittance: Velocity per wrench error along the axes of the frame, shape (6,) or a pair (linear, angular),
                m/(N s) and rad/(Nm s). 1e-4 on ground of 1e5 N/m makes 10 1/s.
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
        self._admittance = six(name, "admittance (m/(N s), rad/(Nm s))", admittance)
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
    def admittance(self) -> Array:
        """Velocity per wrench error, shape (6,), m/(N s) and rad/(Nm s); assign that or a pair (linear, angular)."""
        return self._admittance

    @admittance.setter
    def admittance(self, value: ArrayLike) -> None:
        self._admittance = six(self.name, "admittance (m/(N s), rad/(Nm s))", value)

    def comply(self, error: Array, rate: Array, dt: float) -> tuple[Array, Array]:
        """Velocity and acceleration are those of the filtered wrench error; see `ComplianceTask.comply`."""
        return self._admittance * error, self._admittance * rate


class DampingTask(AdmittanceTask):
    """Yield at a speed proportional to the wrench error, without a reference that moves along.

        acceleration = damping · (admittance ∘ (measured − target wrench) − velocity) + stiffness · pose error

    A loop on the velocity: the damping is its bandwidth and must be well above the rate admittance · K at which the
    wrench error decays on surroundings of stiffness K. The small stiffness pulls towards the target pose; what it
    leaves of the wrench error is stiffness · pose error / (damping · admittance). With a control period T the loop is
    stable for damping < 2 / T only, which is checked.

    Source: mc_rtc's DampingTask, with the gains that its walking stabilizer uses on feet in contact: stiffness
    1 1/s², damping 300 1/s.
    """

    integrates = False
    _kind = "damping"

    def __init__(
        self,
        frame: str,
        target: pin.SE3 | None = None,
        *,
        admittance: ArrayLike,
        target_wrench: ArrayLike | None = None,
        time_constant: float = SMOOTHING,
        velocity_bound: ArrayLike = VELOCITY_BOUND,
        axes: Sequence[str] = POSE_AXES,
        joints: Sequence[str] | None = None,
        name: str | None = None,
        weight: ArrayLike = 10.0,
        stiffness: ArrayLike = 1.0,
        damping: ArrayLike | None = 300.0,
        hard: bool = False,
    ) -> None:
        """Describe the task; the arguments are those of `AdmittanceTask`, without an offset that could be bounded.

        Raises:
            InputError: An unknown axis, or a value out of range.
        """
        super().__init__(
            frame,
            target,
            admittance=admittance,
            target_wrench=target_wrench,
            time_constant=time_constant,
            velocity_bound=velocity_bound,
            axes=axes,
            joints=joints,
            name=name,
            weight=weight,
            stiffness=stiffness,
            damping=damping,
            hard=hard,
        )
