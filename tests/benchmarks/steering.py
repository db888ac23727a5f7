"""Trials of robots that are steered: the highest speed, and long random driving with pushes; and their three studies.

    python tests/benchmarks/steering.py run driving --journal J           # also speed, steered
    python tests/benchmarks/steering.py table driving --journal J

They are registered as kinds of trials, and take all options of `wbc study`.

A walk has a speed if it comes to its end without a fall, and if the robot really moves so fast: the mean over the
second half of the drive is at least nine tenths of the command. The median over seeds is the speed at which half of the
walks fail. A drive that is asked for more than its legs reach grants less, so that the fastest walk without a fall is
recorded, too. A robot that is driven at random and has fallen sets off anew from a stand, until the time is over.
"""

from __future__ import annotations

import math
import resource
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, NamedTuple

import numpy as np
from threadpoolctl import threadpool_limits  # type: ignore[import-untyped]

from wbc.app.cli import main
from wbc.core.changes import as_changes
from wbc.core.errors import InputError
from wbc.core.settings import NonNegative, Positive, Share, settings
from wbc.sim.balance.push_recovery import largest_recovered
from wbc.sim.studies.catalog import STUDIES
from wbc.sim.studies.intervals import rate_interval
from wbc.sim.studies.study import FRESH_SEED, Cell, Study
from wbc.sim.studies.trials import Check, CheckTime, OfWalksSpec, Outcome, TrialKind, register_trial
from wbc.sim.trial.loop import TrialHook, TrialTick
from wbc.sim.trial.push import PUSH_DURATION
from wbc.sim.walks.plans import WalkPlan
from wbc.sim.walks.spec import WalkSpec
from wbc.sim.walks.trial import WalkTrial, walk

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


class _Speed(TrialHook):
    """Places of the robot's pelvis and its heading over time."""

    def __init__(self) -> None:
        self.rows: list[tuple[float, ...]] = []

    def tick(self, tick: TrialTick) -> None:
        """See `TrialHook`."""
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


SETTLED = 30.0
"""Time after which the memory of the process is read for the first time, s."""

HOUR = 3600.0

DIVERGED = "diverged"
"""Reason of the end of a drive whose physics has diverged: no fall, and no result of the trial."""


@settings(kw_only=True)
class DrivingSpec(OfWalksSpec):
    """Random driving of a robot that is steered, with pushes.

    Attributes:
        walk: The walk; its plan and pushes are not used.
        minutes: Simulated time, min.
        draw: Time between two draws of the velocity, s: each part evenly from all that the drive may grant.
        rest: Share of draws that are a stand.
        every: Time between two pushes, s.
        push: Impulse of a push on the torso, in a random direction, Ns/kg. Half of the least push that fells a walk.
    """

    kind: ClassVar[str] = "driving"
    unused: ClassVar[tuple[str, ...]] = ("plan",)

    minutes: Annotated[Positive, "min"] = 5.0
    draw: Annotated[Positive, "s"] = 3.0
    rest: Share = 0.1
    every: Annotated[Positive, "s"] = 10.0
    push: Annotated[NonNegative, "Ns/kg"] = 0.085

    def __post_init__(self) -> None:
        if self.walk.pushes:
            raise InputError(
                "pushes of a drive are random ones; give their impulse and the time between them"
            )
        # The plan is not used: specs that differ in it alone must be equal.
        object.__setattr__(self, "walk", replace(self.walk, plan=WalkPlan(drive=((0.0, 0.0, 0.0, 0.0),))))


class _Drive(NamedTuple):
    """One drive from a stand to a fall, or to the end of the time.

    Attributes:
        seconds: Simulated time, s.
        reason: Reason of the fall, or `DIVERGED`; None at the end of the time.
        steps: Steps taken.
        path: Length of the way of the pelvis, m.
        drift: Distance of the estimated from the true CoM at the end, seen from above, m.
        turned: Error of the estimated heading at the end, rad.
        granted: Velocity granted at the end: forward (m/s), left (m/s) and turn (rad/s).
        pushed: Time since the last push at the end, s; None without one.
    """

    seconds: float
    reason: str | None
    steps: int
    path: float
    drift: float
    turned: float
    granted: tuple[float, float, float]
    pushed: float | None


def driving_outcome(spec: DrivingSpec, check: Check) -> Outcome:
    """Drive a robot at random for a time: falls per hour, drift of the estimate."""
    begin, rng = time.perf_counter(), np.random.default_rng(spec.walk.seed)
    total, drives, memory = 60.0 * spec.minutes, [], _Memory()
    driven = 0.0
    with threadpool_limits(1):  # sums that several threads make depend on their number
        while driven < total - 1e-6:
            drives.append(drive := _drive(spec, total - driven, rng, check, memory, driven))
            driven += drive.seconds
            if drive.reason == DIVERGED:
                return Outcome("diverged", error=f"the simulation has diverged after {driven:.1f} s")
    falls = [drive for drive in drives if drive.reason is not None]
    low, high = rate_interval(len(falls), driven / HOUR)
    path = sum(drive.path for drive in drives)
    record = {
        "seconds": driven,
        "falls": len(falls),
        "falls_per_hour": {"mean": len(falls) * HOUR / driven, "low": low, "high": high},
        "steps": sum(drive.steps for drive in drives),
        "path": path,
        "drift": max(drive.drift for drive in drives),
        "drift_per_metre": sum(drive.drift for drive in drives) / path if path > 0.0 else 0.0,
        "turned": max(abs(drive.turned) for drive in drives),
        "drives": [drive._asdict() for drive in drives],
    }
    wall = time.perf_counter() - begin
    clock = {"wall_s": wall, "real_time_factor": driven / wall, "memory_mib": memory.read}
    return Outcome("done", record, clock)


class _Memory:
    """Memory of this process over a drive, MiB: once settled, then the present one."""

    def __init__(self) -> None:
        self.read: list[float] = []

    def update(self, driven: float) -> None:
        """Read the memory when due, after some simulated time (s)."""
        if driven >= SETTLED * (1 if not self.read else 10 * len(self.read)):
            self.read.append(_memory())


def _drive(
    spec: DrivingSpec, seconds: float, rng: np.random.Generator, check: Check, memory: _Memory, driven: float
) -> _Drive:
    """Drive from a stand until a fall or for a time."""
    trial = WalkTrial(replace(spec.walk, noise_seed=int(rng.integers(2**31))))
    scenario = _RandomDrive(spec, trial, rng, check)
    trial.meters, trial.scenario = [], [scenario]
    plant, walking = trial.plant, trial.walking
    while plant.time < seconds - 1e-9 and trial.step():
        memory.update(driven + plant.time)
    reason = (
        DIVERGED if trial.diverged is not None else None if trial.fall is None else trial.fall.name.lower()
    )
    truth, estimate = plant.truth(), walking.control.observer.robot
    drift = math.hypot(*(truth.com[:2] - estimate.com[:2]).tolist())
    turned = math.remainder(_yaw(estimate.q[3:7].tolist()) - _yaw(truth.q[3:7].tolist()), 2.0 * math.pi)
    since = plant.time - (scenario.push - spec.every) if scenario.push > spec.every else None
    return _Drive(
        plant.time, reason, walking.steps_done, scenario.path, drift, turned, walking.granted_velocity, since
    )


class _RandomDrive(TrialHook):
    """Random velocities and pushes.

    Attributes:
        push: Time of the next push, s.
        path: Length of the way of the pelvis so far, m.
    """

    def __init__(self, spec: DrivingSpec, trial: WalkTrial, rng: np.random.Generator, check: Check) -> None:
        self._spec, self._rng, self._check = spec, rng, check
        forward, back, aside, turn = trial.walking.velocity_limits
        self._low, self._high = (-back, -aside, -turn), (forward, aside, turn)
        self._draw, self.push, self.path = 2.0, spec.every, 0.0
        self._place = trial.plant.data.qpos[:2].copy()

    def before(self, trial: WalkTrial) -> None:
        """Command a velocity and begin a push when they are due."""
        spec, rng, plant = self._spec, self._rng, trial.plant
        self._check()
        if plant.time >= self._draw - 1e-9:
            self._draw += spec.draw
            velocity, stands = rng.uniform(self._low, self._high), rng.random() < spec.rest
            trial.walking.velocity = None if stands else velocity.tolist()
            del trial.tick_times[:]  # else they count among the memory of the walk
        if plant.time >= self.push - 1e-9:
            self.push += spec.every
            angle = rng.uniform(0.0, 2.0 * math.pi)
            force = spec.push * plant.robot.mass / PUSH_DURATION
            plant.push("torso", force * np.array([math.cos(angle), math.sin(angle), 0.0]), PUSH_DURATION)

    def after(self, trial: WalkTrial) -> None:
        """Add up the way of the pelvis."""
        now = trial.plant.data.qpos[:2].copy()
        self.path, self._place = self.path + math.hypot(*(now - self._place).tolist()), now


def _yaw(quaternion: list[float]) -> float:
    x, y, z, w = quaternion
    return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


def _memory() -> float:
    """Return the memory that this process holds now, MiB; where the system does not tell, the most it has held."""
    status = Path("/proc/self/statm")
    if status.exists():
        return int(status.read_text().split()[1]) * resource.getpagesize() / 2**20
    unit = 1 if sys.platform == "darwin" else 2**10  # of bytes
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / 2**20


QUICK = {"drive.pace_limit": 0.6}
"""Settings of a drive with the quick steps that high speeds need."""


def speed(seeds: int = 4) -> Study:
    """Return the highest speeds of a robot that is steered: three robots, four directions, two modes."""
    highest = {"forward": 0.8, "back": 0.8, "left": 0.4, "turn": 1.2}
    return Study(
        name="speed",
        about="highest speed walked by a robot that is steered, m/s, turning rad/s; the median over seeds is that at "
        "which half of the walks fail",
        kind="speed_limit",
        metric="fastest",
        base={"terrain": "flat", "noise": "realistic", "changes": dict(QUICK)},
        cells=tuple(
            Cell(
                f"{robot}, {heading}",
                {"robot": robot, "heading": heading, "highest": most, "resolution": most / 16},
            )
            for robot in ("hrp4_class", "talos", "g1")
            for heading, most in highest.items()
        ),
        arms={"position": {}, "torque": {"mode": "torque"}},
        seeds=tuple(range(FRESH_SEED, FRESH_SEED + seeds)),
        reference="position",
    )


def steered(seeds: int = 10) -> Study:
    """Return drives at one speed in each direction: three robots, two modes. A walk without a fall has that speed."""
    asked = {"forward": 0.4, "forward 0.5": 0.5, "back": 0.3, "left": 0.2, "turn": 0.5}
    # g1 is granted 0.18 m/s to the side with three quarters of its reach.
    wide = {**QUICK, "drive.reach": 0.85}
    cells = []
    for robot in ("hrp4_class", "talos", "g1"):
        for name, speed in asked.items():
            values = {"robot": robot, "heading": name.split()[0], "highest": speed, "resolution": speed}
            changes = wide if (robot, name) == ("g1", "left") else QUICK
            cells.append(Cell(f"{robot}, {name}", {**values, "changes": dict(changes)}))
    return Study(
        name="steered",
        about="robots that are steered at 0.4 and 0.5 m/s forward, 0.3 back, 0.2 to the left and 0.5 rad/s: the speed, "
        "or 0 where the walk falls or is slower than nine tenths of it",
        kind="speed_limit",
        base={"terrain": "flat", "noise": "realistic"},
        cells=tuple(cells),
        arms={"position": {}, "torque": {"mode": "torque"}},
        seeds=tuple(range(FRESH_SEED, FRESH_SEED + seeds)),
        reference="position",
    )


def driving(seeds: int = 6) -> Study:
    """Return drives of five minutes with random velocities and pushes: falls per hour, drift of the estimate."""
    return Study(
        name="driving",
        about="falls per hour of a robot that is driven at random and pushed, in drives of 5 minutes",
        kind="driving",
        base={"terrain": "flat", "noise": "realistic", "minutes": 5.0},
        cells=tuple(Cell(robot, {"robot": robot}) for robot in ("hrp4_class", "talos", "g1")),
        arms={"position": {"mode": "position"}},
        seeds=tuple(range(FRESH_SEED, FRESH_SEED + seeds)),
    )


register_trial(SpeedLimitSpec.kind, TrialKind(SpeedLimitSpec.from_json, speed_limit_outcome, metric="speed"))
register_trial(
    DrivingSpec.kind, TrialKind(DrivingSpec.from_json, driving_outcome, metric="falls_per_hour.mean")
)
for study in (speed, steered, driving):
    STUDIES.add(study.__name__, study)

if __name__ == "__main__":
    sys.exit(main(["study", *sys.argv[1:]]))
