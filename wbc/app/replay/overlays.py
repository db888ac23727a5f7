"""Overlays of a replayed walk: footsteps, planned and real, support region, scans and DCM; and the caption."""

from __future__ import annotations

import math

import numpy as np

from wbc.app.log.reader import Log
from wbc.app.log.stances import Drift, stances
from wbc.app.scene.colours import (
    DCM_COLOUR,
    FOOTSTEP_LEGEND,
    SCAN_COLOUR,
    SIDE_COLOURS,
    SUPPORT_COLOUR,
    translucent,
)
from wbc.app.scene.layer import Layer
from wbc.app.scene.layers import stiffness_text
from wbc.app.scene.marks import LIFT, LINE, outline, polygon, ribbon, ribbon_edges, translation
from wbc.app.scene.shapes import HIDDEN, Colour, Surface, disc
from wbc.core.errors import Array
from wbc.core.hull import convex_hull
from wbc.core.robot import SIDES

EVENT_TIME = 2.0
"""Time for which an event is shown, s."""


class Overlays(Layer):
    """Layer of a log: objects beside the robot, each shown in a span of ticks; empty if the log is not of a walk."""

    def __init__(self, log: Log, com_height: float) -> None:
        """Make the objects for a log with ground truth; markers scale with the height of the centre of mass, m."""
        super().__init__()
        self._spans: list[tuple[int, int]] = []
        self._dcm: Array | None = None
        if "foot/left/contact" in log and "dcm/reference/x" in log:
            self._add_objects(log, com_height)

    def _add_objects(self, log: Log, com_height: float) -> None:
        end = len(log)
        for k, stance in enumerate(stances(log)):
            shape = outline(stance.corners + (0.0, 0.0, LIFT))
            self.add(f"footsteps/planned_{k}", shape, SIDE_COLOURS[stance.side], fixed=True)
        for k, stance in enumerate(stances(log, "truth")):
            shape = polygon(stance.corners + (0.0, 0.0, LIFT + 0.001))
            colour = translucent(SIDE_COLOURS[stance.side])
            self._add_span(f"footsteps/real_{k}", shape, colour, stance.start, end)
        for k, (start, stop, corners) in enumerate(_supports(log)):
            self._add_span(f"support/{k}", polygon(corners), SUPPORT_COLOUR, start, stop)
        for k, (landed, points) in enumerate(_scans(log)):
            shape = ribbon(ribbon_edges(points, 2.0 * LINE, len(points)))
            self._add_span(f"scans/{k}", shape, SCAN_COLOUR, landed, end)
        self.add("markers/dcm", disc(com_height), DCM_COLOUR, on_top=True)
        self._dcm = Drift(log)(np.column_stack([log["dcm/estimated"], log["zmp/reference/z"]]))
        self.legend = (("DCM", DCM_COLOUR), *FOOTSTEP_LEGEND, ("support region", SUPPORT_COLOUR))
        if "stiffness/scan/x" in log:
            self.legend = (*self.legend, ("ground as scanned", SCAN_COLOUR))

    def _add_span(self, path: str, shape: Surface, colour: Colour, start: int, end: int) -> None:
        """Add an object that is shown from the tick `start` to the one before `end`."""
        self.add(path, shape, colour)
        self._spans.append((start, end))

    def frame(self, tick: int) -> Array:
        """Return one matrix for each moving path, shape (len(moving), 4, 4)."""
        matrices = np.tile(HIDDEN, (len(self.moving), 1, 1))
        for i, (start, end) in enumerate(self._spans):
            if start <= tick < end:
                matrices[i] = np.eye(4)
        if self._dcm is not None and np.isfinite(self._dcm[tick]).all():
            matrices[-1] = translation(*self._dcm[tick])
        return matrices


def _supports(log: Log) -> list[tuple[int, int, Array]]:
    """Return the spans with the same feet on the ground: first tick, tick after the last, corners of their hull."""
    feet = stances(log, "truth")
    edges = sorted({edge for foot in feet for edge in (foot.start, foot.end)})
    supports = []
    for start, end in zip(edges, edges[1:], strict=False):
        standing = [foot for foot in feet if foot.start <= start and end <= foot.end]
        if standing:
            points = np.concatenate([foot.corners for foot in standing])
            flat = convex_hull(points[:, :2])
            supports.append(
                (start, end, np.column_stack([flat, np.full(len(flat), points[:, 2].max() + LIFT)]))
            )
    return supports


def _scans(log: Log) -> list[tuple[int, Array]]:
    """Return the tick of each scanned profile and its points in the world, shape (n, 3), m."""
    if "stiffness/scan/x" not in log:
        return []
    parts = (log.lists(f"stiffness/scan/{name}") for name in ("x", "lateral", "z"))
    scans, drift = [], Drift(log)
    for tick, (x, y, z) in enumerate(zip(*parts, strict=True)):
        if x is not None and y is not None and z is not None and x.size > 1:
            heading = float(log["stiffness/scan/heading"][tick])
            c, s = math.cos(heading), math.sin(heading)
            points = drift(np.stack([c * x - s * y, s * x + c * y, z], axis=1), tick)
            scans.append((tick, points + (0.0, 0.0, LIFT)))
    return scans


def caption(log: Log, tick: int, drift: Drift | None = None) -> str:
    """Return program, phase, step, stiffness of the soles, drift and last event, one line each, as far as logged."""
    lines = []
    if "program/state" in log:
        lines.append(str(log.texts("program/state")[tick]))
    if "walk/phase" in log:
        phase, side = log.texts("walk/phase")[tick], log.texts("step/side")[tick]
        swing = f", {side} foot swings" if phase == "single support" and side else ""
        lines.append(f"{phase or ''}{swing}, {log['walk/steps_done'][tick]:.0f} steps done")
    stiffness = [
        float(log[f"foot/{side}/stiffness"][tick]) for side in SIDES if f"foot/{side}/stiffness" in log
    ]
    if stiffness and all(math.isfinite(value) for value in stiffness):
        lines.append(stiffness_text(stiffness))
    if drift is not None and "truth/com/x" in log and "foot/left/contact" in log:
        lines.append(drift.text(tick))
    now = float(log.time[tick])
    past = [text for time, text in log.events if now - EVENT_TIME <= time <= now]
    if past:
        lines.append(past[-1])
    return "\n".join(lines)
