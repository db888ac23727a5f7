"""State machine of a walk: phases change by contact and by time, not by time alone.

    STANDING ── start ──▶ DOUBLE ── lift-off ──▶ SINGLE ── touch-down ──▶ DOUBLE ── … ── time ──▶ STANDING

Lift-off waits until the foot that leaves has given its load to the foot that stays. Touch-down is the first load on
the swing foot: early (the swing ends, and the weight may come over at once), on time, or late (the foot reaches on
down, and the pendulum is held meanwhile). The machine moves nothing: it holds the phase and reports events.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated

from wbc.base.errors import InputError
from wbc.base.numbers import ROUNDING
from wbc.base.settings import NonNegative, Share, settings
from wbc.core.robot import SIDES
from wbc.walking.contact import Event, GaitPhase, Touch, touch_down
from wbc.walking.lipm.schedule import SupportPhase, schedule
from wbc.walking.plans.footsteps import Footstep, FootstepPlan
from wbc.walking.plans.gait import Gait

DEBOUNCE, HOLD = 0.01, 0.05
"""Time that the load of a touch-down must last; remaining time that the pattern plans with while a phase waits for a
foot, s."""


@settings
class PhaseSettings:
    """Loads and times at which phases change. Loads are over the robot's weight.

    Attributes:
        touch_down: Load at which a swing foot has met the ground; 0.08 is 30 N of 39 kg.
        early: Ratio of the swing before which a load is a stumble, not a touch-down.
        lift_off: Greatest load of the foot that leaves.
        stance: Least load of the foot that stays.
        max_wait: Longest time that lift-off waits for these two loads, s; then the foot lifts all the same.
        max_late: Longest time that a foot searches for ground, s; then it is taken to stand where it is.
    """

    touch_down: Share = 0.08
    early: Share = 0.6
    lift_off: Share = 0.25
    stance: Share = 0.5
    max_wait: Annotated[NonNegative, "s"] = 0.3
    max_late: Annotated[NonNegative, "s"] = 0.5


class WalkPhases:
    """State machine of one walk.

    Attributes:
        plan: Footstep plan; replaced as landings move or the walk is stopped.
        settings: Loads and times at which phases change.
        phase: Phase now.
        step: Index of the step that swings, or that swings next; the number of steps at the end.
        elapsed: Time in this phase, s.
        duration: Planned length of this phase, s.
        completed: Single supports that have ended with a foot on the ground.
        weight: Weight of the robot with its load, N.
    """

    def __init__(self, plan: FootstepPlan, weight: float, settings: PhaseSettings | None = None) -> None:
        """Stand at the start of a plan, with a weight of the robot above zero, N."""
        self.plan = plan
        self._schedule: tuple[FootstepPlan, tuple[SupportPhase, ...]] | None = None  # with its plan
        self.settings = settings or PhaseSettings()
        self.weight = weight
        self.phase = GaitPhase.STANDING
        self.step = 0
        self.elapsed = 0.0
        self.duration = 0.0
        self.completed = 0
        self._touch = Touch(DEBOUNCE)
        self._stopping = False

    @property
    def swing(self) -> str | None:
        """Side of the foot in the air; None on both feet."""
        return self.plan.steps[self.step].side if self.phase is GaitPhase.SINGLE else None

    @property
    def stance(self) -> int:
        """Foot that stands while the present or next step swings, the last one after it: 0 left, 1 right."""
        steps = self.plan.steps
        return 1 - SIDES.index(steps[min(self.step, len(steps) - 1)].side) if steps else 0

    @property
    def contact(self) -> tuple[bool, bool]:
        """True for each foot on the ground, left and right."""
        return self.swing != "left", self.swing != "right"

    @property
    def finished(self) -> bool:
        """True when the walk is over and the robot stands."""
        return self.phase is GaitPhase.STANDING and self.step >= len(self.plan)

    @property
    def remaining(self) -> float:
        """Time to the planned end of the phase, s; at least `hold` while it waits for a foot."""
        return max(self.duration - self.elapsed, HOLD if self._waits else 0.0)

    @property
    def overdue(self) -> bool:
        """True while lift-off or touch-down is late."""
        return self._waits and self.elapsed >= self.duration - ROUNDING

    @property
    def _waits(self) -> bool:
        return self.phase is GaitPhase.SINGLE or (
            self.phase is GaitPhase.DOUBLE and self.step < len(self.plan)
        )

    def supports(self) -> tuple[SupportPhase, ...]:
        """Return the schedule from now on."""
        if self.step >= len(self.plan) > 0 and self.phase is GaitPhase.STANDING:
            return (SupportPhase(HOLD, self.plan.final, self.step, HOLD),)
        if self._schedule is None or self._schedule[0] is not self.plan:
            self._schedule = self.plan, schedule(self.plan)
        whole = self._schedule[1]
        if self.phase is GaitPhase.STANDING:
            return whole
        index = 2 * self.step + (1 if self.phase is GaitPhase.SINGLE else 0)
        now = whole[index]
        left = max(self.remaining, 1e-3)
        return (SupportPhase(left, now.feet, now.step, max(now.total, left)), *whole[index + 1 :])

    def start(self) -> Event:
        """Begin to walk; `InputError` if the robot walks already, or there is no step to take."""
        if self.phase is not GaitPhase.STANDING or self.step >= len(self.plan):
            raise InputError("a walk can only start from standing, with steps left to take")
        self._enter(GaitPhase.DOUBLE, self.plan.gait.full.initial_double_support)
        return Event.STARTED

    def stop(self, height: float = 0.0) -> bool:
        """Land, bring the other foot beside, lower by a height (m), and stand; False if that is done already."""
        if self.phase is GaitPhase.STANDING or self._stopping:
            return False
        self._stopping = True
        last = self.step if self.phase is GaitPhase.SINGLE else self.step - 1
        self.plan = plan = self.plan.stopping_after(last)
        if len(plan) > last + 1:
            closing = plan.steps[-1]
            self.plan = plan.with_step(len(plan) - 1, replace(closing, z=closing.z - height))
        if self.step >= len(plan):
            self.duration = self.elapsed + self.plan.gait.full.final_double_support
        return True

    def steer(self, steps: Sequence[Footstep], gait: Gait | None = None) -> None:
        """Replace all steps that have not begun, by none for a stand; the gait is as before when None."""
        waited = self.step < len(self.plan)
        left, right = self.plan.feet(self.step)
        begun = self.plan.steps[self.step : self.step + 1] if self.phase is GaitPhase.SINGLE else ()
        gait = self.plan.gait if gait is None else gait
        self.plan = FootstepPlan(left, right, (*begun, *steps), gait)
        self.step, self._stopping = 0, False
        if self.phase is not GaitPhase.DOUBLE:
            return
        if waited and not steps:
            self.duration = self.elapsed + gait.full.final_double_support
        elif steps and not waited:  # off again before the robot stood: the weight has yet to come over
            self.duration = self.elapsed + gait.full.initial_double_support

    def retime(self, remaining: float) -> None:
        """Let the present single support end after a time (s), to catch the pendulum."""
        if self.phase is GaitPhase.SINGLE:
            self.duration = self.elapsed + remaining

    def set_landing(self, step: Footstep, *, carry: bool = True) -> None:
        """Set the landing of the foot that swings, or has landed last; see `FootstepPlan.with_step`."""
        index = self.step if self.phase is GaitPhase.SINGLE else self.step - 1
        self.plan = self.plan.with_step(index, step, carry=carry)

    def update(self, loads: Sequence[float], dt: float) -> tuple[Event, ...]:
        """Advance by one tick with the normal force on left and right foot, N; return its events."""
        self.elapsed += dt
        if self.phase is GaitPhase.SINGLE:
            return self._single(loads, dt)
        if self.phase is GaitPhase.DOUBLE:
            return self._double(loads)
        return ()

    def _single(self, loads: Sequence[float], dt: float) -> tuple[Event, ...]:
        s = self.settings
        side = SIDES.index(self.plan.steps[self.step].side)
        loaded = loads[side] >= s.touch_down * self.weight
        touched = self._touch.update(loaded, dt)
        left = self.duration - self.elapsed
        if left > ROUNDING:
            if not (touched and self.elapsed >= s.early * self.duration):
                return ()
            event, credit = (
                Event.EARLY_TOUCH_DOWN,
                left,
            )  # of time, for the double support: the rhythm is kept
        elif touched:
            event, credit = touch_down(-left, ROUNDING, 0.5 * HOLD), 0.0
        elif left <= -s.max_late + ROUNDING:
            event, credit = (Event.NO_TOUCH_DOWN if s.max_late > 0.0 else Event.TOUCH_DOWN), 0.0
        else:
            return ()
        self.step += 1
        self.completed += 1
        gait = self.plan.gait.full
        last = self.step >= len(self.plan)
        self._enter(GaitPhase.DOUBLE, credit + (gait.final_double_support if last else gait.double_support))
        return (event,)

    def _double(self, loads: Sequence[float]) -> tuple[Event, ...]:
        if self.elapsed < self.duration - ROUNDING:
            return ()
        if self.step >= len(self.plan):
            self._enter(GaitPhase.STANDING, 0.0)
            return (Event.STOPPED,)
        s = self.settings
        leaving = SIDES.index(self.plan.steps[self.step].side)
        free = loads[leaving] <= s.lift_off * self.weight and loads[1 - leaving] >= s.stance * self.weight
        if not free and self.elapsed < self.duration + s.max_wait - ROUNDING:
            return ()
        self._enter(GaitPhase.SINGLE, self.plan.gait.full.single_support)
        return (Event.LIFT_OFF if free else Event.FORCED_LIFT_OFF,)

    def _enter(self, phase: GaitPhase, duration: float) -> None:
        self.phase, self.duration, self.elapsed = phase, duration, 0.0
        self._touch.lift()
