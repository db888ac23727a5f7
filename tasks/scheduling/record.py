"""When a sole's stiffness is decided, and what is written down about each step."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

from wbc.core.errors import InputError, finite_scalar, non_negative, positive
from wbc.feet.sensing.scan import Profile, ScanSettings
from wbc.feet.stiffness.roughness import LEAST_SAMPLES
from wbc.tasks.scheduling.policies import StiffnessDecision


@dataclass(frozen=True)
class StiffnessTiming:
    """When to scan, decide and give up.

    Attributes:
        scan_from: Share of the single support at which scanning starts.
        decide_at: Share of the single support at which the stiffness is decided; the rest is for the actuator.
        deadline: Least time before the landing at which a stiffness may still be changed, s.
        early_landing: How much before its time a landing may come, s: only what is reached even then is commanded.
        min_length: Shortest profile that is good enough, m.
        min_coverage: Least share of a profile's samples that must have been seen.
        fallback: Stiffness to command when there is no decision, Nm/rad; None keeps the last one.
        tolerance: How near the actual stiffness must be to count as reached, Nm/rad.
        sensor_rate: Readings per second of the range sensor, which holds its last reading in between; 0 for one that
            reads at every tick.
        scan: How hits become a profile.
        history: Number of steps that are remembered.

    Source: the paper decides at 75 % of the single support (section IV-C). On rough ground a foot lands before its
    time, on 40 mm stones by up to 0.25 s, and the actuator needs 0.2 s for its whole range: hence 55 %, and 0.25 s for
    an early landing. With 65 % and 0.15 s, 94 % of the soles had reached what was commanded on grounds of 40 and
    55 mm, now 99 %; but one in three is now commanded less than was wanted, instead of one in six. 0.15 m is half of
    what the toe passes over in a step of 0.145 m; deadline and tolerance are chosen here.
    """

    scan_from: float = 0.0
    decide_at: float = 0.55
    deadline: float = 0.05
    early_landing: float = 0.25
    min_length: float = 0.15
    min_coverage: float = 0.5
    fallback: float | None = None
    tolerance: float = 0.5
    sensor_rate: float = 0.0
    scan: ScanSettings = field(default_factory=ScanSettings)
    history: int = 1000

    def __post_init__(self) -> None:
        start = finite_scalar("share of the single support to scan from", self.scan_from, low=0.0, high=1.0)
        finite_scalar(
            "share of the single support to decide at", self.decide_at, low=start, high=1.0, open_low=True
        )
        non_negative("deadline of the stiffness (s)", self.deadline)
        non_negative("early landing (s)", self.early_landing)
        least = (LEAST_SAMPLES - 1) * self.scan.step
        finite_scalar("shortest profile (m)", self.min_length, low=least)
        finite_scalar("least coverage of a profile", self.min_coverage, low=0.0, high=1.0)
        if self.fallback is not None:
            non_negative("fallback stiffness (Nm/rad)", self.fallback)
        positive("tolerance of the stiffness (Nm/rad)", self.tolerance)
        non_negative("rate of the range sensor (Hz)", self.sensor_rate)
        if isinstance(self.history, bool) or int(self.history) != self.history or self.history < 1:
            raise InputError(f"history must be a whole number of at least 1, got {self.history!r}")


@dataclass(frozen=True, eq=False)
class StepStiffness:
    """What happened to the stiffness in one swing.

    Attributes:
        side: The foot that swung.
        step: Number of the swing since the start, from 0.
        commanded: Stiffness at the landing as commanded, Nm/rad.
        actual: Stiffness at the landing as measured, Nm/rad; NaN for a sole without a sensor.
        reached: True if the two agree within the tolerance.
        wanted: What the policy or the fallback wanted, Nm/rad; differs from `commanded` where the actuator could not
            have made it in time. NaN if nothing was decided.
        fallback: Why there was no decision of the policy; None if there was one.
        decision: What the policy said, None if it was not asked or had no opinion.
        profile: Ground as scanned; None if too little was seen.
        decided_before: Time from the decision to the landing, s; NaN if nothing was decided.
        planned_before: The same as it was planned at the decision, s; NaN if nothing was decided.
        computing: Time that profile and policy took, s.
    """

    side: str
    step: int
    commanded: float
    actual: float = math.nan
    reached: bool = False
    wanted: float = math.nan
    fallback: str | None = None
    decision: StiffnessDecision | None = None
    profile: Profile | None = None
    decided_before: float = math.nan
    planned_before: float = math.nan
    computing: float = 0.0

    def as_dict(self) -> dict[str, Any]:
        """JSON-able values; names carry the units, None stands for what is not known."""
        decision, profile = self.decision, self.profile
        return {
            "side": self.side,
            "step": self.step,
            "commanded_nm_per_rad": self.commanded,
            "actual_at_landing_nm_per_rad": _known(self.actual),
            "reached": self.reached,
            "wanted_nm_per_rad": _known(self.wanted),
            "fallback": self.fallback,
            "cluster": None if decision is None else decision.cluster,
            "familiar": None if decision is None else decision.familiar,
            "distance": None if decision is None else decision.distance,
            "features": None if decision is None else dict(decision.features),
            "profile_m": None if profile is None else profile.length,
            "coverage": None if profile is None else profile.coverage,
            "seconds_before_landing": _known(self.decided_before),
            "decision_us": 1e6 * self.computing,
        }


def _known(value: float) -> float | None:
    return value if math.isfinite(value) else None
