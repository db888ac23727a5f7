"""Outcomes of trials, and the kinds of trials that a sweep runs.

A trial is a frozen, picklable spec that can be written as JSON and run. Its result depends on the spec alone, so that
it need not be run twice. The kinds of the library are in `kinds`; your own are registered with
`register_trial`, are an entry point of a package, in the group "wbc.trials", or are named "FILE.py:NAME".
"""

from __future__ import annotations

import logging
import math
import time
import traceback
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Annotated, Any, Literal, Protocol

from pydantic_core import to_jsonable_python

from wbc.base.checked import checked
from wbc.base.errors import InputError, shown
from wbc.base.numbers import plain
from wbc.base.registry import Registry, in_file, reading_data
from wbc.base.settings import Positive
from wbc.sim.trial.trial import TrialHook, TrialTick

Status = Literal["done", "diverged", "timeout", "crashed"]
"""End of a trial: with a result, with a diverged simulation (no result), after its time-out, with an error."""

TimeoutCheck = Callable[[], None]
"""Function that a running trial calls now and then; raises `TrialTimeout` after its time-out."""


class TrialTimeout(Exception):  # noqa: N818 - it is no error of the trial
    """The time-out of a trial is over."""


class AnyTrialSpec(Protocol):
    """Spec that a sweep can run."""

    @property
    def kind(self) -> str:
        """Name of its kind."""

    def to_json(self) -> dict[str, Any]:
        """Return the spec as plain values, with its kind."""


@checked
@dataclass(frozen=True)
class Outcome:
    """Status and result of a trial that has ended."""

    status: Status
    result: dict[str, Any] | None = None  # depends on the spec alone; values that JSON has, or NumPy's
    clock: dict[str, Any] | None = None  # wall-clock timings
    error: str | None = None  # reason why there is no result


@dataclass(frozen=True)
class TrialKind:
    """Functions that read and run the trials of one kind.

    Attributes:
        units: Units of parts of specs and results by their names, such as "zmp_error.mean": those that have one.
    """

    read: Callable[[Mapping[str, Any]], Any]  # makes a spec from plain values
    run: Callable[[Any, TimeoutCheck], Outcome]  # runs a spec; its outcome is "done" or "diverged"
    units: Mapping[str, str] = field(default_factory=dict)
    metric: str = "steps_done"  # part of the results that tables are about, unless a study names another


def _check_kind(kind: object) -> None:
    if not isinstance(kind, TrialKind):
        raise InputError(f"a kind of trial must be a wbc.sim.studies.TrialKind, got {shown(kind)}")


KINDS: Registry[TrialKind] = Registry("trial kind", group="wbc.trials", check=_check_kind)
"""Kinds of trials by the `kind` of their specs; other packages offer theirs by entry points."""


def register_trial(name: str, kind: TrialKind) -> None:
    """Register functions that read and run specs of a kind by the name that the specs have as their `kind`."""
    KINDS.add(name, kind)


def trial_from_json(data: Mapping[str, Any]) -> Any:
    """Return a spec of any kind that its `to_json` wrote; without "kind" it is that of a walk.

    A file of code that the spec names is run only if a user has named it, too (`wbc.base.registry.allow_code`).
    """
    if not isinstance(data, Mapping):
        raise InputError(f"a spec must be a mapping, got {shown(data)}")
    with reading_data():
        name, kind = KINDS.find(data.get("kind", "walk"))
        spec = kind.read({**data, "kind": name} if in_file(name) else data)
    if in_file(name) and (spec.kind, spec.to_json().get("kind")) != (name, name):
        raise InputError(
            f"a spec of '{name}' must keep the kind that it is read with, in `kind` and in `to_json`"
        )
    return spec


@checked
def run_trial(spec: AnyTrialSpec, timeout: Annotated[Positive, "s"] | None = None) -> Outcome:
    """Run a trial for at most `timeout` seconds of wall time; an error is an outcome, and is not raised."""
    stop = math.inf if timeout is None else time.monotonic() + timeout

    def check() -> None:
        if time.monotonic() > stop:
            raise TrialTimeout(f"not done after {timeout:g} s")

    try:
        outcome = KINDS.find(spec.kind)[1].run(spec, check)
        if not isinstance(outcome, Outcome):
            raise TypeError(f"a trial must return a wbc.sim.studies.Outcome, got {shown(outcome)}")
        # Numbers of NumPy become plain ones; one that is unknown, as the ZMP of a robot that never stood, is None.
        written = {
            name: to_jsonable_python(getattr(outcome, name), fallback=plain, inf_nan_mode="null")
            for name in ("result", "clock")
        }
        return replace(outcome, **written)
    except TrialTimeout as error:
        return Outcome("timeout", error=str(error))
    except Exception as error:
        logging.getLogger(__name__).debug("trial crashed", exc_info=True)
        where = traceback.format_exc(limit=-3)
        return Outcome("crashed", error=f"{type(error).__name__}: {error}\n{where}")


class TimeoutHook(TrialHook):
    """Hook that stops a trial after its time-out."""

    def __init__(self, check: TimeoutCheck) -> None:
        self._check = check

    def tick(self, tick: TrialTick) -> None:
        """See `TrialHook`."""
        del tick
        self._check()
