"""Pushes: constant forces on bodies of a robot for limited times, in any engine."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import pinocchio as pin
from numpy.typing import ArrayLike

from wbc.base.numbers import Array, finite_array, finite_scalar

_OVER = 1e-12
"""Remaining time at which a push is over, s."""


@dataclass
class _Push:
    body: Any  # as the engine names it
    force: Array  # in the world, N
    point: Array | None  # of attack in the body, m; None for its centre of mass
    remaining: float  # s


class Pushes:
    """All pushes that act now; any number at a time, also on one body.

    Attributes:
        active: The pushes; empty while none acts.
    """

    def __init__(self) -> None:
        self.active: list[_Push] = []

    def add(self, body: Any, frame: pin.SE3, force: ArrayLike, duration: float, at: ArrayLike | None) -> None:
        """Begin a push with the next physics step, at a point of a frame of a body, m; None for its centre of mass."""
        point = None if at is None else frame.act(finite_array("point of attack (m)", at, (3,)))
        self.active.append(
            _Push(
                body,
                finite_array("force of the push (N)", force, (3,)),
                point,
                finite_scalar("duration of the push (s)", duration, above=0.0),
            )
        )

    def clear(self) -> None:
        """Stop all pushes."""
        self.active.clear()

    def advance(self, timestep: float) -> list[tuple[Any, Array, Array | None]]:
        """Return body, force (N) and point (m) of each push in the coming physics step, s.

        A push that ends within the step acts with the share of its force that gives the same impulse.
        """
        forces = []
        for push in self.active:
            forces.append((push.body, min(1.0, push.remaining / timestep) * push.force, push.point))
            push.remaining -= timestep
        self.active = [push for push in self.active if push.remaining > _OVER]
        return forces
