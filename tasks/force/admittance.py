"""Admittance: a task on a frame that yields at a speed proportional to the wrench error."""

from __future__ import annotations

from typing import Unpack

import pinocchio as pin
from numpy.typing import ArrayLike

from wbc.base.checked import checked
from wbc.base.numbers import Array, read_only
from wbc.tasks.force.compliance import ComplianceOptions, ComplianceTask, six


class AdmittanceTask(ComplianceTask):
    """Task whose frame yields at a velocity proportional to the wrench error, and keeps its offset.

        velocity = admittance ∘ (measured − target wrench), which moves the reference pose

    In contact with surroundings of stiffness K, N/m or Nm/rad, the wrench error decays with the rate admittance · K,
    1/s. There is no overshoot if this rate is at most 1 / (4 · time constant). Without contact the frame moves on at
    the bounded velocity, and so searches for contact. `offset_bound` can bound the offset.

    Source: the rate form is that of mc_rtc's AdmittanceTask (jrl-umi3218/mc_rtc), with the low-pass as a time
    constant, and acceleration and velocity of the reference fed forward exactly.
    """

    __slots__ = ("_admittance",)
    law = "admittance"

    @checked
    def __init__(
        self,
        frame: str,
        target: pin.SE3 | None = None,
        *,
        admittance: ArrayLike,
        **options: Unpack[ComplianceOptions],
    ) -> None:
        """Describe the task.

        Args:
            frame: See `ComplianceTask`.
            target: See `ComplianceTask`.
            admittance: Velocity per wrench error along the axes of the frame, shape (6,) or a pair (linear, angular),
                m/(N s) and rad/(Nm s). For example, 1e-4 m/(N s) on ground of 1e5 N/m gives a rate of 10 1/s.
            **options: See `ComplianceOptions`.
        """
        super().__init__(frame, target, **options)
        self.admittance = admittance

    @property
    def admittance(self) -> Array:
        """Velocity per wrench error, shape (6,), m/(N s) and rad/(Nm s); assign this or a pair (linear, angular)."""
        return read_only(self._admittance)

    @admittance.setter
    def admittance(self, value: ArrayLike) -> None:
        self._admittance = six(self.name, "admittance (m/(N s), rad/(Nm s))", value)

    def comply(self, error: Array, rate: Array, dt: float) -> tuple[Array, Array]:
        """Return admittance ∘ error and its derivative; see `ComplianceTask.comply`."""
        return self._admittance * error, self._admittance * rate
