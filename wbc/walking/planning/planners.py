"""Footstep plans from a distance, a velocity, a path of the middle between the feet, or a stair."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Annotated

import numpy as np
import pinocchio as pin
from pydantic import Field

from wbc.core.errors import ROUNDING, InputError, choose, finite_array
from wbc.core.robot import SIDES
from wbc.core.settings import Positive
from wbc.walking.planning.footsteps import Footstep, FootstepPlan, mean_heading, other

Turn = Annotated[float, Field(ge=1e-3, le=3.0), "rad"]
"""Turn of a step."""

MOST_STEPS = 10_000
"""Greatest number of steps of a plan, three hours of walking: a greater one is a slip of the finger."""


def walk_distance(start: FootstepPlan, distance: float, *, first: str = "left") -> FootstepPlan:
    """Walk straight on with equal steps and close up at the end.

    Args:
        start: Feet and gait; its steps are dropped.
        distance: Displacement of the feet, m; negative walks backwards.
        first: Side that steps first.

    Raises:
        InputError: A distance of zero or not finite.
    """
    if abs(distance) < 1e-6:
        raise InputError("distance (m) must not be zero; a plan without steps stands")
    count = max(1, math.ceil(abs(distance) / start.gait.full.step_length - ROUNDING))
    _check_count("distance (m)", distance, count)
    return walk_path(start, [(distance / count, 0.0, 0.0)] * count, first=first)


def walk_velocity(
    start: FootstepPlan, velocity: Sequence[float], steps: int, *, first: str | None = None
) -> FootstepPlan:
    """Walk with a velocity, in the time that steps take in the gait; `Gait.for_speed` gives the gait of a velocity.

    Sideways and turning, the foot on the side of the motion opens by two steps' worth and the other closes.

    Args:
        start: Feet and gait; its steps are dropped.
        velocity: Forward (m/s), left (m/s) and turn (rad/s) of the robot's middle, shape (3,).
        steps: Number of steps, before the one that closes up.
        first: Side that steps first; the side of the motion when None.

    Raises:
        InputError: A velocity of the wrong size, one that would turn a foot by half a turn in a step, or fewer than one
            step.
    """
    if len(velocity) != 3:
        raise InputError(f"velocity must be (forward m/s, left m/s, turn rad/s), got {velocity!r}")
    vx, vy, turn = velocity
    if steps < 1:
        raise InputError(f"steps must be at least 1, got {steps}")
    _check_count("steps", steps, steps)
    gait = start.gait.full
    duration = gait.single_support + gait.double_support
    if abs(2.0 * turn * duration) >= math.pi:
        raise InputError(
            f"velocity turns a foot by {2.0 * turn * duration:.2f} rad in a step of {duration:g} s; half a turn "
            f"is {math.pi / 2.0 / duration:.2f} rad/s, and the robot's reach is less"
        )
    move = vx * duration, vy * duration, turn * duration
    leaders = tuple("right" if value < 0.0 else "left" for value in (vy, turn))
    return _path(start, [move] * steps, first or leaders[0 if vy else 1], leaders, close=True)


def turn_in_place(
    start: FootstepPlan, angle: float, *, per_step: Turn = 0.25, ahead: float = 0.0
) -> FootstepPlan:
    """Turn on the spot, or about a point ahead.

    Args:
        start: Feet and gait; its steps are dropped.
        angle: To the left, rad.
        per_step: Greatest turn from one foot to the other, rad.
        ahead: Distance of that point before the middle of the feet, m: the robot walks round it and faces it, the outer
            foot opens aside and turns, the other one closes.

    Raises:
        InputError: An angle of zero, or one that is not finite.
    """
    if angle == 0.0:
        raise InputError("angle (rad) must not be zero")
    pairs = max(1, math.ceil(abs(angle) / per_step - ROUNDING))
    _check_count("angle (rad)", angle, 2 * pairs)
    turn, leader = angle / (2 * pairs), "left" if angle > 0.0 else "right"
    if ahead > 0.0:  # the foot that goes aside: were the turn a step later, hands would pull at a cart
        leader = other(leader)
    # Each pair of steps turns by one opening, so that there is nothing left to close.
    return _path(start, [(0.0, -ahead * turn, turn)] * (2 * pairs), leader, (leader, leader), close=False)


def walk_path(
    start: FootstepPlan,
    moves: Iterable[tuple[float, float, float]],
    *,
    first: str = "left",
) -> FootstepPlan:
    """Place the feet beside a middle that moves, and close up.

    Args:
        start: Feet and gait; its steps are dropped.
        moves: Motion of the middle in each step: forward (m), left (m), turn (rad).
        first: Side that steps first.
    """
    choose("side", first, SIDES)
    return _path(start, moves, first, None, close=True)


def _path(
    start: FootstepPlan,
    moves: Iterable[tuple[float, float, float]],
    first: str,
    leaders: tuple[str, ...] | None,
    *,
    close: bool,
) -> FootstepPlan:
    """Place the feet beside a middle that moves; one side leads sideways, one turns, each foot itself when None."""
    half = 0.5 * start.spacing
    middle = _middle(start.left, start.right)
    steps = []
    side = first
    for move in moves:
        dx, dy, turn = finite_array("a move (m, m, rad)", move, (3,)).tolist()
        aside, turned = (1.0, 1.0) if leaders is None else (2.0 * (side == leader) for leader in leaders)
        middle = middle * _planar(dx, aside * dy, turned * turn)
        steps.append(_beside(middle, side, half))
        side = other(side)
    if close and steps:
        steps.append(_beside(middle, side, half))
    return replace(start, steps=tuple(steps))


def climb_stairs(
    start: FootstepPlan,
    *,
    rise: float,
    tread: Annotated[Positive, "m"],
    count: int,
    first_edge: Annotated[Positive, "m"],
    together: bool = True,
    first: str = "left",
) -> FootstepPlan:
    """Climb a stair that is known, or descend it with a negative rise.

    Args:
        start: Feet and gait; its steps are dropped.
        rise: Height of a stair, m.
        tread: Depth of a stair, m.
        count: Number of stairs.
        first_edge: Distance from the middle of the feet to the first edge, m.
        together: Bring both feet onto each stair; one foot a stair when False.
        first: Side that steps first.

    Raises:
        InputError: A stair without depth or rise, or no stairs.
    """
    if rise == 0.0 or count < 1:
        raise InputError(f"a stair must have a rise and at least one step, got rise {rise} m, count {count}")
    _check_count("number of stairs", count, 2 * count + 2)
    middle = _middle(start.left, start.right)
    half = 0.5 * start.spacing
    ground = 0.5 * (start.left.z + start.right.z)
    # Centre of the tread of each stair, after an approach that ends half a tread before the edge.
    approach = first_edge - 0.5 * tread
    if approach < -ROUNDING:
        raise InputError(
            f"the feet must stand half a tread, {0.5 * tread:g} m, before the edge, got {first_edge:g} m"
        )
    steps: list[Footstep] = []
    side = first
    if approach > 1e-6:
        plan = walk_distance(replace(start, steps=()), approach, first=first)
        steps.extend(plan.steps)
        side = other(steps[-1].side)
    for k in range(1, count + 1):
        here = middle * _planar(approach + k * tread, 0.0, 0.0)
        for _ in range(2 if together or k == count else 1):
            steps.append(replace(_beside(here, side, half), z=ground + k * rise))
            side = other(side)
    return replace(start, steps=tuple(steps))


def _check_count(what: str, value: float, count: int) -> None:
    if count > MOST_STEPS:
        raise InputError(f"{what} of {value:g} takes {count} steps; a plan has at most {MOST_STEPS}")


def _planar(x: float, y: float, yaw: float) -> pin.SE3:
    return pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.0, yaw), np.array([x, y, 0.0]))


def _middle(left: Footstep, right: Footstep) -> pin.SE3:
    """Frame between two feet, at their mean heading and height."""
    middle = _planar(0.0, 0.0, mean_heading(left.yaw, right.yaw))
    middle.translation = 0.5 * (left.position + right.position)
    return middle


def _beside(middle: pin.SE3, side: str, half: float) -> Footstep:
    return Footstep.of(side, middle * _planar(0.0, half if side == "left" else -half, 0.0))
