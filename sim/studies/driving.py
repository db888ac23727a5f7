"""Trials of long random driving: falls, drift of the estimate, and memory of a robot that is steered and pushed.

A robot that has fallen sets off anew from a stand, until the time is over.
"""

from __future__ import annotations

import math
import resource
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Annotated, ClassVar, NamedTuple

import numpy as np
from threadpoolctl import threadpool_limits  # type: ignore[import-untyped]

from wbc.core.errors import InputError
from wbc.core.settings import NonNegative, Positive, Share, settings
from wbc.sim.studies.intervals import rate_interval
from wbc.sim.studies.trials import Check, OfWalksSpec, Outcome, TrialKind, register_trial
from wbc.sim.trial.loop import TrialHook
from wbc.sim.trial.push import PUSH_DURATION
from wbc.sim.walks import WalkPlan, WalkTrial

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


register_trial(DrivingSpec.kind, TrialKind(DrivingSpec.from_json, driving_outcome))
