"""Trials: the specs that a sweep runs. A walk is one; the largest push that a walk survives is another.

A trial is a frozen, picklable spec that can be written as JSON and run. Its result depends on the spec alone, so that
it need not be run twice. Your own kinds of trials are registered with `register_trial`.
"""

from __future__ import annotations

import copy
import faulthandler
import logging
import math
import time
import traceback
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Annotated, Any, ClassVar, Literal, Protocol, Self

from wbc.base.checked import checked
from wbc.base.errors import InputError
from wbc.base.registry import Registry
from wbc.base.settings import Positive, settings, to_json
from wbc.sim.balance.push_recovery import largest_recovered
from wbc.sim.plant.robot import DivergedError
from wbc.sim.trial.loop import TrialHook, TrialTick
from wbc.sim.walks.spec import WalkSpec
from wbc.sim.walks.trial import walk

Status = Literal["done", "diverged", "timeout", "crashed"]
"""End of a trial: with a result, with a diverged simulation (no result), after its time-out, with an error."""

TimeoutCheck = Callable[[], None]
"""Function that a running trial calls now and then; raises `TrialTimeout` after its time-out."""


class TrialTimeout(Exception):  # noqa: N818 - it is no error of the trial
    """The time-out of a trial is over."""


class AnyTrialSpec(Protocol):
    """Spec that a sweep can run."""

    kind: ClassVar[str]

    def to_json(self) -> dict[str, Any]:
        """Return the spec as plain values, with its kind."""


@dataclass(frozen=True)
class Outcome:
    """Status and result of a trial that has ended."""

    status: Status
    result: dict[str, Any] | None = None  # depends on the spec alone; plain values
    clock: dict[str, Any] | None = None  # wall-clock timings
    error: str | None = None  # reason why there is no result


@dataclass(frozen=True)
class TrialKind:
    """Functions that read and run the trials of one kind.

    Attributes:
        seeded: Returns a spec with another seed, the rest of it taken as checked; None for kinds that check it again.
    """

    read: Callable[[Mapping[str, Any]], Any]  # makes a spec from plain values
    run: Callable[
        [Any, TimeoutCheck], Outcome
    ]  # runs a spec; returns an outcome that is "done" or "diverged"
    seeded: Callable[[Any, int], Any] | None = None
    metric: str = "steps_done"  # part of the results that tables are about, unless a study names another


KINDS: Registry[TrialKind] = Registry("kind of trial")
"""Kinds of trials by the `kind` of their specs."""


def register_trial(name: str, kind: TrialKind) -> None:
    """Register a kind of trial.

    Args:
        name: The `kind` of its specs.
        kind: Functions that read and run them.
    """
    KINDS.add(name, kind)


def trial_from_json(data: Mapping[str, Any]) -> Any:
    """Return the spec that its `to_json` wrote, of any kind; a walk without a kind."""
    return KINDS[data.get("kind", WalkSpec.kind)].read(data)


def with_seed(spec: Any, seed: int) -> Any:
    """Return a spec of any kind with another seed."""
    seeded = KINDS[spec.kind].seeded
    return trial_from_json({**spec.to_json(), "seed": seed}) if seeded is None else seeded(spec, seed)


@checked
def run_trial(
    spec: AnyTrialSpec, timeout: Annotated[Positive, "s"] | None = None, *, exit_when_stuck: bool = False
) -> Outcome:
    """Run a trial, for `timeout` seconds of wall time at the most. Nothing is raised: an error is an outcome.

    `exit_when_stuck` ends the process when a call into a library does not return for twice that time and half a minute:
    in local processes, which are started again.
    """
    stop = math.inf if timeout is None else time.monotonic() + timeout

    def check() -> None:
        if time.monotonic() > stop:
            raise TrialTimeout(f"not done after {timeout:g} s")

    if exit_when_stuck and timeout is not None:
        faulthandler.dump_traceback_later(2.0 * timeout + 30.0, exit=True, file=2)
    try:
        return KINDS[spec.kind].run(spec, check)
    except TrialTimeout as error:
        return Outcome("timeout", error=str(error))
    except Exception as error:
        logging.getLogger(__name__).debug("trial crashed", exc_info=True)
        where = traceback.format_exc(limit=-3)
        return Outcome("crashed", error=f"{type(error).__name__}: {error}\n{where}")
    finally:
        if exit_when_stuck and timeout is not None:
            faulthandler.cancel_dump_traceback_later()


class TimeoutHook(TrialHook):
    """Hook that stops a walk after its time-out."""

    def __init__(self, check: TimeoutCheck) -> None:
        self._check = check

    def tick(self, tick: TrialTick) -> None:
        """See `TrialHook`."""
        del tick
        self._check()


def walk_outcome(spec: WalkSpec, check: TimeoutCheck) -> Outcome:
    """Run a walk as a trial."""
    result = walk(spec, hooks=[TimeoutHook(check)])
    assert result.clock is not None
    status: Status = "diverged" if result.outcome == "diverged" else "done"
    return Outcome(status, result.record(), to_json(result.clock))


@settings(kw_only=True)
class WalkPushLimitSpec:
    """Search for the largest push from which a walk recovers, by bisection: it does all its steps, wherever they end.

    Bisection takes recovery to be monotonic; the result lies within `resolution` of a change. Written are the fields of
    the walk and these, side by side.

    Attributes:
        walk: The walk, with one push; its impulse is not used.
        highest: Largest impulse tried, Ns/kg.
        resolution: Width of the last interval, Ns/kg.
    """

    kind: ClassVar[str] = "push_limit"

    walk: WalkSpec
    highest: Annotated[Positive, "Ns/kg"] = 1.0
    resolution: Annotated[Positive, "Ns/kg"] = 0.02

    def __post_init__(self) -> None:
        if len(self.walk.pushes) != 1:
            raise InputError(f"a push limit needs a walk with one push, got {len(self.walk.pushes)}")
        if self.resolution > self.highest:
            raise InputError(
                f"resolution (Ns/kg) must be at most the highest impulse of {self.highest:g}, got {self.resolution:g}"
            )
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
        own = {"kind": self.kind, "highest": self.highest, "resolution": self.resolution}
        return self.walk.to_json() | own

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Self:
        """Return the spec that `to_json` wrote; the push may leave its impulse out."""
        values = {key: value for key, value in data.items() if key != "kind"}
        own = {name: values.pop(name) for name in ("highest", "resolution") if name in values}
        values["pushes"] = [{"impulse": 0.0, **push} for push in values.get("pushes", [])]
        return cls(walk=WalkSpec.from_json(values), **own)


def push_limit_outcome(spec: WalkPushLimitSpec, check: TimeoutCheck) -> Outcome:
    """Find the largest push from which a walk recovers, that is, does all its steps, wherever they end."""
    begin, seconds = time.perf_counter(), 0.0
    tried: list[dict[str, Any]] = []

    def recovers(impulse: float) -> bool:
        nonlocal seconds
        result = walk(spec.with_impulse(impulse), hooks=[TimeoutHook(check)])
        seconds += result.seconds
        done = result.outcome in ("completed", "strayed")
        tried.append(
            {
                "impulse": impulse,
                "recovered": done,
                "steps_done": result.steps_done,
                "fall_reason": result.fall_reason,
            }
        )
        if result.outcome == "diverged":
            raise DivergedError("the physics of a walk has diverged")
        return done

    limit = None
    status: Status = "done"
    try:
        if recovers(0.0):  # else the walk falls without a push
            limit = largest_recovered(recovers, spec.highest, spec.resolution + 1e-12)  # for rounded halves
    except DivergedError:
        status = "diverged"
    wall = time.perf_counter() - begin
    record = {"impulse": limit, "walks": len(tried), "seconds": seconds, "tried": tried}
    return Outcome(status, record, {"wall_s": wall, "real_time_factor": seconds / wall})


register_trial(WalkSpec.kind, TrialKind(WalkSpec.from_json, walk_outcome, WalkSpec.with_seed))
register_trial(
    WalkPushLimitSpec.kind,
    TrialKind(WalkPushLimitSpec.from_json, push_limit_outcome, WalkPushLimitSpec.with_seed, "impulse"),
)
