"""What a walk is asked to do: go a distance, keep a velocity, turn, climb the stairs, or take given steps."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields, replace
from typing import Any

from wbc.core.errors import InputError, choose, finite_array, finite_scalar, unknown_name
from wbc.sim.terrain import Terrain
from wbc.sim.terrain.families.stairs import Steps
from wbc.walking.planning.footsteps import SIDES, Footstep, FootstepPlan, mean_heading
from wbc.walking.planning.planners import climb_stairs, turn_in_place, walk_distance, walk_velocity

DISTANCE = 3.0
"""How far a walk goes that is told nothing else, m: the length of the paper's tracks; 22 steps of 0.145 m."""

STRAIGHT = 0.02
"""Greatest heading against stairs, rad: over three treads the feet come off the middle by millimetres."""

STEPS = 22
"""Number of steps of a walk with a velocity unless told otherwise; as many as those of a walk of 3 m."""

KINDS = ("distance", "velocity", "turn", "stairs", "footsteps")
"""What one of has to be given."""


@dataclass(frozen=True, kw_only=True)
class WalkPlan:
    """What to do; one of distance, velocity, turn, stairs and footsteps, and 3 m straight on when none is given.

    Attributes:
        distance: Straight on, m; backwards when negative.
        velocity: Forward (m/s), left (m/s) and turn (rad/s).
        steps: Number of steps of a walk with a velocity.
        turn: On the spot to the left, rad.
        stairs: Climb (or descend) the stairs of the terrain: "together" brings both feet onto each stair,
            "alternate" one foot.
        footsteps: Landings in the world.
        first: Side that steps first; the usual one when None.
    """

    distance: float | None = None
    velocity: tuple[float, float, float] | None = None
    steps: int | None = None
    turn: float | None = None
    stairs: str | None = None
    footsteps: tuple[Footstep, ...] | None = None
    first: str | None = None

    def __post_init__(self) -> None:
        given = [name for name in KINDS if getattr(self, name) is not None]
        if len(given) > 1:
            raise InputError(
                f"a walk has one plan, got {' and '.join(given)}; give one of {', '.join(KINDS)}"
            )
        if not given:
            object.__setattr__(self, "distance", DISTANCE)
        for name in ("distance", "turn"):
            if getattr(self, name) is not None:
                object.__setattr__(self, name, finite_scalar(name, getattr(self, name)))
        if self.velocity is not None:
            values = finite_array("velocity (m/s, m/s, rad/s)", self.velocity, (3,)).tolist()
            object.__setattr__(self, "velocity", tuple(values))
            if self.steps is None:
                object.__setattr__(self, "steps", STEPS)
            if isinstance(self.steps, bool) or not isinstance(self.steps, int) or self.steps < 1:
                raise InputError(f"steps must be an integer of at least 1, got {self.steps!r}")
        elif self.steps is not None:
            raise InputError("steps belong to a walk with a velocity; a distance decides their number itself")
        if self.stairs is not None:
            choose("way to climb stairs", self.stairs, ("together", "alternate"))
        if self.first is not None:
            choose("first side", self.first, SIDES)
        if self.footsteps is not None:
            if self.first is not None:
                raise InputError("footsteps say themselves which side steps first")
            if not isinstance(self.footsteps, (list, tuple)):
                raise InputError(f"footsteps must be a list of footsteps, got {self.footsteps!r}")
            object.__setattr__(self, "footsteps", tuple(_footstep(step) for step in self.footsteps))

    def build(self, start: FootstepPlan, terrain: Terrain) -> FootstepPlan:
        """The footsteps, from two feet that stand.

        Args:
            start: Feet and gait.
            terrain: The ground, for its stairs.

        Raises:
            InputError: A plan without steps, stairs on a ground that has none, or that the robot does not face.
        """
        first = self.first or "left"
        if self.distance is not None:
            return walk_distance(start, self.distance, first=first)
        if self.velocity is not None:
            assert self.steps is not None
            return walk_velocity(start, self.velocity, self.steps, first=self.first)
        if self.turn is not None:
            if self.first is not None:
                raise InputError("the side of the turn steps first; leave the first side out")
            return turn_in_place(start, self.turn)
        if self.stairs is not None:
            heading = mean_heading(start.left.yaw, start.right.yaw)
            if abs(heading) > STRAIGHT:
                raise InputError(
                    f"the robot must face the stairs, which rise along x, within {STRAIGHT:g} rad; its heading is "
                    f"{heading:g} rad"
                )
            rise, tread, count, edge = stair_of(terrain)
            middle = 0.5 * (start.left.x + start.right.x)
            return climb_stairs(
                start,
                rise=rise,
                tread=tread,
                count=count,
                first_edge=edge - middle,
                together=self.stairs == "together",
                first=first,
            )
        assert self.footsteps is not None
        if not self.footsteps:
            raise InputError("a walk needs at least one footstep")
        return replace(start, steps=self.footsteps)

    def to_json(self) -> dict[str, Any]:
        """What was given, as plain values."""
        values = {f.name: getattr(self, f.name) for f in fields(self)}
        if self.footsteps is not None:
            values["footsteps"] = [asdict(step) for step in self.footsteps]
        return {name: value for name, value in values.items() if value is not None}

    @staticmethod
    def from_json(data: Mapping[str, Any]) -> WalkPlan:
        """The plan that `to_json` wrote.

        Raises:
            UnknownNameError: A key that a plan does not have.
        """
        known = [f.name for f in fields(WalkPlan)]
        for name in data:
            if name not in known:
                unknown_name("part of a plan", name, known)
        return WalkPlan(**data)


def _footstep(step: Any) -> Footstep:
    if isinstance(step, Footstep):
        return step
    if not isinstance(step, Mapping):
        raise InputError(f"a footstep must have side, x and y, got {step!r}")
    known = [f.name for f in fields(Footstep)]
    for name in step:
        if name not in known:
            unknown_name("part of a footstep", name, known)
    missing = [name for name in ("side", "x", "y") if name not in step]
    if missing:
        raise InputError(
            f"a footstep must have side, x and y; {' and '.join(missing)} missing in {dict(step)}"
        )
    return Footstep(**step)


def stair_of(terrain: Terrain) -> tuple[float, float, int, float]:
    """Rise (m), tread (m), number of stairs and x of the first edge (m) of a ground of the family `steps`.

    Raises:
        InputError: Another ground, or stairs that lead both up and down.
    """
    family = terrain.parameters
    if not isinstance(family, Steps) or terrain.amplitude <= 0.0:
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
