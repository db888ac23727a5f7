"""Footsteps and footstep plans: two feet that stand, and the steps from there.

`wbc.walking.plans.planners` makes plans from a distance, a velocity or a stair; `wbc.walking.plans.reach` checks
them against the robot's legs.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
import pinocchio as pin
from pydantic import Field

from wbc.base.checked import checked
from wbc.base.errors import InputError, choose, shown
from wbc.base.numbers import Array, finite_scalar
from wbc.base.vectors import along
from wbc.core.frames import yaw_rotation
from wbc.core.robot import SIDES, Robot
from wbc.walking.plans.gait import Gait

LEAST_STAIR = 0.02
"""Difference in height from which two footholds are on a stair, m."""

CLOSED = (0.01, 0.05)
"""Distance (m) and turn (rad) up to which a foot that stands beside the other one need not close up."""


Index = Annotated[int, Field(ge=0)]
"""Index of a step, or a number of steps."""

Place = tuple[float, float, float]
"""x, y (m) and yaw (rad) in the world."""

SoleSizes = tuple[tuple[float, float], tuple[float, float]]
"""(length, width) of the left and of the right sole, m."""


def other(side: str) -> str:
    """Return the other side."""
    return "right" if side == "left" else "left"


@dataclass(frozen=True)
class Footstep:
    """Place of a sole on the ground.

    Attributes:
        side: "left" or "right".
        x: x of the sole centre in the world, m.
        y: y of the sole centre in the world, m.
        z: z of the sole centre in the world, m.
        yaw: Heading, rad.
        pitch: Slope along the foot, toe down positive, rad.
        roll: Slope across the foot, rad.
        fixed: True for a foot that lands here; False where a walk that sees may put it on better ground nearby.
    """

    side: str
    x: float
    y: float
    z: float = 0.0
    yaw: float = 0.0
    pitch: float = 0.0
    roll: float = 0.0
    fixed: bool = False

    def __post_init__(self) -> None:
        try:
            numbers = self.x + self.y + self.z + self.yaw + self.pitch + self.roll
        except TypeError:
            numbers = math.nan
        sound = self.side in SIDES and isinstance(self.fixed, bool)
        if type(numbers) is float and math.isfinite(numbers) and sound:
            return  # by far the most: walks make one in every tick
        choose("side", self.side, SIDES)
        if not isinstance(self.fixed, bool):
            raise InputError(f"fixed of a footstep is True or False, got {shown(self.fixed)}")
        for name in ("x", "y", "z", "yaw", "pitch", "roll"):
            object.__setattr__(self, name, finite_scalar(f"{name} of a footstep", getattr(self, name)))

    @property
    def position(self) -> Array:
        """Sole centre in the world, shape (3,), m."""
        return np.array([self.x, self.y, self.z])

    @property
    def placement(self) -> pin.SE3:
        """Sole frame in the world."""
        return pin.SE3(pin.rpy.rpyToMatrix(self.roll, self.pitch, self.yaw), self.position)

    @staticmethod
    def of(side: str, placement: pin.SE3) -> Footstep:
        """Return the footstep of a sole frame."""
        roll, pitch, yaw = pin.rpy.matrixToRpy(placement.rotation)
        x, y, z = placement.translation
        return Footstep(side, float(x), float(y), float(z), float(yaw), float(pitch), float(roll))

    def moved(self, world: pin.SE3) -> Footstep:
        """Return the footstep after a motion from its old place to the new one."""
        return replace(Footstep.of(self.side, world * self.placement), fixed=self.fixed)

    def beside(self, left: float) -> Place:
        """Return the place that is to the left of this one by a distance, m."""
        return moved((self.x, self.y, self.yaw), 0.0, left, 0.0)

    def middle(self, spacing: float) -> Place:
        """Return the middle between this foot and one that stands beside it, `spacing` from it, m."""
        return self.beside(-0.5 * spacing if self.side == "left" else 0.5 * spacing)

    def seen_from(self, stance: Footstep) -> tuple[float, float, float, float]:
        """Return forward, left, up (m) and turn (rad) from another footstep, in the frame of its heading."""
        direction = math.cos(stance.yaw), math.sin(stance.yaw)
        turn = math.remainder(self.yaw - stance.yaw, math.tau)
        return *along(direction, self.x - stance.x, self.y - stance.y), self.z - stance.z, turn

    def outwards_of(self, stance: Footstep) -> tuple[float, float, float, float]:
        """Return forward, to the side of this foot, up (m) and turn to that side (rad) from the other foot."""
        forward, left, up, turn = self.seen_from(stance)
        return (forward, left, up, turn) if self.side == "left" else (forward, -left, up, -turn)


def moved(place: Place, dx: float, dy: float, turn: float) -> Place:
    """Return a place moved by a motion in its own frame."""
    x, y, yaw = place
    c, s = math.cos(yaw), math.sin(yaw)
    return x + c * dx - s * dy, y + s * dx + c * dy, yaw + turn


def mean_heading(left: float, right: float) -> float:
    """Return the heading half way between those of two feet, the short way round, rad."""
    return right + 0.5 * math.remainder(left - right, math.tau)


@dataclass(frozen=True)
class FootstepPlan:
    """Plan of footsteps: the places of both feet at the start, and the steps from there.

    Attributes:
        left: Place of the left sole at the start.
        right: Place of the right sole at the start.
        steps: Landings in their order; left and right alternate.
        gait: Timings and swing.
    """

    left: Footstep
    right: Footstep
    steps: tuple[Footstep, ...]
    gait: Gait

    def __post_init__(self) -> None:
        steps = tuple(self.steps) if isinstance(self.steps, Iterable) else (self.steps,)
        for what, each, kind in [
            ("left", self.left, Footstep),
            ("right", self.right, Footstep),
            *(("steps", step, Footstep) for step in steps),
            ("gait", self.gait, Gait),
        ]:
            if not isinstance(each, kind):
                raise InputError(f"{what} of a plan must be of class {kind.__name__}, got {shown(each)}")
        object.__setattr__(self, "steps", steps)
        if self.left.side != "left" or self.right.side != "right":
            raise InputError("left and right of a plan must be footsteps of those sides")
        for i, (a, b) in enumerate(zip(self.steps, self.steps[1:], strict=False)):
            if a.side == b.side:
                raise InputError(
                    f"sides of steps must alternate, but steps {i + 1} and {i + 2} are both {a.side}"
                )

    def __len__(self) -> int:
        return len(self.steps)  # a plan that only stands has none, and is a plan: ask for None, not for truth

    def foot(self, side: str) -> Footstep:
        """Return the place of a side's sole at the start."""
        return self.left if choose("side", side, SIDES) == "left" else self.right

    @checked
    def stance(self, index: Index) -> Footstep:
        """Return the stance foot of step `index`; an `InputError` where the plan has neither it nor the one before."""
        self._check(max(index - 1, 0))
        return self.steps[index - 1] if index > 0 else self.foot(other(self.steps[0].side))

    def _check(self, index: int) -> None:
        """Refuse the index of a step that the plan does not have."""
        if not 0 <= index < len(self):
            steps = f"its steps are 0 to {len(self) - 1}" if self.steps else "the plan has no steps"
            raise InputError(f"a plan has no step {index}: {steps}")

    @property
    def climbs(self) -> bool:
        """True if a foot lands at least `LEAST_STAIR` above or below the other foot."""
        return self.rise != 0.0

    @property
    def rise(self) -> float:
        """Height of the first stair, of `LEAST_STAIR` or more, m, negative downwards; 0 without one."""
        heights = [self.stance(0).z, *(step.z for step in self.steps)] if self.steps else []
        rises = (b - a for a, b in zip(heights, heights[1:], strict=False))
        return next((rise for rise in rises if abs(rise) >= LEAST_STAIR), 0.0)

    @property
    def spacing(self) -> float:
        """Lateral distance between the sole centres, m: that of the gait, or else that at the start."""
        spacing = self.gait.feet_spacing
        return abs(self.left.seen_from(self.right)[1]) if spacing is None else spacing

    @checked
    def feet(self, count: Index) -> tuple[Footstep, Footstep]:
        """Return the places of left and right sole after a number of landings."""
        feet = {"left": self.left, "right": self.right}
        for step in self.steps[max(count - 2, 0) : count]:
            feet[step.side] = step
        return feet["left"], feet["right"]

    @property
    def middle(self) -> Place:
        """Middle between the feet at the start, with the heading half way between theirs."""
        left, right = self.left, self.right
        yaw = mean_heading(left.yaw, right.yaw)
        return 0.5 * (left.x + right.x), 0.5 * (left.y + right.y), yaw

    @property
    def final(self) -> tuple[Footstep, Footstep]:
        """Places of left and right sole at the end."""
        return self.feet(len(self))

    @property
    def end(self) -> FootstepPlan:
        """Plan without steps, with the feet at the end of this plan."""
        left, right = self.final
        return replace(self, left=left, right=right, steps=())

    def __add__(self, more: FootstepPlan) -> FootstepPlan:
        """Return this plan and another one after it, which is moved to begin where this one ends.

            plan = walk_distance(start, 1.0) + turn_in_place(start, 0.5 * math.pi) + walk_distance(start, 1.0)

        The middle of its feet and its heading are laid on those of the end. If the foot that has stepped last would
        step first, the other one steps in its place before.

        Raises:
            InputError: Plans of different gaits.
        """
        if not isinstance(more, FootstepPlan):
            return NotImplemented
        if more.gait != self.gait:
            raise InputError(
                "plans that are joined must have one gait: make them from feet with the same gait"
            )
        if not more.steps:
            return self
        here, there = (_frame(plan.middle, 0.5 * (plan.left.z + plan.right.z)) for plan in (self.end, more))
        steps = more.moved(here * there.inverse()).steps
        left, right = self.final
        if self.steps and self.steps[-1].side == steps[0].side:
            steps = (right if steps[0].side == "left" else left, *steps)
        return replace(self, steps=(*self.steps, *steps))

    @checked
    def moved(self, world: pin.SE3) -> FootstepPlan:
        """Return the plan moved to another place.

        Args:
            world: Displacement in the world frame: the new placement of a sole is `world` times its old placement.
        """
        return self._mapped(lambda step: step.moved(world))

    @checked
    def on(self, height: Callable[[float, float], float]) -> FootstepPlan:
        """Return the plan with every sole centre on a known ground.

        Args:
            height: Function that returns the height of the ground, m, at x and y in the world, m.
        """
        return self._mapped(lambda step: replace(step, z=finite_scalar("height (m)", height(step.x, step.y))))

    def _mapped(self, change: Callable[[Footstep], Footstep]) -> FootstepPlan:
        return replace(
            self, left=change(self.left), right=change(self.right), steps=tuple(map(change, self.steps))
        )

    @checked
    def with_step(self, index: Index, step: Footstep, *, carry: bool = True) -> FootstepPlan:
        """Return the plan with one landing changed.

        Args:
            index: Index of the step.
            step: New landing.
            carry: Move all later steps as well, so that they keep their places relative to this step. Otherwise they
                keep their places in the world.

        Raises:
            InputError: The plan has no such step, or the landing is of the other foot.
        """
        self._check(index)
        old = self.steps[index]
        if step.side != old.side:
            raise InputError(f"step {index} is of the {old.side} foot, got a landing of the {step.side} foot")
        later = self.steps[index + 1 :]
        if carry:
            turn = math.remainder(step.yaw - old.yaw, math.tau)
            move = pin.SE3(yaw_rotation(turn), np.zeros(3))
            move.translation = step.position - move.rotation @ old.position
            later = tuple(step.moved(move) for step in later)
        return replace(self, steps=(*self.steps[:index], step, *later))

    @staticmethod
    @checked
    def standing(robot: Robot, gait: Gait | None = None) -> FootstepPlan:
        """Return a plan without steps, with the feet in their present places.

        Args:
            robot: Robot at its present state; the soles are taken as level.
            gait: Timings and swing; the defaults when None.
        """
        left, right = (
            replace(Footstep.of(side, robot.placement(sole.frame)), pitch=0.0, roll=0.0)
            for side, sole in zip(SIDES, robot.soles[:2], strict=True)
        )
        return FootstepPlan(left, right, (), gait or Gait())


def _frame(place: Place, z: float) -> pin.SE3:
    """Return the level frame at a place and a height, m."""
    x, y, yaw = place
    return pin.SE3(yaw_rotation(yaw), np.array([x, y, z]))


def check_start(
    robot: Robot,
    plan: FootstepPlan,
    what: str = "the plan",
    room: tuple[float, float, float] = (0.02, 0.05, 0.05),
) -> None:
    """Raise an `InputError` unless a plan begins where the robot stands, as closely as a first step can make good.

    The feet may be beside the plan by a distance (m), a height (m) and a turn (rad).
    """
    for foot, stands in zip((plan.left, plan.right), FootstepPlan.standing(robot).final, strict=True):
        forward, left, up, turn = stands.seen_from(foot)
        if math.hypot(forward, left) > room[0] or abs(up) > room[1] or abs(turn) > room[2]:
            planned, real = (
                f"({X.x:.3f}, {X.y:.3f}, {X.z:.3f}) m and {X.yaw:.3f} rad" for X in (foot, stands)
            )
            raise InputError(
                f"{what} must begin where the robot stands, within {room[0]:g} m ({room[1]:g} m in height) and "
                f"{room[2]:g} rad; its {foot.side} foot is at {planned}, that of the robot at {real}"
            )
