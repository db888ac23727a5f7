"""Recovery of a robot that is pushed while it stands: it steps until the DCM is over its feet again.

    at rest   no step is due, or the first foot is still on the ground
       │      the DCM is beyond the soles, for as long as a `debounce`: the steps that it was to take are void
       ▼
    steps     on both feet     the steps that catch the DCM are planned anew, every few ticks
       │      on one foot      the landing moves under the DCM, tick by tick
       │      the DCM is well inside the soles: what is left is for the feet on the ground; they close up
       ▼
    at rest   both feet stand and the DCM is well inside the soles

Where to step is for `wbc.walking.planning.capture`; when to, and what the walk is told, is here.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from wbc.core.errors import Array
from wbc.walking.pattern.swing import shortest_swing
from wbc.walking.planning.capture import CaptureSettings, CaptureSteps
from wbc.walking.planning.gait import TIMINGS, Gait
from wbc.walking.planning.phases import Phase
from wbc.walking.planning.sources import Standing, close_up
from wbc.walking.walk import Walk

UNLIMITED = (math.inf, math.inf)
"""Greatest normal force of both feet, N, where nothing limits it."""


class PushRecovery:
    """Steps of one walk out of pushes.

    Attributes:
        active: True while the robot steps out of a push.
        straight: 1 while it steps out of a push straight ahead, -1 straight back, 0 otherwise.
    """

    def __init__(
        self, walk: Walk, settings: CaptureSettings | None, gait: Gait, *, drawn: bool = False
    ) -> None:
        """Wait for a push.

        Args:
            walk: The walk.
            settings: Settings; None for a robot that never steps out of a push.
            gait: Gait of the walk.
            drawn: True if the base of a commanded robot is drawn to the estimated one while `straight` is not zero.
        """
        self.active = False
        self.straight = 0
        self._walk, self._gait = walk, gait
        self._calm = walk.phases.settings
        self._outside = 0.0  # time that the DCM has been outside the feet, s
        self._next = 0.0  # time of the next plan, s
        self._dcm = self._com = np.zeros(3)  # as measured in this tick
        self._any_way: CaptureSteps | None = None
        self._straight_on: CaptureSteps | None = None
        if settings is not None:
            self._any_way = self._planner(settings)
            if drawn:
                self._straight_on = self._planner(settings.for_straight())
        self._planned_by = self._any_way

    def _planner(self, settings: CaptureSettings) -> CaptureSteps:
        """Return a planner of capture steps whose timings are multiples of the control period, two of it at least."""
        walk, gait = self._walk, settings.gait
        short = {name: 2.0 * walk.period for name in TIMINGS if getattr(gait, name) < 2.0 * walk.period}
        gait, _ = replace(gait, **short).on_grid(walk.period)
        settings = replace(settings, gait=gait)
        spacing = walk.phases.plan.spacing
        return CaptureSteps(walk.omega, walk.reach, walk.sole_sizes, spacing, settings)

    @property
    def most_force(self) -> tuple[float, float]:
        """Greatest normal force of left and right foot, N: a foot that is to step out of a push gives up its load."""
        phases = self._walk.phases
        if not self.active or phases.phase is not Phase.DOUBLE or phases.step >= len(phases.plan):
            return UNLIMITED
        share = (phases.elapsed + self._walk.period) / max(phases.duration, 1e-3)
        most = phases.weight * max(0.0, 1.0 - share)
        return (most, math.inf) if phases.plan.steps[phases.step].side == "left" else (math.inf, most)

    def update(self, time: float, beyond: float, dcm: Array, com: Array | None = None) -> bool:
        """Step out of a push if there is one.

        Args:
            time: Time since the start of the walk, s.
            beyond: Distance of the DCM beyond the hull of both soles, m; negative inside.
            dcm: Measured DCM, shape (2,) or (3,), m.
            com: Measured CoM, shape (3,), m; the DCM when None.

        Returns:
            True while the robot steps out of a push; then the walk has its steps.
        """
        if self._planned_by is None:
            return False
        self._dcm, self._com = dcm, dcm if com is None else com
        if not self.active:
            if not self._pushed(beyond, self._planned_by.settings):
                return False
            self._begin(time)
        phases, capture = self._walk.phases, self._planned_by
        if phases.phase is Phase.SINGLE:
            self._aim(capture)
            self._next = time
            return True
        inside = beyond < -capture.settings.inside
        if inside and phases.phase is Phase.STANDING:
            self._end()
            return False
        if time >= self._next:
            self._next = time + capture.settings.again
            now = Standing.of(phases, self._gait, time)
            if inside:
                self._close_up(now, capture)
            else:
                self._catch(now, capture)
        return True

    def _pushed(self, beyond: float, settings: CaptureSettings) -> bool:
        """True when the DCM of a robot that stands has been beyond the soles for long enough."""
        phases = self._walk.phases
        waits = phases.step >= len(phases.plan) or phases.sets_off
        self._outside = self._outside + self._walk.period if waits and beyond > settings.trigger else 0.0
        return self._outside >= settings.debounce - 1e-9

    def _begin(self, time: float) -> None:
        """Drop the steps that the robot was to take, and choose how to step."""
        walk, phases = self._walk, self._walk.phases
        capture = self._any_way
        assert capture is not None
        if phases.step < len(phases.plan):
            walk.steer((), capture.settings.gait)
        phases.settings = replace(self._calm, max_wait=capture.settings.wait, early_credit=0.0)
        walk.adjusts, walk.reaction = False, 0.0
        self.active, self._next = True, time
        if self._straight_on is not None:
            start = Standing.of(phases, self._gait, time).start
            ahead = self._straight_on.pushed_straight(self._dcm, start)
            self.straight = (ahead > 0.0) - (ahead < 0.0)
            if self.straight:
                self._planned_by = self._straight_on

    def _end(self) -> None:
        """Give the walk back as it was."""
        self._walk.phases.settings, self._walk.adjusts = self._calm, True
        self.active, self.straight, self._outside = False, 0, 0.0
        self._planned_by = self._any_way

    def _catch(self, now: Standing, capture: CaptureSteps) -> None:
        """Step to where the DCM will be."""
        phases, gait = self._walk.phases, capture.settings.gait
        wait = gait.initial_double_support
        if phases.step < len(phases.plan):
            wait = max(phases.duration - phases.elapsed, 0.0)
        steps = capture.footsteps(self._dcm, now.start, now.first, wait).steps
        self._walk.steer(steps, gait, self._dcm, self._with_it)

    def _close_up(self, now: Standing, capture: CaptureSteps) -> None:
        """Put the foot that was to step next beside the other one, quietly."""
        phases, gait = self._walk.phases, capture.settings.gait
        if phases.step >= len(phases.plan):
            return
        steps = close_up(replace(now.start, gait=gait), now.first or "left").steps
        if len(phases.plan) - phases.step != len(steps):
            self._walk.steer(steps, gait)

    def _aim(self, capture: CaptureSteps) -> None:
        """Move the landing of the foot in the air under the DCM."""
        phases, s = self._walk.phases, capture.settings
        remaining = phases.duration - phases.elapsed
        begins = phases.elapsed < 1.5 * self._walk.period
        if begins:
            remaining = self._swing_time(s) - phases.elapsed
        if remaining <= s.aim_until:
            return
        planned = phases.plan.steps[phases.step]
        landing = capture.landing(self._dcm, phases.plan.stance(phases.step), planned, remaining)
        moved = math.hypot(landing.x - planned.x, landing.y - planned.y)
        if begins or moved > s.least_change:
            self._walk.aim(landing, remaining, self._dcm, self._with_it, s.sink)

    def _swing_time(self, settings: CaptureSettings) -> float:
        """Time of the swing that begins, s: short steps take less."""
        phases, gait = self._walk.phases, settings.gait
        lift, landing = phases.plan.lift_off(phases.step), phases.plan.steps[phases.step]
        length = math.hypot(landing.x - lift.x, landing.y - lift.y)
        least = max(shortest_swing(gait), settings.quickest + length / settings.step_speed)
        return min(gait.single_support, least)

    @property
    def _with_it(self) -> Array | None:
        """CoM from which the pattern goes on with the measured DCM; None for its own."""
        return self._com if self.straight else None
