"""Where the feet go: a plan is two feet that stand, and the steps from there.

`wbc.walking.planning.planners` makes plans from a distance, a velocity or a stair; `wbc.walking.planning.reach` says
whether a robot can walk one.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pinocchio as pin

from wbc.core.errors import Array, InputError, choose, finite_scalar
from wbc.core.robot import Robot
from wbc.walking.planning.gait import Gait

SIDES = ("left", "right")

LEAST_STAIR = 0.02
"""Difference in height from which two footholds are on a stair, m."""


def other(side: str) -> str:
    """The other side."""
    return "right" if side == "left" else "left"


@dataclass(frozen=True)
class Footstep:
    """Where a sole stands.

    Attributes:
        side: "left" or "right".
        x: Sole centre in the world, m.
        y: Sole centre in the world, m.
        z: Sole centre in the world, m.
        yaw: Heading, rad.
        pitch: Slope along the foot, toe down positive, rad.
        roll: Slope across the foot, rad.
    """

    side: str
    x: float
    y: float
    z: float = 0.0
    yaw: float = 0.0
    pitch: float = 0.0
    roll: float = 0.0

    def __post_init__(self) -> None:
        choose("side", self.side, SIDES)
        for name in ("x", "y", "z", "yaw", "pitch", "roll"):
            finite_scalar(f"{name} of a footstep", getattr(self, name))

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
        """The footstep of a sole frame."""
        roll, pitch, yaw = pin.rpy.matrixToRpy(placement.rotation)
        x, y, z = placement.translation
        return Footstep(side, float(x), float(y), float(z), float(yaw), float(pitch), float(roll))

    def seen_from(self, stance: Footstep) -> tuple[float, float, float, float]:
        """Forward, left, up and turn from another footstep, in its heading's frame, m and rad."""
        c, s = math.cos(stance.yaw), math.sin(stance.yaw)
        dx, dy = self.x - stance.x, self.y - stance.y
        turn = math.remainder(self.yaw - stance.yaw, 2.0 * math.pi)
        return c * dx + s * dy, c * dy - s * dx, self.z - stance.z, turn


def heading(rotation: Array) -> float:
    """Heading of the x axis of a frame, given its rotation to the world, shape (3, 3); rad."""
    return math.atan2(rotation[1, 0], rotation[0, 0])


def mean_heading(left: float, right: float) -> float:
    """Heading half way between those of two feet, the short way round, rad."""
    return right + 0.5 * math.remainder(left - right, 2.0 * math.pi)


@dataclass(frozen=True)
class FootstepPlan:
    """Two feet on the ground and the steps from there; sides alternate.

    Attributes:
        left: Where the left sole stands at the start.
        right: Where the right sole stands at the start.
        steps: Landings in order, each of the foot that the one before is not.
        gait: Timings and swing.
    """

    left: Footstep
    right: Footstep
    steps: tuple[Footstep, ...]
    gait: Gait

    def __post_init__(self) -> None:
        if self.left.side != "left" or self.right.side != "right":
            raise InputError("left and right of a plan must be footsteps of those sides")
        object.__setattr__(self, "steps", tuple(self.steps))
        for i, (a, b) in enumerate(zip(self.steps, self.steps[1:], strict=False)):
            if a.side == b.side:
                raise InputError(
                    f"sides of steps must alternate, but steps {i + 1} and {i + 2} are both {a.side}"
                )

    def __len__(self) -> int:
        return len(self.steps)

    def stance(self, index: int) -> Footstep:
        """The foot that stands while step `index` swings."""
        if index > 0:
            return self.steps[index - 1]
        return self.right if self.steps[0].side == "left" else self.left

    def lift_off(self, index: int) -> Footstep:
        """Where the foot of step `index` leaves the ground."""
        if index > 1:
            return self.steps[index - 2]
        side = self.steps[index].side
        return self.left if side == "left" else self.right

    @property
    def climbs(self) -> bool:
        """True if a foot is put down a stair (`LEAST_STAIR`) or more above or below the other one."""
        heights = [self.stance(0).z, *(step.z for step in self.steps)] if self.steps else []
        return any(abs(b - a) >= LEAST_STAIR for a, b in zip(heights, heights[1:], strict=False))

    @property
    def final(self) -> tuple[Footstep, Footstep]:
        """Where left and right sole stand at the end."""
        feet = {"left": self.left, "right": self.right}
        for step in self.steps[-2:]:
            feet[step.side] = step
        return feet["left"], feet["right"]

    def moved(self, world: pin.SE3) -> FootstepPlan:
        """The plan in another place.

        Args:
            world: Motion that takes the old places to the new ones, for example a turn and a shift.
        """
        left, right, *steps = (
            Footstep.of(step.side, world * step.placement) for step in (self.left, self.right, *self.steps)
        )
        return replace(self, left=left, right=right, steps=tuple(steps))

    def on(self, height: Callable[[float, float], float]) -> FootstepPlan:
        """The plan with every sole centre put on a ground that is known.

        Args:
            height: Height of the ground at (x, y), m.
        """
        left, right, *steps = (
            replace(step, z=float(height(step.x, step.y))) for step in (self.left, self.right, *self.steps)
        )
        return replace(self, left=left, right=right, steps=tuple(steps))

    def with_step(self, index: int, step: Footstep, *, carry: bool = True) -> FootstepPlan:
        """The plan with one landing changed.

        Args:
            index: Which step.
            step: Its new landing.
            carry: Move all later steps along, so that they keep their places relative to this one; otherwise
                they stay where they are.

        Raises:
            InputError: A landing of the other foot, or no such step.
        """
        if not 0 <= index < len(self):
            raise InputError(f"no step {index} in a plan of {len(self)}")
        old = self.steps[index]
        if step.side != old.side:
            raise InputError(f"step {index} is of the {old.side} foot, got a landing of the {step.side} foot")
        later = self.steps[index + 1 :]
        if carry:
            turn = math.remainder(step.yaw - old.yaw, 2.0 * math.pi)
            move = pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.0, turn), np.zeros(3))
            move.translation = step.position - move.rotation @ old.position
            later = tuple(Footstep.of(s.side, move * s.placement) for s in later)
        return replace(self, steps=(*self.steps[:index], step, *later))

    def stopping_after(self, index: int) -> FootstepPlan:
        """The plan cut after a step, with one more that brings the other foot beside it.

        Args:
            index: Last step to walk; −1 walks none.
        """
        kept = replace(self, steps=self.steps[: index + 1])
        left, right = kept.final
        last = left if (self.steps[index].side if index >= 0 else "right") == "left" else right
        mate = right if last is left else left
        half = 0.5 * abs(self.left.seen_from(self.right)[1])
        if self.gait.feet_spacing is not None:
            half = 0.5 * self.gait.feet_spacing
        offset = 2.0 * half if mate.side == "left" else -2.0 * half
        c, s = math.cos(last.yaw), math.sin(last.yaw)
        beside = replace(last, side=mate.side, x=last.x - s * offset, y=last.y + c * offset)
        forward, left_of, up, turn = mate.seen_from(beside)
        if math.hypot(forward, left_of) < 0.01 and abs(up) < 0.01 and abs(turn) < 0.05:
            return kept  # it stands there already
        return replace(kept, steps=(*kept.steps, beside))

    @staticmethod
    def standing(robot: Robot, gait: Gait | None = None) -> FootstepPlan:
        """A plan without steps, with the feet where they are now.

        Args:
            robot: Robot at its present state; the feet are put parallel to the world's ground.
            gait: Timings and swing; the defaults when None.
        """
        left, right = (
            replace(Footstep.of(side, robot.placement(sole.frame)), pitch=0.0, roll=0.0)
            for side, sole in zip(SIDES, robot.soles[:2], strict=True)
        )
        return FootstepPlan(left, right, (), gait or Gait())
