"""Trials that find the highest speed of a walk in one direction, by bisection.

A walk has a speed if it comes to its end without a fall, and if the robot really moves so fast: the mean over the
second half of the drive is at least nine tenths of the command. The median over seeds is the speed at which half of the
walks fail. A drive that is asked for more than its legs reach grants less, so that the fastest walk without a fall is
recorded, too.
"""

from __future__ import annotations

import math
import time
from dataclasses import replace
from typing import Annotated, Any, ClassVar, Literal

import numpy as np

from wbc.core.changes import as_changes
from wbc.core.errors import InputError
from wbc.core.settings import Positive, settings
from wbc.sim.balance.push_recovery import largest_recovered
from wbc.sim.studies.trials import Check, CheckTime, OfWalksSpec, Outcome, TrialKind, register_trial
from wbc.sim.walks import WalkHook, WalkPlan, WalkSpec, WalkTick, walk

Heading = Literal["forward", "back", "left", "turn"]
"""Direction of a drive."""

KEPT = 0.9
"""Share of the commanded speed that the robot must move with."""

_DIRECTIONS: dict[str, tuple[float, float, float]] = {
    "forward": (1.0, 0.0, 0.0),
    "back": (-1.0, 0.0, 0.0),
    "left": (0.0, 1.0, 0.0),
    "turn": (0.0, 0.0, 1.0),
}


@settings(kw_only=True)
class SpeedLimitSpec(OfWalksSpec):
    """Search for the highest speed of a robot that is steered, by bisection.

    Bisection takes speeds below one that is walked to be walked as well; the result lies within `resolution` of a
    change.

    Attributes:
        walk: The walk; its plan is not used.
        heading: Direction: forward, back, left, or turn on the spot.
        seconds: Time for which the speed is commanded, s.
        highest: Highest speed tried, m/s or rad/s.
        resolution: Width of the last interval, m/s or rad/s.
    """

    kind: ClassVar[str] = "speed_limit"
    unused: ClassVar[tuple[str, ...]] = ("plan",)

    heading: Heading = "forward"
    seconds: Annotated[Positive, "s"] = 12.0
    highest: Annotated[Positive, "m/s or rad/s"] = 0.8
    resolution: Annotated[Positive, "m/s or rad/s"] = 0.05

    def __post_init__(self) -> None:
        if self.resolution > self.highest:
            raise InputError(
                f"resolution must be at most the highest speed of {self.highest:g}, got {self.resolution:g}"
            )
        # The plan is not used: specs that differ in it alone must be equal.
        object.__setattr__(self, "walk", self.at(0.0))

    def at(self, speed: float) -> WalkSpec:
        """Return the walk at a speed (m/s or rad/s), with limits of the drive that allow it."""
        forward, left, turn = (speed * part for part in _DIRECTIONS[self.heading])
        plan = WalkPlan(drive=((0.0, forward, left, turn), (self.seconds, 0.0, 0.0, 0.0)))
        limits = {"drive.fastest": (self.highest,) * 3, "drive.fastest_back": self.highest}
        return replace(self.walk, plan=plan, changes=as_changes({**limits, **dict(self.walk.changes)}))


class _Speed(WalkHook):
    """Places of the robot's pelvis and its heading over time."""

    def __init__(self) -> None:
        self.rows: list[tuple[float, ...]] = []

    def tick(self, tick: WalkTick) -> None:
        """See `WalkHook`."""
        x, y, z, w = tick.plant.truth().q[3:7].tolist()
        yaw = math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
        self.rows.append((tick.plant.time, *tick.plant.truth().q[:2].tolist(), yaw))

    def mean(self, heading: str, seconds: float) -> float:
        """Mean speed along a direction over the second half of a drive of some seconds, m/s or rad/s."""
        rows = np.array(self.rows)
        rows = rows[(rows[:, 0] >= 0.5 * seconds) & (rows[:, 0] <= seconds)]
        if len(rows) < 2:
            return 0.0
        along, across, turn = _DIRECTIONS[heading]
        times, yaw = rows[:, 0], np.unwrap(rows[:, 3])
        if turn:
            return float((yaw[-1] - yaw[0]) / (times[-1] - times[0]))
        steps, middle = np.diff(rows[:, 1:3], axis=0), 0.5 * (yaw[1:] + yaw[:-1])
        ahead = steps[:, 0] * np.cos(middle) + steps[:, 1] * np.sin(middle)
        left = steps[:, 1] * np.cos(middle) - steps[:, 0] * np.sin(middle)
        return float((along * ahead + across * left).sum() / (times[-1] - times[0]))


def speed_limit_outcome(spec: SpeedLimitSpec, check: Check) -> Outcome:
    """Find the highest speed of a robot, how fast it moved at it, and how fast in its fastest walk without a fall."""
    begin = time.perf_counter()
    tried: list[dict[str, Any]] = []
    moved = {0.0: 0.0}

    def walks(speed: float) -> bool:
        measured = _Speed()
        result = walk(spec.at(speed), hooks=[CheckTime(check), measured])
        moved[speed] = mean = measured.mean(spec.heading, spec.seconds)
        fine = result.outcome == "completed" and mean >= KEPT * speed
        tried.append(
            {
                "speed": speed,
                "walked": fine,
                "moved": mean,
                "outcome": result.outcome,
                "steps": result.steps_done,
            }
        )
        return fine

    limit = largest_recovered(walks, spec.highest, spec.resolution + 1e-12)
    fastest = max((each["moved"] for each in tried if each["outcome"] == "completed"), default=0.0)
    diverged = any(each["outcome"] == "diverged" for each in tried)
    record = {
        "speed": None if diverged else limit,
        "moved": moved[limit],
        "fastest": fastest,
        "walks": len(tried),
        "tried": tried,
    }
    return Outcome("diverged" if diverged else "done", record, {"wall_s": time.perf_counter() - begin})


register_trial(SpeedLimitSpec.kind, TrialKind(SpeedLimitSpec.from_json, speed_limit_outcome))
