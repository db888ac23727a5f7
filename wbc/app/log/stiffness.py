"""Signals of the stiffness scheduling: scan, decision and result of a step, written at its landing."""
# ruff: noqa: D102 - overrides are documented where they are declared

from __future__ import annotations

import json
import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from wbc.app.log.columns import Columns
from wbc.app.log.tick import Source, Tick
from wbc.core.errors import Array

if TYPE_CHECKING:
    from wbc.tasks.scheduling.stiffness import StiffnessScheduler


class StiffnessSource(Source):
    """One set of values for each step, in the tick in which its landing is detected."""

    def __init__(self, columns: Columns, task: StiffnessScheduler, keep: Callable[[Array], int]) -> None:
        """Add the columns.

        Args:
            columns: Takes the columns.
            task: Stiffness scheduling.
            keep: Stores a list and returns its index.
        """
        self._task, self._columns, self._keep = task, columns, keep
        self._last: Any = task.steps[-1] if task.steps else None
        self._side = columns.add("stiffness/side", "1", "foot that landed", "text")
        self._numbers = columns.group(
            "stiffness",
            ("commanded", "actual", "wanted", "time_before_landing", "computing"),
            ("Nm/rad", "Nm/rad", "Nm/rad", "s", "s"),
            "at the landing; time_before_landing and computing belong to the decision",
        )
        self._cluster = columns.add("stiffness/cluster", "1", "cluster chosen by the policy", "whole")
        self._fallback = columns.add("stiffness/fallback", "1", "reason for the fallback stiffness", "text")
        self._features = columns.add("stiffness/features", "1", "features of the decision, as JSON", "text")
        self._x = columns.add(
            "stiffness/scan/x",
            "m",
            "profile: distance along the walking direction from the world origin",
            "list",
        )
        self._z = columns.add("stiffness/scan/z", "m", "profile: height in the world", "list")
        self._lateral = columns.add(
            "stiffness/scan/lateral", "m", "profile: to the left of that line", "list"
        )
        self._heading = columns.add("stiffness/scan/heading", "rad", "walking direction of the profile")
        self._all = columns.since(self._side)

    def write(self, tick: Tick, row: Array) -> None:
        row[self._all] = math.nan
        steps = self._task.steps
        if not steps or steps[-1] is self._last:
            return
        self._last = step = steps[-1]
        text = self._columns.text
        row[self._side] = text(step.side)
        row[self._numbers] = (
            step.commanded,
            step.actual,
            step.requested,
            step.decided_before,
            step.computing,
        )
        if step.fallback is not None:
            row[self._fallback] = text(step.fallback)
        if step.decision is not None:
            row[self._cluster] = math.nan if step.decision.cluster is None else step.decision.cluster
            row[self._features] = text(json.dumps(dict(step.decision.features)))
        profile = step.profile
        if profile is not None:
            row[self._x], row[self._z] = self._keep(profile.x), self._keep(profile.z)
            row[self._lateral] = self._keep(profile.lateral)
            row[self._heading] = math.atan2(profile.forward[1], profile.forward[0])
