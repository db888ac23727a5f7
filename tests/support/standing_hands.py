"""Hands of a robot that stands, without a simulator: orders, readings and forces are made by hand."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from wbc.robots import load
from wbc.walking import FootstepPlan, HandSettings, WalkingControl, WalkingControlSettings
from wbc.walking.hands.hand import Hand, HandState
from wbc.walking.hands.hands import Hands

DOWN, AHEAD = (0.0, 0.0, -1.0), (1.0, 0.0, 0.0)


def standing(robot: str = "hrp4_class", **settings: Any) -> tuple[WalkingControl, Hands]:
    """Return the controller of a robot that stands, and its hands."""
    model = load(robot).robot()
    given = WalkingControlSettings(hands=HandSettings(**settings))
    walking = WalkingControl(model, FootstepPlan.standing(model), 0.005, given)
    return walking, walking.hands


def wrench_at(place: np.ndarray[Any, Any], force: Any, moment: Any = (0.0, 0.0, 0.0)) -> np.ndarray[Any, Any]:
    return np.concatenate([force, np.cross(place, force) + moment])


def held_hand(force: float, **settings: Any) -> tuple[Hands, Hand, Callable[[float], None]]:
    """Return hands of which the left one holds with a force, and a tick of it with what the QP gives at most."""
    hands = standing(**settings)[1]
    return hands, *hold(hands, "left_hand", AHEAD, force)


def hold(hands: Hands, name: str, along: Any, force: float) -> tuple[Hand, Callable[[float], None]]:
    hand = hands.all[name]

    def tick(most: float) -> None:
        felt = max(hand.target, 2.0 * hands.settings.touch)
        chosen = np.array((0.0, 0.0, min(most, hand.force.value + hand.extra)))
        wrench = np.concatenate((-felt * hand.direction, np.zeros(3)))
        hand.update(wrench, np.eye(3), chosen, 0.005)

    hands.press(name, force, along, firm=True)
    while hand.state is not HandState.HOLD or hand.target < force:
        tick(np.inf)
    return hand, tick


def turned(walking: WalkingControl, yaw: float) -> np.ndarray[Any, Any]:
    """Return the configuration of a robot whose whole body is turned, rad."""
    q = np.array(walking.controller.robot.q)
    q[3:7] = (0.0, 0.0, np.sin(0.5 * yaw), np.cos(0.5 * yaw))
    return q
