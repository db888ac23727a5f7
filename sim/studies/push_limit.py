"""Search for the largest push from which a robot recovers, by bisection: of a walk, and of a stand."""

from __future__ import annotations

import copy
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Annotated, Any, ClassVar, Self

from wbc.base.errors import InputError
from wbc.base.settings import Positive, from_json, json_object, settings, to_json, units
from wbc.sim.balance.push_recovery import recovers
from wbc.sim.balance.standing import StandSpec
from wbc.sim.simulation.simulation import DivergedError
from wbc.sim.studies.outcomes import Outcome, TimeoutCheck, TimeoutHook, TrialKind, register_trial
from wbc.sim.trial.push import WalkPush
from wbc.sim.walks.spec import WalkSpec
from wbc.sim.walks.trial import walk

OWN = ("highest", "resolution")
"""Fields of a search; those of the trial that is pushed are written beside them."""


UNITS = {"impulse": "Ns/kg", "seconds": "s"}
"""Units of the results of a search."""


@settings(kw_only=True)
class PushLimitSpec:
    """Search by bisection, which takes recovery to be monotonic: the result lies within `resolution` of a change.

    Attributes:
        highest: Largest impulse tried, Ns/kg.
        resolution: Width of the last interval, Ns/kg.
    """

    highest: Annotated[Positive, "Ns/kg"] = 1.0
    resolution: Annotated[Positive, "Ns/kg"] = 0.02

    def __post_init__(self) -> None:
        if self.resolution > self.highest:
            raise InputError(
                f"resolution (Ns/kg) must be at most the highest impulse of {self.highest:g}, got {self.resolution:g}"
            )

    def _own(self) -> dict[str, Any]:
        """Return the fields of the search as plain values, with the kind."""
        return {"kind": self.kind, **{name: getattr(self, name) for name in OWN}}  # type: ignore[attr-defined]


def _parted(data: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the fields of the search, and those of the trial that is pushed."""
    values = {key: value for key, value in json_object("a push limit", data).items() if key != "kind"}
    return {name: values.pop(name) for name in OWN if name in values}, values


@settings(kw_only=True)
class WalkPushLimitSpec(PushLimitSpec):
    """Largest push from which a walk recovers: it does all its steps, wherever they end.

    Written are the fields of the walk and of `PushLimitSpec`, side by side.

    Attributes:
        walk: The walk, with one push; its impulse is not used.
    """

    kind: ClassVar[str] = "push_limit"

    walk: WalkSpec

    def __post_init__(self) -> None:
        super().__post_init__()
        if len(self.walk.pushes) != 1:
            raise InputError(f"a push limit needs a walk with one push, got {len(self.walk.pushes)}")
        # The impulse is not used: specs that differ in it alone must be equal.
        object.__setattr__(self, "walk", self.with_impulse(0.0))

    def with_impulse(self, impulse: float) -> WalkSpec:
        """Return the walk with another impulse of its push, Ns/kg."""
        return replace(self.walk, pushes=(replace(self.walk.pushes[0], impulse=impulse),))

    def with_seed(self, seed: int) -> WalkPushLimitSpec:
        """Return the search on a walk with another seed; what has been checked is not checked again."""
        twin = copy.copy(self)
        object.__setattr__(twin, "walk", self.walk.with_seed(seed))
        return twin

    def to_json(self) -> dict[str, Any]:
        """Return the spec as plain values."""
        return self.walk.to_json() | self._own()

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Self:
        """Return the spec that `to_json` wrote; the push may leave its impulse out."""
        own, values = _parted(data)
        values["pushes"] = [{"impulse": 0.0, **push} for push in values.get("pushes", [])]
        return cls(walk=WalkSpec.from_json(values), **own)


@settings(kw_only=True)
class StandPushLimitSpec(PushLimitSpec):
    """Largest push from which a robot that stands recovers: see `wbc.sim.balance.push_recovery.recovers`.

    Written are the fields of the stand, its push, and the fields of `PushLimitSpec`, side by side.

    Attributes:
        stand: The stand, long enough for the push and what comes after it.
        push: The push, at a time; its impulse is not used.
    """

    kind: ClassVar[str] = "stand_push_limit"

    stand: StandSpec
    push: WalkPush

    def __post_init__(self) -> None:
        super().__post_init__()
        end = self.stand.seconds if self.push.time is None else self.push.time + self.push.duration
        if end >= self.stand.seconds:
            raise InputError(
                f"a push on a stand must have a time, and end before the stand does after {self.stand.seconds:g} s"
            )
        object.__setattr__(self, "push", replace(self.push, impulse=0.0))

    def to_json(self) -> dict[str, Any]:
        """Return the spec as plain values."""
        return self.stand.to_json() | {"push": to_json(self.push)} | self._own()

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Self:
        """Return the spec that `to_json` wrote; the push may leave its impulse out, and is 0.5 s after the start."""
        own, values = _parted(data)
        push = {"impulse": 0.0, **({"time": 0.5} | dict(values.pop("push", {})))}
        return cls(stand=StandSpec.from_json(values), push=from_json(WalkPush, push), **own)


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


def walk_limit_outcome(spec: WalkPushLimitSpec, check: TimeoutCheck) -> Outcome:
    """Find the largest push from which a walk recovers, that is, does all its steps, wherever they end."""

    def tried(impulse: float) -> tuple[bool, float, dict[str, Any]]:
        result = walk(spec.with_impulse(impulse), hooks=[TimeoutHook(check)])
        if result.outcome == "diverged":
            raise DivergedError("the physics of a walk has diverged")
        facts = {"steps_done": result.steps_done, "fall_reason": result.fall_reason}
        return result.outcome in ("completed", "strayed"), result.seconds, facts

    return _searched(spec, tried)


def stand_limit_outcome(spec: StandPushLimitSpec, check: TimeoutCheck) -> Outcome:
    """Find the largest push from which a robot that stands recovers."""

    def tried(impulse: float) -> tuple[bool, float, dict[str, Any]]:
        held = recovers(spec.stand, replace(spec.push, impulse=impulse), hooks=[TimeoutHook(check)])
        return held, spec.stand.seconds, {}

    return _searched(spec, tried)


def _searched(spec: PushLimitSpec, tried: Callable[[float], tuple[bool, float, dict[str, Any]]]) -> Outcome:
    """Search with a function of an impulse: True after a recovery, simulated time, s, and further facts."""
    begin, seconds = time.perf_counter(), 0.0
    rows: list[dict[str, Any]] = []

    def holds(impulse: float) -> bool:
        nonlocal seconds
        recovered, simulated, facts = tried(impulse)
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


register_trial(
    WalkPushLimitSpec.kind,
    TrialKind(
        WalkPushLimitSpec.from_json,
        walk_limit_outcome,
        WalkPushLimitSpec.with_seed,
        units(WalkPushLimitSpec) | UNITS,
        "impulse",
    ),
)
register_trial(
    StandPushLimitSpec.kind,
    TrialKind(
        StandPushLimitSpec.from_json, stand_limit_outcome, None, units(StandPushLimitSpec) | UNITS, "impulse"
    ),
)
