"""A push while walking: when, where to and how hard."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from typing import Any

from wbc.core.errors import InputError, finite_scalar, non_negative, positive, unknown_name
from wbc.sim.balance.push_recovery import PUSH_DURATION


@dataclass(frozen=True, kw_only=True)
class WalkPush:
    """A constant horizontal force on a body for a while; at a time, or at a phase of a step.

    Attributes:
        impulse: Force times duration over the robot's mass, Ns/kg.
        direction: Where to, rad, in the world: 0 along x, π/2 along y.
        duration: s.
        body: Body that is pushed, at its centre of mass.
        time: When, s; None for a phase of a step.
        step: Number of the step, from 1; None for a time.
        phase: Share of the step at which the push begins: 0 when its foot lifts off, 1 when the next one would.
    """

    impulse: float
    direction: float = 0.0
    duration: float = PUSH_DURATION
    body: str = "torso"
    time: float | None = None
    step: int | None = None
    phase: float = 0.0

    def __post_init__(self) -> None:
        def store(name: str, value: float) -> None:
            object.__setattr__(self, name, value)

        if not isinstance(self.body, str):
            raise InputError(f"body of a push must be the name of a link or frame, got {self.body!r}")
        store("impulse", non_negative("impulse of a push (Ns/kg)", self.impulse))
        store("direction", finite_scalar("direction of a push (rad)", self.direction))
        store("duration", positive("duration of a push (s)", self.duration))
        store("phase", finite_scalar("phase of a push", self.phase, low=0.0, high=1.0))
        if (self.time is None) is (self.step is None):
            raise InputError("a push comes either at a time or at a step; give one of them")
        if self.time is not None:
            store("time", non_negative("time of a push (s)", self.time))
        elif isinstance(self.step, bool) or not isinstance(self.step, int) or self.step < 1:
            raise InputError(f"step of a push must be an integer of at least 1, got {self.step!r}")

    def to_json(self) -> dict[str, Any]:
        """The push as plain values."""
        return asdict(self)

    @staticmethod
    def from_json(data: Mapping[str, Any]) -> WalkPush:
        """The push that `to_json` wrote.

        Raises:
            UnknownNameError: A key that a push does not have.
            InputError: No impulse, or a value out of range.
        """
        known = [f.name for f in fields(WalkPush)]
        for name in data:
            if name not in known:
                unknown_name("part of a push", name, known)
        if "impulse" not in data:
            raise InputError("a push needs an impulse (Ns/kg)")
        return WalkPush(**data)
