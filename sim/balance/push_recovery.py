"""Push recovery of a standing robot: one push as a function of a frozen spec, the largest push, and tables of them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Annotated, Literal

import numpy as np

from wbc.core.control import Mode
from wbc.core.errors import InputError
from wbc.core.settings import Count, NonNegative, Positive, Seed, settings
from wbc.sim.balance.standing import MODES, Feedback, StandSpec, StandTrial
from wbc.sim.trial.push import PUSH_DURATION, PushSchedule, WalkPush

REST_SPEED = 0.1
"""Horizontal speed of the centre of mass below which a robot is at rest, m/s: above the sway of a standing robot with
noisy sensors, below the speed of a fall once it has begun."""


@settings(kw_only=True)
class StandPushSpec(StandSpec):
    """A stand with one push: a constant horizontal force on the torso's centre of mass.

    Attributes:
        mode: Command of the drives.
        impulse: Force times duration over the robot's mass, Ns/kg: the change of the speed of its centre of mass.
        direction: Direction of the force, rad; 0 is forward, π/2 to the left.
        duration: Duration of the push, s.
        before: Time of standing before the push, s.
        after: Time from the end of the push to the verdict, s.
        seconds: Sum of these three times, s, whatever is given.
    """

    mode: Mode = "torque"
    impulse: Annotated[NonNegative, "Ns/kg"] = 0.1
    direction: Annotated[float, "rad"] = 0.0
    duration: Annotated[Positive, "s"] = PUSH_DURATION
    before: Annotated[Positive, "s"] = 0.5
    after: Annotated[Positive, "s"] = 4.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "seconds", self.before + self.duration + self.after)
        super().__post_init__()


@dataclass(frozen=True)
class PushResult:
    """Result of a push at a standing robot.

    Attributes:
        recovered: True if it never fell (`wbc.sim.TrueFallDetector`) and at the end its centre of mass is at rest, its
            horizontal speed below 0.1 m/s. Feet may have slid, tipped or left the ground meanwhile.
    """

    recovered: bool
    fell_at: float | None  # time of the fall, s; None if it did not fall
    com_offset: float  # largest horizontal distance of the centre of mass from its place before the push, m
    failures: int  # ticks without a solution


def push_standing(spec: StandPushSpec) -> PushResult:
    """Push a standing robot; the same spec gives the same result."""
    push = WalkPush(time=spec.before, impulse=spec.impulse, direction=spec.direction, duration=spec.duration)
    trial = StandTrial(spec, [PushSchedule([push])])
    plant, sway = trial.plant, trial.sway
    with trial.running():
        trial.advance(spec.seconds)
    pushed = sway.com[round(spec.before / spec.period) :]
    speed = float(np.linalg.norm(plant.truth().com_velocity[:2]))
    return PushResult(
        recovered=not trial.fallen and speed < REST_SPEED,
        fell_at=plant.time if trial.fallen else None,
        com_offset=max((float(np.linalg.norm((com - sway.origin)[:2])) for com in pushed), default=0.0),
        failures=trial.control.failures,
    )


def largest_recovered(recovers: Callable[[float], bool], highest: float, resolution: float) -> float:
    """Return the largest impulse with a recovery, found by bisection up to `highest`, Ns/kg; 0 if there was none.

    Bisection assumes that a robot that recovers from a push recovers from weaker ones, and from none. The result lies
    within `resolution`, Ns/kg, of a change from recovery to fall.
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

    def specs(self) -> list[StandPushSpec]:
        """Return a spec for each cell of the table, robot by robot, mode by mode, direction by direction."""
        same = ("duration", "after", "foot", "noise", "seed", "feedback", "steps")
        common = {name: getattr(self, name) for name in same}
        return [
            StandPushSpec(robot=robot, mode=mode, direction=math.tau * i / self.directions, **common)
            for robot in self.robot
            for mode in self.mode
            for i in range(self.directions)
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

        def recovers(impulse: float, spec: StandPushSpec = spec) -> bool:
            return push_standing(replace(spec, impulse=impulse)).recovered

        impulse = largest_recovered(recovers, table.highest, table.resolution)
        yield PushCell(spec.robot, spec.mode, round(math.degrees(spec.direction), 3), round(impulse, 4))


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
