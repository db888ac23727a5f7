"""Phases of a plan that is walked: its steps as they are now, the phase and its time, and the supports from now on."""

from __future__ import annotations

from dataclasses import replace

from wbc.base.numbers import ROUNDING
from wbc.core.robot import SIDES
from wbc.walking.contact import GaitPhase
from wbc.walking.lipm.schedule import SupportPhase, schedule
from wbc.walking.plans.footsteps import Footstep, FootstepPlan, other
from wbc.walking.plans.gait import StepGait
from wbc.walking.plans.sources import AT_REST, REPLAN, Velocity

HOLD = 0.05
"""Remaining time that the pattern plans with while a phase waits for a foot, s."""


class PlanPhases:
    """Plan that is walked, with the phase that it is in.

    Attributes:
        plan: Steps from the one that swings or swings next on, as they are now; landings move.
        gait: Gait of the plan.
        step: Index of the step that swings, or that swings next; the number of steps at the end.
        phase: Phase now.
        stance: Foot that carries while the present or next step swings: 0 left, 1 right.
        elapsed: Time since the start of this phase, s.
        duration: Planned length of this phase, s.
    """

    def __init__(self, feet: FootstepPlan) -> None:
        """Stand on the feet of a plan without steps."""
        self.plan, self.gait, self.step = feet, feet.gait.full, 0
        self._enter(GaitPhase.STANDING, 0.0)
        self._face()

    # ---- what is under way --------------------------------------------------------------------------------------

    @property
    def landing(self) -> Footstep:
        """Landing of the step that swings or swings next."""
        return self.plan.steps[self.step]

    @property
    def swing(self) -> int | None:
        """Foot that swings, 0 left and 1 right; None on both feet."""
        return 1 - self.stance if self.phase is GaitPhase.SINGLE else None

    @property
    def ended(self) -> bool:
        """True once no step is left to take."""
        return self.step >= len(self.plan)

    @property
    def rests(self) -> bool:
        """True while the robot stands and has no step to take."""
        return self.phase is GaitPhase.STANDING and self.ended

    @property
    def remaining(self) -> float:
        """Time to the planned end of the phase, s; at least `HOLD` while it waits for a foot."""
        return max(self.duration - self.elapsed, HOLD if self._waits else 0.0)

    @property
    def overdue(self) -> bool:
        """True while lift-off or touch-down is late."""
        return self.elapsed >= self.duration - ROUNDING and self._waits

    @property
    def _waits(self) -> bool:
        """True in a phase that ends by the load of a foot."""
        return self.phase is GaitPhase.SINGLE or (self.phase is GaitPhase.DOUBLE and not self.ended)

    @property
    def next_side(self) -> str | None:
        """Side that steps after the step that has begun; None for either."""
        if self.phase is GaitPhase.SINGLE:
            return other(self.landing.side)
        return self.landing.side if self._waits else None

    @property
    def comes_to_rest(self) -> bool:
        """True in the last moments of the last step: no ZMP takes the DCM from its rest to another step that soon."""
        return self.step + 1 >= len(self.plan) and self.duration - self.elapsed < REPLAN

    @property
    def velocity(self) -> Velocity:
        """Mean velocity over the next two steps, seen from the foot that stands."""
        plan, step = self.plan, self.step
        if step + 2 > len(plan):
            return AT_REST
        forward, left, _, turn = plan.steps[step + 1].seen_from(plan.stance(step))
        two = 2.0 * self.gait.cycle
        return forward / two, left / two, turn / two

    @property
    def transfer(self) -> float:
        """Time from the next touch-down until the foot that lands has taken over, s."""
        last = self.step + 1 >= len(self.plan)
        return 0.5 * (self.gait.final_double_support if last else self.gait.double_support)

    def supports(self, most: int | None = None) -> tuple[SupportPhase, ...]:
        """Return the schedule from now on: of all steps or of `most`, and the support on both feet after them."""
        if self.rests and len(self.plan) > 0:
            return (SupportPhase(HOLD, self.plan.final, HOLD),)
        supports = schedule(self.plan, self.step, most)
        if self.phase is GaitPhase.STANDING:
            return supports
        now, *later = supports[1:] if self.phase is GaitPhase.SINGLE else supports
        left = max(self.remaining, 1e-3)
        return (SupportPhase(left, now.feet, max(now.total, left)), *later)

    # ---- changes ------------------------------------------------------------------------------------------------

    def set_landing(self, landing: Footstep, *, carry: bool = True, left: float | None = None) -> None:
        """Set the landing of the foot that swings, and the time left until then, s; see `FootstepPlan.with_step`."""
        self.plan = self.plan.with_step(self.step, landing, carry=carry)
        if left is not None:
            self.duration = self.elapsed + left

    def steer(self, steps: tuple[Footstep, ...], gait: StepGait) -> bool:
        """Replace all steps that have not begun, by none for a stand; return True if a robot that stood sets off."""
        swings, waited = self.phase is GaitPhase.SINGLE, not self.ended
        left, right = self.plan.feet(self.step)
        begun = self.plan.steps[self.step : self.step + 1] if swings else ()
        self.plan, self.gait, self.step = FootstepPlan(left, right, (*begun, *steps), gait), gait, 0
        sets_off = self.phase is GaitPhase.STANDING and bool(steps)
        if sets_off:
            self._enter(GaitPhase.DOUBLE, gait.initial_double_support)
        elif self.phase is GaitPhase.DOUBLE and waited and not steps:
            self.duration = self.elapsed + gait.final_double_support
        elif self.phase is GaitPhase.DOUBLE and steps and not waited:
            # Off again before the robot stood: the weight has yet to come over.
            self.duration = self.elapsed + gait.initial_double_support
        self._face()
        return sets_off

    def lift(self) -> None:
        """Begin to swing."""
        self._enter(GaitPhase.SINGLE, self.gait.single_support)

    def land(self, landed: Footstep, credit: float) -> None:
        """Stand on both feet where the foot has landed; the double support is longer by a time that is left, s."""
        planned = self.landing
        # Its tilt is that of a stone or of a correction: the pattern needs place and heading alone.
        self.set_landing(replace(landed, pitch=planned.pitch, roll=planned.roll), carry=False)
        self.step += 1
        self._face()
        gait = self.gait
        self._enter(
            GaitPhase.DOUBLE, credit + (gait.final_double_support if self.ended else gait.double_support)
        )

    def stand(self) -> None:
        """Stand: the walk has ended."""
        self._enter(GaitPhase.STANDING, 0.0)

    def _enter(self, phase: GaitPhase, duration: float) -> None:
        """Begin a phase, planned to last for a time, s."""
        self.phase, self.elapsed, self.duration = phase, 0.0, duration

    def _face(self) -> None:
        """Stand on the foot beside that of the present step."""
        steps = self.plan.steps
        self.stance = 1 - SIDES.index(steps[min(self.step, len(steps) - 1)].side) if steps else 0
