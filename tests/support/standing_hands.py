"""Hands of a robot that stands, without a simulator: orders, readings and forces are made by hand."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
from at_rest import at_rest

from wbc.robots import load
from wbc.walking import FootstepPlan, HandSettings, WalkingControl, WalkingControlSettings
from wbc.walking.hands.hand import Hand, HandState
from wbc.walking.hands.hands import Hands
from wbc.walking.source import StandSource

DOWN, AHEAD = (0.0, 0.0, -1.0), (1.0, 0.0, 0.0)


def standing(robot: str = "hrp4_class", **settings: Any) -> tuple[WalkingControl, Hands]:
    """Return the controller of a robot that stands, and its hands, whose sensors have read zero."""
    model = load(robot).robot()
    given = WalkingControlSettings(hands=HandSettings(**settings))
    walking = WalkingControl(model, FootstepPlan.standing(model), 0.005, given)
    measure(walking)
    return walking, walking.hands


def measure(walking: WalkingControl, **sensors: Any) -> None:
    """Let hands without an order take in a measurement at rest; their sensors read zero if nothing else is given."""
    robot, hands = walking.controller.robot, walking.hands
    given = {"hand_wrenches": np.zeros((len(hands.all), 6))} | sensors
    hands.update(at_rest(robot, 0.0, **given), StandSource(robot).update(None))  # type: ignore[arg-type]


def wrench_at(place: np.ndarray[Any, Any], force: Any, moment: Any = (0.0, 0.0, 0.0)) -> np.ndarray[Any, Any]:
    return np.concatenate([force, np.cross(place, force) + moment])


def held_hand(force: float, **settings: Any) -> tuple[Hands, Hand, Callable[[float], None]]:
    """Return hands of which the left one holds with a force, and a tick of it with what the QP gives at most."""
    hands = standing(**settings)[1]
    return hands, *hold(hands, "left_hand", AHEAD, force)


def hold(hands: Hands, name: str, along: Any, force: float) -> tuple[Hand, Callable[[float], None]]:
    hand = hands.all[name]

    def tick(most: float) -> None:
        felt = max(hand.force.total, 2.0 * hands.settings.touch)
        feel(
            hand,
            -felt * hand.direction,
            chosen=(0.0, 0.0, min(most, hand.force.ramp.value + hand.force.extra)),
        )

    hands.press(name, force, along, firm=True)
    while hand.state is not HandState.HOLD or hand.force.total < force:
        tick(np.inf)
    return hand, tick


def feel(hand: Hand, force: Any, moment: Any = (0.0, 0.0, 0.0), chosen: Any = None) -> None:
    """Let a hand feel a wrench, in the world, for a tick in which the QP has chosen a force for its contact."""
    turn, solution = hand.measured.rotation.T, None
    if chosen is not None:
        contacts = {hand.contact.name: slice(0, 3)}
        solution = SimpleNamespace(layout=SimpleNamespace(contacts=contacts), variables=np.array(chosen))
    hand.update(np.concatenate((turn @ force, turn @ moment)) + hand.sensor.tare, solution)  # type: ignore[arg-type]


def turned(walking: WalkingControl, yaw: float) -> np.ndarray[Any, Any]:
    """Return the configuration of a robot whose whole body is turned, rad."""
    q = np.array(walking.controller.robot.q)
    q[3:7] = (0.0, 0.0, np.sin(0.5 * yaw), np.cos(0.5 * yaw))
    return q
