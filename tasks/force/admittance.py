"""Admittance and damping: tasks on a frame that yields at a speed proportional to the wrench error."""

from __future__ import annotations

from typing import Unpack

import pinocchio as pin
from numpy.typing import ArrayLike

from wbc.core.arguments import checked
from wbc.core.errors import Array, check_options
from wbc.tasks.force.compliance import ComplianceTask, six
from wbc.tasks.options import ComplianceOptions, OffsetOptions


class AdmittanceTask(ComplianceTask):
    """Yield at a speed proportional to the wrench error, and keep the offset.

        velocity = admittance ∘ (measured − target wrench),   the reference pose is moved by it

    On surroundings of stiffness K, N/m or Nm/rad, the wrench error decays at admittance · K, 1/s, without overshoot
    if that is at most 1 / (4 · time constant). Without contact the frame moves on at the clamped speed, which searches
    for a touch-down. The offset can be bounded by `offset_bound`.

    Source: the rate form is that of mc_rtc's AdmittanceTask (jrl-umi3218/mc_rtc), with the low-pass as a time
    constant, and acceleration and velocity of the reference fed forward exactly.
    """

    _kind = "admittance"

    @checked
    def __init__(
        self,
        frame: str,
        target: pin.SE3 | None = None,
        *,
        admittance: ArrayLike,
        **options: Unpack[OffsetOptions],
    ) -> None:
        """Describe the task.

        Args:
            frame: Frame of the robot, or the name of a sole.
            target: Pose in the world at zero offset; the present one when None.
            admittance: Velocity per wrench error along the axes of the frame, shape (6,) or a pair (linear, angular),
                m/(N s) and rad/(Nm s). 1e-4 on ground of 1e5 N/m makes 10 1/s.
            **options: See `OffsetOptions`.
        """
        super().__init__(frame, target, **options)
        self.admittance = admittance

    @property
    def admittance(self) -> Array:
        """Velocity per wrench error, shape (6,), m/(N s) and rad/(Nm s); assign that or a pair (linear, angular)."""
        return self._admittance

    @admittance.setter
    def admittance(self, value: ArrayLike) -> None:
        self._admittance = six(self.name, "admittance (m/(N s), rad/(Nm s))", value)

    def comply(self, error: Array, rate: Array, dt: float) -> tuple[Array, Array]:
        """Return admittance ∘ error and its derivative; see `ComplianceTask.comply`."""
        return self._admittance * error, self._admittance * rate


class DampingTask(AdmittanceTask):
    """Yield at a speed proportional to the wrench error, without a moving reference.

        acceleration = damping · (admittance ∘ (measured − target wrench) − velocity) + stiffness · pose error

    A loop on the velocity: the damping is its bandwidth and must be well above the rate admittance · K at which the
    wrench error decays on surroundings of stiffness K. The small stiffness pulls towards the target pose; the wrench
    error that remains is stiffness · pose error / (damping · admittance). With a control period T the loop is stable
    for damping < 2 / T only, which is checked. Stiffness 1 1/s² and damping 300 1/s by default.

    Source: mc_rtc's DampingTask, with the gains that its walking stabilizer uses on feet in contact: stiffness
    1 1/s², damping 300 1/s.
    """

    integrates = False
    _kind = "damping"

    @checked
    def __init__(
        self,
        frame: str,
        target: pin.SE3 | None = None,
        *,
        admittance: ArrayLike,
        **options: Unpack[ComplianceOptions],
    ) -> None:
        """Describe the task; the arguments are those of `AdmittanceTask`, without an offset that could be bounded."""
        check_options(self, ComplianceOptions, options)
        options = {"stiffness": 1.0, "damping": 300.0, **options}
        super().__init__(frame, target, admittance=admittance, **options)
