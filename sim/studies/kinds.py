"""Kinds of trials: a walk, a stand, a tracked clip, and the search for the largest push of a walk or a stand."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Annotated, Any, Self

from wbc.base.errors import InputError, shown
from wbc.base.settings import Positive, from_json, json_object, settings, to_json, units
from wbc.sim.balance.standing import StandResult, StandSpec, StandTrial, recovers
from wbc.sim.balance.tracking import MotionSpec, TrackResult, TrackTrial
from wbc.sim.simulation.simulation import DivergedError
from wbc.sim.studies.outcomes import Outcome, TimeoutCheck, TimeoutHook, TrialKind, register_trial
from wbc.sim.trial.push import WalkPush
from wbc.sim.trial.spec import TrialResult, TrialSpec
from wbc.sim.trial.trial import AnyTrial
from wbc.sim.walks.result import WalkResult
from wbc.sim.walks.spec import WalkSpec
from wbc.sim.walks.trial import WalkTrial

OWN = ("highest", "resolution")
"""Fields of a search; those of the trial that is pushed are written beside them."""

WALK, STAND = "push_limit", "stand_push_limit"
"""Kinds of searches."""

UNITS = {"impulse": "Ns/kg", "seconds": "s"}
"""Units of the results of a search."""


@settings(kw_only=True)
class PushLimitSpec:
    """Search by bisection, which takes recovery to be monotonic: the result lies within `resolution` of a change.

    A walk recovers if it does all its steps, wherever they end; a stand as `wbc.sim.balance.standing.recovers`
    says. Written are the fields of the trial, its push, and the two numbers of the search, side by side.

    Attributes:
        trial: The walk or stand, without a push; a stand is long enough for the push and what comes after it.
        push: The push; its impulse is not used.
        highest: Largest impulse tried, Ns/kg.
        resolution: Width of the last interval, Ns/kg.
    """

    trial: WalkSpec | StandSpec
    push: WalkPush
    highest: Annotated[Positive, "Ns/kg"] = 1.0
    resolution: Annotated[Positive, "Ns/kg"] = 0.02

    def __post_init__(self) -> None:
        if self.resolution > self.highest:
            raise InputError(
                f"resolution (Ns/kg) must be at most the highest impulse of {self.highest:g}, got {self.resolution:g}"
            )
        # The impulse is not used: specs that differ in it alone must be equal.
        object.__setattr__(self, "push", replace(self.push, impulse=0.0))
        trial, push = self.trial, self.push
        if isinstance(trial, WalkSpec):
            if trial.pushes:
                raise InputError(f"the walk of a push limit has no push of its own, got {len(trial.pushes)}")
            self.pushed_walk(trial, 0.0)  # refuses a push that the walk cannot have
        elif push.time is None or push.time + push.duration >= trial.seconds:
            raise InputError(
                f"a push on a stand must have a time, and end before the stand does after {trial.seconds:g} s"
            )

    @property
    def kind(self) -> str:
        """Name of the kind, by the trial."""
        return WALK if isinstance(self.trial, WalkSpec) else STAND

    def pushed_walk(self, trial: WalkSpec, impulse: float) -> WalkSpec:
        """Return a walk with the push of an impulse, Ns/kg."""
        return replace(trial, pushes=(replace(self.push, impulse=impulse),))

    def tried(self, impulse: float, check: TimeoutCheck) -> tuple[bool, float, dict[str, Any]]:
        """Run the trial with an impulse, Ns/kg: True after a recovery, simulated time, s, and further facts."""
        hooks = [TimeoutHook(check)]
        if isinstance(self.trial, StandSpec):
            held = recovers(self.trial, replace(self.push, impulse=impulse), hooks=hooks, visuals=False)
            return held, self.trial.seconds, {}
        result = WalkTrial(self.pushed_walk(self.trial, impulse), visuals=False).run(hooks)
        if result.outcome == "diverged":
            raise DivergedError("the physics of a walk has diverged")
        facts = {"steps_done": result.steps_done, "fall_reason": result.fall_reason}
        return result.outcome in ("completed", "strayed"), result.seconds, facts

    def to_json(self) -> dict[str, Any]:
        """Return the spec as plain values."""
        push = to_json(self.push)
        own = {"kind": self.kind, **{name: getattr(self, name) for name in OWN}}
        return self.trial.to_json() | ({"pushes": [push]} if self.kind == WALK else {"push": push}) | own

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Self:
        """Return the spec that `to_json` wrote.

        The push may leave its impulse out. That of a stand is 0.5 s after the start if it has no time.
        """
        values = json_object("a push limit", data)
        kind: type[WalkSpec | StandSpec] = StandSpec
        if values.pop("kind", WALK) == WALK:
            kind, pushes = WalkSpec, values.pop("pushes", [])
            if not isinstance(pushes, (list, tuple)) or len(pushes) != 1:
                raise InputError(f"a push limit needs a walk with one push, got {shown(pushes)}")
            push = json_object("a push", pushes[0])
        else:
            push = {"time": 0.5} | json_object("a push", values.pop("push", {}))
        own = {name: values.pop(name) for name in OWN if name in values}
        return cls(trial=kind.from_json(values), push=from_json(WalkPush, {"impulse": 0.0} | push), **own)


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


def limit_outcome(spec: PushLimitSpec, check: TimeoutCheck) -> Outcome:
    """Find the largest push from which a walk or a stand recovers."""
    begin, seconds = time.perf_counter(), 0.0
    rows: list[dict[str, Any]] = []

    def holds(impulse: float) -> bool:
        nonlocal seconds
        recovered, simulated, facts = spec.tried(impulse, check)
        seconds += simulated
        rows.append({"impulse": impulse, "recovered": recovered, **facts})
        return recovered

    limit, diverged = None, False
    try:
        if holds(0.0):  # else the robot falls without a push
            limit = largest_recovered(holds, spec.highest, spec.resolution + 1e-12)  # for rounded halves
    except DivergedError:
        diverged = True
    wall = time.perf_counter() - begin
    record = {"impulse": limit, "walks": len(rows), "seconds": seconds, "tried": rows}
    clock = {"wall_s": wall, "real_time_factor": seconds / wall}
    return Outcome("diverged" if diverged else "done", record, clock)


for _kind in (WALK, STAND):
    register_trial(
        _kind, TrialKind(PushLimitSpec.from_json, limit_outcome, units(PushLimitSpec) | UNITS, "impulse")
    )


def _register(
    spec: type[TrialSpec], result: type[TrialResult], build: Callable[[Any], AnyTrial], metric: str
) -> None:
    """Register a kind of trial of the library by the classes of its specs and results."""

    def run(given: Any, check: TimeoutCheck) -> Outcome:
        try:
            found: TrialResult = (trial := build(given)).run([TimeoutHook(check)])
        except DivergedError:
            return Outcome("diverged")
        return Outcome("done" if trial.diverged is None else "diverged", found.record(), found.timings())

    register_trial(spec.kind, TrialKind(spec.from_json, run, units(spec) | units(result), metric))


_register(WalkSpec, WalkResult, lambda spec: WalkTrial(spec, visuals=False), "steps_done")
_register(StandSpec, StandResult, lambda spec: StandTrial(spec, visuals=False), "com_error")
_register(MotionSpec, TrackResult, lambda spec: TrackTrial(spec.clip(), spec, visuals=False), "joint_rms")
