"""Account of a machine's run: its phases, why it ended, and the times of all its ticks."""

from __future__ import annotations

import enum
from dataclasses import dataclass, field

import numpy as np

from wbc.base.numbers import Array
from wbc.machine.clock import Quiet

BUCKETS = (0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0)
"""Upper ends of the classes of the histogram, ms."""


KEPT = 1 << 20
"""Ticks whose times are kept: 35 minutes at 500 Hz; later ones replace the first."""


def _room() -> Array:
    """Return room for the times of ticks, touched, so that no page fault waits in the loop."""
    return np.full(KEPT, 0.0)


class Phase(enum.Enum):
    """State of the loop, in the order of a run."""

    START = "start"
    """The servos hold the measured posture, and then take the joints to half-sitting."""
    HANG = "hanging"
    """The legs move until the soles are level and under the centre of mass, and hold that until they touch ground."""
    STAND = "balancing what the feet carry"
    """The feet carry a part of the weight, and a balance controller acts until they carry the robot."""
    RUN = "run"
    """The control of the run acts."""
    STOP = "stop"
    """The robot sinks."""
    DAMPED = "damped"
    """The run is over, and the joints are damped."""


@dataclass(eq=False)
class RunReport:
    """Report of a run on a machine: reason of its end, late ticks, and times.

    Attributes:
        period: Control period, s.
        reason: Reason of the end.
        phases: Phases, each with the time at which it began, s.
        ticks: Number of ticks.
        missed: Number of ticks that ended after the next one should have begun.
        skipped: Number of periods without a tick, because of late ticks.
        late: Delay of the wake-up of each tick, shape (ticks,), s; until the end of the run, room for those of all.
        busy: Time of each tick from the wake-up until the command is sent, shape (ticks,), s; as `late`.
        ages: Longest time between two measurements, s.
        quiet: Real-time settings that the operating system granted, and its interruptions of the run.
        blind: Last reason why clouds of points were missing in the run; empty if none were missing.
    """

    period: float
    reason: str = ""
    phases: tuple[tuple[Phase, float], ...] = ()
    ticks: int = 0
    missed: int = 0
    skipped: int = 0
    late: Array = field(default_factory=_room, repr=False)
    busy: Array = field(default_factory=_room, repr=False)
    ages: float = 0.0
    quiet: Quiet = field(default_factory=Quiet)
    blind: str = ""

    def add(self, deadline: float, woken: float, done: float) -> float:
        """Add a tick that should have begun at a deadline, s, and return the deadline of the next one."""
        place = self.ticks % KEPT
        self.late[place], self.busy[place] = woken - deadline, done - woken
        self.ticks += 1
        deadline += self.period
        if done > deadline:
            self.missed += 1
            lost = int((done - deadline) / self.period) + 1
            self.skipped += lost
            deadline += lost * self.period
        return deadline

    def end(self) -> None:
        """End the run: no tick comes any more."""
        kept = min(self.ticks, KEPT)
        self.late, self.busy = self.late[:kept].copy(), self.busy[:kept].copy()

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
            f"{self.quiet.priority or 'no'}, page faults from disk {self.quiet.page_faults[0]}",
            *([f"no clouds of points: {self.blind}"] if self.blind else ()),
            f"{'ms up to':>12}{'late':>10}{'busy':>10}",
        ]
        counts = self.histogram()
        for i, end in enumerate([*BUCKETS, np.inf]):
            lines.append(f"{end:>12g}{counts['late'][i]:>10}{counts['busy'][i]:>10}")
        return "\n".join(lines)
