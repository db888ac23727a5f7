"""Gait of a walk: phases, contacts, swing and touch-down, for planned and free steps.

    STANDING ── sets off ──▶ DOUBLE ── lift-off ──▶ SINGLE ── touch-down ──▶ DOUBLE or SINGLE ── … ──▶ STANDING

Planned steps (`wbc.walking.lipm.walk`) and free steps (`wbc.walking.stepping.gait`) say when a foot lifts, where and
when it lands, when it takes over, and how the pendulum moves until then.
"""

from __future__ import annotations

import logging
import math
from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import replace

import pinocchio as pin

from wbc.base.errors import InputError
from wbc.base.numbers import ROUNDING
from wbc.tasks.stabilizer.pendulum import Pendulum
from wbc.walking.contact import Event, GaitPhase
from wbc.walking.ground import GroundEstimate
from wbc.walking.plans.footsteps import Footstep, FootstepPlan
from wbc.walking.plans.gait import Gait, SwingShape
from wbc.walking.plans.reach import Reach
from wbc.walking.plans.sources import FootstepSource, Standing, next_steps
from wbc.walking.source import Progress, Reference, ReferenceSource
from wbc.walking.steering import Steering
from wbc.walking.swing import FootMotion, SwingFoot

logger = logging.getLogger(__name__)

REPLAN = 0.1
"""Time between questions to a planner on both feet, s."""


class GaitMachine(ReferenceSource):
    """State machine of a robot that stands, shifts its weight, steps and stands.

    Attributes:
        dt: Control period, s.
        time: Time since the gait began, s.
        phase: Phase now.
        stance: Foot that carries while the present or next step swings: 0 left, 1 right.
        elapsed: Time since the start of this phase, s.
        duration: Planned length of this phase, s.
        steps_done: Steps that have ended with a foot on the ground.
        swing: Swing of this step, which has its landing; None before the first decision on it, and on both feet.
        reach: Reach of the legs, which bounds footsteps that are asked for; None where they are taken as they are.
        met: Time since lift-off at which the swing foot met the ground while the other one still carries, s; else None.
        ground: What is known of the ground.
    """

    ground: GroundEstimate
    reach: Reach | None = None
    steering: Steering
    _gait: Gait  # of the footsteps that are asked for

    def __init__(self, dt: float, ground: GroundEstimate, lasting: float = 0.0) -> None:
        """Take a period, s, and an estimate of the ground; a touch-down is a load that lasts for a time, s."""
        self.ground, self.dt, self._lasting = ground, dt, lasting

    def begin(self, heading: float) -> None:
        """Stand where the robot stands now, with a heading, rad; all steps and orders before are forgotten."""
        self.phase, self.stance, self.steps_done = GaitPhase.STANDING, 1, 0
        self.time = self.elapsed = self.duration = 0.0
        self.swing: SwingFoot | None = None
        self.met: float | None = None
        self._loaded = 0.0  # time for which the swing foot has borne the load of a contact, s
        self.planner, self.reason = None, ""
        self.ground.forget()

    def _ask(
        self, planner: FootstepSource, feet: Sequence[Footstep], first: str | None, *, swings: bool = False
    ) -> FootstepPlan | None:
        """Return a planner's steps from where the feet stand, left and right, the one that `swings` where it lands.

        The foot of the side `first` steps next, either one if it is None. The answer has timings in whole periods. It
        is None where the planner fails, or asks for a step out of reach; `reason` says why.
        """
        left, right = (replace(foot, pitch=0.0, roll=0.0) for foot in feet)
        start = FootstepPlan(left, right, (), self._gait)
        now = Standing(start, first, self.steps_done + swings, swings, self.time, self.reach)
        try:
            plan = next_steps(planner, now, self.steering.extent)
            return replace(plan, gait=plan.gait.full.on_grid(self.dt)[0])
        except Exception as error:  # of a planner of the user's own, too
            ours = isinstance(error, InputError)
            self.reason = reason = str(error) if ours else f"{type(error).__name__}: {error}"
            trace = None if ours else error
            logger.warning("footsteps refused (%s); the robot comes to a stand", reason, exc_info=trace)
            return None

    @property
    def fast_share(self) -> float:
        """Share from 0 to 1 by which the walk is a fast one."""
        return 0.0

    @property
    def air(self) -> int | None:
        """Foot in the air; None on both feet."""
        return 1 - self.stance if self.phase is GaitPhase.SINGLE and self.met is None else None

    def _enter(self, phase: GaitPhase, duration: float) -> None:
        """Begin a phase, planned to last for a time, s."""
        self.phase, self.elapsed, self.duration = phase, 0.0, duration
        self.swing = self.met = None
        self._loaded = 0.0

    def _touches(self, loaded: bool) -> bool:
        """Return True if the swing foot has met the ground; it bears the load of a contact in this tick, or not."""
        self._loaded = self._loaded + self.dt if loaded else 0.0
        return loaded and self._loaded >= self._lasting - ROUNDING

    def _begin_swing(
        self, frames: Sequence[pin.SE3], landing: Footstep, duration: float, shape: SwingShape
    ) -> None:
        """Start a swing from where the foot stands, over what is seen on the way."""
        start = frames[1 - self.stance]
        self.swing = SwingFoot(start, landing, duration, shape, self.ground.way(start, landing))

    @abstractmethod
    def _ahead(self) -> tuple[float, tuple[Footstep, ...], float]:
        """Return the heading, rad, the landings to come, that of the swing foot first, and the time of a step, s."""

    def _record(self, contact: tuple[bool, bool] = (True, True), events: tuple[Event, ...] = ()) -> Progress:
        """Return the record of the step as it is now, with the contacts and events of a tick."""
        phase, stance = self.phase, self.stance
        heading, upcoming, cycle = self._ahead()
        swing = 1 - stance if phase is GaitPhase.SINGLE else None
        return Progress(
            phase,
            stance,
            swing,
            contact,
            heading,
            self.steps_done,
            self.elapsed,
            self.duration,
            upcoming,
            cycle,
            events,
            self.met is not None,
            self.fast_share,
        )

    def _reference(
        self,
        pendulum: Pendulum,
        places: list[pin.SE3],
        events: tuple[Event, ...],
        *,
        most_push: float = math.inf,
        most_force: tuple[float, float] | None = None,
        cop: tuple[float, float] = (0.0, 0.0),
        urgency: float = 0.0,
    ) -> Reference:
        """Return the references of a tick; the swing foot pushes at most so hard, m/s², and the other ones stand.

        The placements of the feet are kept, not copied, and that of the swing foot takes its place among them.
        """
        side, swing = self.air, self.swing
        feet = [FootMotion.at_rest(place) for place in places]
        if side is not None and swing is not None:
            feet[side] = swing.at(self.elapsed, most_push)
            places[side] = feet[side].placement
        if most_force is None:
            contact, most_force = (side != 0, side != 1), (math.inf, math.inf)
        else:
            contact = most_force[0] > 0.0, most_force[1] > 0.0
        self.progress = self._record(contact, events)
        return Reference(pendulum, (feet[0], feet[1]), self.progress, most_force, cop, urgency)
