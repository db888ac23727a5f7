"""Footstep plans from a distance, a velocity, a path of the middle between the feet, or a stair."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import cycle, islice
from typing import Annotated

from pydantic import Field

from wbc.base.checked import checked
from wbc.base.errors import InputError, choose
from wbc.base.numbers import ROUNDING, finite_array
from wbc.base.settings import Angle, Count, NonNegative, Number, Positive
from wbc.core.robot import SIDES
from wbc.walking.plans.footsteps import Footstep, FootstepPlan, Place, moved, other
from wbc.walking.plans.sources import checked_velocity

Turn = Annotated[float, Field(ge=1e-3, le=3.0), "rad"]
"""Turn of a step."""

Move = tuple[float, float, float]
"""Motion of the middle between the feet in a step: forward (m), to the left (m), turn (rad)."""

MOST_STEPS = 10_000
"""Greatest number of steps of a plan, three hours of walking: a greater one is a slip of the finger."""


@checked
def walk_distance(
    start: FootstepPlan, distance: Annotated[Number, "m"], *, first: str | None = None
) -> FootstepPlan:
    """Plan a walk straight on, with equal steps and the feet side by side at the end.

    Args:
        start: Feet and gait at the start, or a plan that the new steps extend.
        distance: Displacement of the feet, m; not zero, and negative for backwards.
        first: Side that steps first. When None: the left side, or after a plan the side that has not stepped last.
    """
    if abs(distance) < 1e-6:
        raise InputError("distance (m) must not be zero; a plan without steps stands")
    count = max(1, math.ceil(abs(distance) / start.gait.full.step_length - ROUNDING))
    _check_count("distance (m)", distance, count)
    return walk_path(start, [(distance / count, 0.0, 0.0)] * count, first=first)


@checked
def walk_velocity(
    start: FootstepPlan, velocity: Sequence[float], steps: Count, *, first: str | None = None
) -> FootstepPlan:
    """Plan a walk with a velocity; `Gait.for_speed` returns a gait with step times for a velocity.

    To walk sideways or to turn, the foot on the side of the motion moves by twice the motion of a step, and the other
    foot follows.

    Args:
        start: Feet and gait at the start, or a plan that the new steps extend.
        velocity: Velocity of the robot, shape (3,): forward (m/s), to the left (m/s) and turn (rad/s). A step turns by
            less than a quarter turn.
        steps: Number of steps before the last one, which brings the feet side by side.
        first: Side that steps first; the side of the motion when None.
    """
    vx, vy, turn = checked_velocity(velocity)
    _check_count("steps", steps, steps)
    gait = start.gait.full
    duration = gait.cycle
    if abs(2.0 * turn * duration) >= math.pi:
        raise InputError(
            f"velocity turns a foot by {2.0 * turn * duration:.2f} rad in a step of {duration:g} s; half a turn "
            f"is {math.pi / 2.0 / duration:.2f} rad/s, and the robot's reach is less"
        )
    ahead, left, turn = vx * duration, vy * duration, turn * duration
    first = first or ("right" if (vy or turn) < 0.0 else "left")
    moves = [
        (ahead, 2.0 * left if opens(side, left) else 0.0, 2.0 * turn if opens(side, turn) else 0.0)
        for side in islice(sides(first), steps)
    ]
    return _path(start, moves, first)


@checked
def turn_in_place(
    start: FootstepPlan, angle: Angle, *, per_step: Turn = 0.25, ahead: Annotated[NonNegative, "m"] = 0.0
) -> FootstepPlan:
    """Plan a turn on the spot, or about a point ahead.

    Args:
        start: Feet and gait at the start, or a plan that the new steps extend.
        angle: Angle of the turn, rad; not zero, and positive to the left.
        per_step: Largest turn from one foot to the other, rad.
        ahead: Distance of the point in front of the middle of the feet, m. The robot walks around the point and faces
            it: one foot steps aside and turns, the other foot follows.
    """
    if angle == 0.0:
        raise InputError("angle (rad) must not be zero")
    pairs = max(1, math.ceil(abs(angle) / per_step - ROUNDING))
    _check_count("angle (rad)", angle, 2 * pairs)
    turn, leader = angle / (2 * pairs), "left" if angle > 0.0 else "right"
    if ahead > 0.0:  # the foot that goes aside: were the turn a step later, hands would pull at a cart
        leader = other(leader)
    # Each pair of steps turns by one opening, so that there is nothing left to close.
    return _path(
        start, [(0.0, -2.0 * ahead * turn, 2.0 * turn), (0.0, 0.0, 0.0)] * pairs, leader, close=False
    )


@checked
def walk_path(
    start: FootstepPlan, moves: Iterable[tuple[float, float, float]], *, first: str | None = None
) -> FootstepPlan:
    """Plan steps on both sides of a moving middle, with the feet side by side at the end.

    Args:
        start: Feet and gait at the start, or a plan that the new steps extend.
        moves: Motion of the middle in each step: forward (m), to the left (m), turn (rad).
        first: Side that steps first. When None: the left side, or after a plan the side that has not stepped last.
    """
    return _path(start, moves, _first_side(start, first))


def _path(
    start: FootstepPlan, moves: Iterable[Sequence[float]], first: str, *, close: bool = True
) -> FootstepPlan:
    """Return the plan of steps beside a middle that moves from the middle of the feet at the start."""
    numbers = [finite_array("a move (m, m, rad)", move, (3,)).tolist() for move in moves]
    _check_count("number of moves", len(numbers), len(numbers))
    for *_, turn in numbers:
        if abs(turn) > math.pi:
            raise InputError(f"turn of a move (rad) must be at most half a turn, {math.pi:.4g}, got {turn:g}")
    at = start.end
    z = 0.5 * (at.left.z + at.right.z)
    steps = steps_along(at.middle, z, start.spacing, first, numbers, close=close)
    return _after(start, replace(at, steps=steps))


def _first_side(start: FootstepPlan, first: str | None) -> str:
    """Return the side that steps first, if it is given; else the left one, or the one that has not stepped last."""
    if first is not None:
        return choose("side", first, SIDES)
    return other(start.steps[-1].side) if start.steps else "left"


def _after(start: FootstepPlan, plan: FootstepPlan) -> FootstepPlan:
    """Return a plan that begins where `start` ends, with the steps of `start` before."""
    return start + plan if start.steps else plan


def steps_along(
    middle: Place,
    z: float,
    spacing: float,
    first: str,
    moves: Iterable[Sequence[float]],
    *,
    close: bool = True,
) -> tuple[Footstep, ...]:
    """Return steps beside a middle that moves (forward, left, m, turn, rad), and one that closes up."""
    steps, side = [], first
    for dx, dy, turn in moves:
        middle = moved(middle, dx, dy, turn)
        steps.append(beside(middle, side, spacing, z))
        side = other(side)
    if close and steps:
        steps.append(beside(middle, side, spacing, z))
    return tuple(steps)


def sides(first: str) -> Iterator[str]:
    """Yield the sides that step, one after the other, without end."""
    return cycle((first, other(first)))


def opens(side: str, left: float) -> bool:
    """Return True for the foot on the side of a motion or turn to the left, which opens; the other one closes."""
    return left > 0.0 if side == "left" else left < 0.0


def beside(middle: Place, side: str, spacing: float, z: float) -> Footstep:
    """Return the foot of a side that stands beside a middle."""
    x, y, yaw = moved(middle, 0.0, 0.5 * spacing if side == "left" else -0.5 * spacing, 0.0)
    return Footstep(side, x, y, z, math.remainder(yaw, math.tau))


@checked
def climb_stairs(
    start: FootstepPlan,
    *,
    rise: Annotated[Number, "m"],
    tread: Annotated[Positive, "m"],
    count: Count,
    first_edge: Annotated[Positive, "m"],
    together: bool = True,
    first: str | None = None,
) -> FootstepPlan:
    """Plan steps up known stairs, or, with a negative rise, down.

    Args:
        start: Feet and gait at the start, or a plan that the new steps extend.
        rise: Height of a stair, m; not zero.
        tread: Depth of a stair, m.
        count: Number of stairs.
        first_edge: Distance from the middle of the feet to the first edge, m; at least half a tread.
        together: Bring both feet onto each stair; with False one foot onto each stair.
        first: Side that steps first. When None: the left side, or after a plan the side that has not stepped last.
    """
    if rise == 0.0:
        raise InputError("rise (m) must not be zero; walk_distance walks on the level")
    _check_count("number of stairs", count, 2 * count + 2)
    feet = start.end
    middle, ground = feet.middle, 0.5 * (feet.left.z + feet.right.z)
    # Centre of the tread of each stair, after an approach that ends half a tread before the edge.
    approach = first_edge - 0.5 * tread
    if approach < -ROUNDING:
        raise InputError(
            f"the feet must stand half a tread, {0.5 * tread:g} m, before the edge, got {first_edge:g} m"
        )
    steps: list[Footstep] = []
    first = _first_side(start, first)
    side = first
    if approach > 1e-6:
        plan = walk_distance(start.end, approach, first=first)
        steps.extend(plan.steps)
        side = other(steps[-1].side)
    for k in range(1, count + 1):
        here = moved(middle, approach + k * tread, 0.0, 0.0)
        for _ in range(2 if together or k == count else 1):
            steps.append(beside(here, side, start.spacing, ground + k * rise))
            side = other(side)
    return _after(start, replace(start.end, steps=tuple(steps)))


def _check_count(what: str, value: float, count: int) -> None:
    if count > MOST_STEPS:
        raise InputError(f"{what} of {value:g} takes {count} steps; a plan has at most {MOST_STEPS}")
