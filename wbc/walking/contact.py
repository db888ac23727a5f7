"""Contacts of the feet while they walk: events, phases, and the detection of a touch-down, for every walk."""

from __future__ import annotations

import enum


class GaitPhase(enum.Enum):
    """Phase of the feet."""

    STANDING = "standing"
    """Both feet stand, and no step has been asked for."""
    DOUBLE = "double support"
    """Both feet stand between two steps."""
    SINGLE = "single support"
    """One foot stands, and the other one swings."""


class Event(enum.Enum):
    """Event of a tick."""

    STARTED = "started"
    LIFT_OFF = "lift-off"
    FORCED_LIFT_OFF = "lift-off though still loaded"
    EARLY_TOUCH_DOWN = "early touch-down"
    TOUCH_DOWN = "touch-down"
    LATE_TOUCH_DOWN = "late touch-down"
    NO_TOUCH_DOWN = "no ground found"
    STOPPED = "stopped"


LIFT_OFFS = frozenset((Event.LIFT_OFF, Event.FORCED_LIFT_OFF))
"""Events that begin a step."""

TOUCHED = frozenset((Event.EARLY_TOUCH_DOWN, Event.TOUCH_DOWN, Event.LATE_TOUCH_DOWN))
"""Events that end one in contact; a foot that finds no ground has no impact."""


def touch_down(late: float, before: float, after: float) -> Event:
    """Return the event of a contact that comes `late`, s: on time from `before` to `after` its planned time, s."""
    if late < -before:
        return Event.EARLY_TOUCH_DOWN
    return Event.TOUCH_DOWN if late < after else Event.LATE_TOUCH_DOWN
