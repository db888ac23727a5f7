"""Simulated hands: presses on a surface, a hand on a wall that holds a robot on one foot, carts, a door.

A new trial of hands goes here, as a module with its spec, its result and one function.
"""

from wbc.sim.hands.carts import CartResult, CartSpec, CartTrial, push_cart
from wbc.sim.hands.doors import DoorResult, DoorSpec, DoorTrial, open_door
from wbc.sim.hands.one_foot import OneFootResult, OneFootSpec, OneFootTrial, push_on_one_foot
from wbc.sim.hands.pressing import HandPressResult, HandPressSpec, HandPressTrial, press_hands
from wbc.sim.hands.trial import HandTrial, HandTrialResult, HandTrialSpec

__all__ = [
    # What all have in common
    "HandTrial",
    "HandTrialResult",
    "HandTrialSpec",
    # Pressing
    "HandPressResult",
    "HandPressSpec",
    "HandPressTrial",
    "press_hands",
    # A hand on a wall
    "OneFootResult",
    "OneFootSpec",
    "OneFootTrial",
    "push_on_one_foot",
    # Carts
    "CartResult",
    "CartSpec",
    "CartTrial",
    "push_cart",
    # Doors
    "DoorResult",
    "DoorSpec",
    "DoorTrial",
    "open_door",
]
