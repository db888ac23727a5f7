"""Settings of stiffness scheduling, and the record of each step."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Annotated, Any

from pydantic import Field

from wbc.base.errors import InputError
from wbc.base.settings import Count, NonNegative, Positive, Share, settings
from wbc.feet.sensing.roughness import LEAST_SAMPLES
from wbc.feet.sensing.scan import Profile, ScanSettings
from wbc.tasks.scheduling.policies import StiffnessDecision


@settings
class StiffnessTiming:
    """Settings of stiffness scheduling: when to scan, to decide and to fall back.

    Attributes:
        scan_from: Share of the single support at which scanning starts.
        decide_at: Share of the single support at which the stiffness is decided; the rest is for the actuator.
        deadline: Shortest time before the landing at which a stiffness may still be changed, s.
        early_landing: Longest time by which a foot may land early, s: only a stiffness reached even then is commanded.
        min_length: Shortest profile that a policy is asked about, m.
        min_coverage: Smallest share of a profile's samples that must have been seen.
        fallback: Stiffness to command when there is no decision, Nm/rad; None keeps the last one.
        tolerance: Largest difference of actual and commanded stiffness that counts as reached, as a share.
        sensor_rate: Readings per second of the range sensor, which holds its last reading in between, Hz; 0 for one
            that reads at every tick.
        scan: Settings of the profile.
        history: Number of steps that are recorded.

    Source: the paper decides at 75 % of the single support (section IV-C). On rough ground a foot lands early, on
    40 mm stones by up to 0.25 s, and the actuator needs 0.2 s for its whole range: hence 55 %, and 0.25 s for an early
    landing. On grounds of 40 and 55 mm 99 % of the soles then reach the commanded stiffness, and one in three is
    commanded less than the policy asked for; with 65 % and 0.15 s these are 94 % and one in six. 0.15 m is half of
    what the toe passes over in a step of 0.145 m; deadline and tolerance are chosen here.
    """

    scan_from: Share = 0.0
    decide_at: Share = 0.55
    deadline: Annotated[NonNegative, "s"] = 0.05
    early_landing: Annotated[NonNegative, "s"] = 0.25
    min_length: Annotated[Positive, "m"] = 0.15
    min_coverage: Share = 0.5
    fallback: Annotated[NonNegative, "Nm/rad"] | None = None
    tolerance: Annotated[float, Field(gt=0.0, lt=1.0)] = 0.05
    sensor_rate: Annotated[NonNegative, "Hz"] = 0.0
    scan: ScanSettings = field(default_factory=ScanSettings)
    history: Count = 1000

    def __post_init__(self) -> None:
        if self.decide_at <= self.scan_from:
            raise InputError(
                f"decide_at must be above scan_from = {self.scan_from:g}, got {self.decide_at:g}"
            )
        shortest = (LEAST_SAMPLES - 1) * self.scan.step
        if self.min_length < shortest:
            raise InputError(
                f"min_length (m) must be at least {shortest:g}, {LEAST_SAMPLES} samples, got {self.min_length:g}"
            )


@dataclass(frozen=True, eq=False)
class StepStiffness:
    """Record of the stiffness of one swing.

    Attributes:
        requested: Stiffness asked for by policy or fallback, Nm/rad; differs from `commanded` if the actuator could
            not have reached it in time. NaN if nothing was decided.
    """

    side: str  # the foot that swung
    step: int  # number of the swing since the start, from 0
    commanded: float  # stiffness at the landing as commanded, Nm/rad
    actual: float = math.nan  # stiffness at the landing as measured, Nm/rad; NaN for a sole without a sensor
    reached: bool = False  # True if the two agree within the tolerance
    requested: float = math.nan
    fallback: str | None = None  # reason for using the fallback; None if the policy decided
    decision: StiffnessDecision | None = None  # answer of the policy; None if it was not asked or gave none
    profile: Profile | None = None  # ground as scanned; None if too little was seen
    compliance: float = 0.0  # depth of a foot over its load that was felt before the decision, m/N
    decided_before: float = math.nan  # time from the decision to the landing, s; NaN if nothing was decided
    planned_before: float = math.nan  # the same as planned at the decision, s; NaN if nothing was decided
    computing: float = 0.0  # wall time of profile and policy, s

    def as_dict(self) -> dict[str, Any]:
        """Return the record as JSON values; names carry the units, None stands for unknown values."""
        decision, profile = self.decision, self.profile
        return {
            "side": self.side,
            "step": self.step,
            "commanded_nm_per_rad": self.commanded,
            "actual_at_landing_nm_per_rad": _finite_or_none(self.actual),
            "reached": self.reached,
            "wanted_nm_per_rad": _finite_or_none(self.requested),
            "fallback": self.fallback,
            "cluster": None if decision is None else decision.cluster,
            "familiar": None if decision is None else decision.familiar,
            "distance": None if decision is None else decision.distance,
            "features": None if decision is None else dict(decision.features),
            "compliance_m_per_n": self.compliance,
            "profile_m": None if profile is None else profile.length,
            "coverage": None if profile is None else profile.coverage,
            "seconds_before_landing": _finite_or_none(self.decided_before),
            "decision_us": 1e6 * self.computing,
        }


def as_good_as(one: float, other: float, tolerance: float) -> bool:
    """Return True if two stiffnesses differ by no more than a share of the larger one."""
    return abs(one - other) <= tolerance * max(one, other)


def _finite_or_none(value: float) -> float | None:
    return value if math.isfinite(value) else None
