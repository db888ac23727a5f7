"""Pushes: external forces on the robot's bodies."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco

from wbc.core.errors import Array

_OVER = 1e-12
"""Remaining time at which a push is over, s."""


@dataclass
class Push:
    """A constant force on a body for a limited time.

    Attributes:
        body: Index of the body.
        force: Force in the world, shape (3,), N.
        point: Point of attack in the body, shape (3,), m; None for its centre of mass.
        remaining: Time left, s.
    """

    body: int
    force: Array
    point: Array | None
    remaining: float


class Pushes:
    """All pushes that act now; any number at a time, also on one body."""

    def __init__(self) -> None:
        self._active: list[Push] = []
        self._applied: set[int] = set()  # bodies whose forces are set in MuJoCo's data

    def __bool__(self) -> bool:
        """True while `apply` is needed: to set forces, or to remove the last ones."""
        return bool(self._applied) or bool(self._active)

    def add(self, push: Push) -> None:
        """Begin a push with the next physics step."""
        self._active.append(push)

    def clear(self, data: mujoco.MjData) -> None:
        """Stop all pushes."""
        self._active.clear()
        self._release(data)

    def apply(self, data: mujoco.MjData, timestep: float) -> None:
        """Set the forces of the coming physics step.

        A push that ends within the step acts with the share of its force that gives the same impulse.

        Args:
            data: The simulation, its positions up to date.
            timestep: Physics step, s.
        """
        applied = data.xfrc_applied
        self._release(data)
        self._applied = {push.body for push in self._active}
        for push in self._active:
            force = min(1.0, push.remaining / timestep) * push.force
            applied[push.body, :3] += force
            if push.point is not None:
                rotation = data.xmat[push.body].reshape(3, 3)
                arm = data.xpos[push.body] + rotation @ push.point - data.xipos[push.body]
                applied[push.body, 3:] += _cross(arm, force)
            push.remaining -= timestep
        self._active = [push for push in self._active if push.remaining > _OVER]

    def _release(self, data: mujoco.MjData) -> None:
        """Remove the forces of the last step; those that others set on other bodies stay."""
        for body in self._applied:
            data.xfrc_applied[body] = 0.0
        self._applied.clear()


def _cross(a: Array, b: Array) -> list[float]:
    """Return the cross product of two vectors; NumPy's own takes 20 times as long on three numbers."""
    (x, y, z), (u, v, w) = a.tolist(), b.tolist()
    return [y * w - z * v, z * u - x * w, x * v - y * u]
