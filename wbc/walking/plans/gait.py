"""Gait: step sizes, timings and swing height."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import fields, replace
from functools import cached_property, lru_cache
from typing import Annotated, Any, NamedTuple, Self

import numpy as np
from pydantic import Field

from wbc.base.checked import checked
from wbc.base.errors import InputError
from wbc.base.numbers import ROUNDING
from wbc.base.settings import NonNegative, Number, Period, Positive, settings

SHORTEST = 0.05
"""Least duration of a piece of the motion, s: ten periods of 5 ms."""

HEEL = 0.3
"""Default of the pitch of a foot that rises onto a stair, heel first, rad: level behind the body it would meet the end
of the ankle's range."""

EDGE_SHARE = 0.2
"""Ratio of the swing by which the foot travels later up, or earlier down, a stair as high as the swing."""


class SwingShape(NamedTuple):
    """Shape of a swing."""

    swing_height: float  # highest point over the highest of both ends and of the way, m
    apex: float  # time of the highest point over that of the swing
    takeoff_time: float  # time in which the foot only rises after lift-off, s
    landing_time: float  # time in which the foot only sinks before touch-down, s
    landing_speed: float  # downward speed at touch-down, m/s
    landing_height: float  # height over the landing below which the foot is no faster, m
    search_depth: float  # depth below the landing to which the foot searches for ground that comes late, m
    search_time: float  # time from touch-down as planned until the foot is at that depth, s
    lift_speed: float = 0.0  # upward speed at lift-off, m/s
    touch: float = 1.0  # speed at touch-down over that at the landing height, if there is one
    # Ratio of the swing by which the foot travels later up, or earlier down, a stair as high as the swing.
    edge: float = EDGE_SHARE
    heel: float = HEEL  # pitch of a foot that rises onto a stair, rad
    # Height of a stair, over that of the swing, from which on this pitch begins; half a swing more has all of it.
    stair: float = 1.0
    # Least time in which the foot comes down from a height h when its time is cut short, over √(h/g).
    quickest: float = 0.0
    level: float = 1.0  # time over that of the swing at which the sole has its tilt at the landing
    # Greatest acceleration with which the foot rises, m/s²: a swing that is short lifts it less.
    lift: float = math.inf
    # Least duration of a piece of the motion, s, so that a late change stays a motion.
    piece: float = SHORTEST

    @property
    def shortest(self) -> float:
        """Least duration of a swing, s."""
        return self.takeoff_time + self.landing_time + 2.0 * self.piece


TIMINGS = ("single_support", "double_support", "initial_double_support", "final_double_support")


Size = Annotated[float, Field(gt=0.0, le=60.0)]
"""A length or a time of a gait, m or s; the robot's reach is far below 60."""

SizeOrZero = Annotated[float, Field(ge=0.0, le=60.0)]
"""A length or a time of a gait that may be zero, m or s."""


SPEEDS = (0.15, 0.3, 0.4, 0.5, 0.6)
"""Speeds of `BY_SPEED`, m/s: the greatest of forward speed, twice the sideways speed and 0.6 m of the turning one."""

BY_SPEED = {
    "single_support": (0.8, 0.57, 0.47, 0.42, 0.36),
    "double_support": (0.3, 0.15, 0.1, 0.08, 0.06),
    "initial_double_support": (0.8, 0.6, 0.6, 0.6, 0.6),
    "takeoff_time": (0.05, 0.03, 0.02, 0.02, 0.02),
    "landing_time": (0.1, 0.08, 0.05, 0.05, 0.05),
    "swing_height": (0.06, 0.05, 0.04, 0.04, 0.04),
    "landing_height": (0.02, 0.01, 0.005, 0.005, 0.005),
    "landing_speed": (0.1, 0.12, 0.15, 0.15, 0.15),
    "apex": (0.4, 0.42, 0.45, 0.45, 0.45),
}
"""Timings (s), heights (m) and shape of the swing at `SPEEDS`; below the first as there, which is `StepGait`. Quick
swings are low and land without slowing down first: a knee's greatest speed is needed to lift the foot."""

TICK, FINE = 0.01, 0.001
"""Timings of a gait for a speed are multiples of the first number, s; its other values are multiples of the second."""


@settings
class Gait:
    """Sizes and timings of steps; each can be left open.

    A value that is None is chosen by the size of the robot (`sized`) and, for a commanded velocity, by the velocity
    (`for_speed`); otherwise it is that of `StepGait`. Given values do not change.

    Attributes:
        step_length: Largest forward distance from the stance foot to the landing, m.
        feet_spacing: Lateral distance between the sole centres, m; the robot's own when None.
        single_support: Time on one foot, s; in a plan 0.9/ω at least, with ω of the robot that walks it.
        double_support: Time on both feet between steps, s.
        initial_double_support: Time to shift the weight before the first step, s.
        final_double_support: Time to come to rest after the last step, s.
        swing_height: Height of the highest point of the swing above the lift-off or the landing, whichever is higher,
            m.
        apex: Time of the highest point as a share of the single support, 0.3 to 0.7; 0.5 in a plan with stairs.
        takeoff_time: Time after lift-off in which the foot only rises, s.
        landing_time: Time before touch-down in which the foot only sinks, s.
        landing_speed: Downward speed at touch-down, m/s; half of it on level ground, and in a plan with stairs.
        landing_height: Height above the landing below which the foot sinks at `landing_speed`, m, so that higher ground
            is also met gently. 0 in a plan with stairs, whose heights are known.
        search_depth: Depth below the landing to which the foot searches for lower ground, m.
        search_time: Time from the planned touch-down until the foot is at `search_depth`, s.
    """

    step_length: Annotated[Size, "m"] | None = None
    feet_spacing: Annotated[Positive, "m"] | None = None
    single_support: Annotated[Size, "s"] | None = None
    double_support: Annotated[Size, "s"] | None = None
    initial_double_support: Annotated[Size, "s"] | None = None
    final_double_support: Annotated[Size, "s"] | None = None
    swing_height: Annotated[Size, "m"] | None = None
    apex: Annotated[float, Field(ge=0.3, le=0.7)] | None = None
    takeoff_time: Annotated[SizeOrZero, "s"] | None = None
    landing_time: Annotated[SizeOrZero, "s"] | None = None
    landing_speed: Annotated[SizeOrZero, "m/s"] | None = None
    landing_height: Annotated[SizeOrZero, "m"] | None = None
    search_depth: Annotated[Size, "m"] | None = None
    search_time: Annotated[Size, "s"] | None = None

    def __post_init__(self) -> None:
        gait = self.full
        if gait.takeoff_time + gait.landing_time > 0.5 * gait.single_support + ROUNDING:
            raise InputError(
                f"takeoff_time + landing_time must be at most half of the single support, "
                f"{0.5 * gait.single_support:g} s, got {gait.takeoff_time + gait.landing_time:g} s"
            )
        if gait.single_support < gait.swing.shortest - ROUNDING:
            raise InputError(
                f"single_support must be at least {gait.swing.shortest:g} s for take-off, swing and landing, got "
                f"{gait.single_support:g} s"
            )

    @cached_property
    def full(self) -> StepGait:
        """Gait with a number for every value; values that are not given have their defaults."""
        return StepGait(**self.given)

    @property
    def given(self) -> dict[str, Any]:
        """Given values, by name."""
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        return {name: value for name, value in values.items() if value is not None}

    @checked
    def on_grid(self, period: Period) -> tuple[Self, tuple[str, ...]]:
        """Return the gait with its given timings rounded to multiples of a period, s, and a message for each change.

        A time on one foot that take-off and landing need whole is rounded up.
        """
        changed: dict[str, Any] = {}
        full = self.full
        least = max(full.swing.shortest, 2.0 * (full.takeoff_time + full.landing_time))
        notes = []
        for name in TIMINGS:
            value = getattr(self, name)
            if value is None:
                continue
            ticks = round(value / period)
            if name == "single_support":
                ticks = max(ticks, math.ceil(least / period - ROUNDING))
            if ticks < 2:
                raise InputError(
                    f"{name} of {value:g} s must span two control periods of {period:g} s or more"
                )
            if abs(ticks * period - value) > ROUNDING:
                changed[name] = ticks * period
                notes.append(
                    f"{name} of {value:g} s rounded to {ticks * period:g} s, a multiple of the control period"
                )
        return replace(self, **changed) if changed else self, tuple(notes)

    @staticmethod
    @checked
    def for_speed(velocity: tuple[Number, Number, Number], gait: Gait | None = None) -> StepGait:
        """Return the gait for a velocity; steps take less time at a higher velocity.

        Values between the columns of `BY_SPEED` are interpolated; the timings are multiples of 10 ms.

        Args:
            velocity: Forward (m/s), left (m/s) and turn (rad/s).
            gait: Gait whose given values do not change.
        """
        return Gait.at_speed(pace(velocity), gait)

    @staticmethod
    @checked
    def at_speed(speed: Annotated[NonNegative, "m/s"], gait: Gait | None = None) -> StepGait:
        """Return the gait for a speed to two decimals, m/s; see `for_speed`. Of a `StepGait` all values are given."""
        return gait if isinstance(gait, StepGait) else _at_speed(round(speed, 2), gait or Gait())


@settings
class StepGait(Gait):
    """Gait with a number for every value.

    The defaults are those of the soft-footed robot of Frizza et al., Humanoids 2022 (the authors' published plan:
    0.8 s / 0.3 s, 60 mm swing); 0.145 m per step makes 22 steps of 3 m.
    """

    step_length: Annotated[Size, "m"] = 0.145
    single_support: Annotated[Size, "s"] = 0.8
    double_support: Annotated[Size, "s"] = 0.3
    initial_double_support: Annotated[Size, "s"] = 0.8
    final_double_support: Annotated[Size, "s"] = 0.8
    swing_height: Annotated[Size, "m"] = 0.06
    apex: Annotated[float, Field(ge=0.3, le=0.7)] = 0.4
    takeoff_time: Annotated[SizeOrZero, "s"] = 0.05
    landing_time: Annotated[SizeOrZero, "s"] = 0.1
    landing_speed: Annotated[SizeOrZero, "m/s"] = 0.1
    landing_height: Annotated[SizeOrZero, "m"] = 0.02
    search_depth: Annotated[Size, "m"] = 0.04
    search_time: Annotated[Size, "s"] = 0.3

    @property
    def full(self) -> StepGait:
        """The gait itself."""
        return self

    @property
    def cycle(self) -> float:
        """Time of a step, single and double support, s."""
        return self.single_support + self.double_support

    @property
    def swing(self) -> SwingShape:
        """Shape of the swing, by the values of the gait that have the same names."""
        names = [name for name in SwingShape._fields if hasattr(self, name)]
        return SwingShape(**{name: getattr(self, name) for name in names})

    def for_stairs(self) -> StepGait:
        """Return the gait for stairs of known heights: the swing is highest half way and slow only at its end."""
        return replace(self, apex=0.5, landing_speed=0.5 * self.landing_speed, landing_height=0.0)


def pace(velocity: Sequence[float]) -> float:
    """Return the speed by which the gait of a velocity (forward, left, m/s, and turn, rad/s) goes, m/s."""
    forward, left, turn = (abs(float(part)) for part in velocity)
    return max(forward, 2.0 * left, 0.6 * turn)


@lru_cache(maxsize=256)
def _at_speed(speed: float, gait: Gait) -> StepGait:
    """Gait for a speed (m/s) with the given values of another one, and the time on one foot that these need."""
    values = dict[str, Any]()
    for name, at_speeds in BY_SPEED.items():
        grid = TICK if name in (*TIMINGS, "takeoff_time", "landing_time") else FINE
        values[name] = round(float(np.interp(speed, SPEEDS, at_speeds)) / grid) * grid
    values |= gait.given
    if gait.single_support is None:
        slow = values["takeoff_time"] + values["landing_time"]
        least = math.ceil(max(2.0 * slow, slow + 2.0 * SHORTEST) / TICK - ROUNDING) * TICK
        values["single_support"] = max(values["single_support"], least)
    return StepGait(**values)
