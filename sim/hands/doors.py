"""Simulated door: opened by its handle, pushed on by the other hand, and walked through."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from wbc.core.errors import Array
from wbc.core.settings import NonNegative, Positive, settings
from wbc.robots import load
from wbc.sim.hands.trial import ArmSpace, HandTrial, HandTrialResult, HandTrialSpec
from wbc.sim.scenes import make_scene
from wbc.sim.trial.loop import TrialHook
from wbc.walking.hands.hand import HandSettings, HandState
from wbc.walking.planning.planners import turn_in_place, walk_distance

HANDLE = (0.62, 0.42)
"""The handle in front of and below the shoulder, in shares of the arm's reach."""

HAND = "right_hand"
"""Hand that opens the door, whose hinge is on the left."""

OTHER = "left_hand"
"""Hand that pushes the leaf on."""

TUCK = (0.3, 0.0, 0.5)
"""Place of a hand close to the trunk: before, outside and below the shoulder, in shares of the arm's reach."""

BACK = (-0.25, 0.1, 0.6)
"""Place of the other hand while the first one opens the door, likewise."""

SWEEP = ((0.45, -0.1, 0.4), (0.65, 0.0, 0.35), (0.65, 0.4, 0.35), TUCK)
"""Way of the other hand, likewise."""

ASIDE = 0.4
"""Distance of the handle to the right of the middle of the doorway, m."""

REST = 1.0
"""Time at rest after each way, s."""

GOOD = math.radians(3.0)
"""Angle by which the feet have slipped that is left alone, rad."""

LEAF = 0.06
"""Distance of the handle before the leaf, m."""


@settings(kw_only=True)
class DoorSpec(HandTrialSpec):
    """A door that opens away is opened by its handle, pushed on, and walked through.

    The right hand grips the handle and the robot walks until the door is ajar. It lets go, the left hand pushes the
    leaf aside, both hands come to the trunk, and the robot walks through.

    Attributes:
        resistance: Dry friction of the hinge, Nm.
        push: Way forward with the handle in the hand, m.
        through: Way forward after the left hand has pushed the leaf aside, m; 0 ends when the right hand has let go.
        limit: Force above which the hand yields, N.
        height: Height of the handle over the ground, m; where the arm is at ease when not given.
        hands: Settings of the hand.
    """

    resistance: Annotated[NonNegative, "Nm"] = 2.0
    push: Annotated[float, Field(gt=0.0, le=0.85), "m"] = 0.25
    through: Annotated[float, Field(ge=0.0, le=10.0), "m"] = 1.5
    limit: Annotated[Positive, "N"] = 10.0
    height: Annotated[Positive, "m"] | None = None
    hands: HandSettings = HandSettings()


@dataclass(frozen=True)
class DoorResult(HandTrialResult):
    """Result of a door trial.

    Attributes:
        released_deg: Angle of the door when the hand let go, degrees.
        open_deg: Angle of the door at the end, degrees.
        beyond_mm: Distance of the pelvis behind the door's frame at the end; negative before it.
        force_N: Greatest force of the hand, low-passed as the controller has it.
        touch_N: Greatest force of the door and its frame on the robot after the hand had let go, over 10 ms; the left
            hand pushes the leaf with a part of it.
        steps_done: Steps.
    """

    released_deg: float
    open_deg: float
    beyond_mm: float
    force_N: float
    touch_N: float
    steps_done: int


class DoorTrial(HandTrial):
    """One door trial about to begin.

    Attributes:
        spec: The trial.
    """

    def __init__(self, spec: DoorSpec) -> None:
        """Build robot, door and controller.

        Raises:
            InputError: A robot that stands in the door.
        """
        self.spec = spec
        robot = load(spec.robot).robot()
        self._arm = ArmSpace.of(robot)
        self._shoulder = robot.placement(robot.base_frame).actInv(self._arm.shoulder)
        handle = self._arm.point(*HANDLE)
        self._handle = float(handle[0]), float(handle[2]) if spec.height is None else spec.height
        scene = make_scene(
            "door", distance=self._handle[0] + LEAF, handle=self._handle[1], resistance=spec.resistance
        )
        super().__init__(spec, scene, spec.hands)
        self._hinge = int(self.plant.model.joint("scene/door hinge").qposadr[0])
        self._released = math.nan
        self._force = self._touch = self._given = 0.0

    def run(self, hooks: Sequence[TrialHook] = ()) -> DoorResult:
        """Open the door, walk through, and return the result.

        Args:
            hooks: Look on.
        """
        with self.running(hooks):
            self._stages()
        frame = self._handle[0] + LEAF
        return DoorResult(
            **asdict(self.common()),
            released_deg=round(math.degrees(self._released), 1),
            open_deg=round(math.degrees(self._angle), 1),
            beyond_mm=round(1e3 * float(self.plant.data.qpos[0] - frame), 1),
            force_N=round(self._force, 1),
            touch_N=round(self._touch, 1),
            steps_done=self.walking.steps_done,
        )

    @property
    def _angle(self) -> float:
        """Angle of the door, rad."""
        return float(self.plant.data.qpos[self._hinge])

    def _stages(self) -> None:
        spec, hands, plant = self.spec, self.hands, self.plant
        if not self.advance(0.5):
            return
        self.stage = "grip"
        x, z = self._handle
        hand, other = hands.all[HAND], self.walking.arms[OTHER]
        other.reach(self._before(BACK, 1.0), "pelvis")
        hands.grip(HAND, (x, -ASIDE, z), (1.0, 0.0, 0.0), spec.limit)
        if not self.until(lambda: hand.state is HandState.GRIP, 20.0):
            return
        plant.grip(HAND, "door handle")
        if not self.advance(0.5):
            return
        self.stage = "push"
        if not self._walk(spec.push, self._feel):
            return
        self.stage = "let go"
        self._released = self._angle
        plant.let_go(HAND)
        hands.release(HAND)
        if not self.advance(1.0, self._bump):
            return
        if spec.through > 0.0:
            self.stage = "open"
            if not self._sweep():
                return
            self.stage = "through"
            slip = hands.slip
            if abs(slip) > GOOD and not self.follow(turn_in_place(self.stand(), -slip), REST, self._bump):
                return
            if not self._walk(spec.through, self._bump):
                return
        self.stage = "done"

    def _sweep(self) -> bool:
        """Push the leaf on with the other hand, and take both hands to the trunk; False if the robot falls."""
        arms = self.walking.arms
        arms[HAND].reach(self._before(TUCK, -1.0), "pelvis")
        for shares in SWEEP:
            arms[OTHER].reach(self._before(shares, 1.0), "pelvis")
            if not self.advance(1.5, self._bump):
                return False
        return True

    def _before(self, shares: tuple[float, float, float], side: float) -> Array:
        """Return a point in the pelvis: in front of, outside and below the shoulder, in shares of the reach."""
        forward, outward, below = shares
        point: Array = self._shoulder + self._arm.reach * np.array((forward, outward, -below))
        point[1] *= side
        return point

    def _walk(self, distance: float, look: Callable[[], None]) -> bool:
        """Walk straight ahead and come to rest; False if the robot falls."""
        return self.follow(walk_distance(self.stand(), distance), REST, look)

    def _feel(self) -> None:
        self._force = max(self._force, float(np.linalg.norm(self.hands.outside[:3])))

    def _bump(self) -> None:
        truth = self.plant.truth()
        given = truth.contact_force[truth.contact_sole < 0].sum(axis=0)
        self._given += 0.3 * (float(np.linalg.norm(given)) - self._given)
        self._touch = max(self._touch, self._given)


def open_door(spec: DoorSpec | None = None, **values: Any) -> DoorResult:
    """Simulate a robot that opens a door by its handle and walks through.

    Args:
        spec: The trial; the default one when None.
        **values: Fields of `DoorSpec` that differ from it.

    Raises:
        UnknownNameError: A field that the spec does not have; the nearest names are given.
        InputError: A value out of range, a robot without hands, or a force whose sudden loss it would not survive.
    """
    return DoorTrial(replace(spec or DoorSpec(), **values)).run()
