"""Simulated stand on one foot with a hand on a wall beside the robot, and a push."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Annotated, Any

from wbc.core.robot import Robot
from wbc.core.settings import NonNegative, Positive, settings
from wbc.robots import load
from wbc.sim.hands.trial import ArmSpace, HandTrial, HandTrialResult, HandTrialSpec
from wbc.sim.scenes import make_scene
from wbc.sim.trial.loop import TrialHook
from wbc.sim.trial.push import PUSH_DURATION
from wbc.walking.hands.hand import HandSettings, HandState
from wbc.walking.planning.footsteps import FootstepPlan
from wbc.walking.planning.gait import Gait

APPROACH = 3.0
"""Time on both feet beside that in which the hand goes before the wall and builds up its force, s."""

SECOND = 3.5
"""Time on one foot before the push, s."""


@settings(kw_only=True)
class OneFootSpec(HandTrialSpec):
    """A robot stands on its right foot with its left hand on a wall, and is pushed at the torso.

    Attributes:
        force: Force with which the hand presses on the wall, N; 0 leaves the hand where it is.
        impulse: Force of the push times its duration over the robot's mass, Ns/kg.
        direction: Direction of the push, degrees; 0 is forward, 90 to the left, to the wall.
        seconds: Time on one foot after the push, s.
        distance: Distance of the wall from the middle of the feet, m; where the arm is at ease when not given.
        hands: Settings of the hand.
    """

    force: Annotated[NonNegative, "N"] = 15.0
    impulse: Annotated[NonNegative, "Ns/kg"] = 0.1
    direction: Annotated[float, "°"] = 90.0
    seconds: Annotated[Positive, "s"] = 4.0
    distance: Annotated[Positive, "m"] | None = None
    hands: HandSettings = HandSettings(help=1.0)


@dataclass(frozen=True)
class OneFootResult(HandTrialResult):
    """Result of a push on one foot.

    Attributes:
        impulse: Ns/kg.
        direction_deg: Direction of the push, degrees.
        force_N: Force asked for, of the hand.
        lost: True if the hand has lost the wall.
        on_one_foot: True if the foot in the air never touched the ground until the end.
    """

    impulse: float
    direction_deg: float
    force_N: float
    lost: bool
    on_one_foot: bool


class OneFootTrial(HandTrial):
    """One such stand about to begin.

    Attributes:
        spec: The stand.
    """

    def __init__(self, spec: OneFootSpec) -> None:
        """Build robot, wall and controller."""
        self.spec = spec
        space = ArmSpace.of(load(spec.robot).robot())
        shoulder, reach = space.shoulder, space.reach
        y = float(shoulder[1]) + 0.6 * reach if spec.distance is None else spec.distance
        self._point = (float(shoulder[0]) + 0.22 * reach, y, float(shoulder[2]) - 0.39 * reach)
        super().__init__(spec, make_scene("wall", distance=y, angle=90.0), spec.hands, self._plan)
        self._off = True

    @property
    def _first(self) -> float:
        """Time on both feet, s."""
        return self.spec.hands.reach + self.spec.hands.ramp + APPROACH

    def _plan(self, robot: Robot) -> FootstepPlan:
        swing = SECOND + self.spec.seconds + 5.0
        plan = FootstepPlan.standing(robot, Gait(single_support=swing, initial_double_support=self._first))
        return replace(plan, steps=(plan.left,))

    def run(self, hooks: Sequence[TrialHook] = ()) -> OneFootResult:
        """Lift a foot, push, and return the result.

        Args:
            hooks: Look on.
        """
        with self.running(hooks):
            self._stages()
        spec = self.spec
        return OneFootResult(
            **asdict(self.common()),
            impulse=spec.impulse,
            direction_deg=spec.direction,
            force_N=spec.force,
            lost=self.hands.all["left_hand"].state is HandState.LOST,
            on_one_foot=self._off and self.stage == "done",
        )

    def _stages(self) -> None:
        spec, plant = self.spec, self.plant
        if not self.advance(0.3):
            return
        if spec.force:
            self.hands.press("left_hand", spec.force, (0.0, 1.0, 0.0), at=self._point, firm=True)
        if not self.advance(self._first - 0.3):
            return
        self.stage = "lift"
        if not self.advance(SECOND):
            return
        self.stage = "push"
        force, angle = spec.impulse * self.robot.mass / PUSH_DURATION, math.radians(spec.direction)
        plant.push("torso", (force * math.cos(angle), force * math.sin(angle), 0.0), PUSH_DURATION)
        if self.advance(spec.seconds, self._look):
            self.stage = "done"

    def _look(self) -> None:
        self._off = self._off and not self.walking.walk.phases.contact[0]


def push_on_one_foot(spec: OneFootSpec | None = None, **values: Any) -> OneFootResult:
    """Simulate a robot on one foot, a hand on a wall, that is pushed.

    Args:
        spec: The stand; the default one when None.
        **values: Fields of `OneFootSpec` that differ from it.

    Raises:
        UnknownNameError: A field that the spec does not have; the nearest names are given.
        InputError: A value out of range, or a robot without hands.
    """
    return OneFootTrial(replace(spec or OneFootSpec(), **values)).run()
