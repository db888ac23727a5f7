"""Simulated pushing and pulling: a cart goes forward, turns, and comes back."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from types import MappingProxyType
from typing import Annotated, Any

import numpy as np
import pinocchio as pin
from pydantic import Field

from wbc.core.settings import NonNegative, Positive, settings
from wbc.robots import load
from wbc.sim.hands.trial import SIDES, ArmSpace, HandTrial, HandTrialResult, HandTrialSpec
from wbc.sim.scenes import make_scene
from wbc.sim.scenes.things import GRIP
from wbc.sim.trial.loop import TrialHook
from wbc.walking.hands.hand import HandSettings, HandState
from wbc.walking.planning.footsteps import FootstepPlan, mean_heading
from wbc.walking.planning.planners import walk_distance, walk_velocity

BAR = (0.69, 0.48)
"""The cart's bar in front of and below the shoulder, in shares of the arm's reach."""

BEHIND = 0.57
"""Distance of the cart's bar behind its middle, m."""

USUAL: Mapping[str, float] = MappingProxyType({"resistance": 15.0, "turn_step": 2.2})
"""Values of `CartSpec` that are not given."""

ROBOTS: Mapping[str, Mapping[str, float]] = MappingProxyType(
    {
        "talos": {"resistance": 49.0, "limit": 30.0, "distance": 0.55, "height": 0.95},
        "g1": {"height": 0.85, "turn_step": 1.1},
    }
)
"""The same of single robots, which come before the usual ones."""

REST = 2.0
"""Time at rest after each way, s."""

GOOD = math.radians(1.5)
"""Error of the heading that is left alone, rad."""


@settings(kw_only=True)
class CartSpec(HandTrialSpec):
    """A cart is gripped at both handles, pushed, turned about its middle, and pulled back.

    Attributes:
        forward: Way forward, m.
        turn: Turn to the left about the middle of the cart, degrees.
        back: Way back, m.
        resistance: Force along the ground that moves the cart, N; 15 N (49 N for talos) when not given.
        limit: Force of a hand above which it yields, N; what the robot may lose suddenly bounds it. 30 N for
            talos, else nine tenths of the resistance, when not given.
        distance: Distance of the bar in front of the middle of the feet, m; where the arms are at ease (0.55 m for
            talos) when not given.
        height: Height of the bar over the ground, m; likewise (0.95 m for talos, 0.85 m for g1).
        turn_step: Turn of a step about the middle of the cart, to which the robot steps sideways, degrees; 2.2 (1.1 for
            g1) when not given.
        corrections: Greatest number of turns after each leg that take back an error of the heading, which the robot
            knows from its hands.
        hands: Settings of the hands.
    """

    forward: Annotated[float, Field(ge=0.0, le=10.0), "m"] = 1.0
    turn: Annotated[float, Field(ge=-180.0, le=180.0), "°"] = 30.0
    back: Annotated[float, Field(ge=0.0, le=10.0), "m"] = 1.0
    resistance: Annotated[NonNegative, "N"] | None = None
    limit: Annotated[Positive, "N"] | None = None
    distance: Annotated[Positive, "m"] | None = None
    height: Annotated[Positive, "m"] | None = None
    turn_step: Annotated[float, Field(gt=0.1, le=20.0), "°"] | None = None
    corrections: Annotated[int, Field(ge=0, le=20)] = 3
    hands: HandSettings = HandSettings()

    def of_robot(self, name: str, otherwise: float = math.nan) -> float:
        """Return the value of a field; where it is not given that of the robot, the usual one, or else another."""
        given = getattr(self, name)
        usual = {**USUAL, **ROBOTS.get(self.robot, {})}
        return float(usual.get(name, otherwise) if given is None else given)


@dataclass(frozen=True)
class CartResult(HandTrialResult):
    """Result of a cart trial.

    Attributes:
        resistance_N: Force along the ground that moves the cart.
        place_error_mm: Distance of the cart from where it should be at the end.
        heading_error_deg: Error of its heading then, degrees.
        cart_tilt_deg: Greatest tilt of the cart, degrees.
        pelvis_tilt_deg: Greatest tilt of the pelvis, degrees.
        force_N: Greatest force of both hands, low-passed as the controller has it.
        steps_done: Steps.
        corrections: Turns that took back an error of the heading.
    """

    resistance_N: float
    place_error_mm: float
    heading_error_deg: float
    cart_tilt_deg: float
    pelvis_tilt_deg: float
    force_N: float
    steps_done: int
    corrections: int


class CartTrial(HandTrial):
    """One cart trial about to begin.

    Attributes:
        spec: The trial.
    """

    def __init__(self, spec: CartSpec) -> None:
        """Build robot, cart and controller.

        Raises:
            InputError: A robot that stands in the cart.
        """
        self.spec = spec
        x, _, z = ArmSpace.of(load(spec.robot).robot()).point(*BAR).tolist()
        self._bar = (spec.of_robot("distance", x), GRIP, spec.of_robot("height", z))
        self._resistance = spec.of_robot("resistance")
        scene = make_scene("cart", distance=self._bar[0], handle=self._bar[2], resistance=self._resistance)
        super().__init__(spec, scene, spec.hands)
        self._cart = int(self.plant.model.body("scene/cart").id)
        self._begin = self._pose()
        self._goal = self._begin
        self._held = 0.0  # heading of the line between the hands less that of the cart, rad
        self._greatest = np.zeros(3)  # tilt of the cart and of the pelvis, rad, and force, N
        self._corrections = 0

    def run(self, hooks: Sequence[TrialHook] = ()) -> CartResult:
        """Push, turn and pull the cart, and return the result.

        Args:
            hooks: Look on.
        """
        with self.running(hooks):
            self._stages()
        error = self._goal.actInv(self._pose())
        cart, pelvis, force = self._greatest.tolist()
        return CartResult(
            **asdict(self.common()),
            resistance_N=self._resistance,
            place_error_mm=round(1e3 * float(np.hypot(*error.translation[:2])), 1),
            heading_error_deg=round(math.degrees(_yaw(error)), 2),
            cart_tilt_deg=round(math.degrees(cart), 2),
            pelvis_tilt_deg=round(math.degrees(pelvis), 2),
            force_N=round(force, 1),
            steps_done=self.walking.steps_done,
            corrections=self._corrections,
        )

    def _stages(self) -> None:
        spec, hands = self.spec, self.hands
        if not self.advance(0.5):
            return
        self.stage = "grip"
        x, y, z = self._bar
        limit = spec.of_robot("limit", 0.9 * self._resistance)
        for name, side in SIDES.items():
            hands.grip(name, (x, side * y, z), (1.0, 0.0, 0.0), limit)
        if not self.until(lambda: all(hand.state is HandState.GRIP for hand in hands.all.values()), 20.0):
            return
        for name in SIDES:
            self.plant.grip(name, name.replace("_hand", " handle"))
        if not self.advance(1.0):
            return
        self._held = self._heading()
        for stage, way, turn in (
            ("forward", spec.forward, 0.0),
            ("turn", 0.0, math.radians(spec.turn)),
            ("back", -spec.back, 0.0),
        ):
            if way == turn == 0.0:
                continue
            self.stage = stage
            self._goal = self._goal * pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.0, turn), np.array((way, 0.0, 0.0)))
            start = self.stand()
            plan = walk_distance(start, way) if way else self._turning(start, turn)
            if not self.follow(plan, REST, self._look):
                return
            for _ in range(spec.corrections):
                rest = math.remainder(
                    _yaw(self._goal) - self._heading() + self._held - _yaw(self._begin), math.tau
                )
                if abs(rest) < GOOD:
                    break
                self._corrections += 1
                if not self.follow(self._turning(self.stand(), rest), REST, self._look):
                    return
        self.stage = "done"

    def _turning(self, start: FootstepPlan, angle: float) -> FootstepPlan:
        """Return a plan that turns the robot about the middle of the cart."""
        radius = self._bar[0] + BEHIND
        steps = max(2, math.ceil(abs(angle) / math.radians(self.spec.of_robot("turn_step"))))
        duration = start.gait.single_support + start.gait.double_support
        rate, before = angle / (steps * duration), mean_heading(start.left.yaw, start.right.yaw)
        for _ in range(4):  # the step that closes up turns as well
            plan = walk_velocity(start, (0.0, -radius * rate, rate), steps=steps)
            left, right = plan.final
            off = math.remainder(mean_heading(left.yaw, right.yaw) - before - angle, math.tau)
            turned = angle + off
            rate *= angle / turned if turned else 1.0
        return plan

    def _heading(self) -> float:
        """Return the heading of what both hands hold, as the robot knows it, rad."""
        estimate = self.walking.control.observer.robot
        left, right = (estimate.placement(estimate.frames[name]).translation for name in SIDES)
        return math.atan2(right[0] - left[0], left[1] - right[1]) + self.hands.slip

    def _pose(self) -> pin.SE3:
        """Return the true place of the cart on the ground."""
        data = self.plant.data
        rotation = data.xmat[self._cart].reshape(3, 3)
        yaw = math.atan2(rotation[1, 0], rotation[0, 0])
        x, y, _ = data.xpos[self._cart].tolist()
        return pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.0, yaw), np.array((x, y, 0.0)))

    def _look(self) -> None:
        data = self.plant.data
        cart = math.acos(min(1.0, float(data.xmat[self._cart][8])))
        _, x, y, _ = data.qpos[3:7].tolist()
        tilt = math.acos(max(-1.0, min(1.0, 1.0 - 2.0 * (x * x + y * y))))
        force = float(np.linalg.norm(self.hands.outside[:3]))
        self._greatest = np.maximum(self._greatest, (cart, tilt, force))


def push_cart(spec: CartSpec | None = None, **values: Any) -> CartResult:
    """Simulate a robot that pushes, turns and pulls a cart.

        result = push_cart(robot="talos", resistance=49.0)

    Args:
        spec: The trial; the default one when None.
        **values: Fields of `CartSpec` that differ from it.

    Raises:
        UnknownNameError: A field that the spec does not have; the nearest names are given.
        InputError: A value out of range, a robot without hands, or a force whose sudden loss it would not survive.
    """
    return CartTrial(replace(spec or CartSpec(), **values)).run()


def _yaw(pose: pin.SE3) -> float:
    return math.atan2(pose.rotation[1, 0], pose.rotation[0, 0])
