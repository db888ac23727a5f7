"""Push recovery of a standing robot: one push, the largest push, and tables of them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np

from wbc.base.errors import InputError
from wbc.base.settings import Count, Positive, Seed, settings
from wbc.core.drive.control import Mode
from wbc.sim.balance.standing import MODES, Feedback, StandSpec, StandTrial
from wbc.sim.trial.push import PUSH_DURATION, PushSchedule, WalkPush

REST_SPEED = 0.1
"""Horizontal speed of the centre of mass below which a robot is at rest, m/s: above the sway of a standing robot with
noisy sensors, below the speed of a fall once it has begun."""


def recovers(spec: StandSpec, push: WalkPush) -> bool:
    """Return True if a standing robot recovers from a push.

    It has never fallen (`TrueFallDetector`) and its centre of mass is at rest in the end, its horizontal speed
    below 0.1 m/s. Feet may have slid, tipped or left the ground meanwhile.
    """
    trial = StandTrial(spec, [PushSchedule([push])])
    with trial.running():
        trial.advance(spec.seconds)
    speed = float(np.linalg.norm(trial.plant.truth().com_velocity[:2]))
    return not trial.fallen and speed < REST_SPEED


def largest_recovered(recovers: Callable[[float], bool], highest: float, resolution: float) -> float:
    """Return the largest impulse with a recovery, by bisection up to `highest`, Ns/kg; 0 if there was none.

    A robot that recovers from a push is taken to recover from weaker ones; `resolution` is in Ns/kg.
    """
    low, high = 0.0, highest
    if recovers(high):
        return high
    while high - low > resolution:
        middle = 0.5 * (low + high)
        if recovers(middle):
            low = middle
        else:
            high = middle
    return low


BEFORE = 0.5
"""Time of standing before a push, s."""


@settings(kw_only=True)
class PushTableSpec:
    """A table of largest pushes: robots, control modes and directions.

    Attributes:
        robot: Robots: names that `wbc robots` lists, or files (MJCF, URDF or TOML).
        mode: Commands of the drives: position, torque, hybrid; one or several.
        directions: Number of directions, evenly spread, beginning with forward and going to the left.
        highest: Largest impulse tried, Ns/kg.
        resolution: Width of the last interval of the bisection, Ns/kg.
        duration: Duration of a push, s.
        after: Time from the end of a push to the verdict, s.
        foot: Foot under both ankles.
        noise: Errors of the sensors, none or realistic.
        seed: Fixes every random draw.
        feedback: In position control, whether the controller sees the robot as commanded or as estimated.
        steps: Whether the robots may step: none, or allowed in torque and hybrid control.
    """

    robot: tuple[str, ...] = ("hrp4_class", "talos")
    mode: tuple[Mode, ...] = MODES
    directions: Count = 8
    highest: Annotated[Positive, "Ns/kg"] = 1.0
    resolution: Annotated[Positive, "Ns/kg"] = 0.01
    duration: Annotated[Positive, "s"] = PUSH_DURATION
    after: Annotated[Positive, "s"] = 4.0
    foot: str = "flat"
    noise: str = "none"
    seed: Seed = 0
    feedback: Feedback = "closed"
    steps: Literal["none", "allowed"] = "none"

    def __post_init__(self) -> None:
        if not self.resolution < self.highest:
            raise InputError(
                f"highest impulse must exceed the resolution of {self.resolution:g} Ns/kg, got {self.highest:g}"
            )
        self.specs()

    def specs(self) -> list[StandSpec]:
        """Return the stand of each robot and mode."""
        common = {name: getattr(self, name) for name in ("foot", "noise", "seed", "feedback", "steps")}
        seconds = BEFORE + self.duration + self.after
        return [
            StandSpec(robot=robot, mode=mode, seconds=seconds, **common)
            for robot in self.robot
            for mode in self.mode
        ]


@dataclass(frozen=True)
class PushCell:
    """One cell of the table."""

    robot: str  # name of the robot
    mode: Mode  # "position", "torque" or "hybrid"
    direction_deg: float  # direction of the push, degrees; 0 is forward, 90 to the left
    impulse: float  # largest impulse from which the robot recovered, Ns/kg


def push_table(table: PushTableSpec) -> Iterator[PushCell]:
    """Yield the largest push of every robot, mode and direction, cell by cell."""
    for spec in table.specs():
        for i in range(table.directions):
            direction = math.tau * i / table.directions

            def stays(impulse: float, spec: StandSpec = spec, direction: float = direction) -> bool:
                push = WalkPush(time=BEFORE, impulse=impulse, direction=direction, duration=table.duration)
                return recovers(spec, push)

            impulse = largest_recovered(stays, table.highest, table.resolution)
            yield PushCell(spec.robot, spec.chosen, round(math.degrees(direction), 3), round(impulse, 4))


def format_push_table(cells: list[PushCell]) -> str:
    """Return the cells as a table in Markdown: a line for each robot and mode, a column for each direction."""
    directions = sorted({cell.direction_deg for cell in cells})
    lines = [
        "| robot | mode | " + " | ".join(f"{d:g}°" for d in directions) + " | least |",
        "|---|---|" + "---:|" * (len(directions) + 1),
    ]
    rows: dict[tuple[str, str], dict[float, float]] = {}
    for cell in cells:
        rows.setdefault((cell.robot, cell.mode), {})[cell.direction_deg] = cell.impulse
    for (robot, mode), row in rows.items():
        values = [f"{row[d]:.2f}" if d in row else "" for d in directions]
        lines.append(f"| {robot} | {mode} | " + " | ".join(values) + f" | {min(row.values()):.2f} |")
    return "\n".join(lines)
