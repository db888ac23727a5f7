"""Check of a footstep plan against the reach of a robot's legs and the extent of the ground."""

from __future__ import annotations

import math
from typing import Annotated

from pydantic import AfterValidator

from wbc.base.checked import checked
from wbc.base.errors import InputError
from wbc.base.numbers import ROUNDING
from wbc.base.settings import Number
from wbc.core.robot import SIDES
from wbc.walking.plans.footsteps import LEAST_STAIR, Footstep, FootstepPlan, Index
from wbc.walking.plans.gait import StepGait
from wbc.walking.plans.reach import QUICKEST, Reach

MAX_SLOPE = 0.5
"""Steepest landing that a plan may ask for, rad: tan 0.5 = 0.55, near the friction at which a sole slips."""


def _in_order(extent: tuple[float, float, float, float]) -> tuple[float, float, float, float]:
    low_x, high_x, low_y, high_y = extent
    if not (low_x < high_x and low_y < high_y):
        raise ValueError(f"must be smallest and largest x, smallest and largest y, got {extent}")
    return extent


Extent = Annotated[tuple[Number, Number, Number, Number], AfterValidator(_in_order), "m"]
"""Smallest and largest x, smallest and largest y of the ground, m."""


class OutOfReachError(InputError):
    """A step that the legs do not reach in the time of its swing, or a velocity of such steps."""


@checked
def check_plan(
    plan: FootstepPlan,
    reach: Reach | None,
    extent: Extent | None = None,
    *,
    effort: bool = True,
    first: Index = 0,
) -> None:
    """Raise an `InputError` unless legs of a reach walk a plan on a ground of an extent, m; None is endless.

    Of legs whose reach is unknown, None, the ground alone is checked, under the centres of the soles. Without `effort`
    the speeds and torques that its swings need are not checked: those of a plan that was accepted are the same from a
    place beside it. The `first` steps, and with them the feet at the start, may be left out.
    """
    if reach is not None:
        _check_legs(plan, reach, first, effort=effort)
    if extent is not None:
        check_extent(plan, reach, extent, first)


def _check_legs(plan: FootstepPlan, reach: Reach, first: int, *, effort: bool) -> None:
    gait = plan.gait.full.for_stairs() if plan.climbs else plan.gait.full
    height = gait.swing_height
    if height > reach.max_swing_height + ROUNDING:
        raise InputError(
            f"swing_height of {height:g} m is out of reach: the legs lift a foot by up to "
            f"{reach.max_swing_height:.3f} m"
        )
    if gait.single_support < reach.min_single_support - ROUNDING:
        raise InputError(
            f"single_support of {gait.single_support:g} s is too quick: the robot needs "
            f"{reach.min_single_support:.3f} s at least, {QUICKEST:g}/ω"
        )
    if first == 0:
        _check_overlap("the feet at the start", plan.left, plan.right, reach)
    for i, step in enumerate(plan.steps[first:], first):
        _check_step(f"step {i + 1} of {len(plan)} ({step.side})", plan.stance(i), step, reach)
        _check_overlap(f"step {i + 1} of {len(plan)}", step, plan.stance(i), reach)
        if effort:
            _check_effort(plan, i, gait, reach)


def _check_step(what: str, stance: Footstep, step: Footstep, reach: Reach) -> None:
    forward, spacing, up, open_turn = step.outwards_of(stance)
    limits = (
        ("goes forward by", forward, -reach.max_length, reach.max_length, "m"),
        ("stands beside the stance foot by", spacing, reach.min_spacing, reach.max_spacing, "m"),
        ("rises by", up, -reach.max_height, reach.max_height, "m"),
        ("turns outwards by", open_turn, -0.5 * reach.max_yaw, reach.max_yaw, "rad"),
        ("pitches by", step.pitch, -MAX_SLOPE, MAX_SLOPE, "rad"),
        ("rolls by", step.roll, -MAX_SLOPE, MAX_SLOPE, "rad"),
    )
    for verb, value, low, high, unit in limits:
        if not low - ROUNDING <= value <= high + ROUNDING:
            raise OutOfReachError(
                f"{what} {verb} {value:.4g} {unit}; within reach is {low:.3f} to {high:.3f} {unit}"
                + (": a smaller step_length or velocity fits" if verb.startswith("goes") else "")
            )


def _check_effort(plan: FootstepPlan, index: int, gait: StepGait, reach: Reach) -> None:
    """Raise an `InputError` for a step on level ground that is long, quick and high at once; stairs take their time."""
    step, stance = plan.steps[index], plan.stance(index)
    before = plan.feet(index)[SIDES.index(step.side)]
    (begin, from_side, down, _), (end, to_side, up, _) = (foot.seen_from(stance) for foot in (before, step))
    if max(abs(down), abs(up)) >= LEAST_STAIR:
        return
    effort = reach.effort(gait, begin, end, to_side - from_side)
    if effort > 1.0:
        way, height = math.hypot(end - begin, to_side - from_side), 1e3 * gait.swing_height
        raise OutOfReachError(
            f"step {index + 1} of {len(plan)} ({step.side}) moves a foot by {way:.3f} m, {height:.0f} mm high, in "
            f"{gait.single_support:g} s: that takes {effort:.2f} times what hip and knee give in that time; a longer "
            "single_support, shorter steps or a lower swing_height fit"
        )


def _check_overlap(what: str, a: Footstep, b: Footstep, reach: Reach) -> None:
    if reach.overlap(a, b):
        raise InputError(
            f"the soles overlap at {what}: {a.side} at ({a.x:.3f}, {a.y:.3f}), {b.side} at ({b.x:.3f}, {b.y:.3f}) m"
        )


def check_extent(plan: FootstepPlan, reach: Reach | None, extent: Extent, first: int = 0) -> None:
    """Raise an `InputError` for a sole of a plan, or, without a reach, its centre, beyond a ground of an extent, m."""
    low_x, high_x, low_y, high_y = extent
    soles = ((0.0, 0.0), (0.0, 0.0)) if reach is None else reach.soles
    start = () if first else ((-1, plan.left), (-1, plan.right))
    for i, step in (*start, *enumerate(plan.steps[first:], first)):
        length, width = soles[SIDES.index(step.side)]
        c, s = abs(math.cos(step.yaw)), abs(math.sin(step.yaw))
        x, y = 0.5 * (c * length + s * width) - ROUNDING, 0.5 * (s * length + c * width) - ROUNDING
        if not (low_x + x <= step.x <= high_x - x and low_y + y <= step.y <= high_y - y):
            which = f"the {step.side} foot at the start" if i < 0 else f"step {i + 1}"
            raise InputError(
                f"{which} leaves the ground at x = {step.x:.3f}, y = {step.y:.3f} m; it {over(extent)}"
            )


def over(extent: Extent) -> str:
    """Return the extent of a ground, m, as a text."""
    low_x, high_x, low_y, high_y = extent
    return f"extends over x from {low_x:g} to {high_x:g} and y from {low_y:g} to {high_y:g} m"
