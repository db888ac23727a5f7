"""Account of a machine's run: its phases, why it ended, and the times of all its ticks."""

from __future__ import annotations

import enum
from dataclasses import dataclass, field

import numpy as np

from wbc.base.numbers import Array
from wbc.machine.clock import Quiet

BUCKETS = (0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0)
"""Upper ends of the classes of the histogram, ms."""


class Phase(enum.Enum):
    """State of the loop, in the order of a run."""

    START = "start"
    HANG = "hanging"
    STAND = "balancing what the feet carry"
    RUN = "run"
    STOP = "stop"
    DAMPED = "damped"


@dataclass(frozen=True, eq=False)
class RunReport:
    """Report of a run.

    Attributes:
        reason: Reason of the end.
        phases: Phases, each with the time at which it began, s.
        ticks: Number of ticks.
        missed: Number of ticks that ended after the next one should have begun.
        skipped: Number of periods without a tick, because of late ticks.
        late: Delay of the wake-up of each tick, shape (ticks,), s.
        busy: Time of each tick from the wake-up until the command is sent, shape (ticks,), s.
        ages: Longest time between two measurements, s.
        quiet: Real-time settings that the operating system granted, and its interruptions of the run.
        period: Control period, s.
        blind: Reason why clouds of points were missing at some time of the run; empty if none were missing.
    """

    reason: str
    phases: tuple[tuple[Phase, float], ...]
    ticks: int
    missed: int
    skipped: int
    late: Array = field(repr=False)
    busy: Array = field(repr=False)
    ages: float
    quiet: Quiet
    period: float
    blind: str = ""

    def histogram(self) -> dict[str, list[int]]:
        """Return the number of ticks in each class of delay and of busy time; the last class has no upper bound."""
        edges = np.array([0.0, *BUCKETS, np.inf]) * 1e-3
        return {
            name: np.histogram(values, edges)[0].tolist()
            for name, values in (("late", self.late), ("busy", self.busy))
        }

    def __str__(self) -> str:
        lines = [
            f"{self.reason} after {self.ticks} ticks of {1e3 * self.period:g} ms",
            f"deadlines missed: {self.missed}, periods skipped: {self.skipped}; "
            f"longest time between measurements {1e3 * self.ages:.1f} ms",
            f"memory locked: {'yes' if self.quiet.memory_locked else 'no'}, real-time priority: "
            f"{self.quiet.priority or 'no'}, page faults from disk {self.quiet.page_faults[0]}, garbage collections "
            f"{self.quiet.collections}",
            *([f"no clouds of points: {self.blind}"] if self.blind else ()),
            f"{'ms up to':>12}{'late':>10}{'busy':>10}",
        ]
        counts = self.histogram()
        for i, end in enumerate([*BUCKETS, np.inf]):
            lines.append(f"{end:>12g}{counts['late'][i]:>10}{counts['busy'][i]:>10}")
        return "\n".join(lines)
