"""Walks of a trained policy: its file with a hash of the content, and the velocities that a plan asks it for."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from itertools import pairwise

from wbc.base.errors import InputError
from wbc.base.files import file_of
from wbc.core.estimation.observer import Observer
from wbc.core.robot import Robot
from wbc.ground import KnownGround
from wbc.policy.control import PolicyControl
from wbc.policy.description import PolicyDescription
from wbc.policy.guard import PolicyGuard
from wbc.sim.walks.plan import STEP_TIME, WalkPlan

SPEED, START = 0.3, 1.0
"""Velocity of a walk over a distance, m/s, and the time of the stand before a walk, s."""


@lru_cache(maxsize=16)
def described(name: str) -> PolicyDescription:
    """Return the description of a policy, by the name of its file with the hash."""
    return PolicyDescription.of(file_of(name))


def driven(plan: WalkPlan) -> WalkPlan:
    """Return the velocities that a policy is asked for in place of a plan: it has no goal and plans no steps.

    A distance is walked at 0.3 m/s, and steps of a velocity take 0.8 s.
    """
    if plan.drive is not None:
        return plan
    if plan.distance is not None:
        velocity, time = (math.copysign(SPEED, plan.distance), 0.0, 0.0), abs(plan.distance) / SPEED
    elif plan.velocity is not None:
        velocity, time = plan.velocity, STEP_TIME * (plan.steps or 1)
    else:
        raise InputError(
            "a trained policy walks a distance, steps of a velocity, or velocities over time: its plan has distance, "
            "velocity or drive"
        )
    return replace(
        plan,
        distance=None,
        velocity=None,
        steps=None,
        drive=((START, *velocity), (START + max(time, 0.1), 0.0, 0.0, 0.0)),
    )


def turned(orders: Sequence[Sequence[float]]) -> float:
    """Return the angle that rows of `WalkPlan.drive` ask for, rad."""
    return sum(row[3] * (after[0] - row[0]) for row, after in pairwise(orders))


def sees(name: str) -> bool:
    """Return True for a policy that sees the ground."""
    return any(term.name == "height_scan" for term in described(name).observation)


def trained_control(
    name: str, robot: Robot, observer: Observer, period: float, ground: KnownGround | None, guarded: bool
) -> PolicyControl | PolicyGuard:
    """Return the control of a robot that stands, by a policy of a spec, or the guard of such a control."""
    about = described(name)
    control = PolicyControl(robot, file_of(name), period, description=about, observer=observer, ground=ground)
    return PolicyGuard(control) if guarded else control
