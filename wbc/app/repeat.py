"""Repetition of a recorded walk, with what was changed from its page and with its end, and comparison of two logs."""

from __future__ import annotations

import json
import math
from collections import deque
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from wbc.app.log.reader import Log
from wbc.app.view.controls import END, LiveControls, checked_interventions
from wbc.base.errors import InputError
from wbc.base.files import naming
from wbc.sim.trial.trial import TrialHook
from wbc.sim.walks.spec import WalkSpec

if TYPE_CHECKING:
    from wbc.sim.trial.trial import AnyTrial, TrialTick
    from wbc.sim.walks.trial import WalkTrial

NOT_COMPARED = ("tick/", "stiffness/computing", "view/change")
"""Beginnings of the names of signals that hold wall-clock times, or what is repeated."""


def interventions_of(log: Log) -> list[dict[str, Any]]:
    """Return the interventions of a run, to repeat it, from its log: what its page changed, and its end by Ctrl-C."""
    found = log.texts("view/change").tolist() if "view/change" in log else []
    with naming(log.path, "log that can be repeated"):
        return checked_interventions(entry for text in found if text for entry in json.loads(text))


def recorded_walk(log: Log) -> tuple[WalkSpec, list[dict[str, Any]]]:
    """Return the spec of a walk and its interventions; one whose log was cut off ends there."""
    plain = log.header.get("spec")
    if not isinstance(plain, dict) or "plan" not in plain:
        raise InputError(f"{log.path} is no log of a walk: --repeat needs one of wbc walk --record")
    changes = interventions_of(log)
    if log.broken is not None:
        changes.append({"time": float(log.time[-1]), "what": END})
    return WalkSpec.from_json(plain), changes


class RepeatWalk(TrialHook):
    """Repetition of the interventions of a walk: with the same spec, the walk is the same bit for bit.

    Attributes:
        controls: Controls that carry them out; None before the walk starts.
    """

    def __init__(self, interventions: Iterable[dict[str, Any]]) -> None:
        entries = sorted(checked_interventions(interventions), key=lambda entry: entry["time"])
        self._changes = deque(entry for entry in entries if entry["what"] != END)
        self._end = min((entry["time"] for entry in entries if entry["what"] == END), default=math.inf)
        self.controls: LiveControls | None = None

    def start(self, trial: WalkTrial) -> None:
        """See `TrialHook`."""
        self.controls = LiveControls(trial.plant, trial.control)
        self.after(trial)  # it may have ended before the first tick

    def tick(self, tick: TrialTick) -> None:
        """See `TrialHook`."""
        assert self.controls is not None
        self.controls.update(tick.plant.time)
        while self._changes and self._changes[0]["time"] <= tick.plant.time:
            entry = self._changes.popleft()
            self.controls.apply({"do": entry.pop("what"), **entry})

    def after(self, trial: AnyTrial) -> None:
        """See `TrialHook`."""
        if trial.plant.time > self._end - 0.5 * trial.plant.control_period:
            trial.stop()


def first_difference(log: Log, other: Log) -> str | None:
    """Return where two logs of one run differ first, in words; None where they are the same bit for bit."""
    compared = [{name for name in each.signals if not name.startswith(NOT_COMPARED)} for each in (log, other)]
    ticks = min(len(log), len(other))
    first, found = ticks, ""
    for name in log:
        if name not in compared[0] & compared[1]:
            continue
        one, two = (each.column(name).slice(0, ticks) for each in (log, other))
        if one.equals(two):
            continue
        pairs = enumerate(zip(one.to_pylist(), two.to_pylist(), strict=True))
        tick = next((i for i, (a, b) in pairs if repr(a) != repr(b)), ticks)  # NaN is NaN, also in lists
        if tick < first:
            first, found = tick, name
    if found:
        return f"from {log.time[first]:.3f} s on, first in {found}"
    if len(log) != len(other) and log.broken is None:
        return f"{len(log)} ticks, and {len(other)} when repeated"
    lacking = sorted(compared[0] ^ compared[1])
    return f"only in signals that one of them lacks: {', '.join(lacking[:3])}" if lacking else None
