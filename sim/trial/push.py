"""Pushes: at a time, or at a phase of a step."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated

import numpy as np

from wbc.base.errors import InputError
from wbc.base.numbers import ROUNDING
from wbc.base.settings import Angle, Count, NonNegative, Positive, Share, settings
from wbc.sim.simulation.simulation import Simulation
from wbc.sim.trial.trial import TrialHook, TrialTick
from wbc.walking.contact import LIFT_OFFS
from wbc.walking.steered import SteeredControl

PUSH_DURATION = 0.1
"""Duration of a push, s: short against the time constant of a falling humanoid, √(0.8 m / g) ≈ 0.29 s."""


@settings(kw_only=True)
class WalkPush:
    """Push of a walk: a constant horizontal force on a body, from a time or from a phase of a step on.

    Attributes:
        impulse: Force times duration divided by the robot's mass, Ns/kg.
        direction: Direction of the force in the world, rad: 0 along x, π/2 along y.
        duration: Duration of the force, s.
        body: Link or frame that is pushed; the force acts at the centre of mass of the link.
        time: Time at which the push begins, s; None for a phase of a step.
        step: Number of the step, from 1; None for a time.
        phase: Phase of the step at which the push begins: 0 at the lift-off of its foot, 1 at the planned lift-off of
            the next foot.
    """

    impulse: Annotated[NonNegative, "Ns/kg"]
    direction: Angle = 0.0
    duration: Annotated[Positive, "s"] = PUSH_DURATION
    body: str = "torso"
    time: Annotated[NonNegative, "s"] | None = None
    step: Count | None = None
    phase: Share = 0.0

    def __post_init__(self) -> None:
        if (self.time is None) is (self.step is None):
            raise InputError("a push begins either at a time or at a step; give one of them")


def push_along(
    plant: Simulation, impulse: float, direction: float, duration: float = PUSH_DURATION, body: str = "torso"
) -> None:
    """Begin a horizontal push: impulse over the robot's mass, Ns/kg, direction in the world, rad, duration, s."""
    force = impulse * plant.robot.mass / duration
    plant.push(body, force * np.array([math.cos(direction), math.sin(direction), 0.0]), duration)


class PushSchedule(TrialHook):
    """The pushes of one trial that have not begun yet."""

    def __init__(self, pushes: Sequence[WalkPush]) -> None:
        """Keep all pushes for later."""
        self._pending = list(pushes)
        self._lift_off: dict[int, tuple[float, float]] = {}  # step, from 1 → time and duration of the step, s

    @property
    def not_begun(self) -> list[str]:
        """A sentence for each push that has not begun."""
        places = [f"at {p.time:g} s" if p.step is None else f"at step {p.step}" for p in self._pending]
        return [f"the push {place} did not begin before the end" for place in places]

    def tick(self, tick: TrialTick) -> None:
        """Begin the pushes that are due."""
        if not self._pending:
            return
        plant, now = tick.plant, tick.plant.time
        progress = tick.control.progress if isinstance(tick.control, SteeredControl) else None
        if progress is not None and not LIFT_OFFS.isdisjoint(progress.events):
            self._lift_off.setdefault(progress.steps_done + 1, (now, progress.cycle))
        for push in [push for push in self._pending if now >= self._due(push) - ROUNDING]:
            self._pending.remove(push)
            push_along(plant, push.impulse, push.direction, push.duration, push.body)

    def _due(self, push: WalkPush) -> float:
        """Return the time at which a push begins, s; infinite if its step has not begun."""
        if push.time is not None:
            return push.time
        assert push.step is not None, "a push has a time or a step"
        begin, cycle = self._lift_off.get(push.step, (math.inf, 0.0))
        return begin + push.phase * cycle
