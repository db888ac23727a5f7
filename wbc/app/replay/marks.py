"""Marks and text of a logged walk: footsteps, planned and real, support region, scans and DCM."""

from __future__ import annotations

import math

import numpy as np

from wbc.app.drift import Drift
from wbc.app.log.reader import Log
from wbc.app.log.stances import stances
from wbc.app.view.live_marks import stiffness_text
from wbc.app.view.marks import (
    DCM_COLOUR,
    LIFT,
    LINE,
    POINT,
    SCAN_COLOUR,
    SUPPORT_COLOUR,
    Mark,
    Scale,
    footstep,
    ground_mark,
)
from wbc.core.errors import Array
from wbc.core.hull import convex_hull
from wbc.core.robot import SIDES

EVENT_TIME = 2.0
"""Time for which an event is shown, s."""


class LoggedMarks:
    """Marks of a log, each shown in a span of ticks; none if the log is not of a walk."""

    def __init__(self, log: Log, drift: Drift, scale: Scale) -> None:
        """Make the marks of a log; `drift` says where the world of the estimate lies."""
        self._spans: list[tuple[int, int, Mark]] = []
        self._dcm: Array | None = None
        self._size = POINT * scale.height
        if not ("foot/left/contact" in log and "dcm/reference/x" in log):
            return
        up, end = (0.0, 0.0, LIFT), len(log)
        true = stances(log, "truth")
        for k, stance in enumerate(stances(log)):
            mark = footstep(f"planned step {k}", stance.side, stance.corners + up, real=False)
            self._spans.append((0, end, mark))
        for k, stance in enumerate(true):
            mark = footstep(f"real step {k}", stance.side, stance.corners + up, real=True)
            self._spans.append((stance.start, end, mark))
        edges = sorted({edge for foot in true for edge in (foot.start, foot.end)})
        for start, stop in zip(edges, edges[1:], strict=False):
            standing = [foot.corners for foot in true if foot.start <= start and stop <= foot.end]
            if standing:
                points = np.concatenate(standing)
                flat = convex_hull(points[:, :2])
                area = np.column_stack([flat, np.full(len(flat), points[:, 2].max() + LIFT)])
                mark = Mark("support", "area", area, SUPPORT_COLOUR, meaning="support region")
                self._spans.append((start, stop, mark))
        for k, (landed, points) in enumerate(_scans(log, drift)):
            mark = Mark(f"scan {k}", "line", points, SCAN_COLOUR, 2.0 * LINE, "ground as scanned")
            self._spans.append((landed, end, mark))
        grounds = _grounds(log, drift)
        untils = [*(tick for tick, _ in grounds[1:]), end]
        for (begin, points), until in zip(grounds, untils, strict=False):
            self._spans.append((begin, until, ground_mark(points)))
        self._dcm = drift(np.column_stack([log["dcm/estimated"], log["zmp/reference/z"]]))

    def __call__(self, tick: int) -> list[Mark]:
        """Return the marks at a tick."""
        marks = [mark for start, end, mark in self._spans if start <= tick < end]
        if self._dcm is not None and np.isfinite(self._dcm[tick]).all():
            marks.append(Mark("dcm", "ball", self._dcm[tick : tick + 1], DCM_COLOUR, self._size, "DCM"))
        return marks


def _scans(log: Log, drift: Drift) -> list[tuple[int, Array]]:
    """Return the tick of each scanned profile and its points in the world, shape (n, 3), m."""
    if "stiffness/scan/x" not in log:
        return []
    parts = (log.lists(f"stiffness/scan/{name}") for name in ("x", "lateral", "z"))
    headings, scans = log["stiffness/scan/heading"], []
    for tick, (x, y, z) in enumerate(zip(*parts, strict=True)):
        if x is not None and y is not None and z is not None and x.size > 1:
            c, s = math.cos(headings[tick]), math.sin(headings[tick])
            points = drift(np.stack([c * x - s * y, s * x + c * y, z], axis=1), tick)
            scans.append((tick, points + (0.0, 0.0, LIFT)))
    return scans


def _grounds(log: Log, drift: Drift) -> list[tuple[int, Array]]:
    """Return the tick of each map of the ground and its cells in the world, shape (n, 3), m."""
    if "ground/map/x" not in log:
        return []
    parts = (log.lists(f"ground/map/{name}") for name in ("x", "y", "z"))
    cells = [
        (k, np.stack(each, axis=1)) for k, each in enumerate(zip(*parts, strict=True)) if each[0] is not None
    ]
    return [(k, drift(points, k)) for k, points in cells if len(points)]


class Captions:
    """Lines of text of a log: program, phase, step, stiffness of the soles, drift and last event, as far as logged."""

    def __init__(self, log: Log, drift: Drift) -> None:
        """Read what the lines say."""

        def texts(name: str) -> list[str | None] | None:
            return list(log.texts(name)) if name in log else None

        self._log, self._time, self._events = log, log.time, list(log.events)
        self._program, self._phase, self._side = map(texts, ("program/state", "walk/phase", "step/side"))
        self._steps = log["walk/steps_done"] if "walk/phase" in log else np.zeros(len(log))
        stiffness = [f"foot/{side}/stiffness" for side in SIDES]
        self._stiffness = [log[name] for name in stiffness if name in log]
        shown = "truth/com/x" in log and "foot/left/contact" in log
        self._drift = drift if shown else None

    def __call__(self, tick: int) -> list[str]:
        """Return the lines at a tick."""
        lines = []
        if self._program is not None:
            lines.append(str(self._program[tick]))
        if self._phase is not None and self._side is not None:
            phase, side = self._phase[tick], self._side[tick]
            swing = f", {side} foot swings" if phase == "single support" and side else ""
            lines.append(f"{phase or ''}{swing}, {self._steps[tick]:.0f} steps done")
        stiffness = [float(values[tick]) for values in self._stiffness]
        if stiffness and all(map(math.isfinite, stiffness)):
            lines.append(stiffness_text(stiffness))
        if self._drift is not None:
            lines.append(self._drift.text(tick))
        now = float(self._time[tick])
        past = [text for time, text in self._events if now - EVENT_TIME <= time <= now]
        return [*lines, *past[-1:]]
