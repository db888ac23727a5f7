"""Plan of a walk: a distance, a velocity, a turn, stairs, given footsteps, or velocities over time."""

from __future__ import annotations

import itertools
import math
from collections.abc import Collection, Sequence
from dataclasses import replace
from typing import Annotated, Any, Literal

import numpy as np

from wbc.base.errors import InputError
from wbc.base.numbers import ROUNDING
from wbc.base.settings import Angle, Count, Number, settings
from wbc.sim.terrain.families.stairs import Stairs
from wbc.sim.terrain.spec import Terrain
from wbc.sim.trial.trial import AnyTrial, TrialHook
from wbc.walking.plans.check import OutOfReachError
from wbc.walking.plans.footsteps import LEAST_STAIR, Footstep, FootstepPlan, Place, mean_heading, moved
from wbc.walking.plans.gait import Gait
from wbc.walking.plans.planners import climb_stairs, turn_in_place, walk_distance, walk_velocity
from wbc.walking.plans.sources import Velocity, VelocityLimits, checked_velocity
from wbc.walking.steered import SteeredControl

DISTANCE = 3.0
"""Default distance of a walk, m: the length of the paper's tracks; 22 steps of 0.145 m."""

ROOM_ASIDE = 0.45
"""Room that a walk needs beside the way of its middle, m: feet, soles, and what it strays."""

STRAIGHT = 0.02
"""Greatest heading against stairs, rad: over three treads the feet come off the middle by millimetres."""

STEP_TIME, PIECE = 0.8, 0.25
"""Time of a free step, at most, and length of the pieces of a drive, s: for its way."""

MOST_PIECES = 20_000
"""Greatest number of pieces of a drive whose way is looked at."""

STEPS = 22
"""Default number of steps of a walk with a velocity; as many as those of a walk of 3 m."""

KINDS = ("distance", "velocity", "turn", "stairs", "footsteps", "drive")
"""Kinds of plans, of which a walk has one."""


class TooFastError(InputError):
    """A velocity that planned steps do not give, and free steps may."""


@settings(kw_only=True)
class WalkPlan:
    """Plan of a walk: one of distance, velocity, turn, stairs, footsteps and drive; 3 m straight on by default.

    Attributes:
        distance: Distance straight on, m; negative for backwards; 3 m where no plan is given.
        velocity: Velocity forward (m/s), to the left (m/s) and turn (rad/s); steps take less time at a higher velocity.
        steps: Number of steps of a walk with a velocity. Free steps walk for the time that so many slow steps take.
        turn: Angle of a turn on the spot, rad; positive to the left.
        stairs: Way to climb or descend the stairs of the terrain: with both feet or with one foot on each stair.
        footsteps: Landings of the feet in the world.
        drive: Commanded velocities over time: rows of time (s), forward (m/s), left (m/s) and turn (rad/s). Each row
            holds until the next one. The robot stands at the start. The velocity of the last row must be zero, and the
            walk ends with this stand.
    """

    distance: Annotated[Number, "m"] | None = None
    velocity: Annotated[tuple[float, float, float], "m/s, m/s, rad/s"] | None = None
    steps: Count | None = None
    turn: Angle | None = None
    stairs: Literal["together", "alternate"] | None = None
    footsteps: tuple[Footstep, ...] | None = None
    drive: Annotated[tuple[tuple[float, float, float, float], ...], "s, m/s, m/s, rad/s"] | None = None

    def __post_init__(self) -> None:
        given = [name for name in KINDS if getattr(self, name) is not None]
        if len(given) > 1:
            raise InputError(
                f"a walk has one plan, got {' and '.join(given)}; give one of {', '.join(KINDS)}"
            )
        if not given:
            object.__setattr__(self, "distance", DISTANCE)
        if self.velocity is None and self.steps is not None:
            raise InputError("steps belong to a walk with a velocity; a distance fixes their number itself")
        if self.velocity is not None and self.steps is None:
            object.__setattr__(self, "steps", STEPS)
        if self.drive is not None:
            check_drive(self.drive)
        if self.footsteps == ():
            raise InputError("a walk needs at least one footstep")

    @property
    def climbs(self) -> bool:
        """True for stairs, and for footsteps on them."""
        heights = [0.0, *(step.z for step in self.footsteps or ())]
        high = any(abs(b - a) >= LEAST_STAIR for a, b in itertools.pairwise(heights))
        return self.stairs is not None or high

    def build(self, start: FootstepPlan, terrain: Terrain) -> FootstepPlan:
        """Return the footsteps, from two feet that stand, with their gait; the ground is that of the stairs."""
        if self.distance is not None:
            return walk_distance(start, self.distance)
        if self.velocity is not None:
            assert self.steps is not None
            start = replace(start, gait=Gait.for_speed(self.velocity, start.gait))
            return walk_velocity(start, self.velocity, self.steps)
        if self.turn is not None:
            return turn_in_place(start, self.turn)
        if self.stairs is not None:
            return _stairs(start, terrain, together=self.stairs == "together")
        if self.drive is not None:
            return start  # footsteps follow as the robot goes
        assert self.footsteps is not None
        return replace(start, steps=self.footsteps)

    def way(self, start: Place, gait: Gait, *, planned: bool) -> list[tuple[float, float]]:
        """Return places that the middle of the robot passes, m; unless `planned`, those that it may reach at most.

        The walk starts at a place (m) with a heading (rad).
        """
        if self.footsteps is not None:
            return [(start[0], start[1]), *((step.x, step.y) for step in self.footsteps)]
        moves: list[tuple[float, float, float]] = []
        if self.distance is not None:
            moves = [(self.distance, 0.0, 0.0)]
        elif self.velocity is not None and self.steps is not None:
            full = Gait.for_speed(self.velocity, gait)
            time = full.cycle if planned else STEP_TIME
            x, y, turn = self.velocity
            moves = [(x * time, y * time, turn * time)] * self.steps
        for row, after in zip(self.drive or (), (self.drive or ())[1:], strict=False):
            count = max(1, min(MOST_PIECES, math.ceil((after[0] - row[0]) / PIECE)))
            time = (after[0] - row[0]) / count
            moves += [(row[1] * time, row[2] * time, row[3] * time)] * (count if any(row[1:]) else 0)
        places = [start]
        for move in moves:
            places.append(moved(places[-1], *move))
        return [(x, y) for x, y, _ in places]


def check_velocity(velocity: Velocity, limits: VelocityLimits, what: str, *, together: bool = False) -> None:
    """Raise an `OutOfReachError` for a velocity that the steps of a walk do not give, which is named.

    With `together` the parts share what there is: the squares of their shares of the limits are at most 1 in sum.
    """
    x, y, turn = velocity
    parts = (x, limits.forward if x >= 0.0 else limits.back), (y, limits.aside), (turn, limits.turn)
    shares = [abs(part) / most if most > 0.0 else math.inf if part else 0.0 for part, most in parts]
    if (math.hypot(*shares) if together else max(shares)) > 1.0 + ROUNDING:
        both = ", and less of each where they come together" if together else ""
        # Rounded down, so that none of them is refused.
        forward, back, aside, turns = (math.floor(1e3 * limit) / 1e3 for limit in limits)
        raise OutOfReachError(
            f"{what} give velocities of at most {forward:g} m/s forward, {back:g} back, {aside:g} aside and "
            f"{turns:g} rad/s{both}, got ({x:g}, {y:g}, {turn:g})"
        )


def fitted(ground: Terrain, way: Sequence[tuple[float, float]], given: Collection[str]) -> Terrain:
    """Return a ground on which a way, m, fits with room beside it: longer and wider by whole metres where it has to be.

    The dimensions of the track that are `given` by their names stay.
    """
    x0, x1, y0, y1 = ground.extent
    (low_x, low_y), (high_x, high_y) = np.min(way, axis=0) - ROOM_ASIDE, np.max(way, axis=0) + ROOM_ASIDE
    own = {*given, *ground.parameters.track()}
    sizes: dict[str, Any] = {}
    if high_x > x1 and "length" not in own:
        sizes["length"] = math.ceil(high_x - ROOM_ASIDE - ground.start)
    if low_x < x0 and "strip" not in own:
        sizes["strip"] = math.ceil(ground.start - low_x)
    if (high_y > y1 or low_y < y0) and "width" not in own:
        sizes["width"] = 2.0 * math.ceil(max(high_y, -low_y))
    return replace(ground, **sizes) if sizes else ground


def check_drive(rows: Sequence[Sequence[float]]) -> None:
    """Check the rows of a drive: time (s), increasing, forward (m/s), left (m/s), turn (rad/s); a stand at the end."""
    if not rows:
        raise InputError("a drive has at least one row of time, forward, left and turn")
    for i, row in enumerate(rows):
        if row[0] < 0.0 or (i > 0 and row[0] <= rows[i - 1][0]):
            raise InputError(
                f"times of a drive increase from 0 on, got {row[0]:g} s in row {i + 1}"
                + (f" after {rows[i - 1][0]:g} s" if i else "")
            )
        try:
            checked_velocity(row[1:])
        except InputError as error:
            raise InputError(f"row {i + 1} of a drive: {error}") from None
    if any(rows[-1][1:]):
        raise InputError(
            f"a drive ends with a stand, got velocity {tuple(rows[-1][1:])} in its last row; add a row of zeros"
        )


class Drive(TrialHook):
    """Commanded velocities of a walk, row by row."""

    def __init__(self, rows: Sequence[Sequence[float]] | None, walking: SteeredControl) -> None:
        """Begin with the first row of `WalkPlan.drive`; None for a walk along a plan."""
        self._pending, self._walking = list(rows or ()), walking

    def before(self, trial: AnyTrial) -> None:
        """Command the velocity that is due."""
        while self._pending and trial.plant.time >= self._pending[0][0] - ROUNDING:
            self._walking.velocity = self._pending.pop(0)[1:]

    @property
    def over(self) -> bool:
        """True when the last row is commanded and the robot stands, at its goal or without an order."""
        return not self._pending and self._walking.done


def _stairs(start: FootstepPlan, terrain: Terrain, *, together: bool) -> FootstepPlan:
    """Return footsteps on the stairs of a ground, with both feet or with one foot on each stair."""
    heading = mean_heading(start.left.yaw, start.right.yaw)
    if abs(heading) > STRAIGHT:
        raise InputError(
            f"the robot must face the stairs, which rise along x, within {STRAIGHT:g} rad; its heading is "
            f"{heading:g} rad"
        )
    rise, tread, count, edge = stair_of(terrain)
    ahead = edge - 0.5 * (start.left.x + start.right.x)
    return climb_stairs(start, rise=rise, tread=tread, count=count, first_edge=ahead, together=together)


def stair_of(terrain: Terrain) -> tuple[float, float, int, float]:
    """Return rise (m), tread (m), number and x of the first edge (m) of the stairs of a ground, or refuse it."""
    family = terrain.parameters
    if not isinstance(family, Stairs) or terrain.amplitude <= 0.0:
        raise InputError(f"there are no stairs on terrain '{terrain.name}'; use terrain 'steps'")
    if family.direction == "up_down":
        raise InputError(
            "a plan climbs stairs in one direction; give the terrain direction=up or direction=down"
        )
    count = family.risers(terrain.amplitude)
    rise = terrain.amplitude / count
    lead = 0.5 * (terrain.length - (count - 1) * family.tread)
    sign = 1.0 if family.direction == "up" else -1.0
    return sign * rise, family.tread, count, terrain.start + lead
