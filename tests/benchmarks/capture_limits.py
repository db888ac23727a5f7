"""Largest pushes from which steps can save a robot, by the linear pendulum.

    python tests/benchmarks/capture_limits.py

The ZMP is at once at the edge of the feet on the ground that is next to the DCM, 8 mm inside it; the robot does not
lean; feet land when and where they should, as far as the legs reach. Pushes act for 0.1 s.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from wbc.robots import load
from wbc.walking import Reach
from wbc.walking.pattern.lipm import natural_frequency
from wbc.walking.planning.reach import bent_height, sole_spacing
from wbc.walking.planning.sources import DriveSettings

MARGIN, PUSH, LIFT, DOUBLE = 0.008, 0.1, 0.05, 0.06
"""Distance of the ZMP from the edge (m), duration of a push, time from its start to lift-off, double support (s)."""


@dataclass(frozen=True)
class Figures:
    """Frequency (1/s), edges of the feet in place to the front and to the side, spacing, reach (m) of a robot."""

    omega: float
    front: float
    side: float
    spacing: float
    reach: Reach

    @staticmethod
    def of(name: str) -> Figures:
        """Return the figures of a robot by name."""
        robot = load(name).robot()
        height = min(float(robot.com[2]), bent_height(robot, DriveSettings().stretch))
        sole, spacing = robot.soles[0], sole_spacing(robot)
        front, side = 0.5 * sole.length - MARGIN, 0.5 * (spacing + sole.width) - MARGIN
        return Figures(natural_frequency(height), front, side, spacing, Reach.of(robot, height))

    def pushed(self, impulse: float, edge: float) -> float:
        """DCM at the end of a push (Ns/kg) with the ZMP at an edge (m)."""
        centre = edge - impulse / PUSH / self.omega**2
        return centre - centre * math.exp(self.omega * PUSH)

    def later(self, dcm: float, edge: float, time: float) -> float:
        """DCM after a time (s) with the ZMP at an edge (m)."""
        return edge + (dcm - edge) * math.exp(self.omega * time)

    def forward(self, impulse: float, swing: float) -> bool:
        """True if one step to the front catches a push."""
        dcm = self.later(self.pushed(impulse, self.front), self.front, LIFT + swing - PUSH)
        return dcm <= self.front + self.reach.max_length

    def aside(self, impulse: float, closing: float, swing: float) -> bool:
        """True if the inner foot that closes up, as a loaded foot cannot leave, and the outer one catch a push."""
        dcm = self.later(self.pushed(impulse, self.side), self.side, LIFT + closing + DOUBLE - PUSH)
        edge = self.side - self.reach.min_spacing  # of the foot that has closed up
        return self.later(dcm, edge, swing) <= edge + self.reach.widest


def largest(stands: Callable[[float], bool]) -> float:
    """Largest impulse (Ns/kg) up to 2 from which a robot stands."""
    low, high = 0.0, 2.0
    while high - low > 1e-3:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if stands(middle) else (low, middle)
    return low


def row(name: str) -> str:
    """Return a row of the table."""
    robot = Figures.of(name)
    values = (
        largest(lambda push: robot.pushed(push, robot.side) <= robot.side),
        largest(lambda push: robot.aside(push, 0.25, 0.28)),
        largest(lambda push: robot.aside(push, 0.2, 0.2)),
        largest(lambda push: robot.pushed(push, robot.front) <= robot.front),
        largest(lambda push: robot.forward(push, 0.28)),
    )
    return f"| {name} | " + " | ".join(f"{value:.2f}" for value in values) + " |"


if __name__ == "__main__":
    print(
        "| robot | side, in place | steps of 0.25, 0.28 s | of 0.2, 0.2 s | forward, in place | a step of 0.28 s |"
    )
    print("|---|---:|---:|---:|---:|---:|")
    for each in ("hrp4_class", "talos", "g1"):
        print(row(each))
