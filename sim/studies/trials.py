"""Trials: what a sweep runs. A walk is one; the largest push that a walk survives is another.

A trial is a frozen, picklable spec that can be written as JSON and run. Its result depends on the spec alone, so that
it need not be run twice. Kinds of trials of one's own are made known with `register_trial`.
"""

from __future__ import annotations

import faulthandler
import logging
import math
import time
import traceback
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Protocol

from wbc.core.errors import InputError, finite_scalar, positive, unknown_name
from wbc.core.settings import to_json
from wbc.sim.walks import WalkHook, WalkSpec, WalkTick, walk

Check = Callable[[], None]
"""To be called now and then by a trial that runs; raises `TrialTimeout` when its time is up."""


class TrialTimeout(Exception):  # noqa: N818 - it is no error of the trial
    """The time of a trial is up."""


class Trial(Protocol):
    """What can be run."""

    kind: ClassVar[str]

    def to_json(self) -> dict[str, Any]:
        """The spec as plain values, with its kind."""


@dataclass(frozen=True)
class Outcome:
    """How a trial ended.

    Attributes:
        status: "done", "diverged", "timeout" or "crashed".
        result: What the spec decides, as plain values.
        clock: What the clock said.
        error: Why there is no result.
    """

    status: str
    result: dict[str, Any] | None = None
    clock: dict[str, Any] | None = None
    error: str | None = None


@dataclass(frozen=True)
class TrialKind:
    """How a kind of trial is read and run.

    Attributes:
        read: Makes a spec from plain values.
        run: Runs it; gives "done" or "diverged", record and clock.
    """

    read: Callable[[Mapping[str, Any]], Any]
    run: Callable[[Any, Check], Outcome]


_KINDS: dict[str, TrialKind] = {}


def register_trial(name: str, kind: TrialKind) -> None:
    """Make a kind of trial known.

    Args:
        name: The `kind` of its specs.
        kind: How it is read and run.

    Raises:
        InputError: The name is taken.
    """
    if name in _KINDS:
        raise InputError(f"a kind of trial '{name}' is registered already")
    _KINDS[name] = kind


def trial_from_json(data: Mapping[str, Any]) -> Any:
    """The spec that its `to_json` wrote, of any kind; a walk when none is said.

    Raises:
        UnknownNameError: No such kind.
        InputError: A value that cannot be used.
    """
    name = data.get("kind", WalkSpec.kind)
    if name not in _KINDS:
        unknown_name("kind of trial", name, _KINDS)
    return _KINDS[name].read(data)


def run_trial(spec: Trial, timeout: float | None = None, *, exit_when_stuck: bool = False) -> Outcome:
    """Run a trial and say how it ended. Nothing is raised: an error is an outcome.

    Args:
        spec: What to run.
        timeout: Wall time that it may take, s; endless when None.
        exit_when_stuck: End the process when a call into a library does not come back for twice that time and
            half a minute: in processes of our own, which are started again.
    """
    stop = math.inf if timeout is None else time.monotonic() + positive("time-out of a trial (s)", timeout)

    def check() -> None:
        if time.monotonic() > stop:
            raise TrialTimeout(f"not done after {timeout:g} s")

    if exit_when_stuck and timeout is not None:
        faulthandler.dump_traceback_later(2.0 * timeout + 30.0, exit=True, file=2)
    try:
        return _KINDS[spec.kind].run(spec, check)
    except TrialTimeout as error:
        return Outcome("timeout", error=str(error))
    except Exception as error:
        logging.getLogger(__name__).debug("trial crashed", exc_info=True)
        where = traceback.format_exc(limit=-3)
        return Outcome("crashed", error=f"{type(error).__name__}: {error}\n{where}")
    finally:
        if exit_when_stuck and timeout is not None:
            faulthandler.cancel_dump_traceback_later()


class CheckTime(WalkHook):
    """Stops a walk whose time is up."""

    def __init__(self, check: Check) -> None:
        self._check = check

    def tick(self, tick: WalkTick) -> None:
        """See `WalkHook`."""
        del tick
        self._check()


def walk_outcome(spec: WalkSpec, check: Check) -> Outcome:
    """Run a walk as a trial."""
    result = walk(spec, hooks=[CheckTime(check)])
    assert result.clock is not None
    status = "diverged" if result.outcome == "diverged" else "done"
    return Outcome(status, result.record(), to_json(result.clock))


@dataclass(frozen=True, kw_only=True)
class WalkPushLimitSpec:
    """The largest push from which a walk recovers, found by bisection.

    Bisection takes recovery to be monotonic; what is found lies within `resolution` of a change.

    Attributes:
        walk: The walk, with one push; its impulse is not used.
        highest: Largest impulse tried, Ns/kg.
        resolution: Width of the last interval, Ns/kg.
    """

    kind: ClassVar[str] = "push_limit"

    walk: WalkSpec
    highest: float = 1.0
    resolution: float = 0.02

    def __post_init__(self) -> None:
        if len(self.walk.pushes) != 1:
            raise InputError(f"a push limit needs a walk with one push, got {len(self.walk.pushes)}")
        object.__setattr__(self, "highest", positive("highest impulse (Ns/kg)", self.highest))
        least = finite_scalar(
            "resolution (Ns/kg)", self.resolution, low=0.0, high=self.highest, open_low=True
        )
        object.__setattr__(self, "resolution", least)
        # The push that does not matter must not make equal specs differ.
        push = replace(self.walk.pushes[0], impulse=0.0)
        object.__setattr__(self, "walk", replace(self.walk, pushes=(push,)))

    def with_impulse(self, impulse: float) -> WalkSpec:
        """The walk with a push of some impulse, Ns/kg."""
        return replace(self.walk, pushes=(replace(self.walk.pushes[0], impulse=impulse),))

    def to_json(self) -> dict[str, Any]:
        """The spec as plain values: those of the walk, and the search."""
        walk = self.walk.to_json()
        del walk["kind"]
        return {"kind": self.kind, **walk, "highest": self.highest, "resolution": self.resolution}

    @staticmethod
    def from_json(data: Mapping[str, Any]) -> WalkPushLimitSpec:
        """The spec that `to_json` wrote; pushes may leave the impulse out."""
        values = {key: value for key, value in data.items() if key != "kind"}
        search = {name: values.pop(name) for name in ("highest", "resolution") if name in values}
        pushes = [{"impulse": 0.0, **push} for push in values.pop("pushes", [])]
        return WalkPushLimitSpec(walk=WalkSpec.from_json(values | {"pushes": pushes}), **search)


def push_limit_outcome(spec: WalkPushLimitSpec, check: Check) -> Outcome:
    """Find the largest push from which a walk recovers; it does if the whole plan is walked."""
    begin = time.perf_counter()
    tried: list[tuple[float, bool, int, str | None]] = []
    seconds = 0.0
    diverged = False

    def recovers(impulse: float) -> bool:
        nonlocal seconds, diverged
        result = walk(spec.with_impulse(impulse), hooks=[CheckTime(check)])
        seconds += result.seconds
        diverged = diverged or result.outcome == "diverged"
        done = result.outcome == "completed"
        tried.append((impulse, done, result.steps_done, result.fall_reason))
        return done

    low, high = 0.0, spec.highest
    if not recovers(0.0):
        found = None  # it falls without a push: there is no limit to be found
    elif recovers(high):
        found = high
    else:
        while high - low > spec.resolution + 1e-12 and not diverged:
            middle = 0.5 * (low + high)
            if recovers(middle):
                low = middle
            else:
                high = middle
        found = low
    wall = time.perf_counter() - begin
    record = {
        "impulse": None if diverged else found,
        "walks": len(tried),
        "seconds": seconds,
        "tried": [
            {"impulse": i, "recovered": ok, "steps_done": n, "fall_reason": why} for i, ok, n, why in tried
        ],
    }
    return Outcome(
        "diverged" if diverged else "done", record, {"wall_s": wall, "real_time_factor": seconds / wall}
    )


register_trial(WalkSpec.kind, TrialKind(WalkSpec.from_json, walk_outcome))
register_trial(WalkPushLimitSpec.kind, TrialKind(WalkPushLimitSpec.from_json, push_limit_outcome))
