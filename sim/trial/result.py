"""Base of the results of all trials."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class TrialResult:
    """Result of a trial; what follows from the spec alone is the same bit for bit in every run.

    Attributes:
        robot: Name of the robot.
        seed: Seed.
        seconds: Simulated time, s.
        failures: Ticks without a solution or with an unusable measurement.
    """

    robot: str
    seed: int
    seconds: float
    failures: int
